#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <filesystem>
#include <fstream>

#include "tests/core/io/samples.h"

namespace strata::test {
namespace {

using io::SurfaceFormat;
using ::testing::ElementsAre;
using ::testing::HasSubstr;

TEST(SurfaceFormats, AreKnownByTheirEndingInAnyCase) {
  EXPECT_EQ(io::surface_format("wing.STL"), SurfaceFormat::Stl);
  EXPECT_EQ(io::surface_format("a.b/c.obj"), SurfaceFormat::Obj);
  EXPECT_EQ(io::surface_format("x.meshb"), SurfaceFormat::Medit);
  EXPECT_FALSE(io::surface_format("stl"));
  EXPECT_FALSE(io::surface_format("dir.stl/name"));
  EXPECT_FALSE(io::surface_format("x.step"));
}

TEST(SurfaceFormats, AllHoldTheSameTetrahedron) {
  for (const Sample& sample : samples()) {
    const TriangleSoup soup = read(sample.bytes, sample.format);
    ASSERT_EQ(soup.triangles.size(), 4u) << sample.name;
    EXPECT_EQ(soup.points.size(), 4u) << sample.name;
    for (std::size_t t = 0; t < 4; ++t)
      for (std::size_t i = 0; i < 3; ++i)
        EXPECT_EQ(soup.points[static_cast<std::size_t>(soup.triangles[t][i])], Vec3(kTetPoints[kTetFaces[t][i]])) << sample.name;
    EXPECT_EQ(soup.patch.size(), 4u) << sample.name;
  }
}

TEST(SurfaceFormats, AFileIsRefusedUnderItsBaseName) {
  const auto path = std::filesystem::temp_directory_path() / "strata_io_bad_surface.off";
  std::ofstream(path) << "OFF\n1 x\n";
  try {
    io::read_surface_file(path.string());
    FAIL() << "read a bad file";
  } catch (const MeshError& error) {
    EXPECT_EQ(std::string(error.what()), "strata_io_bad_surface.off: line 2: expected the number of faces, found 'x'");
  }
  std::filesystem::remove(path);
  EXPECT_THROW(io::read_surface_file(path.string()), MeshError);
  EXPECT_THROW(io::read_surface_file("surface.step"), MeshError);
}

TEST(Obj, PolygonsAreFannedAndNegativeAndSlashedIndicesWork) {
  const TriangleSoup soup =
      read("# a comment\nmtllib x.mtl\nv 0 0 0 1 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nvt 0 0\nvn 0 0 1\nf -4/1/1 -3//1 \\\n -2/1 4\n",
           SurfaceFormat::Obj);
  EXPECT_THAT(soup.triangles, ElementsAre(std::array{0, 1, 2}, std::array{0, 2, 3}));
  EXPECT_THAT(soup.patch_names, ElementsAre("surface"));
}

TEST(Obj, PatchesAreGroupsElseObjectsElseMaterials) {
  const std::string vertices = "v 0 0 0\nv 1 0 0\nv 0 1 0\n";
  EXPECT_THAT(read(vertices + "usemtl red\nf 1 2 3\no body\nf 1 2 3\ng nose  cone\nf 1 2 3\ng\nf 1 2 3\n", SurfaceFormat::Obj).patch_names,
              ElementsAre("red", "body", "nose cone"));
}

TEST(Obj, ABadIndexIsRefusedWithItsLine) {
  const std::string vertices = "v 0 0 0\nv 1 0 0\nv 0 1 0\n";
  for (const char* index : {"0", "4", "-4", "99999999999"}) {
    const auto refused = refusal(vertices + "f 1 2 " + index + "\n", SurfaceFormat::Obj);
    ASSERT_TRUE(refused) << index;
    EXPECT_EQ(refused->reason, Reason::SurfaceIndexOutOfRange);
    EXPECT_THAT(refused->message, HasSubstr("line 4:"));
  }
  EXPECT_EQ(refusal(vertices + "f 1 2 x\n", SurfaceFormat::Obj)->reason, Reason::FileMalformed);
  EXPECT_EQ(refusal(vertices + "f 1 2\n", SurfaceFormat::Obj)->reason, Reason::FileMalformed);
  EXPECT_EQ(refusal("v 0 0\nv 1 0 0\n", SurfaceFormat::Obj)->reason, Reason::FileMalformed);
  EXPECT_EQ(refusal(vertices, SurfaceFormat::Obj)->reason, Reason::SurfaceEmpty);
}

TEST(Off, CommentsColoursAndPolygonsAreFine) {
  const TriangleSoup soup =
      read("# top\nCOFF # kind\n\n4 1\n0 0 0 255 0 0 255\n1 0 0 255 0 0 255 # red\n1 1 0 1 1 1 1\n0 1 0 1 1 1 1\n4 0 1 2 3 0.5 0.5 0.5\n",
           SurfaceFormat::Off);
  EXPECT_THAT(soup.triangles, ElementsAre(std::array{0, 1, 2}, std::array{0, 2, 3}));
  EXPECT_THAT(soup.patch_names, ElementsAre("surface"));
}

TEST(Off, ABadIndexNamesTheFace) {
  for (const char* index : {"-2", "3"}) {
    const auto refused = refusal(std::string("OFF\n3 2 0\n0 0 0\n1 0 0\n0 1 0\n3 0 1 2\n3 0 1 ") + index + "\n", SurfaceFormat::Off);
    ASSERT_TRUE(refused);
    EXPECT_EQ(refused->reason, Reason::SurfaceIndexOutOfRange);
    EXPECT_THAT(refused->message, HasSubstr("line 7: face 1"));
  }
}

TEST(Counts, OfAHeaderNeverDecideAnAllocation) {
  for (const auto& [text, format] :
       {std::pair{"OFF\n4000000000 4000000000 0\n0 0 0\n", SurfaceFormat::Off},
        std::pair{"OFF\n3 4000000000 0\n0 0 0\n1 0 0\n0 1 0\n3 0 1 2\n", SurfaceFormat::Off},
        std::pair{"OFF\n3 1 0\n0 0 0\n1 0 0\n0 1 0\n4000000000 0 1 2\n", SurfaceFormat::Off},
        std::pair{"OFF\n99999999999999999999 1 0\n", SurfaceFormat::Off},
        std::pair{"ply\nformat ascii 1.0\nelement vertex 4000000000\nproperty float x\nend_header\n", SurfaceFormat::Ply},
        std::pair{"MeshVersionFormatted 2\nDimension 3\nVertices\n4000000000\n0 0 0 0\n", SurfaceFormat::Medit},
        std::pair{"MeshVersionFormatted 2\nDimension 3\nVertices\n-4\n", SurfaceFormat::Medit}}) {
    const auto refused = refusal(text, format);
    ASSERT_TRUE(refused) << text;
    EXPECT_EQ(refused->reason, Reason::FileMalformed) << text;
  }
}

TEST(Ply, FaceReferencesArePatches) {
  for (const std::string& bytes : {ascii_ply(), binary_ply(Bytes::AsIs), binary_ply(Bytes::Swapped)}) {
    const TriangleSoup soup = read(bytes, SurfaceFormat::Ply);
    EXPECT_THAT(soup.patch_names, ElementsAre("7", "8"));
    EXPECT_THAT(soup.patch, ElementsAre(0, 0, 1, 0));
  }
}

TEST(Ply, FacesWithoutReferenceAreTheSurface) {
  const TriangleSoup soup = read(
      "ply\r\nformat ascii 1.0\r\nelement vertex 3\r\nproperty float confidence\r\nproperty float x\r\nproperty float y\r\nproperty float "
      "z\r\n"
      "element face 1\r\nproperty list uchar int vertex_indices\r\nelement edge 1\r\nproperty int vertex1\r\nend_header\r\n"
      "nan 0 0 0\r\n0.5 1 0 0\r\n0 0 1 0\r\n3 0 1 2\r\n7\r\n",
      SurfaceFormat::Ply);
  EXPECT_EQ(soup.triangles.size(), 1u);
  EXPECT_THAT(soup.patch_names, ElementsAre("surface"));
}

TEST(Ply, BadIndicesAndNonFiniteVerticesAreRefused) {
  std::string bytes = binary_ply(Bytes::AsIs);
  const std::size_t data = bytes.find("end_header\n") + 11;
  std::string nan_vertex = bytes;
  const double nan = std::numeric_limits<double>::quiet_NaN();
  std::memcpy(nan_vertex.data() + data + 24, &nan, sizeof(nan));
  EXPECT_EQ(refusal(nan_vertex, SurfaceFormat::Ply)->reason, Reason::SurfaceNonFinite);
  EXPECT_THAT(refusal(nan_vertex, SurfaceFormat::Ply)->message, HasSubstr("vertex 1"));
  bytes[bytes.size() - 4] = 77;
  EXPECT_EQ(refusal(bytes, SurfaceFormat::Ply)->reason, Reason::SurfaceIndexOutOfRange);
}

TEST(Medit, ReferencesNamePatchesAndOtherKeywordsAreSteppedOver) {
  EXPECT_THAT(read(kTetMedit, SurfaceFormat::Medit).patch_names, ElementsAre("5", "9"));
  const TriangleSoup soup = read(
      "# made by hand\nMeshVersionFormatted 1\nDimension\n3\nQuadrilaterals 1 # before its vertices\n1 2 3 4 -3\nRidges 2\n1\n2\n"
      "Vertices 4\n0 0 0 0\n1 0 0 0\n1 1 0 0\n0 1 0 0\n",
      SurfaceFormat::Medit);
  EXPECT_THAT(soup.triangles, ElementsAre(std::array{0, 1, 2}, std::array{0, 2, 3}));
  EXPECT_THAT(soup.patch_names, ElementsAre("-3"));
}

TEST(Medit, ABadReferenceNamesItsLine) {
  std::string text = kTetMedit;
  text.replace(text.find("2 3 4 9"), 7, "2 30 4 9");
  const auto refused = refusal(text, SurfaceFormat::Medit);
  ASSERT_TRUE(refused);
  EXPECT_EQ(refused->reason, Reason::SurfaceIndexOutOfRange);
  EXPECT_THAT(refused->message, HasSubstr("line 13: a triangle names vertex 30, but there are 4"));
}

TEST(Gmf, PositionsThatGoBackAreRefused) {
  std::string bytes = gmf(2, Bytes::AsIs);
  const std::int32_t back = 8;
  std::memcpy(bytes.data() + 12, &back, sizeof(back));
  EXPECT_EQ(refusal(bytes, SurfaceFormat::Medit)->reason, Reason::FileMalformed);
}

}  // namespace
}  // namespace strata::test
