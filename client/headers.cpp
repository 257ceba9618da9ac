#include "client/headers.h"

#include <grpcpp/grpcpp.h>

#include <cstdio>
#include <random>
#include <utility>

namespace strata::client {
namespace {

using grpc::experimental::ClientInterceptorFactoryInterface;
using grpc::experimental::ClientRpcInfo;
using grpc::experimental::InterceptionHookPoints;
using grpc::experimental::Interceptor;
using grpc::experimental::InterceptorBatchMethods;

using Headers = std::vector<std::pair<std::string, std::string>>;

std::string random_hex(int words) {
  std::random_device device;
  std::string text;
  char digits[9];
  for (int i = 0; i < words; ++i) {
    std::snprintf(digits, sizeof digits, "%08x", device());
    text += digits;
  }
  return text;
}

class AddHeaders final : public Interceptor {
 public:
  explicit AddHeaders(const Headers& headers) : headers_(headers) {}
  void Intercept(InterceptorBatchMethods* methods) override {
    if (methods->QueryInterceptionHookPoint(InterceptionHookPoints::PRE_SEND_INITIAL_METADATA))
      for (const auto& [name, value] : headers_) methods->GetSendInitialMetadata()->emplace(name, value);
    methods->Proceed();
  }

 private:
  const Headers& headers_;
};

class AddHeadersFactory final : public ClientInterceptorFactoryInterface {
 public:
  explicit AddHeadersFactory(Headers headers) : headers_(std::move(headers)) {}
  Interceptor* CreateClientInterceptor(ClientRpcInfo*) override { return new AddHeaders(headers_); }

 private:
  const Headers headers_;
};

}  // namespace

std::vector<std::unique_ptr<ClientInterceptorFactoryInterface>> add_headers(const std::string& token) {
  // One trace a command (https://www.w3.org/TR/trace-context): all of its calls belong together.
  Headers headers{{"traceparent", "00-" + random_hex(4) + "-" + random_hex(2) + "-01"}};
  if (!token.empty()) headers.emplace_back("authorization", "Bearer " + token);
  std::vector<std::unique_ptr<ClientInterceptorFactoryInterface>> factories;
  factories.push_back(std::make_unique<AddHeadersFactory>(std::move(headers)));
  return factories;
}

}  // namespace strata::client
