#include "server/library_log.h"

#include <google/protobuf/stubs/logging.h>
#include <grpc/support/log.h>
#include <spdlog/spdlog.h>

#include <chrono>
#include <map>
#include <mutex>
#include <string>
#include <utility>

#include "server/job_log.h"

namespace strata::server {
namespace {

constexpr std::chrono::seconds kTellEvery{10};  // the same complaint: whoever calls can bring it about as often as they like

// What protobuf has to say of messages that others sent is no error of ours.
void log_protobuf(google::protobuf::LogLevel, const char*, int, const std::string& message) {
  spdlog::debug(R"("msg":"protobuf","text":"{}")", json_escaped(message));
}

// Is it time to tell what stands in this line of gRPC's?
bool is_due(const std::string& file, int line) {
  using Clock = std::chrono::steady_clock;
  static std::mutex mutex;
  static std::map<std::pair<std::string, int>, Clock::time_point> told;
  const std::lock_guard lock(mutex);
  const Clock::time_point now = Clock::now();
  const auto [place, first] = told.try_emplace({file, line}, now);
  if (!first && now - place->second < kTellEvery) return false;
  place->second = now;
  return true;
}

void log_grpc(gpr_log_func_args* said) {
  const bool matters = said->severity == GPR_LOG_SEVERITY_ERROR && is_due(said->file, said->line);
  spdlog::log(matters ? spdlog::level::warn : spdlog::level::debug, R"("msg":"grpc","text":"{}")", json_escaped(said->message));
}

}  // namespace

void take_library_logs() {
  google::protobuf::SetLogHandler(log_protobuf);
  gpr_set_log_function(log_grpc);
}

}  // namespace strata::server
