#include "server/server.h"

#include <grpcpp/ext/proto_server_reflection_plugin.h>
#include <grpcpp/grpcpp.h>
#include <grpcpp/health_check_service_interface.h>
#include <grpcpp/security/tls_certificate_provider.h>
#include <grpcpp/security/tls_credentials_options.h>

#include <stdexcept>

#include "server/listener.h"

namespace strata::server {
namespace {

constexpr int kMaxMetadataBytes = 16 << 10;
constexpr int kMaxStreams = 256;               // per connection
constexpr const char* kServices[] = {"", "strata.v1.JobService", "strata.v1.BlobService", "strata.v1.SystemService"};

std::shared_ptr<grpc::ServerCredentials> tls_credentials(const TlsFiles& files) {
  check_tls_files(files);
  using grpc::experimental::FileWatcherCertificateProvider;
  const auto provider =
      files.client_ca.empty()
          ? std::make_shared<FileWatcherCertificateProvider>(files.key, files.certificate, files.refresh_seconds)
          : std::make_shared<FileWatcherCertificateProvider>(files.key, files.certificate, files.client_ca, files.refresh_seconds);
  grpc::experimental::TlsServerCredentialsOptions options(provider);
  options.watch_identity_key_cert_pairs();
  if (!files.client_ca.empty()) {
    options.watch_root_certs();
    options.set_cert_request_type(GRPC_SSL_REQUEST_AND_REQUIRE_CLIENT_CERTIFICATE_AND_VERIFY);
  }
  return grpc::experimental::TlsServerCredentials(options);
}

// Whoever wants to see certificates of clients wants TLS: without it, nobody would be asked for one.
bool uses_tls(const ServerOptions& options) {
  return !options.tls.certificate.empty() || !options.tls.key.empty() || !options.tls.client_ca.empty();
}

bool is_unix(const std::string& address) { return address.rfind("unix:", 0) == 0; }

void set_limits(grpc::ServerBuilder& builder, const WireLimits& limits) {
  builder.SetMaxReceiveMessageSize(static_cast<int>(limits.max_message_bytes));
  // gRPC unpacks a message whole before it looks at its size; frames are packed by themselves, and are never taken at their word.
  for (const grpc_compression_algorithm packed : {GRPC_COMPRESS_DEFLATE, GRPC_COMPRESS_GZIP})
    builder.SetCompressionAlgorithmSupportStatus(packed, false);
  builder.AddChannelArgument(GRPC_ARG_MAX_CONCURRENT_STREAMS, kMaxStreams);
  builder.AddChannelArgument(GRPC_ARG_MAX_METADATA_SIZE, kMaxMetadataBytes);
  builder.AddChannelArgument(GRPC_ARG_SERVER_HANDSHAKE_TIMEOUT_MS, 10'000);
  builder.AddChannelArgument(GRPC_ARG_MAX_CONNECTION_IDLE_MS, 600'000);  // clients connect again without their users noticing
  builder.AddChannelArgument(GRPC_ARG_KEEPALIVE_TIME_MS, 30'000);
  builder.AddChannelArgument(GRPC_ARG_KEEPALIVE_TIMEOUT_MS, 20'000);
  builder.AddChannelArgument(GRPC_ARG_HTTP2_MIN_RECV_PING_INTERVAL_WITHOUT_DATA_MS, 10'000);
}

}  // namespace

struct Server::Parts {
  std::unique_ptr<Transfers> transfers;
  std::unique_ptr<grpc::Service> jobs, blobs, system;
  std::unique_ptr<Listener> listener;
  std::unique_ptr<grpc::Server> server;  // goes first
};

bool is_local(const std::string& address) {
  if (is_unix(address)) return true;
  const std::string host = address.substr(0, address.rfind(':'));
  return host == "localhost" || host == "[::1]" || host.rfind("127.", 0) == 0;
}

void check_options(const ServerOptions& options) {
  const bool tls = uses_tls(options);
  if (tls) check_tls_files(options.tls);
  for (const std::string& address : options.listen) check_address(address);
  for (const std::string& address : options.listen)
    if (!tls && !options.insecure && !is_local(address))
      throw std::runtime_error(address + " is reachable from other machines: give --tls-cert and --tls-key, or say --insecure");
}

Server::Server(const ServerOptions& options, CallWatchers watchers, Gate& gate, JobDesk& desk, BlobStore& blobs)
    : parts_(std::make_unique<Parts>()) {
  check_options(options);
  const bool tls = uses_tls(options);
  parts_->transfers = std::make_unique<Transfers>(options.max_transfers, options.stall_seconds);
  parts_->jobs = make_job_service(gate, desk, blobs, *parts_->transfers, options.limits);
  parts_->blobs = make_blob_service(gate, desk, blobs, *parts_->transfers, options.limits);
  parts_->system = make_system_service(gate, desk, options.limits);

  grpc::EnableDefaultHealthCheckService(true);
  grpc::reflection::InitProtoReflectionServerBuilderPlugin();
  grpc::ServerBuilder builder;
  set_limits(builder, options.limits);
  builder.experimental().SetInterceptorCreators(std::move(watchers));
  for (const auto& service : {parts_->jobs.get(), parts_->blobs.get(), parts_->system.get()}) builder.RegisterService(service);
  parts_->listener = std::make_unique<Listener>(options.max_connections);
  for (const std::string& address : options.listen) {
    const bool encrypt = tls && !is_unix(address);
    parts_->listener->add(address, builder, encrypt ? tls_credentials(options.tls) : grpc::InsecureServerCredentials());
  }
  parts_->server = builder.BuildAndStart();
  if (!parts_->server) throw std::runtime_error("gRPC cannot start a server");
  for (const char* service : kServices) parts_->server->GetHealthCheckService()->SetServingStatus(service, true);
  parts_->listener->start();
}

Server::~Server() { shutdown(std::chrono::milliseconds(0)); }

const std::vector<std::string>& Server::addresses() const { return parts_->listener->addresses(); }

void Server::set_not_serving() { parts_->server->GetHealthCheckService()->SetServingStatus(false); }

void Server::shutdown(std::chrono::milliseconds grace) {
  if (!parts_->server) return;
  parts_->listener->stop();
  parts_->server->Shutdown(std::chrono::system_clock::now() + grace);
  parts_->server->Wait();
  parts_->server.reset();
}

}  // namespace strata::server
