#include "server/job_log.h"

#include <spdlog/spdlog.h>

#include <nlohmann/json.hpp>
#include <utility>

#include "server/trace.h"

namespace strata::server {
namespace {

class LoggedRunner final : public JobRunner {
 public:
  explicit LoggedRunner(JobRunner& runner) : runner_(runner) {}

  int slots() const override { return runner_.slots(); }
  void cancel(const std::string& job_id, Stop why) override { runner_.cancel(job_id, why); }

  void start(JobOrder order, EventSink on_event, Done on_done) override {
    const std::string id = order.job_id;
    spdlog::info(R"("msg":"job started","job":"{}","threads":{},"trace_id":"{}")", id, order.threads, trace_of(order.traceparent).trace_id);
    auto seen = [id, on_event = std::move(on_event)](v1::WatchJobResponse event) {
      log_event(id, event);
      on_event(std::move(event));
    };
    auto ended = [id, on_done = std::move(on_done)](v1::Job result) {
      log_end(id, result);
      on_done(std::move(result));
    };
    runner_.start(std::move(order), std::move(seen), std::move(ended));
  }

 private:
  static void log_event(const std::string& id, const v1::WatchJobResponse& event) {
    if (event.has_stage_ended())
      spdlog::debug(R"("msg":"stage ended","job":"{}","stage":"{}","seconds":{:.3f})", id, v1::Stage_Name(event.stage_ended().stage()),
                    event.stage_ended().seconds());
    if (event.has_adjustment()) spdlog::info(R"("msg":"adjusted","job":"{}","reason":"{}")", id, event.adjustment().reason());
  }

  JobRunner& runner_;
};

}  // namespace

std::string json_escaped(const std::string& text) {
  const std::string quoted = nlohmann::json(text).dump(-1, ' ', true, nlohmann::json::error_handler_t::replace);
  return quoted.substr(1, quoted.size() - 2);
}

void log_end(const std::string& job_id, const v1::Job& job) {
  spdlog::info(R"("msg":"job ended","job":"{}","state":"{}","reason":"{}","error":"{}","wall_s":{:.3f},"cpu_s":{:.3f},"hexes":{})", job_id,
               v1::JobState_Name(job.state()), job.error().reason(), json_escaped(job.error().message()), job.usage().wall_seconds(),
               job.usage().cpu_seconds(), job.hexes());
}

std::unique_ptr<JobRunner> log_jobs(JobRunner& runner) { return std::make_unique<LoggedRunner>(runner); }

}  // namespace strata::server
