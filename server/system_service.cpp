#include <google/protobuf/util/time_util.h>
#include <grpcpp/grpcpp.h>
#include <unistd.h>

#include <fstream>

#include "core/base/stage.h"
#include "server/convert.h"
#include "server/frames.h"
#include "server/services.h"
#include "server/status.h"
#include "strata/v1/system.grpc.pb.h"

namespace strata::server {
namespace {

using grpc::CallbackServerContext;

std::int64_t resident_bytes() {
  std::ifstream statm("/proc/self/statm");
  std::int64_t size = 0, resident = 0;
  statm >> size >> resident;
  return resident * sysconf(_SC_PAGESIZE);
}

class SystemService final : public v1::SystemService::CallbackService {
 public:
  SystemService(Gate& gate, const JobDesk& desk, const WireLimits& limits)
      : gate_(gate), desk_(desk), limits_(limits), started_(google::protobuf::util::TimeUtil::GetCurrentTime()) {}

  grpc::ServerUnaryReactor* GetCapabilities(CallbackServerContext* context, const v1::GetCapabilitiesRequest*,
                                            v1::GetCapabilitiesResponse* response) override {
    const grpc::Status status = may_ask(*context);
    if (!status.ok()) return done(context, status);
    response->set_version(desk_.options().generator);
    response->add_api_versions("strata.v1");
    for (int f = v1::SurfaceFormat_MIN + 1; f <= v1::SurfaceFormat_MAX; ++f)
      response->add_surface_formats(static_cast<v1::SurfaceFormat>(f));
    for (int f = v1::OutputFormat_MIN + 1; f <= v1::OutputFormat_MAX; ++f) response->add_output_formats(static_cast<v1::OutputFormat>(f));
    for (const v1::Codec codec : kCodecs) response->add_codecs(codec);
    for (int s = 0; s < kStageCount; ++s) response->add_stages(to_wire(static_cast<Stage>(s)));
    v1::Limits& limits = *response->mutable_limits();
    limits.set_max_message_bytes(limits_.max_message_bytes);
    limits.set_max_inline_surface_bytes(desk_.admission_options().max_inline_surface_bytes);
    limits.set_max_upload_bytes(limits_.max_upload_bytes);
    limits.set_max_frame_bytes(limits_.max_frame_bytes);
    limits.set_slots(desk_.slots());
    limits.set_threads_per_job(desk_.options().threads_per_job);
    limits.set_queue_capacity(desk_.options().queue_capacity);
    limits.set_result_ttl_seconds(desk_.options().result_ttl_seconds);
    limits.set_memory_budget_bytes(desk_.admission_options().memory_budget_bytes);
    response->set_draining(desk_.draining());
    return done(context, grpc::Status::OK);
  }

  grpc::ServerUnaryReactor* GetServerStatus(CallbackServerContext* context, const v1::GetServerStatusRequest*,
                                            v1::GetServerStatusResponse* response) override {
    const grpc::Status status = may_ask(*context);
    if (!status.ok()) return done(context, status);
    const JobDesk::Load load = desk_.load();
    *response->mutable_start_time() = started_;
    response->set_running_jobs(load.running);
    response->set_queued_jobs(load.queued);
    response->set_jobs_total(load.total);
    response->set_resident_memory_bytes(resident_bytes());
    response->set_draining(desk_.draining());
    return done(context, grpc::Status::OK);
  }

 private:
  [[nodiscard]] grpc::Status may_ask(const CallbackServerContext& context) const {
    return status_of([&] { gate_.admit(credentials_of(context), Role::Viewer, CallKind::Plain); });
  }

  static grpc::ServerUnaryReactor* done(CallbackServerContext* context, const grpc::Status& status) {
    grpc::ServerUnaryReactor* reactor = context->DefaultReactor();
    reactor->Finish(status);
    return reactor;
  }

  Gate& gate_;
  const JobDesk& desk_;
  const WireLimits limits_;
  const google::protobuf::Timestamp started_;
};

}  // namespace

std::unique_ptr<grpc::Service> make_system_service(Gate& gate, const JobDesk& desk, const WireLimits& limits) {
  return std::make_unique<SystemService>(gate, desk, limits);
}

}  // namespace strata::server
