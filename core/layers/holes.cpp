#include "core/layers/holes.h"

#include <algorithm>
#include <limits>

#include "core/base/parallel.h"
#include "core/layers/border_row.h"
#include "core/mesh/adjacency.h"

namespace strata {
namespace {

constexpr double kMostOfWall = 0.1;      // of its quads may be in holes
constexpr std::size_t kMostInHoles = 16; // quads, that may be in holes of the smallest wall
constexpr int kRings = 1;                // of quads round the one that is nearest to a bad place
constexpr int kMoreRings = 2;            // where there is a hole already
constexpr int kTries = 4;                // to fit rows: holes grow by a ring each time

void sort_out(std::vector<QuadId>& quads) {
  std::sort(quads.begin(), quads.end());
  quads.erase(std::unique(quads.begin(), quads.end()), quads.end());
}

// With the quads of the wall that share a vertex with them, and so on.
std::vector<QuadId> with_rings(const HexMesh& mesh, const VertexStars<QuadId>& stars, const IdMap<QuadId, std::uint8_t>& wall,
                               std::vector<QuadId> quads, int rings) {
  for (int ring = 0; ring < rings; ++ring) {
    const std::size_t known = quads.size();
    for (std::size_t i = 0; i < known; ++i)
      for (VertexId v : mesh.quads[quads[i]])
        for (QuadId q : stars.of(v))
          if (wall[q] != 0) quads.push_back(q);
    sort_out(quads);
  }
  return quads;
}

Vec3 centre_of(const HexMesh& mesh, QuadId q) {
  Vec3 sum = Vec3::Zero();
  for (VertexId v : mesh.quads[q]) sum += 0.25 * mesh.position[v];
  return sum;
}

QuadId nearest_of_wall(const HexMesh& mesh, const IdMap<QuadId, std::uint8_t>& wall, const Vec3& place) {
  QuadId nearest;
  double least = std::numeric_limits<double>::infinity();
  for (QuadId q : mesh.quads.ids())
    if (wall[q] != 0)
      if (const double d = (centre_of(mesh, q) - place).squaredNorm(); d < least) least = d, nearest = q;
  return nearest;
}

// Those that hang together by vertices.
std::vector<std::vector<QuadId>> parts_of(const HexMesh& mesh, const VertexStars<QuadId>& stars, const std::vector<QuadId>& quads) {
  std::vector<std::vector<QuadId>> parts;
  std::vector<std::uint8_t> seen(quads.size(), 0);
  const auto take = [&](std::vector<QuadId>& part, QuadId q) {
    const auto at = std::lower_bound(quads.begin(), quads.end(), q);
    if (at == quads.end() || *at != q || seen[static_cast<std::size_t>(at - quads.begin())]) return;
    seen[static_cast<std::size_t>(at - quads.begin())] = 1;
    part.push_back(q);
  };
  for (QuadId first : quads) {
    std::vector<QuadId> part;
    take(part, first);
    for (std::size_t i = 0; i < part.size(); ++i)
      for (VertexId v : mesh.quads[part[i]])
        for (QuadId q : stars.of(v)) take(part, q);
    std::sort(part.begin(), part.end());
    if (!part.empty()) parts.push_back(std::move(part));
  }
  return parts;
}

}  // namespace

std::optional<std::vector<QuadId>> widened_holes(const HexMesh& mesh, const IdMap<QuadId, std::uint8_t>& wall, std::vector<QuadId> holes,
                                                 const std::vector<Vec3>& places) {
  std::vector<QuadId> nearest(places.size());
  parallel_for(places.size(), [&](std::size_t i) { nearest[i] = nearest_of_wall(mesh, wall, places[i]); }, 1);
  std::erase_if(nearest, [](QuadId q) { return !q.valid(); });
  sort_out(nearest);
  if (nearest.empty()) return std::nullopt;
  const VertexStars<QuadId> stars = quads_round_vertices(mesh);
  const std::vector<QuadId> known = holes;
  for (QuadId q : nearest) {
    std::vector<QuadId> round = with_rings(mesh, stars, wall, {q}, kRings);
    const bool again = std::any_of(round.begin(), round.end(), [&](QuadId r) { return std::binary_search(known.begin(), known.end(), r); });
    if (again) round = with_rings(mesh, stars, wall, std::move(round), kMoreRings);
    holes.insert(holes.end(), round.begin(), round.end());
  }
  sort_out(holes);
  const auto of_wall = static_cast<double>(std::count(wall.begin(), wall.end(), 1));
  if (holes.size() > kMostInHoles && static_cast<double>(holes.size()) > kMostOfWall * of_wall) return std::nullopt;
  return holes;
}

std::optional<WithHoles> with_rows_round(const HexMesh& mesh, const IdMap<QuadId, std::uint8_t>& wall, std::vector<QuadId> holes,
                                         const Ground& ground, Context& context) {
  const VertexStars<QuadId> stars = quads_round_vertices(mesh);
  for (int i = 0; i < kTries; ++i) {
    WithHoles result{mesh, holes};
    bool all = true;
    for (const std::vector<QuadId>& part : parts_of(mesh, stars, holes)) {
      if (std::optional<HexMesh> with_row = add_row_round(result.mesh, part, ground, context)) {
        result.mesh = std::move(*with_row);
        continue;
      }
      all = false;
      const std::vector<QuadId> more = with_rings(mesh, stars, wall, part, 1);
      holes.insert(holes.end(), more.begin(), more.end());
    }
    if (all) return result;
    sort_out(holes);
  }
  return std::nullopt;
}

}  // namespace strata
