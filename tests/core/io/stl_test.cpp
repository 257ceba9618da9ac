#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "tests/core/io/samples.h"

namespace strata::test {
namespace {

using ::testing::ElementsAre;
using ::testing::HasSubstr;
constexpr auto kStl = io::SurfaceFormat::Stl;

TEST(AsciiStl, EachNamedSolidIsAPatchAndEqualCornersAreOnePoint) {
  const TriangleSoup soup = read(solid("base", {0}) + solid("wing wall", {1, 2, 3}), kStl);
  EXPECT_EQ(soup.points.size(), 4u);
  EXPECT_EQ(soup.triangles.size(), 4u);
  EXPECT_THAT(soup.patch_names, ElementsAre("base", "wing wall"));
  EXPECT_THAT(soup.patch, ElementsAre(0, 1, 1, 1));
}

TEST(AsciiStl, SolidsOfOneNameAreOnePatch) {
  const TriangleSoup soup = read(solid("a", {0}) + solid("b", {1}) + solid("a", {2, 3}), kStl);
  EXPECT_THAT(soup.patch_names, ElementsAre("a", "b"));
  EXPECT_THAT(soup.patch, ElementsAre(0, 1, 0, 0));
}

TEST(AsciiStl, ASurfaceWithoutNamesIsOnePatchCalledSurface) {
  EXPECT_THAT(read(solid("", {0, 1}) + solid("", {2, 3}), kStl).patch_names, ElementsAre("surface"));
}

TEST(AsciiStl, UnnamedSolidsAmongNamedOnesAreNumbered) {
  const TriangleSoup soup = read(solid("", {0}) + solid("wall", {1}) + solid("", {2, 3}), kStl);
  EXPECT_THAT(soup.patch_names, ElementsAre("solid_0", "wall", "solid_2"));
}

TEST(AsciiStl, ASolidWithoutTrianglesIsNoPatch) {
  EXPECT_THAT(read(solid("empty", {}) + solid("all", {0, 1, 2, 3}), kStl).patch_names, ElementsAre("all"));
}

TEST(AsciiStl, NamesAreKeptAsTheyAre) {
  const std::string name = "Fl\xc3\xbcgel  ../../etc/passwd; $(x)";
  EXPECT_THAT(read(solid(name, {0, 1, 2, 3}), kStl).patch_names, ElementsAre(name));
}

TEST(AsciiStl, CaseTabsAndCrlfDoNotMatter) {
  std::string text;
  for (const char c : solid("wall", {0, 1, 2, 3}))
    text += c == '\n' ? std::string("\r\n") : std::string(1, c == ' ' ? '\t' : static_cast<char>(std::toupper(c)));
  const TriangleSoup soup = read(text, kStl);
  EXPECT_EQ(soup.triangles.size(), 4u);
  EXPECT_EQ(soup.points.size(), 4u);
  EXPECT_THAT(soup.patch_names, ElementsAre("WALL"));
}

TEST(AsciiStl, NormalsMayBeNanOrMissing) {
  std::string text = solid("wall", {0, 1, 2, 3});
  text.replace(text.find("normal 0 0 0"), 12, "normal nan -nan inf");
  text.replace(text.find("normal 0 0 0"), 12, "");
  EXPECT_EQ(read(text, kStl).triangles.size(), 4u);
}

struct BadToken {
  const char* token;
  Reason reason;
};

TEST(AsciiStl, ABadCoordinateIsRefusedWithItsLine) {
  for (const BadToken& bad : {BadToken{"zero", Reason::FileMalformed}, BadToken{"1.5abc", Reason::FileMalformed},
                              BadToken{"0x10", Reason::FileMalformed}, BadToken{"nan", Reason::SurfaceNonFinite},
                              BadToken{"-inf", Reason::SurfaceNonFinite}, BadToken{"1e400", Reason::SurfaceNonFinite}}) {
    const std::string text = std::string("solid a\nfacet normal 0 0 1\nouter loop\nvertex 0 0 0\nvertex 0 ") + bad.token +
                             " 0\nvertex 0 1 0\nendloop\nendfacet\nendsolid\n";
    const auto refused = refusal(text, kStl);
    ASSERT_TRUE(refused) << bad.token;
    EXPECT_EQ(refused->reason, bad.reason) << bad.token;
    EXPECT_THAT(refused->message, HasSubstr("line 5:"));
    EXPECT_THAT(refused->message, HasSubstr(bad.token));
  }
}

TEST(AsciiStl, ANumberTooSmallForADoubleIsZero) {
  const TriangleSoup soup = read(
      "solid a\nfacet normal 0 0 1\nouter loop\nvertex 1e-400 -1e-400 0\nvertex +1 0 0\nvertex 0 1 0\nendloop\nendfacet\nendsolid\n", kStl);
  EXPECT_EQ(soup.points[0], Vec3(0, 0, 0));
  EXPECT_EQ(soup.points[1], Vec3(1, 0, 0));
}

TEST(AsciiStl, AFacetOfFourCornersIsRefused) {
  const auto refused = refusal(
      "solid a\nfacet normal 0 0 1\nouter loop\nvertex 0 0 0\nvertex 1 0 0\nvertex 1 1 0\nvertex 0 1 0\nendloop\nendfacet\nendsolid\n",
      kStl);
  ASSERT_TRUE(refused);
  EXPECT_THAT(refused->message, HasSubstr("line 7: expected 'endloop', found 'vertex'"));
}

TEST(AsciiStl, AFileCutBetweenTwoFacetsIsRefused) {
  const std::string text = solid("a", {0, 1, 2, 3});
  const auto refused = refusal(text.substr(0, text.find("endsolid")), kStl);
  ASSERT_TRUE(refused);
  EXPECT_THAT(refused->message, HasSubstr("expected 'endsolid', found the end of the file"));
}

// Several pieces of the parallel parse, with the solid changing and a bad line far down.
class LongAsciiStl : public ::testing::Test {
 protected:
  void SetUp() override {
    for (int s = 0; s < kSolids; ++s) {
      text_ += "solid s" + std::to_string(s % 3) + "\n";
      for (int f = 0; f < kFacets; ++f) text_ += facet(f % 4);
      text_ += "endsolid\n";
    }
  }
  static constexpr int kSolids = 7, kFacets = 4000;
  std::string text_;
};

TEST_F(LongAsciiStl, ReadsInPiecesAsFromTheTop) {
  ASSERT_GT(text_.size(), 3u << 20);
  const TriangleSoup soup = read(text_, kStl);
  ASSERT_EQ(soup.triangles.size(), std::size_t{kSolids * kFacets});
  EXPECT_EQ(soup.points.size(), 4u);
  EXPECT_THAT(soup.patch_names, ElementsAre("s0", "s1", "s2"));
  for (std::size_t t = 0; t < soup.triangles.size(); ++t) {
    ASSERT_EQ(soup.patch[t], static_cast<int>(t / kFacets) % 3);
    for (std::size_t i = 0; i < 3; ++i)
      ASSERT_EQ(soup.points[static_cast<std::size_t>(soup.triangles[t][i])], Vec3(kTetPoints[kTetFaces[t % 4][i]]));
  }
}

TEST_F(LongAsciiStl, NamesTheFirstOfSeveralBadLines) {
  const std::size_t late = text_.rfind("vertex"), early = text_.find("vertex", text_.size() / 2);
  text_.replace(late, 6, "vortex");
  text_.replace(early, 6, "wertex");
  const auto refused = refusal(text_, kStl);
  ASSERT_TRUE(refused);
  const auto line = 1 + std::count(text_.begin(), text_.begin() + static_cast<std::ptrdiff_t>(early), '\n');
  EXPECT_THAT(refused->message, HasSubstr("line " + std::to_string(line) + ": expected 'vertex', found 'wertex'"));
}

TEST(BinaryStl, IsOnePatchCalledSurface) {
  const TriangleSoup soup = read(binary_stl("anything"), kStl);
  EXPECT_EQ(soup.triangles.size(), 4u);
  EXPECT_EQ(soup.points.size(), 4u);
  EXPECT_THAT(soup.patch_names, ElementsAre("surface"));
}

TEST(BinaryStl, AHeaderThatBeginsWithSolidDoesNotMakeItText) { EXPECT_EQ(read(binary_stl("solid wing"), kStl).triangles.size(), 4u); }

TEST(BinaryStl, BytesBehindTheLastTriangleAreTolerated) {
  EXPECT_EQ(read(binary_stl("solid wing") + std::string(37, 'x'), kStl).triangles.size(), 4u);
}

TEST(BinaryStl, ACountBeyondTheFileIsRefusedWithBothCounts) {
  for (const std::uint32_t count : {5u, 4294967295u}) {
    const auto refused = refusal(binary_stl("solid wing", count), kStl);
    ASSERT_TRUE(refused);
    EXPECT_EQ(refused->reason, Reason::FileMalformed);
    EXPECT_THAT(refused->message, HasSubstr("promises " + std::to_string(count) + " triangles"));
    EXPECT_THAT(refused->message, HasSubstr("hold 4"));
  }
}

TEST(BinaryStl, ANanIsRefusedWithItsTriangle) {
  std::string bytes = binary_stl("x");
  const float nan = std::numeric_limits<float>::quiet_NaN();
  std::memcpy(bytes.data() + 84 + 50 * 2 + 12 + 4, &nan, sizeof(nan));
  const auto refused = refusal(bytes, kStl);
  ASSERT_TRUE(refused);
  EXPECT_EQ(refused->reason, Reason::SurfaceNonFinite);
  EXPECT_THAT(refused->message, HasSubstr("triangle 2"));
}

TEST(BinaryStl, MinusZeroIsZero) {
  std::string bytes = binary_stl("x");
  const float minus_zero = -0.0f;
  std::memcpy(bytes.data() + 84 + 12, &minus_zero, sizeof(minus_zero));
  EXPECT_EQ(read(bytes, kStl).points.size(), 4u);
}

TEST(Stl, NothingInsideIsEmptyNotMalformed) {
  EXPECT_EQ(refusal("", kStl)->reason, Reason::SurfaceEmpty);
  EXPECT_EQ(refusal(binary_stl("x", 0).substr(0, 84), kStl)->reason, Reason::SurfaceEmpty);
  EXPECT_EQ(refusal("solid a\nendsolid a\n", kStl)->reason, Reason::SurfaceEmpty);
}

TEST(Stl, WhatIsNeitherFormIsRefused) {
  EXPECT_EQ(refusal(std::string(79, ' '), kStl)->reason, Reason::FileMalformed);
  EXPECT_EQ(refusal("hello", kStl)->reason, Reason::FileMalformed);
}

}  // namespace
}  // namespace strata::test
