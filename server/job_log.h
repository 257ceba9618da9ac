// Writes what happens to jobs into the log: a runner around a runner.
#pragma once

#include <memory>
#include <string>

#include "server/job_runner.h"

namespace strata::server {

std::unique_ptr<JobRunner> log_jobs(JobRunner& runner);

// As the inside of a JSON string.
std::string json_escaped(const std::string& text);

}  // namespace strata::server
