// Binary STL: 80 bytes of anything, a 32-bit count, then 50 bytes a triangle, little-endian. Only the corners are read.
#include <cstdint>
#include <cstring>

#include "core/base/parallel.h"
#include "core/io/read_error.h"
#include "core/io/soup_builder.h"
#include "core/io/surface_readers.h"
#include "core/io/weld_exact.h"

namespace strata::io {
namespace {

constexpr std::size_t kHeaderBytes = 84;
constexpr std::size_t kTriangleBytes = 50;
constexpr std::size_t kNormalBytes = 12;

std::size_t checked_count(std::span<const char> bytes) {
  std::uint32_t promised = 0;
  std::memcpy(&promised, bytes.data() + 80, sizeof(promised));
  const std::size_t held = (bytes.size() - kHeaderBytes) / kTriangleBytes;
  if (promised > held)
    refuse(Reason::FileMalformed, Place::byte(80),
           "the header promises " + std::to_string(promised) + " triangles, but the file's " + std::to_string(bytes.size()) +
               " bytes hold " + std::to_string(held),
           {{"promised", static_cast<double>(promised)}, {"held", static_cast<double>(held)}, {"size", static_cast<double>(bytes.size())}});
  return promised;  // bytes behind the last triangle are tolerated: some writers pad
}

Vec3 corner(std::span<const char> bytes, std::size_t triangle, std::size_t which) {
  float xyz[3];
  std::memcpy(xyz, bytes.data() + kHeaderBytes + kTriangleBytes * triangle + kNormalBytes + sizeof(xyz) * which, sizeof(xyz));
  return {xyz[0], xyz[1], xyz[2]};
}

void require_finite(const std::vector<Vec3>& corners) {
  const std::size_t none = corners.size();
  const std::size_t first = parallel_reduce(
      corners.size(), none, [&](std::size_t i) { return corners[i].allFinite() ? none : i; },
      [](std::size_t a, std::size_t b) { return std::min(a, b); });
  if (first == none) return;
  const std::size_t triangle = first / 3;
  refuse(Reason::SurfaceNonFinite, Place::byte(kHeaderBytes + kTriangleBytes * triangle),
         "triangle " + std::to_string(triangle) + " (counted from 0) has a corner that is not finite",
         {{"triangle", static_cast<double>(triangle)}});
}

}  // namespace

TriangleSoup read_stl_binary(std::span<const char> bytes) {
  const std::size_t count = checked_count(bytes);
  std::vector<Vec3> corners(3 * count);
  parallel_for(corners.size(), [&](std::size_t i) { corners[i] = corner(bytes, i / 3, i % 3); });
  require_finite(corners);
  TriangleSoup soup;
  weld_exact(corners, soup);
  soup.patch.assign(count, 0);
  soup.patch_names = {std::string(kUnnamedPatch)};
  finish_soup(soup);
  return soup;
}

}  // namespace strata::io
