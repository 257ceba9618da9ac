#include "core/quality/validity.h"

#include <algorithm>
#include <atomic>
#include <cmath>
#include <cstdint>
#include <limits>
#include <span>
#include <string>
#include <utility>
#include <vector>

#include "core/base/parallel.h"
#include "core/mesh/adjacency.h"

namespace strata {
namespace {

using Found = std::optional<Diagnostic>;
constexpr std::size_t kNone = std::numeric_limits<std::size_t>::max();

// The smallest i that fails: the same for any thread count.
template <class Fails>
std::size_t first_failure(std::size_t count, const Fails& fails) {
  return parallel_reduce(
      count, kNone, [&](std::size_t i) { return fails(i) ? i : kNone; }, [](std::size_t a, std::size_t b) { return std::min(a, b); });
}

Diagnostic broken(std::string message) {
  Diagnostic diagnostic;
  diagnostic.reason = Reason::InvariantViolated;
  diagnostic.message = std::move(message);
  return diagnostic;
}
template <class Vertices>
Diagnostic broken_at(const HexMesh& mesh, const Vertices& vertices, std::string message) {
  Diagnostic diagnostic = broken(std::move(message));
  for (VertexId v : vertices) diagnostic.box.add(mesh.position[v]);
  return diagnostic;
}
std::string hex_name(std::size_t h) { return "hex " + std::to_string(h); }

Found check_sizes(const HexMesh& mesh) {
  if (mesh.attachment.size() != mesh.position.size()) return broken("vertex arrays differ in size");
  if (mesh.region.size() != mesh.hexes.size() || mesh.layer.size() != mesh.hexes.size()) return broken("hex arrays differ in size");
  if (mesh.patch.size() != mesh.quads.size() || mesh.chart.size() != mesh.quads.size()) return broken("quad arrays differ in size");
  if (mesh.hexes.empty()) return broken("the mesh is empty");
  return {};
}

Found check_indices(const HexMesh& mesh, bool labelled) {
  const auto outside = [&](VertexId v) { return !v.valid() || v.index() >= mesh.position.size(); };
  const std::size_t vertex = first_failure(mesh.position.size(), [&](std::size_t v) { return !mesh.position[VertexId(v)].allFinite(); });
  if (vertex != kNone) return broken("vertex " + std::to_string(vertex) + " has a coordinate that is not finite");
  const std::size_t hex = first_failure(mesh.hexes.size(), [&](std::size_t h) {
    const HexVertices& v = mesh.hexes[HexId(h)];
    return std::any_of(v.begin(), v.end(), outside) || !mesh.region[HexId(h)].valid();
  });
  if (hex != kNone) return broken(hex_name(hex) + " has a vertex or a region out of range");
  const std::size_t quad = first_failure(mesh.quads.size(), [&](std::size_t q) {
    const QuadVertices& v = mesh.quads[QuadId(q)];
    return std::any_of(v.begin(), v.end(), outside) || (labelled && !mesh.patch[QuadId(q)].valid());
  });
  if (quad != kNone) return broken("quad " + std::to_string(quad) + " has a vertex or a patch out of range");
  return {};
}

Found check_distinct(const HexMesh& mesh) {
  const std::size_t hex = first_failure(mesh.hexes.size(), [&](std::size_t h) {
    const HexVertices& v = mesh.hexes[HexId(h)];
    bool twice = false;  // no early way out: 28 comparisons in a row are faster than the branches
    for (std::size_t i = 0; i < 8; ++i)
      for (std::size_t j = 0; j < i; ++j) twice |= v[i] == v[j];
    return twice;
  });
  if (hex != kNone) return broken_at(mesh, mesh.hexes[HexId(hex)], hex_name(hex) + " has a vertex twice");
  return {};
}

// Faces of hexes (6 h + face) and quads (6 hexes + q) in one numbering, in buckets by their smallest vertex: an entry takes four bytes, a
// bucket holds a handful, and matching needs neither sorting nor hashing.
class FaceTable {
 public:
  using Number = std::uint32_t;  // up to 700 million hexes

  explicit FaceTable(const HexMesh& mesh) : mesh_(mesh), hex_faces_(6 * mesh.hexes.size()), offset_(mesh.position.size() + 1, 0) {
    const std::size_t count = hex_faces_ + mesh.quads.size();
    for_each_smallest([&](VertexId v, std::size_t) { std::atomic_ref(offset_[v.index()]).fetch_add(1, std::memory_order_relaxed); });
    // Each count sits in its own entry; the scan makes it the bucket's end, filling counts back down to its beginning.
    std::uint32_t sum = 0;
    for (std::uint32_t& o : offset_) o = sum += o;
    entries_.resize(count);
    for_each_smallest([&](VertexId v, std::size_t number) {
      const std::uint32_t at = std::atomic_ref(offset_[v.index()]).fetch_sub(1, std::memory_order_relaxed) - 1;
      entries_[at] = static_cast<Number>(number);
    });
  }

  [[nodiscard]] std::size_t bucket_count() const { return mesh_.position.size(); }
  [[nodiscard]] bool is_quad(std::size_t i) const { return i >= hex_faces_; }
  [[nodiscard]] HexId hex(std::size_t i) const { return HexId(i / 6); }
  [[nodiscard]] QuadId quad(std::size_t i) const { return QuadId(i - hex_faces_); }
  [[nodiscard]] QuadVertices vertices(std::size_t i) const {
    return is_quad(i) ? mesh_.quads[quad(i)] : face_vertices(mesh_.hexes[hex(i)], static_cast<int>(i % 6));
  }
  [[nodiscard]] std::span<const Number> bucket(std::size_t v) const {
    return {entries_.data() + offset_[v], entries_.data() + offset_[v + 1]};
  }

 private:
  // body(smallest vertex, number) for every face and quad.
  template <class Body>
  void for_each_smallest(const Body& body) const {
    const auto smallest = [](const QuadVertices& q) { return std::min(std::min(q[0], q[1]), std::min(q[2], q[3])); };
    parallel_for(mesh_.hexes.size(), [&](std::size_t h) {
      const HexVertices& hex = mesh_.hexes[HexId(h)];
      for (int f = 0; f < 6; ++f) body(smallest(face_vertices(hex, f)), 6 * h + static_cast<std::size_t>(f));
    });
    parallel_for(mesh_.quads.size(), [&](std::size_t q) { body(smallest(mesh_.quads[QuadId(q)]), hex_faces_ + q); });
  }

  const HexMesh& mesh_;
  std::size_t hex_faces_;
  std::vector<std::uint32_t> offset_;
  std::vector<Number> entries_;
};

// A face turned so that its smallest vertex comes first.
struct TurnedFace {
  VertexId next, diagonal, previous;
  FaceTable::Number number = 0;
};
TurnedFace turned(const QuadVertices& q, FaceTable::Number number) {
  const auto s = static_cast<std::size_t>(std::min_element(q.begin(), q.end()) - q.begin());
  return {q[(s + 1) & 3], q[(s + 2) & 3], q[(s + 3) & 3], number};
}
bool same_turn(const TurnedFace& a, const TurnedFace& b) {
  return a.diagonal == b.diagonal && a.next == b.next && a.previous == b.previous;
}
bool opposite_turn(const TurnedFace& a, const TurnedFace& b) {
  return a.diagonal == b.diagonal && a.next == b.previous && a.previous == b.next;
}

// The hexes behind a quad and in front of it (the normal points to the front).
struct Sides {
  HexId back, front;
};
using AllSides = IdMap<QuadId, Sides>;

// Everything on one set of four vertices.
struct Meeting {
  std::array<TurnedFace, 2> hex;  // the first two
  TurnedFace quad;
  int hexes = 0, quads = 0;
};

const char* fault_of(const FaceTable& table, const IdMap<HexId, RegionId>& region, const Meeting& m) {
  if (m.hexes == 0) return "a quad lies on no face";
  if (m.hexes > 2) return "a face has more than two hexes";
  if (m.quads > 1) return "two quads lie on one face";
  const RegionId first = region[table.hex(m.hex[0].number)];
  if (m.hexes == 1) {
    if (m.quads == 0) return "a boundary face has no quad";
    return same_turn(m.quad, m.hex[0]) ? nullptr : "a boundary quad points inwards";
  }
  if (!opposite_turn(m.hex[0], m.hex[1])) return "two hexes lie on the same side of their face";
  const RegionId second = region[table.hex(m.hex[1].number)];
  if (first == second) return m.quads == 0 ? nullptr : "a quad lies inside a region";
  if (m.quads == 0) return "an interface face has no quad";
  return same_turn(m.quad, m.hex[second < first ? 1 : 0]) ? nullptr : "an interface quad points out of the larger region";
}

// What is wrong in a bucket, and on which face; notes the sides of its quads when nothing is.
struct FaceFault {
  const char* what = nullptr;
  FaceTable::Number number = 0;
};
FaceFault match(const HexMesh& mesh, const FaceTable& table, std::span<const FaceTable::Number> bucket, std::vector<TurnedFace>& faces,
                AllSides& sides) {
  faces.clear();
  for (FaceTable::Number i : bucket) faces.push_back(turned(table.vertices(i), i));
  while (!faces.empty()) {
    const TurnedFace face = faces.back();
    Meeting meeting;
    for (std::size_t i = faces.size(); i-- > 0;) {
      if (!same_turn(faces[i], face) && !opposite_turn(faces[i], face)) continue;
      if (table.is_quad(faces[i].number)) {
        meeting.quad = faces[i];
        ++meeting.quads;
      } else if (meeting.hexes++ < 2) {
        meeting.hex[static_cast<std::size_t>(meeting.hexes - 1)] = faces[i];
      }
      faces[i] = faces.back();
      faces.pop_back();
    }
    if (const char* what = fault_of(table, mesh.region, meeting)) return {what, face.number};
    if (meeting.quads == 1)
      for (int i = 0; i < meeting.hexes; ++i) {
        const TurnedFace& at = meeting.hex[static_cast<std::size_t>(i)];
        Sides& s = sides[table.quad(meeting.quad.number)];
        (same_turn(at, meeting.quad) ? s.back : s.front) = table.hex(at.number);
      }
  }
  return {};
}

Found check_faces(const HexMesh& mesh, AllSides& sides) {
  const FaceTable table(mesh);
  const std::size_t blocks = (table.bucket_count() + kGrain - 1) / kGrain;
  std::vector<std::size_t> first(blocks, kNone);
  parallel_blocks(table.bucket_count(), [&](std::size_t begin, std::size_t end) {
    std::vector<TurnedFace> faces;
    for (std::size_t b = begin; b < end && first[begin / kGrain] == kNone; ++b)
      if (match(mesh, table, table.bucket(b), faces, sides).what != nullptr) first[begin / kGrain] = b;
  });
  const std::size_t bucket = blocks == 0 ? kNone : *std::min_element(first.begin(), first.end());
  if (bucket == kNone) return {};
  // Buckets were filled in any order.
  std::vector<FaceTable::Number> numbers(table.bucket(bucket).begin(), table.bucket(bucket).end());
  std::sort(numbers.begin(), numbers.end());
  std::vector<TurnedFace> faces;
  const FaceFault fault = match(mesh, table, numbers, faces, sides);
  return broken_at(mesh, table.vertices(fault.number), std::string(fault.what) + ", at vertex " + std::to_string(bucket));
}

// Layers that cross give a hex up to three quads; in the volume the buffer layer leaves one.
Found check_quads_per_hex(const HexMesh& mesh, const AllSides& sides, int most) {
  const int most_in_layers = std::max(3, most);
  IdMap<HexId, std::int8_t> count(mesh.hexes.size(), 0);
  for (const Sides& s : sides)
    for (HexId h : {s.back, s.front})
      if (h.valid()) ++count[h];
  const std::size_t hex =
      first_failure(mesh.hexes.size(), [&](std::size_t h) { return count[HexId(h)] > (mesh.layer[HexId(h)] > 0 ? most_in_layers : most); });
  if (hex == kNone) return {};
  return broken_at(mesh, mesh.hexes[HexId(hex)], hex_name(hex) + " has " + std::to_string(count[HexId(hex)]) + " quads");
}

Found check_boundary_edges(const HexMesh& mesh, const AllSides& sides) {
  struct Side {
    VertexId low, high;
    RegionId region;
    auto operator<=>(const Side&) const = default;
  };
  std::vector<Side> edges;
  edges.reserve(4 * mesh.quads.size());
  for (QuadId q : mesh.quads.ids())
    for (HexId h : {sides[q].back, sides[q].front}) {
      if (!h.valid()) continue;
      for (std::size_t i = 0; i < 4; ++i) {
        const auto [low, high] = std::minmax(mesh.quads[q][i], mesh.quads[q][(i + 1) & 3]);
        edges.push_back({low, high, mesh.region[h]});
      }
    }
  parallel_sort(edges.begin(), edges.end());
  for (std::size_t i = 0, next = 0; i < edges.size(); i = next) {
    for (next = i + 1; next < edges.size() && edges[next] == edges[i];) ++next;
    if (next - i == 2) continue;
    return broken_at(mesh, std::array{edges[i].low, edges[i].high},
                     "boundary edge " + std::to_string(edges[i].low.value) + " " + std::to_string(edges[i].high.value) + " has " +
                         std::to_string(next - i) + " quads of one region");
  }
  return {};
}

bool clearly_positive(const Vec3& x, const Vec3& y, const Vec3& z) {
  return x.cross(y).dot(z) > kZeroProduct * std::sqrt(x.squaredNorm() * y.squaredNorm() * z.squaredNorm());
}

// The determinants at the corners and, by the principal axes, at the centre (Verdict SAND2007-1751).
bool positive(const HexMesh& mesh, HexId h) {
  const HexVertices& v = mesh.hexes[h];
  std::array<Vec3, 8> p;
  for (std::size_t i = 0; i < 8; ++i) p[i] = mesh.position[v[i]];
  for (std::size_t i = 0; i < 8; ++i) {
    const auto edge = [&](std::size_t k) -> Vec3 {
      const auto end = static_cast<std::uint8_t>(kHexCorners[i][k]);
      return p[std::size_t{end}] - p[i];
    };
    if (!clearly_positive(edge(0), edge(1), edge(2))) return false;
  }
  const Vec3 x = p[1] - p[0] + p[2] - p[3] + p[5] - p[4] + p[6] - p[7];
  const Vec3 y = p[3] - p[0] + p[2] - p[1] + p[7] - p[4] + p[6] - p[5];
  const Vec3 z = p[4] - p[0] + p[5] - p[1] + p[6] - p[2] + p[7] - p[3];
  return clearly_positive(x, y, z);
}

Found check_positive(const HexMesh& mesh) {
  const std::size_t hex = first_failure(mesh.hexes.size(), [&](std::size_t h) { return !positive(mesh, HexId(h)); });
  if (hex == kNone) return {};
  return broken_at(mesh, mesh.hexes[HexId(hex)], hex_name(hex) + " is not positive at each corner and its centre");
}

}  // namespace

std::optional<Diagnostic> check_mesh(const HexMesh& mesh, const Promises& promises) {
  if (Found found = check_sizes(mesh)) return found;
  if (Found found = check_indices(mesh, promises.labelled)) return found;
  if (Found found = check_distinct(mesh)) return found;
  AllSides sides(mesh.quads.size());
  if (Found found = check_faces(mesh, sides)) return found;
  if (Found found = check_quads_per_hex(mesh, sides, promises.quads_per_hex)) return found;
  if (Found found = check_boundary_edges(mesh, sides)) return found;
  return promises.positive ? check_positive(mesh) : Found{};
}

}  // namespace strata
