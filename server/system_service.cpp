#include <google/protobuf/util/time_util.h>
#include <grpcpp/grpcpp.h>
#include <unistd.h>

#include <fstream>

#include "core/base/stage.h"
#include "server/convert.h"
#include "server/services.h"
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
  SystemService(const JobDesk& desk, const WireLimits& limits)
      : desk_(desk), limits_(limits), started_(google::protobuf::util::TimeUtil::GetCurrentTime()) {}

  grpc::ServerUnaryReactor* GetCapabilities(CallbackServerContext* context, const v1::GetCapabilitiesRequest*,
                                            v1::GetCapabilitiesResponse* response) override {
    response->set_version(desk_.options().generator);
    response->add_api_versions("strata.v1");
    for (int f = v1::SurfaceFormat_MIN + 1; f <= v1::SurfaceFormat_MAX; ++f)
      response->add_surface_formats(static_cast<v1::SurfaceFormat>(f));
    for (int f = v1::OutputFormat_MIN + 1; f <= v1::OutputFormat_MAX; ++f) response->add_output_formats(static_cast<v1::OutputFormat>(f));
    for (int s = 0; s < kStageCount; ++s) response->add_stages(to_wire(static_cast<Stage>(s)));
    v1::Limits& limits = *response->mutable_limits();
    limits.set_max_message_bytes(limits_.max_message_bytes);
    limits.set_max_inline_surface_bytes(desk_.options().max_inline_surface_bytes);
    limits.set_max_upload_bytes(limits_.max_upload_bytes);
    limits.set_max_frame_bytes(limits_.max_frame_bytes);
    limits.set_slots(desk_.slots());
    limits.set_threads_per_job(desk_.options().threads_per_job);
    limits.set_queue_capacity(desk_.options().queue_capacity);
    response->set_draining(desk_.draining());
    return done(context);
  }

  grpc::ServerUnaryReactor* GetServerStatus(CallbackServerContext* context, const v1::GetServerStatusRequest*,
                                            v1::GetServerStatusResponse* response) override {
    const JobDesk::Load load = desk_.load();
    *response->mutable_start_time() = started_;
    response->set_running_jobs(load.running);
    response->set_queued_jobs(load.queued);
    response->set_jobs_total(load.total);
    response->set_resident_memory_bytes(resident_bytes());
    response->set_draining(desk_.draining());
    return done(context);
  }

 private:
  static grpc::ServerUnaryReactor* done(CallbackServerContext* context) {
    grpc::ServerUnaryReactor* reactor = context->DefaultReactor();
    reactor->Finish(grpc::Status::OK);
    return reactor;
  }

  const JobDesk& desk_;
  const WireLimits limits_;
  const google::protobuf::Timestamp started_;
};

}  // namespace

std::unique_ptr<grpc::Service> make_system_service(const JobDesk& desk, const WireLimits& limits) {
  return std::make_unique<SystemService>(desk, limits);
}

}  // namespace strata::server
