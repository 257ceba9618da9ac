#include "core/spec/mesh_spec.h"

#include <cmath>

namespace strata {

double ResolvedLayers::height(int i) const { return first_height * std::pow(growth, i); }

double ResolvedLayers::total() const {
  double sum = 0;
  for (int i = 0; i < count; ++i) sum += height(i);
  return sum;
}

bool matches(const std::string& pattern, const std::string& name) {
  // Greedy with one way back: to the last star.
  std::size_t p = 0, n = 0, star = std::string::npos, retry = 0;
  while (n < name.size()) {
    if (p < pattern.size() && pattern[p] == '*') {
      star = p++;
      retry = n;
    } else if (p < pattern.size() && (pattern[p] == '?' || pattern[p] == name[n])) {
      ++p;
      ++n;
    } else if (star != std::string::npos) {
      p = star + 1;
      n = ++retry;
    } else {
      return false;
    }
  }
  while (p < pattern.size() && pattern[p] == '*') ++p;
  return p == pattern.size();
}

}  // namespace strata
