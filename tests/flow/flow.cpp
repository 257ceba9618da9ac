#include "tests/flow/flow.h"

#include <algorithm>
#include <cstring>
#include <map>
#include <set>

#include "core/mesh/adjacency.h"
#include "core/quality/validity.h"
#include "tests/support/mesh_checks.h"

namespace strata::testing {
namespace {

void expect_report_is_of_the_mesh(const Outcome& outcome) {
  const HexMesh& mesh = outcome.mesh;
  const Quality& quality = outcome.quality;
  EXPECT_EQ(quality.vertices, static_cast<std::int64_t>(mesh.position.size()));
  EXPECT_EQ(quality.quads, static_cast<std::int64_t>(mesh.quads.size()));
  EXPECT_EQ(quality.all.count, static_cast<std::int64_t>(mesh.hexes.size()));
  EXPECT_EQ(quality.layers.count + quality.rest.count, quality.all.count);
  EXPECT_EQ(quality.layers.count, layer_hexes(outcome));
  EXPECT_EQ(quality.all.not_positive, 0);
  double least = 1, sum = 0;
  for (HexId h : mesh.hexes.ids()) {
    const double jacobian = scaled_jacobian(corners_of(mesh, h));
    least = std::min(least, jacobian);
    sum += jacobian;
  }
  EXPECT_DOUBLE_EQ(quality.all.min, least);
  EXPECT_NEAR(quality.all.mean, sum / static_cast<double>(mesh.hexes.size()), 1e-12);
  std::int64_t in_regions = 0, in_patches = 0, binned = 0;
  double volume = 0;
  for (const RegionStatistics& r : quality.regions) in_regions += r.hexes, volume += r.volume;
  for (const PatchStatistics& p : quality.patches) in_patches += p.quads;
  for (const std::int64_t n : quality.all.histogram) binned += n;
  EXPECT_EQ(in_regions, quality.all.count);
  EXPECT_EQ(in_patches, quality.quads);
  EXPECT_EQ(binned, quality.all.count);
  EXPECT_NEAR(volume, hex_volume(mesh), 1e-3 * volume) << "faces are bent a little: two readings of one volume";
  ASSERT_EQ(outcome.patch_names.size(), quality.patches.size());
  for (PatchId p : outcome.patch_names.ids()) {
    EXPECT_EQ(quality.patches[p.index()].name, outcome.patch_names[p]);
    EXPECT_EQ(quality.patches[p.index()].reference, p.value + 1);
    EXPECT_EQ(quality.patches[p.index()].quads, std::count(mesh.patch.begin(), mesh.patch.end(), p)) << outcome.patch_names[p];
  }
}

}  // namespace

void expect_sound(const Outcome& outcome) {
  EXPECT_EQ(check_topology(outcome.mesh), "");
  EXPECT_EQ(check_positive(outcome.mesh), "");
  const auto found = check_mesh(outcome.mesh);
  EXPECT_FALSE(found.has_value()) << found->message;
  EXPECT_GT(outcome.quality.all.min, 0);
  expect_report_is_of_the_mesh(outcome);
}

double volume_of(const TriangleSoup& soup) {
  double sum = 0;
  for (const auto& [a, b, c] : soup.triangles) sum += soup.points[a].cross(soup.points[b]).dot(soup.points[c]) / 6;
  return sum;
}

double area_of(const TriangleSoup& soup, const std::string& name) {
  double sum = 0;
  for (std::size_t t = 0; t < soup.triangles.size(); ++t) {
    if (soup.patch_names[static_cast<std::size_t>(soup.patch[t])] != name) continue;
    const auto& [a, b, c] = soup.triangles[t];
    sum += 0.5 * (soup.points[b] - soup.points[a]).cross(soup.points[c] - soup.points[a]).norm();
  }
  return sum;
}

double diagonal_of(const TriangleSoup& soup) {
  Box box;
  for (const Vec3& p : soup.points) box.add(p);
  return box.diagonal();
}

double meshed_volume(const Outcome& outcome) {
  double sum = 0;
  for (const RegionStatistics& r : outcome.quality.regions) sum += r.volume;
  return sum;
}

const PatchStatistics& patch(const Outcome& outcome, const std::string& name) {
  static const PatchStatistics kMissing;
  for (const PatchStatistics& p : outcome.quality.patches)
    if (p.name == name) return p;
  ADD_FAILURE() << "no patch " << name;
  return kMissing;
}

std::int64_t quads_of(const Outcome& outcome, const std::vector<std::string>& patches) {
  std::int64_t sum = 0;
  for (const std::string& name : patches) sum += patch(outcome, name).quads;
  return sum;
}

std::int64_t layer_hexes(const Outcome& outcome) {
  return std::count_if(outcome.mesh.layer.begin(), outcome.mesh.layer.end(), [](std::uint16_t l) { return l > 0; });
}

void expect_patches_kept(const Outcome& outcome, const TriangleSoup& soup, double tolerance) {
  ASSERT_EQ(outcome.patch_names.size(), soup.patch_names.size());
  for (const std::string& name : soup.patch_names) {
    const double wanted = area_of(soup, name);
    EXPECT_NEAR(patch(outcome, name).area, wanted, tolerance * wanted) << name;
  }
}

double distance_to_vertices(const Outcome& outcome, const Vec3& p) {
  double least = std::numeric_limits<double>::infinity();
  for (const QuadVertices& q : outcome.mesh.quads)
    for (VertexId v : q) least = std::min(least, (outcome.mesh.position[v] - p).norm());
  return least;
}

double border_length(const Outcome& outcome, const std::string& a, const std::string& b) {
  const HexMesh& mesh = outcome.mesh;
  std::map<std::pair<VertexId, VertexId>, std::set<std::string>> patches;
  for (QuadId q : mesh.quads.ids())
    for (std::size_t i = 0; i < 4; ++i)
      patches[std::minmax(mesh.quads[q][i], mesh.quads[q][(i + 1) & 3])].insert(outcome.patch_names[mesh.patch[q]]);
  double length = 0;
  for (const auto& [edge, names] : patches)
    if (names.count(a) != 0 && names.count(b) != 0) length += (mesh.position[edge.first] - mesh.position[edge.second]).norm();
  return length;
}

bool same_bytes(const HexMesh& a, const HexMesh& b) {
  const auto equal = [](const auto& x, const auto& y) {
    using Value = typename std::decay_t<decltype(x)>::value_type;
    return x.size() == y.size() && std::memcmp(x.data(), y.data(), x.size() * sizeof(Value)) == 0;
  };
  return equal(a.position, b.position) && equal(a.hexes, b.hexes) && equal(a.region, b.region) && equal(a.layer, b.layer) &&
         equal(a.quads, b.quads) && equal(a.patch, b.patch) && equal(a.chart, b.chart) && a.attachment == b.attachment;
}

}  // namespace strata::testing
