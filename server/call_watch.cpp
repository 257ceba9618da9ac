#include "server/call_watch.h"

#include <grpcpp/grpcpp.h>
#include <spdlog/spdlog.h>

#include <chrono>
#include <map>
#include <optional>
#include <string>

#include "server/ids.h"
#include "server/job_log.h"
#include "server/status.h"

namespace strata::server {
namespace {

using grpc::experimental::InterceptionHookPoints;
using grpc::experimental::Interceptor;
using grpc::experimental::InterceptorBatchMethods;
using grpc::experimental::ServerInterceptorFactoryInterface;
using grpc::experimental::ServerRpcInfo;

constexpr std::size_t kMaxRequestId = 64;
constexpr const char *kTraceparent = "traceparent", *kRequestId = "x-request-id";

const char* name_of(grpc::StatusCode code) {
  static constexpr const char* kNames[] = {"OK",        "CANCELLED",      "UNKNOWN",           "INVALID_ARGUMENT",   "DEADLINE_EXCEEDED",
                                           "NOT_FOUND", "ALREADY_EXISTS", "PERMISSION_DENIED", "RESOURCE_EXHAUSTED", "FAILED_PRECONDITION",
                                           "ABORTED",   "OUT_OF_RANGE",   "UNIMPLEMENTED",     "INTERNAL",           "UNAVAILABLE",
                                           "DATA_LOSS", "UNAUTHENTICATED"};
  return code >= 0 && code <= grpc::StatusCode::UNAUTHENTICATED ? kNames[code] : "UNKNOWN";
}

// "/strata.v1.JobService/GetJob" -> "JobService/GetJob".
std::string short_method(const std::string& method) {
  const std::size_t slash = method.rfind('/'), dot = method.rfind('.', slash);
  return dot == std::string::npos ? method : method.substr(dot + 1);
}

class WatchedCall final : public Interceptor {
 public:
  WatchedCall(std::string method, Metrics& metrics, Tracer& tracer)
      : method_(std::move(method)), metrics_(metrics), tracer_(tracer), begun_(std::chrono::system_clock::now()) {
    metrics_.call_began(method_);
  }
  // The call is over, whether it got as far as a status or not.
  ~WatchedCall() override {
    const auto end = std::chrono::system_clock::now();
    const double seconds = std::chrono::duration<double>(end - begun_).count();
    const char* code = name_of(code_.value_or(grpc::StatusCode::CANCELLED));
    metrics_.call_ended(method_, code, seconds);
    if (!reason_.empty()) metrics_.call_refused(method_, reason_);
    spdlog::debug(R"("msg":"call","rpc":"{}","code":"{}","reason":"{}","ms":{:.1f},"request_id":"{}","trace_id":"{}")", method_, code,
                  reason_, 1000 * seconds, request_id_, trace_.trace_id);
    if (!tracer_.on()) return;
    const bool failed = code_ && *code_ != grpc::StatusCode::OK;
    tracer_.write({method_, trace_, span_id_, begun_, end, {{"rpc.grpc.status", code}, {"request_id", request_id_}}, failed, true});
  }

  void Intercept(InterceptorBatchMethods* methods) override {
    if (methods->QueryInterceptionHookPoint(InterceptionHookPoints::POST_RECV_INITIAL_METADATA)) {
      take_ids(*methods->GetRecvInitialMetadata());
    }
    if (methods->QueryInterceptionHookPoint(InterceptionHookPoints::PRE_SEND_STATUS)) {
      const grpc::Status status = methods->GetSendStatus();
      code_ = status.error_code();
      if (!status.ok()) reason_ = reason_in(status.error_details());
    }
    methods->Proceed();
  }

 private:
  using Metadata = std::multimap<grpc::string_ref, grpc::string_ref>;

  // A caller who gave none gets some, which whatever comes of the call has too: its job is found by them in the log and in the traces.
  void take_ids(Metadata& metadata) {
    const auto value_of = [&](const char* key) {
      const auto found = metadata.find(key);
      return found == metadata.end() ? std::string() : std::string(found->second.data(), found->second.size());
    };
    trace_ = trace_of(value_of(kTraceparent));
    request_id_ = json_escaped(value_of(kRequestId).substr(0, kMaxRequestId));
    if (trace_.parent_id.empty()) {
      traceparent_ = "00-" + trace_.trace_id + "-" + span_id_ + "-01";
      metadata.erase(kTraceparent);
      metadata.emplace(kTraceparent, traceparent_);
    }
    if (request_id_.empty()) {
      request_id_ = random_id();
      metadata.erase(kRequestId);
      metadata.emplace(kRequestId, request_id_);
    }
  }

  const std::string method_, span_id_ = new_span_id();
  Metrics& metrics_;
  Tracer& tracer_;
  const std::chrono::system_clock::time_point begun_;
  TraceContext trace_;
  std::string traceparent_, request_id_, reason_;
  std::optional<grpc::StatusCode> code_;
};

class WatchedCalls final : public ServerInterceptorFactoryInterface {
 public:
  WatchedCalls(Metrics& metrics, Tracer& tracer) : metrics_(metrics), tracer_(tracer) {}
  Interceptor* CreateServerInterceptor(ServerRpcInfo* info) override {
    return new WatchedCall(short_method(info->method()), metrics_, tracer_);
  }

 private:
  Metrics& metrics_;
  Tracer& tracer_;
};

}  // namespace

std::vector<std::unique_ptr<ServerInterceptorFactoryInterface>> watch_calls(Metrics& metrics, Tracer& tracer) {
  std::vector<std::unique_ptr<ServerInterceptorFactoryInterface>> factories;
  factories.push_back(std::make_unique<WatchedCalls>(metrics, tracer));
  return factories;
}

}  // namespace strata::server
