// Properties of the dual: they hold for every edge-balanced octree, so random trees are the proof.
#include "core/dual/dual.h"

#include <gtest/gtest.h>
#include <oneapi/tbb/global_control.h>

#include <algorithm>
#include <array>
#include <cstring>
#include <map>
#include <random>
#include <set>

#include "core/base/context.h"
#include "core/dual/templates.h"
#include "core/dual/transition.h"
#include "core/mesh/hex.h"
#include "core/octree/block_tree.h"
#include "core/octree/split_nodes.h"

namespace strata {
namespace {

// Each node of the tree is split with the given chance; balanced afterwards.
Octree random_octree(unsigned seed, std::size_t levels, double chance) {
  std::mt19937 random(seed);
  SplitNodes split(levels);
  split[0] = {0};
  for (std::size_t level = 1; level < levels; ++level)
    for (const std::uint64_t parent : split[level - 1])
      for (std::uint64_t child = 0; child < 8; ++child)
        if (static_cast<double>(random()) < chance * 4294967296.0) split[level].push_back(parent << 3 | child);
  balance(split);
  return leaves_of(split);
}

Octree uniform_octree(std::size_t levels) {
  SplitNodes split(levels);
  for (std::size_t level = 0; level < levels; ++level)
    for (std::uint64_t code = 0; code < std::uint64_t{1} << (3 * level); ++code) split[level].push_back(code);
  return leaves_of(split);
}

double worst_corner_jacobian(const HexMesh& mesh) {
  double worst = 1;
  for (const HexVertices& hex : mesh.hexes) {
    for (std::size_t c = 0; c < 8; ++c) {
      Vec3 e[3];
      for (std::size_t k = 0; k < 3; ++k)
        e[k] = (mesh.position[hex[static_cast<std::size_t>(kHexCorners[c][k])]] - mesh.position[hex[c]]).normalized();
      worst = std::min(worst, e[0].cross(e[1]).dot(e[2]));
    }
  }
  return worst;
}

using Face = std::array<std::int32_t, 4>;
Face sorted_face(const HexVertices& hex, std::size_t face) {
  Face key;
  for (std::size_t i = 0; i < 4; ++i) key[i] = hex[static_cast<std::size_t>(kHexFaces[face][i])].value;
  std::sort(key.begin(), key.end());
  return key;
}

struct Topology {
  std::size_t faces = 0, worst_face_use = 0, boundary_faces = 0, bad_boundary_edges = 0, bad_boundary_fans = 0;
  std::int64_t euler = 0;            // of the solid
  std::size_t repeated_corners = 0;  // hexes with a node twice
  std::size_t unused_nodes = 0;
};

Topology topology_of(const HexMesh& mesh) {
  Topology result;
  std::vector<std::pair<Face, std::array<std::int32_t, 4>>> faces;
  std::vector<std::pair<std::int32_t, std::int32_t>> edges;
  std::vector<char> used(mesh.position.size(), 0);
  for (const HexVertices& hex : mesh.hexes) {
    std::set<VertexId> distinct(hex.begin(), hex.end());
    if (distinct.size() != 8) ++result.repeated_corners;
    for (const VertexId v : hex) used[v.index()] = 1;
    for (std::size_t f = 0; f < 6; ++f) {
      std::array<std::int32_t, 4> cycle;
      for (std::size_t i = 0; i < 4; ++i) cycle[i] = hex[static_cast<std::size_t>(kHexFaces[f][i])].value;
      faces.emplace_back(sorted_face(hex, f), cycle);
    }
    for (const auto& e : kHexEdges) {
      const auto a = hex[static_cast<std::size_t>(e[0])].value, b = hex[static_cast<std::size_t>(e[1])].value;
      edges.emplace_back(std::min(a, b), std::max(a, b));
    }
  }
  std::sort(faces.begin(), faces.end());
  std::sort(edges.begin(), edges.end());
  edges.erase(std::unique(edges.begin(), edges.end()), edges.end());
  std::map<std::pair<std::int32_t, std::int32_t>, int> boundary_edges;
  std::map<std::int32_t, std::vector<std::array<std::int32_t, 2>>> fans;  // vertex -> (next, previous) in its boundary quads
  for (std::size_t i = 0; i < faces.size();) {
    std::size_t j = i;
    while (j < faces.size() && faces[j].first == faces[i].first) ++j;
    ++result.faces;
    result.worst_face_use = std::max(result.worst_face_use, j - i);
    if (j - i == 1) {
      ++result.boundary_faces;
      const auto& cycle = faces[i].second;
      for (std::size_t k = 0; k < 4; ++k) {
        const auto a = cycle[k], b = cycle[(k + 1) % 4];
        boundary_edges[{a, b}] += 1;
        fans[a].push_back({b, cycle[(k + 3) % 4]});
      }
    }
    i = j;
  }
  // Closed and consistently oriented: each directed edge once, with its opposite.
  for (const auto& [edge, count] : boundary_edges)
    if (count != 1 || !boundary_edges.count({edge.second, edge.first})) ++result.bad_boundary_edges;
  // One fan of quads round every boundary vertex.
  for (const auto& [vertex, corners] : fans) {
    std::map<std::int32_t, std::int32_t> next;
    for (const auto& c : corners) next[c[0]] = c[1];
    std::size_t length = 0;
    const std::int32_t start = corners[0][0];
    std::int32_t at = start;
    do {
      at = next.count(at) ? next[at] : start;
      ++length;
    } while (at != start && length <= corners.size());
    if (length != corners.size()) ++result.bad_boundary_fans;
  }
  std::int64_t vertices = 0;
  for (const char u : used) vertices += u;
  result.unused_nodes = used.size() - static_cast<std::size_t>(vertices);
  result.euler = vertices - static_cast<std::int64_t>(edges.size()) + static_cast<std::int64_t>(result.faces) -
                 static_cast<std::int64_t>(mesh.hexes.size());
  return result;
}

void expect_sound(const HexMesh& mesh) {
  const Topology t = topology_of(mesh);
  EXPECT_LE(t.worst_face_use, 2u);
  EXPECT_EQ(t.bad_boundary_edges, 0u);
  EXPECT_EQ(t.bad_boundary_fans, 0u);
  EXPECT_EQ(t.euler, 1);
  EXPECT_EQ(t.repeated_corners, 0u);
  EXPECT_EQ(t.unused_nodes, 0u);
  EXPECT_GE(worst_corner_jacobian(mesh), 0.28);
}

TEST(Templates, HaveThePublishedPlacements) {
  const std::vector<Placement> placements = make_placements();
  // cube 1, one tet 3, two tets 3, three tets 1, flat 6, flat with tet 6, edge 3, side 6, corner 2
  EXPECT_EQ(placements.size(), 31u);
  EXPECT_TRUE(
      std::is_sorted(placements.begin(), placements.end(), [](const auto& a, const auto& b) { return a.cells.size() < b.cells.size(); }));
}

// All legal bit sets: every face mask with every set of edges that no fine face touches.
std::vector<PatternBits> legal_bits() {
  std::vector<PatternBits> all;
  for (PatternBits faces = 0; faces < 64; ++faces) {
    const PatternBits implied = with_implied_edges(faces);
    for (PatternBits edges = 0; edges < 4096; ++edges)
      if (((edges << kFaceBits) & implied) == 0) all.push_back(implied | edges << kFaceBits);
  }
  return all;
}

TEST(Patterns, EveryOneOfThe6210LegalBitSetsHasASolution) {
  const std::vector<PatternBits> bits = legal_bits();
  ASSERT_EQ(bits.size(), 6210u);
  const std::vector<Pattern> patterns = solve_patterns(bits);
  for (std::size_t i = 0; i < bits.size(); ++i) {
    const Pattern& pattern = patterns[i];
    ASSERT_GE(pattern.node.size(), 8u);
    ASSERT_LE(pattern.node.size(), 56u);
    for (const auto& hex : pattern.interior) {
      std::set<std::int8_t> distinct(hex.begin(), hex.end());
      ASSERT_EQ(distinct.size(), 8u) << "pattern " << bits[i];
      ASSERT_EQ(distinct.count(-1), 0u) << "pattern " << bits[i];
    }
    // The boundary shows exactly what the bits promise.
    for (int z = 0; z <= 4; ++z) {
      for (int y = 0; y <= 4; ++y) {
        for (int x = 0; x <= 4; ++x) {
          const std::array<int, 3> p{x, y, z};
          int hull = 0, odd = 0;
          bool on_fine_face = false;
          for (std::size_t axis = 0; axis < 3; ++axis) {
            hull += p[axis] % 4 == 0;
            odd += p[axis] % 2;
            if (p[axis] % 4 == 0 && bits[i] & face_bit(static_cast<int>(2 * axis) + p[axis] / 4)) on_fine_face = true;
          }
          if (hull == 0) continue;
          const auto& octant = pattern.octant[lattice_index(x, y, z)];
          const auto filled = std::count_if(octant.begin(), octant.end(), [](std::int8_t c) { return c >= 0; });
          if (on_fine_face || odd == 0) {
            ASSERT_EQ(filled, 8 >> hull) << "pattern " << bits[i] << " at " << x << y << z;
          } else {
            ASSERT_TRUE(filled == 0 || filled == 8 >> hull) << "pattern " << bits[i] << " at " << x << y << z;
          }
        }
      }
    }
  }
}

TEST(Dual, OfAUniformOctreeIsTheShiftedGrid) {
  Context context;
  const Dual dual = dualize(uniform_octree(3), context);  // 8^3 blocks, 16^3 cells
  EXPECT_EQ(dual.mesh.position.size(), 4096u);
  EXPECT_EQ(dual.mesh.hexes.size(), 15u * 15u * 15u);
  EXPECT_NEAR(worst_corner_jacobian(dual.mesh), 1.0, 1e-12);
  for (const HexVertices& hex : dual.mesh.hexes) {
    const Vec3 diagonal = dual.mesh.position[hex[6]] - dual.mesh.position[hex[0]];
    ASSERT_NEAR((diagonal - Vec3::Constant(1.0 / 16)).norm(), 0.0, 1e-12);
  }
  expect_sound(dual.mesh);
}

TEST(Dual, OfRandomBalancedOctreesIsASoundHexMesh) {
  std::int64_t hexes = 0;
  for (unsigned seed = 0; seed < 12; ++seed) {
    SCOPED_TRACE(seed);
    Context context;
    const Octree octree = random_octree(seed, 5, seed % 2 ? 0.15 : 0.3);
    const Dual dual = dualize(octree, context);
    expect_sound(dual.mesh);
    EXPECT_EQ(dual.mesh.region.size(), dual.mesh.hexes.size());
    EXPECT_EQ(dual.mesh.layer.size(), dual.mesh.hexes.size());
    EXPECT_EQ(dual.mesh.attachment.size(), dual.mesh.position.size());
    hexes += static_cast<std::int64_t>(dual.mesh.hexes.size());
  }
  EXPECT_GT(hexes, 50000);
}

// One coarse block in the middle of a 3x3x3 arrangement whose chosen neighbours are finer: every class of face masks.
TEST(Dual, IsSoundForEveryFaceMask) {
  for (unsigned mask = 0; mask < 64; ++mask) {
    SCOPED_TRACE(mask);
    SplitNodes split(4);
    split[0] = {0};
    for (std::uint64_t c = 0; c < 8; ++c) split[1].push_back(c);
    // The block (1,1,1) of level 2 and its six neighbours; Morton codes by hand-interleaving two bits an axis.
    const auto code = [](unsigned x, unsigned y, unsigned z) {
      std::uint64_t c = 0;
      for (unsigned bit = 0; bit < 2; ++bit)
        c |= static_cast<std::uint64_t>((x >> bit & 1) | (y >> bit & 1) << 1 | (z >> bit & 1) << 2) << (3 * bit);
      return c;
    };
    for (unsigned face = 0; face < 6; ++face) {
      if (!(mask >> face & 1)) continue;
      std::array<unsigned, 3> at{1, 1, 1};
      at[face / 2] += face % 2 ? 1u : ~0u;
      split[2].push_back(code(at[0], at[1], at[2]));
    }
    std::sort(split[2].begin(), split[2].end());
    balance(split);
    Context context;
    expect_sound(dualize(leaves_of(split), context).mesh);
  }
}

// Eight triangles with sizes up to a factor 16 apart: the trees that real work makes.
TEST(Dual, OfAnOctreeRoundASurfaceIsASoundHexMesh) {
  TriangleSoup soup;
  soup.points = {{1, 0, 0}, {-1, 0, 0}, {0, 1, 0}, {0, -1, 0}, {0, 0, 1}, {0, 0, -1}};
  soup.triangles = {{0, 2, 4}, {2, 1, 4}, {1, 3, 4}, {3, 0, 4}, {2, 0, 5}, {1, 2, 5}, {3, 1, 5}, {0, 3, 5}};
  soup.patch.assign(8, 0);
  soup.patch_names = {"wall"};
  Context context;
  const Surface surface = condition(soup, context);
  SizeField sizes;
  sizes.max_size = 0.2;
  for (const double size : {0.02, 0.16, 0.04, 0.08, 0.03, 0.1, 0.01, 0.07}) sizes.at_triangle.push_back(size);
  Octree octree = refine_octree(surface, sizes, {}, context);
  EXPECT_GT(dualize(octree, context).mesh.hexes.size(), 0u);
  octree.outside.clear();  // the soundness of the whole is easier to tell
  expect_sound(dualize(octree, context).mesh);
}

TEST(Dual, OfASingleBlockIsOneHex) {
  Context context;
  const Dual dual = dualize(leaves_of({}), context);
  EXPECT_EQ(dual.mesh.hexes.size(), 1u);
  EXPECT_EQ(dual.mesh.position.size(), 8u);
  expect_sound(dual.mesh);
}

TEST(Dual, IsTheSameForAnyThreadCount) {
  const Octree octree = random_octree(99, 6, 0.2);
  Context context;
  const Dual expected = dualize(octree, context);
  for (const std::size_t threads : {1u, 2u, 4u}) {
    const tbb::global_control limit(tbb::global_control::max_allowed_parallelism, threads);
    const Dual dual = dualize(octree, context);
    EXPECT_TRUE(dual.mesh.hexes == expected.mesh.hexes);
    EXPECT_TRUE(dual.cell_size == expected.cell_size);
    ASSERT_EQ(dual.mesh.position.size(), expected.mesh.position.size());
    EXPECT_EQ(std::memcmp(dual.mesh.position.data(), expected.mesh.position.data(), sizeof(Vec3) * expected.mesh.position.size()), 0);
  }
}

TEST(Dual, CarriesCellSizeAndCutOfTheBlock) {
  Octree octree = random_octree(7, 4, 0.3);
  for (std::size_t b = 0; b < octree.block_count(); ++b) octree.cut[b] = b % 3 == 0;
  Context context;
  const Dual dual = dualize(octree, context);
  for (const VertexId v : dual.mesh.position.ids()) {
    const Vec3 grid =
        (dual.mesh.position[v] - octree.origin) / octree.root_size * static_cast<double>(std::int64_t{1} << Octree::kMaxLevel);
    const std::int64_t leaf =
        find_leaf(octree, static_cast<std::int64_t>(grid[0]), static_cast<std::int64_t>(grid[1]), static_cast<std::int64_t>(grid[2]));
    ASSERT_GE(leaf, 0);
    ASSERT_EQ(dual.cut[v], octree.cut[static_cast<std::size_t>(leaf)]);
    ASSERT_FLOAT_EQ(dual.cell_size[v], static_cast<float>(octree.cell_size(octree.level[static_cast<std::size_t>(leaf)])));
  }
}

}  // namespace
}  // namespace strata
