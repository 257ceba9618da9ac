// Spans as lines of OTLP JSON, one ExportTraceServiceRequest a line (opentelemetry.io/docs/specs/otlp): for collectors that read files.
#pragma once

#include <chrono>
#include <cstdint>
#include <fstream>
#include <memory>
#include <mutex>
#include <string>
#include <utility>
#include <vector>

#include "server/job_runner.h"

namespace strata::server {

// Where a span belongs, as in the W3C header traceparent: 00-TRACE-SPAN-FLAGS.
struct TraceContext {
  std::string trace_id;   // 32 digits of 0-9a-f
  std::string parent_id;  // 16; empty: none
};

// Of the header, or a new trace when it is none.
TraceContext trace_of(const std::string& traceparent);
std::string new_span_id();

struct Span {
  std::string name;
  TraceContext context;
  std::string span_id;
  std::chrono::system_clock::time_point begin, end;
  std::vector<std::pair<std::string, std::string>> attributes;
  bool failed = false;
  bool of_call = false;  // answers somebody outside
};

// Safe to call from any thread. With an empty path it writes nothing.
class Tracer {
 public:
  // Throws std::runtime_error when the file cannot be written.
  explicit Tracer(const std::string& path);
  [[nodiscard]] bool on() const { return file_.is_open(); }
  void write(const Span& span);

 private:
  std::mutex mutex_;
  std::ofstream file_;
};

// Writes a span for each job that passes through, with one for its wait and one for each stage.
std::unique_ptr<JobRunner> trace_jobs(JobRunner& runner, Tracer& tracer);

}  // namespace strata::server
