// What a job says that did not succeed.
#pragma once

#include <stdexcept>
#include <string>
#include <utility>

#include "strata/v1/job.pb.h"

namespace strata::server {

// `code` as in JobError.code.
v1::JobError job_error(int code, const std::string& reason, const std::string& message);
// A job that was cancelled (code 1) or failed; nothing else is set.
v1::Job ended_badly(v1::JobError error);
// A job that was cancelled because its time was up: it failed. Any other stays as it is.
v1::Job out_of_time(v1::Job job);

// A job that is refused with the error it would end with.
class JobRefused : public std::runtime_error {
 public:
  explicit JobRefused(v1::JobError why) : std::runtime_error(why.message()), error(std::move(why)) {}
  v1::JobError error;
};

}  // namespace strata::server
