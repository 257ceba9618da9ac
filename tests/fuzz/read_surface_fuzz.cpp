// A surface reader given any bytes either refuses them as invalid input or returns a soup whose every index and coordinate is usable.
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <cstdlib>
#include <span>

#include "core/base/diagnostic.h"
#include "core/io/surface_io.h"

namespace {

void require(bool holds) {
  if (!holds) std::abort();
}

void require_usable(const strata::TriangleSoup& soup) {
  require(soup.patch.size() == soup.triangles.size());
  for (const auto& point : soup.points) require(std::isfinite(point.x()) && std::isfinite(point.y()) && std::isfinite(point.z()));
  for (const auto& triangle : soup.triangles) {
    for (const auto corner : triangle) require(static_cast<std::size_t>(corner) < soup.points.size());
  }
  for (const auto patch : soup.patch) require(static_cast<std::size_t>(patch) < soup.patch_names.size());
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  try {
    const std::span bytes(reinterpret_cast<const char*>(data), size);
    require_usable(strata::io::read_surface(bytes, strata::io::SurfaceFormat::STRATA_FUZZ_FORMAT));
  } catch (const strata::MeshError& error) {
    require(error.failure() == strata::Failure::InvalidInput || error.failure() == strata::Failure::LimitExceeded);
    require(!error.diagnostic().message.empty());
  }
  return 0;
}
