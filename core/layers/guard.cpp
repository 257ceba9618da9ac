#include "core/layers/guard.h"

#include <algorithm>
#include <array>

#include "core/base/parallel.h"
#include "core/mesh/hex.h"
#include "core/quality/quality.h"

namespace strata {
namespace {

constexpr double kNothingAbove = 0.98;  // of the column: a rest thinner than the remainder is not looked at

// Columns by their bottom.
struct ColumnsByBottom {
  struct Entry {
    VertexId bottom, top;
    std::int32_t sheet, column;
  };
  std::vector<Entry> entries;
  IdMap<VertexId, std::int32_t> first;

  ColumnsByBottom(std::size_t vertices, const std::vector<GrowingSheet>& sheets) : first(vertices + 1, 0) {
    for (std::size_t s = 0; s < sheets.size(); ++s)
      for (std::size_t c = 0; c < sheets[s].columns.size(); ++c)
        entries.push_back(
            {sheets[s].columns.bottom[c], sheets[s].columns.top[c], static_cast<std::int32_t>(s), static_cast<std::int32_t>(c)});
    std::sort(entries.begin(), entries.end(),
              [](const Entry& a, const Entry& b) { return a.bottom != b.bottom ? a.bottom < b.bottom : a.sheet < b.sheet; });
    for (const Entry& e : entries) ++first[e.bottom];
    exclusive_scan(first.values());
  }
  [[nodiscard]] const Entry* find(VertexId bottom, VertexId top) const {
    for (std::int32_t i = first[bottom]; i < first[VertexId(bottom.value + 1)]; ++i)
      if (entries[static_cast<std::size_t>(i)].top == top) return &entries[static_cast<std::size_t>(i)];
    return nullptr;
  }
};

}  // namespace

Guard::Guard(const HexMesh& mesh, const std::vector<GrowingSheet>& sheets) : first_(mesh.hexes.size() + 1, 0) {
  const ColumnsByBottom columns(mesh.position.size(), sheets);
  for (HexId h : mesh.hexes.ids()) {
    first_[h] = static_cast<std::int32_t>(crossings_.size());
    const HexVertices& hex = mesh.hexes[h];
    for (std::size_t axis = 0; axis < 3; ++axis) {
      Crossing crossing;
      crossing.axis = static_cast<std::uint8_t>(axis);
      int found = 0;
      for (std::size_t e = 0; e < 4; ++e) {
        const VertexId a = hex[static_cast<std::size_t>(kHexEdges[axis * 4 + e][0])],
                       b = hex[static_cast<std::size_t>(kHexEdges[axis * 4 + e][1])];
        const auto* up = columns.find(a, b);
        const auto* down = up == nullptr ? columns.find(b, a) : nullptr;
        const auto* entry = up != nullptr ? up : down;
        if (entry == nullptr) break;
        crossing.sheet = entry->sheet;
        crossing.reversed = down != nullptr;
        crossing.column[e] = entry->column;
        ++found;
      }
      if (found == 4) crossings_.push_back(crossing);
    }
  }
  first_[mesh.hexes.next_id()] = static_cast<std::int32_t>(crossings_.size());
  for (const GrowingSheet& sheet : sheets)
    for (const HexVertices& prism : sheet.prisms.hexes) {
      const std::size_t a = tip_of(prism), b = (a + 1) & 3, c = (a + 2) & 3, d = (a + 3) & 3;
      prisms_.push_back({prism[a], prism[d], prism[d + 4], prism[b], prism[c], prism[c + 4]});
    }
}

double Guard::prism_quality(const HexMesh& mesh, const Prism& prism) {
  std::array<Vec3, 6> p;
  for (std::size_t i = 0; i < 6; ++i) p[i] = mesh.position[prism[i]];
  double worst = 1;
  for (std::size_t i = 0; i < 3; ++i) {
    const std::size_t next = (i + 1) % 3, before = (i + 2) % 3;
    const auto corner = [&](const Vec3& x, const Vec3& y, const Vec3& z) {
      const double lengths = x.norm() * y.norm() * z.norm();
      worst = std::min(worst, lengths > 0 ? x.dot(y.cross(z)) / lengths : 0.0);
    };
    corner(p[next] - p[i], p[before] - p[i], p[i + 3] - p[i]);
    corner(p[before + 3] - p[i + 3], p[next + 3] - p[i + 3], p[i] - p[i + 3]);
  }
  return worst;
}

double Guard::quality(const HexVertices& hex, const IdMap<VertexId, Vec3>& position, const std::vector<GrowingSheet>& sheets,
                      HexId h) const {
  std::array<Vec3, 8> c;
  for (std::size_t i = 0; i < 8; ++i) c[i] = position[hex[i]];
  double worst = corner_scaled_jacobian(c);
  for (std::int32_t k = first_[h]; k < first_[HexId(h.value + 1)]; ++k) {
    const Crossing& crossing = crossings_[static_cast<std::size_t>(k)];
    const GrowingSheet& sheet = sheets[static_cast<std::size_t>(crossing.sheet)];
    std::array<Vec3, 8> low = c, high = c;
    double least_physical = 1;
    for (std::size_t e = 0; e < 4; ++e) {
      const auto& edge = kHexEdges[static_cast<std::size_t>(crossing.axis) * 4 + e];
      const auto bottom = static_cast<std::size_t>(edge[crossing.reversed ? 1 : 0]),
                 top = static_cast<std::size_t>(edge[crossing.reversed ? 0 : 1]);
      const Vec3 along = c[top] - c[bottom];
      const CutShares shares = shares_of(sheet, static_cast<std::size_t>(crossing.column[e]), along.norm());
      low[top] = c[bottom] + shares.first * along;
      high[bottom] = c[bottom] + shares.physical * along;
      least_physical = std::min(least_physical, shares.physical);
    }
    worst = std::min(worst, corner_scaled_jacobian(low));
    if (least_physical < kNothingAbove) worst = std::min(worst, corner_scaled_jacobian(high));
  }
  return worst;
}

IdMap<HexId, HexTarget> Guard::targets(const std::vector<GrowingSheet>& sheets) const {
  IdMap<HexId, HexTarget> result(first_.size() - 1, HexTarget{1, 1, 1});
  parallel_for(result.size(), [&](std::size_t i) {
    const HexId h(i);
    for (std::int32_t k = first_[h]; k < first_[HexId(h.value + 1)]; ++k) {
      const Crossing& crossing = crossings_[static_cast<std::size_t>(k)];
      const GrowingSheet& sheet = sheets[static_cast<std::size_t>(crossing.sheet)];
      double length = 0;
      for (const std::int32_t c : crossing.column) {
        const auto column = static_cast<std::size_t>(c);
        length += 0.25 * sheet.thickness[column] * sheet.feet[column].stretch / sheet.feet[column].size;
      }
      result[h][static_cast<std::size_t>(crossing.axis)] = static_cast<float>(length);
    }
  });
  return result;
}

}  // namespace strata
