#include "server/job_error.h"

#include <utility>

namespace strata::server {
namespace {

constexpr int kCancelled = 1, kDeadlineExceeded = 4;

}  // namespace

v1::JobError job_error(int code, const std::string& reason, const std::string& message) {
  v1::JobError error;
  error.set_code(code);
  error.set_reason(reason);
  error.set_message(message);
  error.mutable_diagnostic()->set_reason(reason);
  error.mutable_diagnostic()->set_severity(v1::SEVERITY_ERROR);
  error.mutable_diagnostic()->set_message(message);
  return error;
}

v1::Job ended_badly(v1::JobError error) {
  v1::Job job;
  job.set_state(error.code() == kCancelled ? v1::JOB_STATE_CANCELLED : v1::JOB_STATE_FAILED);
  *job.mutable_error() = std::move(error);
  return job;
}

v1::Job out_of_time(v1::Job job) {
  if (job.state() != v1::JOB_STATE_CANCELLED) return job;
  const v1::JobError stopped = job.error();
  job.set_state(v1::JOB_STATE_FAILED);
  *job.mutable_error() = job_error(kDeadlineExceeded, "TIME_BUDGET_EXCEEDED", "the job took longer than its time limit");
  job.mutable_error()->set_stage(stopped.stage());
  job.mutable_error()->set_backtrace(stopped.backtrace());
  return job;
}

}  // namespace strata::server
