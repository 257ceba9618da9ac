#include <gtest/gtest.h>

#include <random>

#include "core/base/context.h"
#include "core/mesh/hex.h"
#include "core/quality/quality.h"

namespace strata {
namespace {

std::array<Vec3, 8> box(double a, double b, double c) {
  return {Vec3(0, 0, 0), Vec3(a, 0, 0), Vec3(a, b, 0), Vec3(0, b, 0), Vec3(0, 0, c), Vec3(a, 0, c), Vec3(a, b, c), Vec3(0, b, c)};
}

HexMesh mesh_of(const std::array<Vec3, 8>& p) {
  HexMesh mesh;
  HexVertices hex;
  for (std::size_t i = 0; i < 8; ++i) hex[i] = mesh.position.push_back(p[i]);
  mesh.attachment.resize(8);
  mesh.hexes.push_back(hex);
  mesh.region.push_back(RegionId(0));
  mesh.layer.push_back(0);
  for (const auto& f : kHexFaces) {
    QuadVertices quad;
    for (std::size_t k = 0; k < 4; ++k) quad[k] = hex[static_cast<std::size_t>(f[k])];
    mesh.quads.push_back(quad);
    mesh.patch.push_back(PatchId(0));
    mesh.chart.push_back(ChartId());
  }
  return mesh;
}

TEST(ScaledJacobian, IsOneForEveryBox) {
  EXPECT_DOUBLE_EQ(scaled_jacobian(box(1, 1, 1)), 1);
  EXPECT_NEAR(scaled_jacobian(box(1e-3, 1, 200)), 1, 1e-14);
}

TEST(ScaledJacobian, OfAShearedCubeIsTheCosineOfTheShear) {
  const double angle = 0.7;
  auto p = box(1, 1, 1);
  for (std::size_t i = 4; i < 8; ++i) p[i] = Vec3(p[i].x() + std::sin(angle), p[i].y(), std::cos(angle));
  EXPECT_NEAR(scaled_jacobian(p), std::cos(angle), 1e-14);
  EXPECT_NEAR(corner_scaled_jacobian(p), std::cos(angle), 1e-14);
}

TEST(ScaledJacobian, OfAMirroredCubeIsMinusOne) {
  auto p = box(1, 1, 1);
  for (Vec3& v : p) v.x() = -v.x();
  EXPECT_DOUBLE_EQ(scaled_jacobian(p), -1);
}

TEST(ScaledJacobian, IsZeroWithoutThickness) { EXPECT_EQ(scaled_jacobian(box(1, 1, 0)), 0); }

TEST(ScaledJacobian, LooksAtTheCentreToo) {
  // Twist the top by more than a quarter turn: the corners are lean but the centre is worse.
  auto p = box(1, 1, 1);
  const Eigen::AngleAxisd turn(1.6, Vec3::UnitZ());
  for (std::size_t i = 4; i < 8; ++i) p[i] = turn * (p[i] - Vec3(0.5, 0.5, 0)) + Vec3(0.5, 0.5, 0);
  EXPECT_LE(scaled_jacobian(p), corner_scaled_jacobian(p));
}

TEST(ScaledJacobian, DoesNotChangeUnderRotationAndScaling) {
  std::mt19937 random(5);
  std::uniform_real_distribution<double> noise(-0.3, 0.3);
  for (int round = 0; round < 100; ++round) {
    auto p = box(1, 1, 1);
    for (Vec3& v : p) v += Vec3(noise(random), noise(random), noise(random));
    const double before = scaled_jacobian(p);
    const Eigen::AngleAxisd turn(noise(random) * 10, Vec3(noise(random), noise(random), noise(random)).normalized());
    for (Vec3& v : p) v = 7 * (turn * v) + Vec3(1, 2, 3);
    EXPECT_NEAR(scaled_jacobian(p), before, 1e-12);
  }
}

TEST(MeasureQuality, CountsVolumesAndAreasOfABox) {
  Context context;
  const Quality quality = measure_quality(mesh_of(box(1, 2, 3)), {std::string("wall")}, context);
  EXPECT_EQ(quality.all.count, 1);
  EXPECT_EQ(quality.layers.count, 0);
  EXPECT_EQ(quality.rest.count, 1);
  EXPECT_NEAR(quality.all.mean, 1, 1e-14);
  EXPECT_EQ(quality.all.histogram[kHistogramBins - 1], 1);
  ASSERT_EQ(quality.regions.size(), 1u);
  EXPECT_NEAR(quality.regions[0].volume, 6, 1e-14);
  EXPECT_EQ(quality.regions[0].reference, 1);
  ASSERT_EQ(quality.patches.size(), 1u);
  EXPECT_EQ(quality.patches[0].quads, 6);
  EXPECT_NEAR(quality.patches[0].area, 22, 1e-13);
  EXPECT_EQ(quality.patches[0].jacobian.count, 1) << "a hex counts once per patch";
}

TEST(MeasureQuality, TheVolumeOfABentHexIsTheIntegralOfItsMap) {
  std::mt19937 random(11);
  std::uniform_real_distribution<double> noise(-0.2, 0.2);
  auto p = box(1, 1, 1);
  for (Vec3& v : p) v += Vec3(noise(random), noise(random), noise(random));
  // Gauss-Legendre with 3 points a direction integrates the triquadratic determinant exactly.
  const double g = std::sqrt(0.6);
  const std::array<double, 3> at{0.5 - 0.5 * g, 0.5, 0.5 + 0.5 * g}, weight{5.0 / 18, 8.0 / 18, 5.0 / 18};
  double volume = 0;
  for (std::size_t i = 0; i < 3; ++i)
    for (std::size_t j = 0; j < 3; ++j)
      for (std::size_t k = 0; k < 3; ++k) {
        const double x = at[i], y = at[j], z = at[k];
        const auto mix = [](const Vec3& a, const Vec3& b, double t) -> Vec3 { return a + t * (b - a); };
        const Vec3 dx = mix(mix(p[1] - p[0], p[2] - p[3], y), mix(p[5] - p[4], p[6] - p[7], y), z);
        const Vec3 dy = mix(mix(p[3] - p[0], p[2] - p[1], x), mix(p[7] - p[4], p[6] - p[5], x), z);
        const Vec3 dz = mix(mix(p[4] - p[0], p[5] - p[1], x), mix(p[7] - p[3], p[6] - p[2], x), y);
        volume += weight[i] * weight[j] * weight[k] * dx.cross(dy).dot(dz);
      }
  Context context;
  EXPECT_NEAR(measure_quality(mesh_of(p), {std::string("wall")}, context).regions[0].volume, volume, 1e-13);
}

}  // namespace
}  // namespace strata
