// One check, where a checker puts it: on a thread here, or in a worker process.
#pragma once

#include <atomic>
#include <cstdint>
#include <functional>
#include <vector>

#include "server/checker.h"

namespace strata::server {

// `bytes` gives those of the surface and may throw Refusal. A budget of 0 is none. Does not throw.
Checked run_check(const CheckOrder& order, const std::function<std::vector<char>()>& bytes, std::int64_t memory_budget_bytes,
                  const MesherDoor& mesher, const std::atomic<bool>& cancelled);

}  // namespace strata::server
