#include "server/metrics.h"

#include <prometheus/counter.h>
#include <prometheus/exposer.h>
#include <prometheus/gauge.h>
#include <prometheus/histogram.h>
#include <prometheus/registry.h>
#include <unistd.h>

#include <algorithm>
#include <cctype>
#include <fstream>
#include <stdexcept>
#include <utility>

#include "server/listener.h"

namespace strata::server {
namespace {

const prometheus::Histogram::BucketBoundaries kCallSeconds = {0.001, 0.003, 0.01, 0.03, 0.1, 0.3, 1, 3, 10, 60, 600};
const prometheus::Histogram::BucketBoundaries kCellRates = {100, 300, 1000, 3000, 10000, 30000, 100000};
const prometheus::Histogram::BucketBoundaries kSeconds = {0.01, 0.03, 0.1, 0.3, 1, 3, 10, 30, 100, 300, 1000, 3000};

// "STAGE_WRAP_RIDGES" -> "wrap_ridges".
std::string short_name(std::string name, std::size_t prefix) {
  name.erase(0, prefix);
  std::transform(name.begin(), name.end(), name.begin(), [](unsigned char c) { return static_cast<char>(std::tolower(c)); });
  return name;
}

prometheus::MetricFamily gauge(const char* name, const char* help, double value) {
  prometheus::MetricFamily family;
  family.name = name;
  family.help = help;
  family.type = prometheus::MetricType::Gauge;
  family.metric.resize(1);
  family.metric[0].gauge.value = value;
  return family;
}

double resident_bytes() {
  std::ifstream statm("/proc/self/statm");
  double size = 0, resident = 0;
  statm >> size >> resident;
  return resident * static_cast<double>(sysconf(_SC_PAGESIZE));
}

// Asks the desk when Prometheus asks.
class LoadGauges final : public prometheus::Collectable {
 public:
  LoadGauges(const JobDesk& desk, const MemoryLedger& memory) : desk_(desk), memory_(memory) {}
  std::vector<prometheus::MetricFamily> Collect() const override {
    const JobDesk::Load load = desk_.load();
    return {gauge("strata_jobs_running", "Jobs that run now", load.running),
            gauge("strata_jobs_queued", "Jobs that wait", load.queued),
            gauge("strata_jobs_stored", "Jobs remembered", static_cast<double>(load.total)),
            gauge("strata_draining", "1 when no new jobs are taken", desk_.draining() ? 1 : 0),
            gauge("strata_resident_memory_bytes", "Resident memory of the server process", resident_bytes()),
            gauge("strata_queue_oldest_seconds", "How long the oldest job has waited", load.oldest_queued_seconds),
            gauge("strata_watchers", "Open watches", static_cast<double>(load.watchers)),
            gauge("strata_disk_free_bytes", "Free on the device of the data folder", static_cast<double>(load.disk_free_bytes)),
            gauge("strata_memory_budget_bytes", "Memory for all jobs", static_cast<double>(memory_.budget())),
            gauge("strata_memory_reserved_bytes", "Memory promised to running jobs", static_cast<double>(memory_.reserved()))};
  }

 private:
  const JobDesk& desk_;
  const MemoryLedger& memory_;
};

}  // namespace

struct Metrics::Parts {
  std::shared_ptr<prometheus::Registry> registry = std::make_shared<prometheus::Registry>();
  prometheus::Family<prometheus::Counter>& finished =
      prometheus::BuildCounter().Name("strata_jobs_finished_total").Help("Jobs that ended, by state and reason").Register(*registry);
  prometheus::Family<prometheus::Histogram>& stage_seconds =
      prometheus::BuildHistogram().Name("strata_stage_seconds").Help("Wall time of stages").Register(*registry);
  prometheus::Histogram& job_seconds = prometheus::BuildHistogram()
                                           .Name("strata_job_seconds")
                                           .Help("Wall time of jobs from start to end")
                                           .Register(*registry)
                                           .Add({}, kSeconds);
  prometheus::Counter& cells = prometheus::BuildCounter().Name("strata_hexes_total").Help("Hexes delivered").Register(*registry).Add({});
  prometheus::Counter& cpu =
      prometheus::BuildCounter().Name("strata_job_cpu_seconds_total").Help("CPU time while jobs ran").Register(*registry).Add({});
  prometheus::Family<prometheus::Counter>& calls =
      prometheus::BuildCounter().Name("strata_rpc_requests_total").Help("Calls that ended, by method and status").Register(*registry);
  prometheus::Family<prometheus::Counter>& refused =
      prometheus::BuildCounter().Name("strata_rpc_refused_total").Help("Calls that were refused, by method and reason").Register(*registry);
  prometheus::Family<prometheus::Histogram>& call_seconds =
      prometheus::BuildHistogram().Name("strata_rpc_seconds").Help("Time from the begin of calls to their end").Register(*registry);
  prometheus::Family<prometheus::Gauge>& open_calls =
      prometheus::BuildGauge().Name("strata_rpc_active").Help("Calls and streams under way").Register(*registry);
  prometheus::Histogram& queue_seconds = prometheus::BuildHistogram()
                                             .Name("strata_queue_wait_seconds")
                                             .Help("Time jobs waited before they ran")
                                             .Register(*registry)
                                             .Add({}, kSeconds);
  prometheus::Family<prometheus::Histogram>& estimate_ratio =
      prometheus::BuildHistogram().Name("strata_estimate_ratio").Help("What jobs took over what was estimated").Register(*registry);
  prometheus::Histogram& cell_rate = prometheus::BuildHistogram()
                                         .Name("strata_hexes_per_core_second")
                                         .Help("Hexes delivered per second of CPU time")
                                         .Register(*registry)
                                         .Add({}, kCellRates);
  std::shared_ptr<LoadGauges> load;
  std::unique_ptr<prometheus::Exposer> exposer;

  void count_end(const v1::Job& job) {
    finished.Add({{"state", short_name(v1::JobState_Name(job.state()), 10)}, {"reason", job.error().reason()}}).Increment();
  }

  void count(const v1::Job& job) {
    count_end(job);
    for (const v1::StageRecord& stage : job.stages())
      stage_seconds.Add({{"stage", short_name(v1::Stage_Name(stage.stage()), 6)}}, kSeconds).Observe(stage.seconds());
    job_seconds.Observe(job.usage().wall_seconds());
    cells.Increment(static_cast<double>(job.hexes()));
    cpu.Increment(std::max(0.0, job.usage().cpu_seconds()));
    if (job.state() == v1::JOB_STATE_SUCCEEDED && job.usage().cpu_seconds() > 0)
      cell_rate.Observe(static_cast<double>(job.hexes()) / job.usage().cpu_seconds());
  }

  // Of a job that succeeded, against what was estimated on the way.
  void compare(const v1::Estimate& estimate, const v1::Job& job) {
    static const prometheus::Histogram::BucketBoundaries kRatios = {0.1, 0.25, 0.5, 0.75, 1, 1.5, 2, 3, 5, 10};
    const auto observe = [&](const char* what, double took, double estimated) {
      if (estimated > 0) estimate_ratio.Add({{"what", what}}, kRatios).Observe(took / estimated);
    };
    observe("hexes", static_cast<double>(job.hexes()), static_cast<double>(estimate.hexes()));
    observe("memory", static_cast<double>(job.usage().peak_memory_bytes()), static_cast<double>(estimate.memory_bytes()));
    observe("cpu_seconds", job.usage().cpu_seconds(), estimate.cpu_seconds());
  }

  class MeasuredRunner final : public JobRunner {
   public:
    MeasuredRunner(JobRunner& runner, Parts& parts) : runner_(runner), parts_(parts) {}
    int slots() const override { return runner_.slots(); }
    void cancel(const std::string& job_id, Stop why) override { runner_.cancel(job_id, why); }
    void start(JobOrder order, EventSink on_event, Done on_done) override {
      parts_.queue_seconds.Observe(order.queue_seconds);
      const auto estimate = std::make_shared<v1::Estimate>();
      auto seen = [estimate, on_event = std::move(on_event)](v1::WatchJobResponse event) {
        if (event.has_estimate()) *estimate = event.estimate();
        on_event(std::move(event));
      };
      runner_.start(std::move(order), std::move(seen), [this, estimate, on_done = std::move(on_done)](v1::Job job) {
        parts_.count(job);
        if (job.state() == v1::JOB_STATE_SUCCEEDED) parts_.compare(*estimate, job);
        on_done(std::move(job));
      });
    }

   private:
    JobRunner& runner_;
    Parts& parts_;
  };
};

Metrics::Metrics() : parts_(std::make_unique<Parts>()) {}
Metrics::~Metrics() = default;

std::unique_ptr<JobRunner> Metrics::measure(JobRunner& runner) { return std::make_unique<Parts::MeasuredRunner>(runner, *parts_); }

void Metrics::count_unrun(const v1::Job& job) { parts_->count_end(job); }

void Metrics::call_began(const std::string& rpc) { parts_->open_calls.Add({{"rpc", rpc}}).Increment(); }

void Metrics::call_ended(const std::string& rpc, const std::string& code, double seconds) {
  parts_->open_calls.Add({{"rpc", rpc}}).Decrement();
  parts_->calls.Add({{"rpc", rpc}, {"code", code}}).Increment();
  parts_->call_seconds.Add({{"rpc", rpc}}, kCallSeconds).Observe(seconds);
}

void Metrics::call_refused(const std::string& rpc, const std::string& reason) {
  parts_->refused.Add({{"rpc", rpc}, {"reason", reason}}).Increment();
}

void Metrics::serve(const std::string& address, const JobDesk& desk, const MemoryLedger& memory) {
  check_address(address);
  try {
    parts_->load = std::make_shared<LoadGauges>(desk, memory);
    parts_->exposer = std::make_unique<prometheus::Exposer>(address, 1);
  } catch (const std::exception& error) {
    throw std::runtime_error("cannot serve metrics on " + address + ": " + error.what());
  }
  parts_->exposer->RegisterCollectable(parts_->registry);
  parts_->exposer->RegisterCollectable(parts_->load);
}

void Metrics::stop() { parts_->exposer.reset(); }

}  // namespace strata::server
