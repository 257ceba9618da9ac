#include <gtest/gtest.h>

#include <algorithm>
#include <chrono>

#include "core/base/context.h"
#include "core/surface/surface.h"
#include "tests/support/shapes.h"

namespace strata {
namespace {

TriangleSoup without(const TriangleSoup& soup, const std::string& patch) {
  TriangleSoup kept = soup;
  kept.triangles.clear();
  kept.patch.clear();
  for (std::size_t t = 0; t < soup.triangles.size(); ++t)
    if (soup.patch_names[static_cast<std::size_t>(soup.patch[t])] != patch)
      kept.triangles.push_back(soup.triangles[t]), kept.patch.push_back(soup.patch[t]);
  return kept;
}

TriangleSoup well(double depth, int n = 4) { return without(test::box(Vec3(0, 0, 0), Vec3(1, 1, depth), n), "z_max"); }

struct Conditioned {
  Surface surface;
  std::vector<Diagnostic> told;
  [[nodiscard]] std::int64_t caps() const {
    for (const Diagnostic& d : told)
      if (d.message.find("openings of the surface were closed") != std::string::npos) return d.count;
    return 0;
  }
};
Conditioned conditioned(TriangleSoup soup) {
  Context context;
  Surface surface = condition(std::move(soup), context);
  return {std::move(surface), context.adjustments()};
}

double volume_of(const Surface& surface) {
  double six = 0;
  for (TriangleId t : surface.triangles.ids()) {
    const auto [a, b, c] = surface.corners(t);
    six += a.dot(b.cross(c));
  }
  return six / 6 / (surface.frame.scale * surface.frame.scale * surface.frame.scale);
}

TEST(CapOpenings, AMissingFaceIsFlatAgain) {
  const Conditioned c = conditioned(well(3));
  EXPECT_EQ(c.caps(), 1);
  EXPECT_TRUE(c.surface.closed);
  EXPECT_NEAR(volume_of(c.surface), 3, 1e-12);
  for (TriangleId t : c.surface.triangles.ids()) EXPECT_TRUE(c.surface.normal[t].allFinite());
}

TEST(CapOpenings, ACapHasThePatchOfMostOfItsBorder) {
  const Conditioned c = conditioned(without(test::cylinder(32, 8), "cap_top"));
  EXPECT_EQ(c.caps(), 1);
  for (TriangleId t : c.surface.triangles.ids())
    if (c.surface.normal[t].z() > 0.99) {
      EXPECT_EQ(c.surface.patch_names[c.surface.patch[t]], "side");
    }
}

TEST(CapOpenings, TwoEndsOfATubeAreTwoCaps) {
  const Conditioned c = conditioned(without(without(test::cylinder(32, 8), "cap_top"), "cap_bottom"));
  EXPECT_EQ(c.caps(), 2);
  EXPECT_TRUE(c.surface.closed);
}

TEST(CapOpenings, ALidThatDoesNotReachItsWallsGetsAFrame) {
  TriangleSoup lid = test::box(Vec3(0.25, 0.25, 2), Vec3(0.75, 0.75, 3), 2);
  for (const char* side : {"x_min", "x_max", "y_min", "y_max", "z_min"}) lid = without(lid, side);
  const Conditioned c = conditioned(test::joined(well(3), lid));
  EXPECT_EQ(c.caps(), 1);
  EXPECT_TRUE(c.surface.closed);
  EXPECT_NEAR(volume_of(c.surface), 3, 1e-12);
}

TEST(CapOpenings, AShellThatIsTurnedInsideOutIsCappedToo) {
  const Conditioned c = conditioned(test::flipped(well(3)));
  EXPECT_EQ(c.caps(), 1);
  EXPECT_NEAR(std::abs(volume_of(c.surface)), 3, 1e-12);
}

TEST(CapOpenings, ABorderThatIsNotConvexIsCapped) {
  TriangleSoup block = test::l_block(2);
  for (Vec3& p : block.points) p.z() *= 8;
  const Conditioned c = conditioned(without(block, "z_max"));
  EXPECT_EQ(c.caps(), 1);
  EXPECT_TRUE(c.surface.closed);
  EXPECT_NEAR(volume_of(c.surface), 3 * 8, 1e-9);
}

TEST(CapOpenings, HolesThatTouchAreClosedEach) {
  TriangleSoup soup = test::cube(4);
  // Two squares of a face that share a point only.
  std::vector<std::size_t> gone;
  for (std::size_t t = 0; t < soup.triangles.size(); ++t) {
    Vec3 centre = Vec3::Zero();
    for (std::int32_t p : soup.triangles[t]) centre += soup.points[static_cast<std::size_t>(p)] / 3;
    const bool low = centre.x() > 0.25 && centre.x() < 0.5 && centre.y() > 0.25 && centre.y() < 0.5;
    const bool high = centre.x() > 0.5 && centre.x() < 0.75 && centre.y() > 0.5 && centre.y() < 0.75;
    if (centre.z() > 0.999 && (low || high)) gone.push_back(t);
  }
  ASSERT_EQ(gone.size(), 4u);
  for (auto t = gone.rbegin(); t != gone.rend(); ++t) {
    soup.triangles.erase(soup.triangles.begin() + static_cast<std::ptrdiff_t>(*t));
    soup.patch.erase(soup.patch.begin() + static_cast<std::ptrdiff_t>(*t));
  }
  const Conditioned c = conditioned(soup);
  EXPECT_EQ(c.caps(), 2);
  EXPECT_TRUE(c.surface.closed);
  EXPECT_NEAR(volume_of(c.surface), 1, 1e-12);
}

// A comb: nearly no corner is an ear for long.
TEST(CapOpenings, ALongBorderTakesNoTime) {
  constexpr int kTeeth = 400;
  TriangleSoup soup;
  soup.patch_names = {"comb"};
  std::vector<std::array<double, 2>> outline{{0, 0}, {2.0 * kTeeth, 0}};
  for (int i = kTeeth; i-- > 0;) {
    outline.push_back({2.0 * i + 1.9, 50});
    outline.push_back({2.0 * i, 1});
  }
  const auto n = static_cast<std::int32_t>(outline.size());
  for (const double z : {0.0, 2000.0})
    for (const auto& [x, y] : outline) soup.points.emplace_back(x, y, z);
  for (std::int32_t i = 0; i < n; ++i) {
    const std::int32_t j = (i + 1) % n;
    soup.triangles.push_back({i, j, n + j});
    soup.triangles.push_back({i, n + j, n + i});
  }
  soup.patch.assign(soup.triangles.size(), 0);
  const auto begun = std::chrono::steady_clock::now();
  EXPECT_EQ(conditioned(soup).caps(), 2);
  EXPECT_LT(std::chrono::steady_clock::now() - begun, std::chrono::seconds(20));
}

TEST(CapOpenings, ASideThatIsMissingStaysOpen) { EXPECT_EQ(conditioned(well(1)).caps(), 0); }

TEST(CapOpenings, ASheetIsNoShell) {
  TriangleSoup sheet = test::box(Vec3(0, 0, 0), Vec3(1, 1, 1), 2);
  for (const char* side : {"x_min", "x_max", "y_min", "y_max", "z_min"}) sheet = without(sheet, side);
  for (Vec3& p : sheet.points) p.z() += 0.1 * p.x() * p.y();
  EXPECT_EQ(conditioned(sheet).caps(), 0);
}

// A tube that begins inside another body: there it is open to it, and closed only where it leaves.
TEST(CapOpenings, AnEndInsideAnotherShellStaysOpen) {
  TriangleSoup spout = without(without(test::cylinder(32, 8), "cap_top"), "cap_bottom");
  spout = test::shifted(test::scaled(spout, 0.2), Vec3(0.5, 0.5, 0.4));
  const Conditioned c = conditioned(test::joined(test::cube(4), spout));
  EXPECT_EQ(c.caps(), 1);
}

}  // namespace
}  // namespace strata
