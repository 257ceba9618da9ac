#include "core/fit/hidden_stretches.h"

#include <gtest/gtest.h>

#include "core/base/context.h"
#include "core/features/features.h"
#include "core/surface/surface.h"
#include "tests/support/grids.h"
#include "tests/support/shapes.h"

namespace strata {
namespace {

constexpr int kCells = 4;  // along an edge

// A cube of hexes whose vertices are held to the features of the same cube.
struct HeldCube {
  Context context;
  Surface surface = condition(test::cube(), context);
  Features features = detect_features(surface, {}, context);
  Ground ground{surface, features};
  HexMesh mesh = testing::grid(kCells, kCells, kCells);

  HeldCube() {
    for (VertexId v : mesh.position.ids()) {
      int extremes = 0;
      for (int k = 0; k < 3; ++k) extremes += mesh.position[v][k] == 0 || mesh.position[v][k] == kCells ? 1 : 0;
      mesh.position[v] = surface.box.min + mesh.position[v].cwiseProduct(surface.box.extent()) / kCells;
      if (extremes == 3) mesh.attachment[v] = {Hold::Corner, nearest(Hold::Corner, features.corners.size(), v)};
      if (extremes == 2) mesh.attachment[v] = {Hold::Curve, nearest(Hold::Curve, features.curves.size(), v)};
    }
  }

  [[nodiscard]] std::int32_t nearest(Hold hold, std::size_t count, VertexId v) const {
    std::int32_t best = -1;
    double least = std::numeric_limits<double>::infinity();
    for (std::int32_t of = 0; of < static_cast<std::int32_t>(count); ++of) {
      const double d = (ground.project({hold, of}, mesh.position[v]).position - mesh.position[v]).norm();
      if (d < least) least = d, best = of;
    }
    return best;
  }
  // A vertex of the curve that is so many edges from its first corner.
  [[nodiscard]] VertexId along(CurveId c, int edges) const {
    const Curve& curve = features.curves[c];
    const Vec3 &a = surface.points[curve.points.front()], &b = surface.points[curve.points.back()];
    for (VertexId v : mesh.position.ids())
      if ((mesh.position[v] - (a + edges * (b - a) / kCells)).norm() < 1e-9) return v;
    return {};
  }
};

TEST(HiddenStretches, NothingIsHiddenWhereEdgesStandOnAllCurves) {
  const HeldCube cube;
  for (const std::vector<Stretch>& hidden : hidden_stretches(cube.mesh, cube.ground))
    for (const Stretch& s : hidden) EXPECT_LT(s.to - s.from, 1e-9);
}

TEST(HiddenStretches, BesideAVertexThatLeftItsCurveTwoEdgesAreHidden) {
  HeldCube cube;
  const CurveId c(3);
  cube.mesh.attachment[cube.along(c, 2)] = {Hold::Chart, kWholeSurface};
  const std::vector<Stretch> hidden = hidden_stretches(cube.mesh, cube.ground)[c];
  const double edge = cube.features.curves[c].length / kCells;
  ASSERT_EQ(hidden.size(), 1u);
  EXPECT_NEAR(hidden[0].from, edge, 1e-9);
  EXPECT_NEAR(hidden[0].to, 3 * edge, 1e-9);
  const std::vector<Vec3> line = points_along(hidden[0], cube.features.curves[c], cube.surface);
  ASSERT_GE(line.size(), 2u);
  EXPECT_LT((line.front() - cube.mesh.position[cube.along(c, 1)]).norm(), 1e-9);
  EXPECT_LT((line.back() - cube.mesh.position[cube.along(c, 3)]).norm(), 1e-9);
}

TEST(HiddenStretches, ACurveWithoutVerticesIsHiddenAsAWhole) {
  HeldCube cube;
  const CurveId c(5);
  for (Attachment& at : cube.mesh.attachment)
    if (at == Attachment{Hold::Curve, c.value}) at = {Hold::Chart, kWholeSurface};
  const std::vector<Stretch> hidden = hidden_stretches(cube.mesh, cube.ground)[c];
  ASSERT_EQ(hidden.size(), 1u);
  EXPECT_NEAR(hidden[0].to - hidden[0].from, cube.features.curves[c].length, 1e-9);
}

}  // namespace
}  // namespace strata
