#include <grpcpp/grpcpp.h>

#include <string>
#include <string_view>

#include "server/services.h"

namespace strata::server {
namespace {

std::string metadata_of(const grpc::CallbackServerContext& context, const char* key) {
  const auto found = context.client_metadata().find(key);
  return found == context.client_metadata().end() ? std::string() : std::string(found->second.data(), found->second.size());
}

void add_names(const grpc::AuthContext& peer, const char* property, std::vector<std::string>& names) {
  for (const grpc::string_ref& name : peer.FindPropertyValues(property)) names.emplace_back(name.data(), name.size());
}

}  // namespace

Credentials credentials_of(const grpc::CallbackServerContext& context) {
  constexpr std::string_view kBearer = "Bearer ";
  Credentials credentials;
  credentials.token = metadata_of(context, "authorization");
  if (credentials.token.rfind(kBearer, 0) == 0) credentials.token.erase(0, kBearer.size());
  if (credentials.token.empty()) credentials.token = metadata_of(context, "x-api-key");
  constexpr std::size_t kTraceparent = 55, kRequestId = 64;
  credentials.traceparent = metadata_of(context, "traceparent").substr(0, kTraceparent);
  credentials.request_id = metadata_of(context, "x-request-id").substr(0, kRequestId);
  const auto peer = context.auth_context();
  if (!peer || !peer->IsPeerAuthenticated()) return credentials;
  add_names(*peer, "x509_subject_alternative_name", credentials.certificate);
  add_names(*peer, "x509_common_name", credentials.certificate);
  return credentials;
}

}  // namespace strata::server
