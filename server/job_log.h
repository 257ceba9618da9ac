// Writes what happens to jobs into the log: a runner around a runner.
#pragma once

#include <memory>
#include <string>

#include "server/job_runner.h"

namespace strata::server {

std::unique_ptr<JobRunner> log_jobs(JobRunner& runner);
// The end of a job, from a runner or without one.
void log_end(const std::string& job_id, const v1::Job& job);

// As the inside of a JSON string.
std::string json_escaped(const std::string& text);

}  // namespace strata::server
