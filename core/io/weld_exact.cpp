#include "core/io/weld_exact.h"

#include <array>
#include <bit>
#include <cstdint>
#include <random>

#include "core/io/read_error.h"

namespace strata::io {
namespace {

// Open addressing with linear probing. The hash is keyed afresh for every file, so that no file can be made to collide; ids are given in
// order of first appearance, so the result does not depend on the key.
class PlaceTable {
 public:
  explicit PlaceTable(std::vector<Vec3>& points) : points_(points), slots_(kFirstSlots, kFree) {
    std::random_device device;
    for (std::uint64_t& k : key_) k = (static_cast<std::uint64_t>(device()) << 32 | device()) | 1u;
  }

  std::int32_t id_of(const Vec3& corner) {
    const Vec3 p = corner.array() + 0.0;  // -0 becomes 0
    const std::size_t mask = slots_.size() - 1;
    std::size_t slot = hash(p) & mask;
    for (; slots_[slot] != kFree; slot = (slot + 1) & mask)
      if (points_[static_cast<std::size_t>(slots_[slot])] == p) return slots_[slot];
    const auto id = static_cast<std::int32_t>(points_.size());
    slots_[slot] = id;
    points_.push_back(p);
    if (2 * points_.size() > slots_.size()) grow();
    return id;
  }

 private:
  static constexpr std::int32_t kFree = -1;
  static constexpr std::size_t kFirstSlots = 1024;  // a power of two, like every later size

  [[nodiscard]] std::size_t hash(const Vec3& p) const {
    std::uint64_t h = key_[0];
    for (int i = 0; i < 3; ++i) {
      h = (h ^ std::bit_cast<std::uint64_t>(p[i])) * key_[static_cast<std::size_t>(i) + 1];
      h ^= h >> 32;
    }
    return h;
  }
  void grow() {
    slots_.assign(2 * slots_.size(), kFree);
    const std::size_t mask = slots_.size() - 1;
    for (std::size_t i = 0; i < points_.size(); ++i) {
      std::size_t slot = hash(points_[i]) & mask;
      while (slots_[slot] != kFree) slot = (slot + 1) & mask;
      slots_[slot] = static_cast<std::int32_t>(i);
    }
  }

  std::vector<Vec3>& points_;
  std::vector<std::int32_t> slots_;
  std::array<std::uint64_t, 4> key_{};
};

}  // namespace

void weld_exact(const std::vector<Vec3>& corners, TriangleSoup& soup) {
  require_indexable(corners.size() / 3, "triangles");
  soup.points.clear();
  soup.triangles.resize(corners.size() / 3);
  PlaceTable table(soup.points);
  for (std::size_t t = 0; t < soup.triangles.size(); ++t)
    for (std::size_t i = 0; i < 3; ++i) {
      if (i == 0) require_indexable(soup.points.size() + 3, "points");
      soup.triangles[t][i] = table.id_of(corners[3 * t + i]);
    }
}

}  // namespace strata::io
