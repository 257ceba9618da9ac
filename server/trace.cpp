#include "server/trace.h"

#include <algorithm>
#include <nlohmann/json.hpp>
#include <random>
#include <stdexcept>

namespace strata::server {
namespace {

using Json = nlohmann::json;
using Time = std::chrono::system_clock::time_point;

constexpr std::size_t kTraceDigits = 32, kSpanDigits = 16;
constexpr int kKindInternal = 1, kKindServer = 2, kStatusError = 2;  // numbers of OTLP

std::string random_hex(std::size_t digits) {
  static thread_local std::mt19937_64 random{std::random_device{}()};
  static constexpr char kDigits[] = "0123456789abcdef";
  std::string text;
  for (std::size_t i = 0; i < digits; ++i) text += kDigits[random() & 15];
  return text;
}

bool is_id(const std::string& text, std::size_t digits) {
  return text.size() == digits && text.find_first_not_of("0123456789abcdef") == std::string::npos &&
         text.find_first_not_of('0') != std::string::npos;
}

std::string nanos(Time at) { return std::to_string(std::chrono::duration_cast<std::chrono::nanoseconds>(at.time_since_epoch()).count()); }

Json attribute(const std::string& key, const std::string& value) { return {{"key", key}, {"value", {{"stringValue", value}}}}; }

Json json_of(const Span& span) {
  Json json{{"traceId", span.context.trace_id},
            {"spanId", span.span_id},
            {"name", span.name},
            {"kind", span.of_call ? kKindServer : kKindInternal},
            {"startTimeUnixNano", nanos(span.begin)},
            {"endTimeUnixNano", nanos(span.end)}};
  if (!span.context.parent_id.empty()) json["parentSpanId"] = span.context.parent_id;
  json["attributes"] = Json::array();
  for (const auto& [key, value] : span.attributes) json["attributes"].push_back(attribute(key, value));
  if (span.failed) json["status"] = {{"code", kStatusError}};
  return json;
}

class TracedRunner final : public JobRunner {
 public:
  TracedRunner(JobRunner& runner, Tracer& tracer) : runner_(runner), tracer_(tracer) {}
  int slots() const override { return runner_.slots(); }
  void cancel(const std::string& job_id, Stop why) override { runner_.cancel(job_id, why); }

  void start(JobOrder order, EventSink on_event, Done on_done) override {
    const std::string id = order.job_id, parent = order.traceparent;
    const std::chrono::duration<double> waited(order.queue_seconds);
    const Time begin = std::chrono::system_clock::now();
    runner_.start(std::move(order), std::move(on_event), [this, id, parent, waited, begin, on_done = std::move(on_done)](v1::Job job) {
      if (tracer_.on()) write_spans(id, parent, waited, begin, job);
      on_done(std::move(job));
    });
  }

 private:
  void write_spans(const std::string& id, const std::string& parent, std::chrono::duration<double> waited, Time begin, const v1::Job& job) {
    const auto ticks = [](std::chrono::duration<double> d) { return std::chrono::duration_cast<std::chrono::system_clock::duration>(d); };
    Span run{"job", trace_of(parent), new_span_id(), begin, std::chrono::system_clock::now(), {{"strata.job", id}}, false, false};
    run.attributes.emplace_back("strata.state", v1::JobState_Name(job.state()));
    run.failed = job.state() == v1::JOB_STATE_FAILED;
    if (run.failed) run.attributes.emplace_back("strata.reason", job.error().reason());
    tracer_.write(run);
    tracer_.write({"queue", run.context, new_span_id(), begin - ticks(waited), begin, {{"strata.job", id}}, false, false});
    // Stages follow each other without gaps.
    Time at = begin;
    for (const v1::StageRecord& stage : job.stages()) {
      const Time end = at + ticks(std::chrono::duration<double>(stage.seconds()));
      tracer_.write(
          {v1::Stage_Name(stage.stage()), {run.context.trace_id, run.span_id}, new_span_id(), at, end, {{"strata.job", id}}, false, false});
      at = end;
    }
  }

  JobRunner& runner_;
  Tracer& tracer_;
};

}  // namespace

TraceContext trace_of(const std::string& traceparent) {
  constexpr std::size_t kTraceAt = 3, kSpanAt = kTraceAt + kTraceDigits + 1, kLength = kSpanAt + kSpanDigits + 3;
  if (traceparent.size() == kLength && traceparent.rfind("ff", 0) != 0 && traceparent[2] == '-' && traceparent[kSpanAt - 1] == '-') {
    const TraceContext context{traceparent.substr(kTraceAt, kTraceDigits), traceparent.substr(kSpanAt, kSpanDigits)};
    if (is_id(context.trace_id, kTraceDigits) && is_id(context.parent_id, kSpanDigits)) return context;
  }
  return {random_hex(kTraceDigits), ""};
}

std::string new_span_id() { return random_hex(kSpanDigits); }

Tracer::Tracer(const std::string& path) {
  if (path.empty()) return;
  file_.open(path, std::ios::app);
  if (!file_) throw std::runtime_error("cannot write " + path + " (--trace-file)");
}

void Tracer::write(const Span& span) {
  if (!on()) return;
  const Json line{{"resourceSpans",
                   {{{"resource", {{"attributes", {attribute("service.name", "stratad")}}}},
                     {"scopeSpans", {{{"scope", {{"name", "strata"}}}, {"spans", {json_of(span)}}}}}}}}};
  const std::string text = line.dump(-1, ' ', true, Json::error_handler_t::replace) + "\n";
  const std::lock_guard lock(mutex_);
  file_ << text << std::flush;
}

std::unique_ptr<JobRunner> trace_jobs(JobRunner& runner, Tracer& tracer) { return std::make_unique<TracedRunner>(runner, tracer); }

}  // namespace strata::server
