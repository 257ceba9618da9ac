#include "core/buffer/thicken.h"

#include <algorithm>
#include <cstdint>

#include "core/base/parallel.h"
#include "core/mesh/hex.h"

namespace strata {
namespace {

// A corner counts as positive above this scaled triple product: flat hexes must not pass by rounding.
constexpr double kFlatCorner = 0.02;
constexpr float kLeastShare = 0.125F;  // below an eighth a shorter push does not cure a bad hex any more: it never sees the corner

bool is_positive(const HexMesh& mesh, HexId h) {
  const HexVertices& hex = mesh.hexes[h];
  for (std::size_t c = 0; c < 8; ++c) {
    const Vec3& p = mesh.position[hex[c]];
    const auto edge = [&](std::size_t i) { return Vec3(mesh.position[hex[static_cast<std::size_t>(kHexCorners[c][i])]] - p); };
    const Vec3 a = edge(0), b = edge(1), d = edge(2);
    if (!(a.cross(b).dot(d) > kFlatCorner * a.norm() * b.norm() * d.norm())) return false;
  }
  return true;
}

}  // namespace

Vec3 visible_direction(const std::vector<Vec3>& normals) {
  Vec3 mean = Vec3::Zero();
  for (const Vec3& n : normals) mean += n;
  if (mean.norm() > 0) mean.normalize();
  // The point of the normals' convex hull nearest to the origin points along the best direction (Gilbert's iteration).
  constexpr int kSteps = 60;
  Vec3 x = mean;
  for (int step = 0; step < kSteps; ++step) {
    const auto worst = std::min_element(normals.begin(), normals.end(), [&](const Vec3& a, const Vec3& b) { return a.dot(x) < b.dot(x); });
    const Vec3 d = *worst - x;
    const double length2 = d.squaredNorm();
    if (length2 == 0) break;
    const double t = std::clamp(-x.dot(d) / length2, 0.0, 1.0);
    if (t == 0) break;
    x += t * d;
  }
  const double size = x.norm();
  if (size == 0) return mean;
  x /= size;
  for (const Vec3& n : normals)
    if (n.dot(x) <= 0) return mean;
  return x;
}

void push_where_positive(HexMesh& mesh, const std::vector<Push>& pushes) {
  IdMap<VertexId, std::int32_t> pushed(mesh.position.size(), -1);
  for (std::size_t i = 0; i < pushes.size(); ++i) pushed[pushes[i].vertex] = static_cast<std::int32_t>(i);
  std::vector<HexId> hexes;
  for (HexId h : mesh.hexes.ids())
    for (VertexId v : mesh.hexes[h])
      if (pushed[v] >= 0) {
        hexes.push_back(h);
        break;
      }
  std::vector<Vec3> start(pushes.size());
  for (std::size_t i = 0; i < pushes.size(); ++i) start[i] = mesh.position[pushes[i].vertex];
  std::vector<float> share(pushes.size(), 1.0F);
  std::vector<std::uint8_t> bad(hexes.size(), 0);
  while (true) {
    parallel_for(pushes.size(), [&](std::size_t i) { mesh.position[pushes[i].vertex] = start[i] + double{share[i]} * pushes[i].by; });
    parallel_for(hexes.size(), [&](std::size_t i) { bad[i] = !is_positive(mesh, hexes[i]); });
    std::vector<std::uint8_t> halve(pushes.size(), 0);
    bool again = false;
    for (std::size_t i = 0; i < hexes.size(); ++i) {
      if (bad[i] == 0) continue;
      for (VertexId v : mesh.hexes[hexes[i]]) {
        const std::int32_t p = pushed[v];
        if (p < 0 || share[static_cast<std::size_t>(p)] <= kLeastShare) continue;
        halve[static_cast<std::size_t>(p)] = 1;
        again = true;
      }
    }
    if (!again) return;
    for (std::size_t i = 0; i < pushes.size(); ++i)
      if (halve[i] != 0) share[i] *= 0.5F;
  }
}

}  // namespace strata
