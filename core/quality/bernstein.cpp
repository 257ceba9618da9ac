// Positivity of a hex by Bernstein coefficients: Johnen, Weill, Remacle, "Robust and efficient validation of the linear hexahedral
// element", 2017. The determinant is triquadratic; on any box it lies between the least and the largest of its 27 coefficients, of which
// the eight at the box's corners are values of the determinant itself.
#include <algorithm>
#include <cmath>

#include "core/base/parallel.h"
#include "core/mesh/hex.h"
#include "core/quality/validity.h"

namespace strata {
namespace {

constexpr int kBisections = 3;  // bounds converge quadratically: each bisection leaves about a quarter of the gap
constexpr std::size_t kSide = 3;
constexpr std::array<std::size_t, 3> kStride{1, kSide, kSide* kSide};
using Coefficients = std::array<double, kSide * kSide * kSide>;  // x runs fastest

// Calls body(at) with the first index of each of the nine lines of coefficients along `axis`.
template <class Body>
void for_each_line(std::size_t axis, const Body& body) {
  const std::size_t u = kStride[(axis + 1) % 3], v = kStride[(axis + 2) % 3];
  for (std::size_t i = 0; i < kSide; ++i)
    for (std::size_t j = 0; j < kSide; ++j) body(i * u + j * v);
}

// Determinants at the 27 points with coordinates 0, 1/2, 1.
Coefficients sampled(const std::array<Vec3, 8>& p) {
  const auto between = [](const Vec3& a, const Vec3& b, std::size_t t) -> Vec3 { return a + (0.5 * static_cast<double>(t)) * (b - a); };
  // Derivative along an axis at the four edges along it, then bilinear in the other two.
  const auto bilinear = [&](const std::array<Vec3, 4>& d, std::size_t s, std::size_t t) {
    return between(between(d[0], d[1], s), between(d[2], d[3], s), t);
  };
  const std::array<Vec3, 4> dx{p[1] - p[0], p[2] - p[3], p[5] - p[4], p[6] - p[7]};  // by y, then z
  const std::array<Vec3, 4> dy{p[3] - p[0], p[2] - p[1], p[7] - p[4], p[6] - p[5]};  // by x, then z
  const std::array<Vec3, 4> dz{p[4] - p[0], p[5] - p[1], p[7] - p[3], p[6] - p[2]};  // by x, then y
  Coefficients f;
  for (std::size_t z = 0; z < kSide; ++z)
    for (std::size_t y = 0; y < kSide; ++y)
      for (std::size_t x = 0; x < kSide; ++x)
        f[x + kSide * y + kSide * kSide * z] = bilinear(dx, y, z).cross(bilinear(dy, x, z)).dot(bilinear(dz, x, y));
  return f;
}

// The parabola through f(0), f(1/2), f(1) has the middle coefficient 2 f(1/2) - (f(0) + f(1)) / 2.
void to_bernstein(Coefficients& f) {
  for (std::size_t axis = 0; axis < 3; ++axis)
    for_each_line(axis, [&](std::size_t at) {
      const std::size_t d = kStride[axis];
      f[at + d] = 2 * f[at + d] - 0.5 * (f[at] + f[at + 2 * d]);
    });
}

// The half of the box with the smaller (or larger) coordinates along `axis`: de Casteljau.
Coefficients half(Coefficients f, std::size_t axis, bool upper) {
  for_each_line(axis, [&](std::size_t at) {
    const std::size_t d = kStride[axis];
    double &a = f[at], &b = f[at + d], &c = f[at + 2 * d];
    const double ab = 0.5 * (a + b), bc = 0.5 * (b + c), middle = 0.5 * (ab + bc);
    if (upper) a = middle, b = bc;
    else b = ab, c = middle;
  });
  return f;
}

bool value_not_positive(const Coefficients& f) {
  for (std::size_t i = 0; i < 8; ++i)
    if (!(f[2 * (i & 1) + 2 * kSide * ((i >> 1) & 1) + 2 * kSide * kSide * (i >> 2)] > 0)) return true;
  return false;
}

bool positive(const Coefficients& f, int bisections) {
  if (value_not_positive(f)) return false;
  if (std::all_of(f.begin(), f.end(), [](double c) { return c > 0; })) return true;
  if (bisections == 0) return false;
  for (std::size_t child = 0; child < 8; ++child) {
    Coefficients part = half(half(half(f, 0, (child & 1) != 0), 1, (child & 2) != 0), 2, (child & 4) != 0);
    if (!positive(part, bisections - 1)) return false;
  }
  return true;
}

}  // namespace

bool bernstein_positive(const std::array<Vec3, 8>& corners) {
  Coefficients f = sampled(corners);
  to_bernstein(f);
  return positive(f, kBisections);
}

std::vector<HexId> folded_hexes(const HexMesh& mesh) {
  std::vector<std::uint8_t> folded(mesh.hexes.size(), 0);
  parallel_for(folded.size(), [&](std::size_t i) {
    std::array<Vec3, 8> corners;
    for (std::size_t c = 0; c < 8; ++c) corners[c] = mesh.position[mesh.hexes[HexId(i)][c]];
    folded[i] = !bernstein_positive(corners);
  });
  std::vector<HexId> result;
  for (std::size_t i = 0; i < folded.size(); ++i)
    if (folded[i] != 0) result.push_back(HexId(i));
  return result;
}

}  // namespace strata
