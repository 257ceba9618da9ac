#include "core/fit/part_contacts.h"

#include <algorithm>
#include <array>
#include <vector>

#include "core/fit/fit.h"
#include "core/mesh/adjacency.h"
#include "core/quality/contacts.h"
#include "core/quality/quality.h"

namespace strata {
namespace {

constexpr int kRounds = 6;
constexpr int kSparingRounds = 4;
constexpr double kSparing = 0.1;      // scaled Jacobian that they leave
constexpr double kFirstShare = 0.01;  // of the way from a vertex to the middle of its hexes; doubled each round
constexpr double kClear = 100 * kContactShare;  // parted by so much that writing and reading the mesh brings nothing back

double least_jacobian(const HexMesh& mesh, std::span<const HexId> hexes) {
  double least = 1;
  for (HexId h : hexes) {
    std::array<Vec3, 8> corners;
    for (std::size_t c = 0; c < 8; ++c) corners[c] = mesh.position[mesh.hexes[h][c]];
    least = std::min(least, scaled_jacobian(corners));
  }
  return least;
}

// False when the hexes would get poorer than `least`, or than they are.
bool draw_in(HexMesh& mesh, const VertexStars<HexId>& star, VertexId v, double share, double least) {
  const auto hexes = star.of(v);
  Vec3 middle = Vec3::Zero();
  for (HexId h : hexes)
    for (VertexId w : mesh.hexes[h]) middle += mesh.position[w];
  middle /= 8.0 * static_cast<double>(hexes.size());
  const Vec3 before = mesh.position[v];
  const double needed = std::min(least_jacobian(mesh, hexes), least);
  mesh.position[v] += share * (middle - before);
  if (least_jacobian(mesh, hexes) >= needed) return true;
  mesh.position[v] = before;
  return false;
}

}  // namespace

PartedContacts part_contacts(HexMesh mesh) {
  PartedContacts result;
  if (!find_contacts(mesh).empty()) {
    std::vector<Contact> contacts = find_contacts(mesh, kClear);
    const VertexStars<HexId> star = hexes_round_vertices(mesh);
    std::vector<VertexId> moved;
    double share = kFirstShare;
    for (int round = 0; round < kRounds && !contacts.empty(); ++round, share *= 2) {
      std::vector<VertexId> touching;
      for (const Contact& c : contacts) {
        touching.push_back(c.vertex);
        for (VertexId v : mesh.quads[c.quad]) touching.push_back(v);
      }
      std::sort(touching.begin(), touching.end());
      touching.erase(std::unique(touching.begin(), touching.end()), touching.end());
      for (VertexId v : touching)
        if (draw_in(mesh, star, v, share, round < kSparingRounds ? kSparing : 2 * kLeastJacobian)) moved.push_back(v);
      contacts = find_contacts(mesh, kClear);
    }
    std::sort(moved.begin(), moved.end());
    moved.erase(std::unique(moved.begin(), moved.end()), moved.end());
    result.moved = static_cast<std::int64_t>(moved.size());
    result.left = static_cast<std::int64_t>(find_contacts(mesh).size());
  }
  result.mesh = std::move(mesh);
  return result;
}

}  // namespace strata
