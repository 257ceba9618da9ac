#include "server/machine.h"

#include <sched.h>

#include <algorithm>
#include <cmath>
#include <fstream>
#include <limits>
#include <optional>
#include <sstream>

namespace strata::server {
namespace {

constexpr std::int64_t kMiB = std::int64_t{1} << 20;
constexpr std::int64_t kServerReserve = 512 * kMiB;
constexpr std::int64_t kLeast = 256 * kMiB;  // a machine with less has no business here, but tests do

// "max", and what else is no number, is none.
std::optional<double> number_in(const std::string& path) {
  std::ifstream file(path);
  double number = 0;
  return file >> number ? std::optional(number) : std::nullopt;
}

// cpu.max of version 2: "QUOTA PERIOD".
std::optional<double> cores_in(const std::string& path) {
  std::ifstream file(path);
  double quota = 0, period = 0;
  return file >> quota >> period && period > 0 ? std::optional(quota / period) : std::nullopt;
}

std::optional<double> cores_of_first_version(const std::string& folder) {
  const auto quota = number_in(folder + "/cpu.cfs_quota_us"), period = number_in(folder + "/cpu.cfs_period_us");
  return quota && period && *period > 0 ? std::optional(*quota / *period) : std::nullopt;
}

void narrow(GroupLimits& limits, std::optional<double> cores, std::optional<double> memory) {
  constexpr auto kNone = static_cast<double>(std::int64_t{1} << 60);  // version 1 says "no limit" by a huge number
  if (cores && *cores > 0 && (limits.cores == 0 || *cores < limits.cores)) limits.cores = *cores;
  if (!memory || *memory >= kNone) return;
  const auto bytes = static_cast<std::int64_t>(*memory);
  if (limits.memory_bytes == 0 || bytes < limits.memory_bytes) limits.memory_bytes = bytes;
}

// "/a/b", "/a", "": a group and those around it. A container sees only its own, as the last one, whatever the path says.
template <class Look>
void look_upwards(std::string path, const Look& look) {
  while (path.size() > 1) {
    look(path);
    path.erase(path.rfind('/'));
  }
  look("");
}

bool has(const std::string& controllers, const std::string& name) {
  std::istringstream list(controllers);
  for (std::string one; std::getline(list, one, ',');)
    if (one == name) return true;
  return false;
}

double available_memory(const std::string& path) {
  std::ifstream file(path);
  for (std::string line; std::getline(file, line);)
    if (line.rfind("MemAvailable:", 0) == 0) return 1024 * std::stod(line.substr(line.find(':') + 1));  // counted in KiB
  return std::numeric_limits<double>::infinity();
}

}  // namespace

GroupLimits group_limits(const std::string& root) {
  GroupLimits limits;
  const std::string groups = root + "/sys/fs/cgroup", memory = groups + "/memory", cpu = groups + "/cpu";
  std::ifstream file(root + "/proc/self/cgroup");
  for (std::string line; std::getline(file, line);) {  // ID:CONTROLLERS:PATH
    const std::size_t first = line.find(':'), second = line.find(':', first + 1);
    if (first == std::string::npos || second == std::string::npos) continue;
    const std::string controllers = line.substr(first + 1, second - first - 1), path = line.substr(second + 1);
    if (path.empty() || path.front() != '/') continue;
    if (controllers.empty())
      look_upwards(
          path, [&](const std::string& at) { narrow(limits, cores_in(groups + at + "/cpu.max"), number_in(groups + at + "/memory.max")); });
    if (has(controllers, "memory"))
      look_upwards(path, [&](const std::string& at) { narrow(limits, {}, number_in(memory + at + "/memory.limit_in_bytes")); });
    if (has(controllers, "cpu")) look_upwards(path, [&](const std::string& at) { narrow(limits, cores_of_first_version(cpu + at), {}); });
  }
  return limits;
}

int usable_cores() {
  cpu_set_t set;
  int cores = sched_getaffinity(0, sizeof set, &set) == 0 ? CPU_COUNT(&set) : 1;
  const double quota = group_limits().cores;
  if (quota > 0) cores = std::min(cores, static_cast<int>(std::ceil(quota)));
  return std::max(cores, 1);
}

std::int64_t usable_memory() {
  double least = available_memory("/proc/meminfo");
  const std::int64_t group = group_limits().memory_bytes;
  if (group > 0) least = std::min(least, static_cast<double>(group));
  constexpr auto kMost = static_cast<double>(std::int64_t{1} << 60);
  return std::max(static_cast<std::int64_t>(std::min(least, kMost)) - kServerReserve, kLeast);
}

}  // namespace strata::server
