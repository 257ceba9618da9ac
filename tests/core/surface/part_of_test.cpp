#include <gtest/gtest.h>

#include "core/base/context.h"
#include "core/surface/surface.h"
#include "tests/support/shapes.h"

namespace strata {
namespace {

TEST(PartOf, KeepsTheMarkedTrianglesWithTheirPatchesAndTheFrame) {
  Context context;
  const Surface whole = condition(test::joined(test::cube(3), test::shifted(test::cube(2), Vec3(4, 0, 0))), context);
  IdMap<TriangleId, std::uint8_t> keep(whole.triangles.size(), std::uint8_t{0});
  for (TriangleId t : whole.triangles.ids()) keep[t] = whole.component[t] == 1;
  const Surface part = part_of(whole, keep);
  EXPECT_EQ(part.triangles.size(), 48U);
  EXPECT_EQ(part.points.size(), 26U);
  EXPECT_TRUE(part.closed);
  EXPECT_EQ(part.component_count, 1);
  EXPECT_EQ(part.frame.scale, whole.frame.scale);
  std::size_t n = 0;
  for (TriangleId t : whole.triangles.ids()) {
    if (keep[t] == 0) continue;
    const TriangleId p(n++);
    EXPECT_EQ(part.corners(p), whole.corners(t));
    EXPECT_EQ(part.patch[p], whole.patch[t]);
    EXPECT_EQ(part.source[p], whole.source[t]);
  }
}

TEST(PartOf, EdgesToWhatIsLeftOutAreOpen) {
  Context context;
  const Surface whole = condition(test::cube(2), context);
  IdMap<TriangleId, std::uint8_t> keep(whole.triangles.size(), std::uint8_t{1});
  for (TriangleId t : whole.triangles.ids()) keep[t] = whole.patch_names[whole.patch[t]] != "z_max";
  const Surface part = part_of(whole, keep);
  EXPECT_FALSE(part.closed);
  int open = 0;
  for (const EdgeNeighbours& n : part.neighbours)
    for (TriangleId t : n) open += t.valid() ? 0 : 1;
  EXPECT_EQ(open, 8);
}

}  // namespace
}  // namespace strata
