#include "core/quality/contacts.h"

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <utility>

#include "core/base/parallel.h"
#include "core/base/triangle_geometry.h"
#include "core/mesh/adjacency.h"

namespace strata {
namespace {

// Quads in grids of cells that fit their size, one grid for each power of two: a quad lies in eight cells at most, a vertex asks one cell
// of every grid.
class QuadGrids {
 public:
  QuadGrids(const HexMesh& mesh, const std::vector<QuadId>& quads, double share)
      : mesh_(mesh), quads_(quads), reach_(quads.size()), box_(quads.size()), level_(quads.size()) {
    parallel_for(quads.size(), [&](std::size_t i) { measure(i, share); });
    levels_ = level_;
    parallel_sort(levels_.begin(), levels_.end());
    levels_.erase(std::unique(levels_.begin(), levels_.end()), levels_.end());
    std::vector<std::vector<Entry>> found((quads.size() + kGrain - 1) / kGrain);
    parallel_blocks(quads.size(), [&](std::size_t begin, std::size_t end) {
      for (std::size_t i = begin; i != end; ++i) add_cells(i, found[begin / kGrain]);
    });
    for (const auto& part : found) entries_.insert(entries_.end(), part.begin(), part.end());
    parallel_sort(entries_.begin(), entries_.end());
  }

  void contacts_of(VertexId v, std::vector<Contact>& out) const {
    const Vec3& p = mesh_.position[v];
    const std::size_t first = out.size();
    for (const int level : levels_) {
      const Cell cell = cell_of(p, level);
      auto at = std::lower_bound(entries_.begin(), entries_.end(), Entry{hash(cell, level), 0});
      for (; at != entries_.end() && at->first == hash(cell, level); ++at)
        if (lies_on(v, p, at->second)) out.push_back({v, quads_[at->second]});
    }
    const auto mine = out.begin() + static_cast<std::ptrdiff_t>(first);
    std::sort(mine, out.end());
    out.erase(std::unique(mine, out.end()), out.end());
  }

 private:
  using Cell = std::array<std::int64_t, 3>;
  using Entry = std::pair<std::uint64_t, std::uint32_t>;  // cell, place in quads_

  [[nodiscard]] std::array<Vec3, 4> corners(std::size_t i) const {
    const QuadVertices& q = mesh_.quads[quads_[i]];
    return {mesh_.position[q[0]], mesh_.position[q[1]], mesh_.position[q[2]], mesh_.position[q[3]]};
  }
  void measure(std::size_t i, double share) {
    const std::array<Vec3, 4> c = corners(i);
    double shortest = (c[3] - c[0]).norm();
    for (std::size_t k = 0; k < 3; ++k) shortest = std::min(shortest, (c[k + 1] - c[k]).norm());
    reach_[i] = share * shortest;
    for (const Vec3& p : c) box_[i].add(p);
    box_[i].min.array() -= reach_[i];
    box_[i].max.array() += reach_[i];
    level_[i] = std::ilogb(std::max(box_[i].extent().maxCoeff(), std::numeric_limits<double>::min())) + 1;
  }
  [[nodiscard]] static Cell cell_of(const Vec3& p, int level) {
    Cell cell;
    for (std::size_t k = 0; k < 3; ++k)
      cell[k] = static_cast<std::int64_t>(std::floor(std::ldexp(p[static_cast<Eigen::Index>(k)], -level)));
    return cell;
  }
  // Cells that collide only cost a test more.
  [[nodiscard]] static std::uint64_t hash(const Cell& cell, int level) {
    std::uint64_t h = static_cast<std::uint64_t>(level);
    for (const std::int64_t k : cell) {
      h = (h ^ static_cast<std::uint64_t>(k)) * 0x9E3779B97F4A7C15ULL;
      h ^= h >> 29;
    }
    return h;
  }
  void add_cells(std::size_t i, std::vector<Entry>& out) const {
    const Cell low = cell_of(box_[i].min, level_[i]), high = cell_of(box_[i].max, level_[i]);
    for (std::int64_t x = low[0]; x <= high[0]; ++x)
      for (std::int64_t y = low[1]; y <= high[1]; ++y)
        for (std::int64_t z = low[2]; z <= high[2]; ++z) out.emplace_back(hash({x, y, z}, level_[i]), static_cast<std::uint32_t>(i));
  }
  [[nodiscard]] bool lies_on(VertexId v, const Vec3& p, std::size_t i) const {
    if ((p.array() < box_[i].min.array()).any() || (p.array() > box_[i].max.array()).any()) return false;
    const QuadVertices& q = mesh_.quads[quads_[i]];
    if (std::find(q.begin(), q.end(), v) != q.end()) return false;
    const std::array<Vec3, 4> c = corners(i);
    const Vec3 centre = 0.25 * (c[0] + c[1] + c[2] + c[3]);
    for (std::size_t k = 0; k < 4; ++k)
      if ((closest_on_triangle(p, c[k], c[(k + 1) & 3], centre) - p).norm() <= reach_[i]) return true;
    return false;
  }

  const HexMesh& mesh_;
  const std::vector<QuadId>& quads_;
  std::vector<double> reach_;
  std::vector<Box> box_;
  std::vector<int> level_, levels_;
  std::vector<Entry> entries_;
};

std::vector<QuadId> outer_quads(const HexMesh& mesh) {
  std::vector<QuadId> quads;
  const bool one_region = std::all_of(mesh.region.begin(), mesh.region.end(), [&](RegionId r) { return r == *mesh.region.begin(); });
  const IdMap<QuadId, QuadSides> sides = one_region ? IdMap<QuadId, QuadSides>(mesh.quads.size()) : quad_sides(mesh);
  for (QuadId q : mesh.quads.ids())
    if (!sides[q].front.valid()) quads.push_back(q);
  return quads;
}

}  // namespace

std::vector<Contact> find_contacts(const HexMesh& mesh, double share) {
  const std::vector<QuadId> quads = outer_quads(mesh);
  const QuadGrids grids(mesh, quads, share);
  IdMap<VertexId, std::uint8_t> on_skin(mesh.position.size(), std::uint8_t{0});
  for (QuadId q : quads)
    for (VertexId v : mesh.quads[q]) on_skin[v] = 1;
  std::vector<std::vector<Contact>> found((on_skin.size() + kGrain - 1) / kGrain);
  parallel_blocks(on_skin.size(), [&](std::size_t begin, std::size_t end) {
    for (std::size_t v = begin; v != end; ++v)
      if (on_skin[VertexId(v)] != 0) grids.contacts_of(VertexId(v), found[begin / kGrain]);
  });
  std::vector<Contact> contacts;
  for (const auto& part : found) contacts.insert(contacts.end(), part.begin(), part.end());
  return contacts;
}

}  // namespace strata
