// What of the machine this process may use.
#pragma once

#include <cstdint>
#include <string>

namespace strata::server {

// The narrowest of the control group this process is in and of those around it. 0: no limit.
struct GroupLimits {
  double cores = 0;
  std::int64_t memory_bytes = 0;
};
// Versions 1 and 2. `root` stands before /proc and /sys, for tests.
GroupLimits group_limits(const std::string& root = "");

// Cores: affinity and the quota of control groups; at least one.
int usable_cores();

// What is left of the machine, or of the control groups, for jobs: available memory less what the server itself may need.
std::int64_t usable_memory();

}  // namespace strata::server
