#include "core/carve/colour.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "core/base/context.h"
#include "core/base/diagnostic.h"
#include "core/base/parallel.h"
#include "core/carve/triangle_sides.h"
#include "core/mesh/hex.h"

namespace strata {
namespace {

constexpr double kHair = 1e-6;         // of an edge: a node on the surface must not leak from one side to the other
constexpr std::int32_t kPocket = 8;    // nodes: smaller components are no regions
constexpr double kClearlyInside = 0.75;  // winding number that tells a leak from noise round an open border
constexpr double kMostOpen = 0.12;     // of a region's border: more is not a hole to be closed but a side that is missing
constexpr std::size_t kLeakSamples = 4096;
constexpr std::size_t kNearestNodes = 64;  // tried for each seed point: enough that one sees it past a thin wall

// An edge between two nodes near the surface, and the triangle that cuts it, if any.
struct Link {
  VertexId a, b;
  TriangleId hit;
};

std::optional<Locator::Hit> crossing(const Locator& locator, const Vec3& from, const Vec3& to) {
  const Vec3 d = to - from;
  return locator.first_hit(from - kHair * d, d, 1 + 2 * kHair);
}

// Nodes that lie on the surface and the triangle under them. They see one another along it and would flood a region of their own.
IdMap<VertexId, TriangleId> find_triangles_under_nodes(const Dual& dual, const Locator& locator) {
  IdMap<VertexId, TriangleId> under(dual.mesh.position.size());
  parallel_for(
      under.size(),
      [&](std::size_t i) {
        const VertexId v(i);
        if (dual.cut[v] == 0) return;
        const double hair = kHair * static_cast<double>(dual.cell_size[v]);
        under[v] = locator.closest(dual.mesh.position[v], hair).triangle;
      },
      256);
  return under;
}

std::vector<Link> links_near_surface(const Dual& dual, const Locator& locator) {
  std::vector<std::pair<VertexId, VertexId>> pairs;
  for (const HexVertices& hex : dual.mesh.hexes)
    for (const auto& edge : kHexEdges) {
      const VertexId a = hex[static_cast<std::size_t>(edge[0])], b = hex[static_cast<std::size_t>(edge[1])];
      if (dual.cut[a] != 0 && dual.cut[b] != 0) pairs.emplace_back(std::min(a, b), std::max(a, b));
    }
  parallel_sort(pairs.begin(), pairs.end());
  pairs.erase(std::unique(pairs.begin(), pairs.end()), pairs.end());
  const IdMap<VertexId, TriangleId> under = find_triangles_under_nodes(dual, locator);
  std::vector<Link> links(pairs.size());
  parallel_for(
      pairs.size(),
      [&](std::size_t i) {
        const auto [a, b] = pairs[i];
        links[i] = {a, b, under[a].valid() ? under[a] : under[b]};
        if (links[i].hit.valid()) return;
        const auto hit = crossing(locator, dual.mesh.position[a], dual.mesh.position[b]);
        links[i] = {a, b, hit ? hit->triangle : TriangleId{}};
      },
      128);
  return links;
}

// Components numbered by their smallest node.
struct Components {
  IdMap<VertexId, std::int32_t> of;
  std::vector<std::int32_t> size;
};

Components flood(const Dual& dual, const std::vector<Link>& links, const std::vector<std::uint8_t>& side) {
  const std::size_t nodes = dual.mesh.position.size();
  std::vector<std::int32_t> parent(nodes);
  for (std::size_t i = 0; i < nodes; ++i) parent[i] = static_cast<std::int32_t>(i);
  const auto root = [&](std::int32_t i) {
    while (parent[static_cast<std::size_t>(i)] != i) {
      auto& p = parent[static_cast<std::size_t>(i)];
      p = parent[static_cast<std::size_t>(p)];
      i = p;
    }
    return i;
  };
  const auto join = [&](VertexId a, VertexId b) {
    if (!side.empty() && side[a.index()] != side[b.index()]) return;
    const std::int32_t ra = root(a.value), rb = root(b.value);
    parent[static_cast<std::size_t>(std::max(ra, rb))] = std::min(ra, rb);
  };
  for (const HexVertices& hex : dual.mesh.hexes)
    for (const auto& edge : kHexEdges) {
      const VertexId a = hex[static_cast<std::size_t>(edge[0])], b = hex[static_cast<std::size_t>(edge[1])];
      if (dual.cut[a] == 0 || dual.cut[b] == 0) join(a, b);
    }
  for (const Link& link : links)
    if (!link.hit.valid()) join(link.a, link.b);
  Components result;
  result.of.resize(nodes);
  for (std::size_t i = 0; i < nodes; ++i) {
    const std::int32_t r = root(static_cast<std::int32_t>(i));
    if (r == static_cast<std::int32_t>(i)) {
      result.of[VertexId(i)] = static_cast<std::int32_t>(result.size.size());
      result.size.push_back(0);
    } else {
      result.of[VertexId(i)] = result.of[VertexId(r)];
    }
    ++result.size[static_cast<std::size_t>(result.of[VertexId(i)])];
  }
  return result;
}

// Per component: 1 when it holds a node known to lie outside or, where nothing is known, one on the border of the mesh, which is
// clear of the surface.
std::vector<std::uint8_t> find_outside(const Dual& dual, const Components& components) {
  std::vector<std::uint8_t> outside(components.size.size(), 0);
  const auto mark = [&](VertexId v) { outside[static_cast<std::size_t>(components.of[v])] = 1; };
  for (VertexId v : dual.outside.ids())
    if (dual.outside[v] != 0) mark(v);
  if (!dual.outside.empty()) return outside;
  Box box;
  for (const Vec3& p : dual.mesh.position) box.add(p);
  for (VertexId v : dual.mesh.position.ids()) {
    const Vec3& p = dual.mesh.position[v];
    if ((p.array() == box.min.array()).any() || (p.array() == box.max.array()).any()) mark(v);
  }
  return outside;
}

// Nodes of outside components that the surface winds round: a flood that came through a hole. Empty: no leak.
std::vector<std::uint8_t> leaked_side(const Dual& dual, const Components& components, const std::vector<std::uint8_t>& outside,
                                      const Locator& locator) {
  const auto is_outside = [&](std::size_t i) { return outside[static_cast<std::size_t>(components.of[VertexId(i)])] != 0; };
  // An open shell may be turned inside out as a whole: what counts is that the surface winds round the node.
  const auto winding = [&](std::size_t i) { return std::abs(locator.winding_number(dual.mesh.position[VertexId(i)])); };
  std::vector<std::size_t> candidates;
  for (std::size_t i = 0; i < dual.cut.size(); ++i)
    if (is_outside(i)) candidates.push_back(i);
  const std::size_t stride = candidates.size() / kLeakSamples + 1;
  bool leaks = false;
  for (std::size_t i = 0; i < candidates.size() && !leaks; i += stride) leaks = winding(candidates[i]) > kClearlyInside;
  if (!leaks) return {};
  std::vector<std::uint8_t> side(dual.mesh.position.size(), 0);
  parallel_for(side.size(), [&](std::size_t i) { side[i] = is_outside(i) && winding(i) > 0.5; }, 128);
  return side;
}

// How much of a component's border is no surface but a hole that the winding number closes.
struct Opening {
  double hole = 0, wall = 0;  // areas
  Box box;                    // of the hole, working frame
  [[nodiscard]] bool gapes() const { return hole > kMostOpen * (hole + wall); }
};
std::vector<Opening> measure_openings(const Dual& dual, const Components& components, const std::vector<std::uint8_t>& side,
                                      const std::vector<Link>& links) {
  std::vector<Opening> openings(components.size.size());
  // The component on the inner side of a border, and the share of area of an edge that crosses the border.
  const auto opening = [&](VertexId a, VertexId b) -> Opening& {
    return openings[static_cast<std::size_t>(components.of[side[a.index()] != 0 ? a : b])];
  };
  const auto area = [&](VertexId a, VertexId b) { return static_cast<double>(dual.cell_size[a]) * static_cast<double>(dual.cell_size[b]); };
  constexpr double kHexesPerEdge = 4;
  for (const HexVertices& hex : dual.mesh.hexes)
    for (const auto& edge : kHexEdges) {
      const VertexId a = hex[static_cast<std::size_t>(edge[0])], b = hex[static_cast<std::size_t>(edge[1])];
      if (side[a.index()] != side[b.index()] && (dual.cut[a] == 0 || dual.cut[b] == 0)) {
        opening(a, b).hole += area(a, b) / kHexesPerEdge;
        opening(a, b).box.add(Vec3(0.5 * (dual.mesh.position[a] + dual.mesh.position[b])));
      }
    }
  for (const Link& link : links) {
    if (side[link.a.index()] == side[link.b.index()]) continue;
    Opening& o = opening(link.a, link.b);
    (link.hit.valid() ? o.wall : o.hole) += area(link.a, link.b);
    if (!link.hit.valid()) o.box.add(Vec3(0.5 * (dual.mesh.position[link.a] + dual.mesh.position[link.b])));
  }
  return openings;
}

std::string point_text(const Vec3& p) {
  return "(" + std::to_string(p.x()) + ", " + std::to_string(p.y()) + ", " + std::to_string(p.z()) + ")";
}

[[noreturn]] void throw_no_region(Reason reason, std::string message, std::string field, const Box& box) {
  Diagnostic diagnostic;
  diagnostic.reason = reason;
  diagnostic.message = std::move(message);
  diagnostic.field = std::move(field);
  diagnostic.box = box;
  throw MeshError(Failure::InvalidInput, std::move(diagnostic));
}

[[noreturn]] void throw_open(const Opening& opening, const Surface& surface, std::string field) {
  Diagnostic diagnostic;
  diagnostic.reason = Reason::SurfaceNotClosed;
  diagnostic.field = std::move(field);
  diagnostic.box.add(surface.frame.to_input(opening.box.min));
  diagnostic.box.add(surface.frame.to_input(opening.box.max));
  const double percent = std::round(100 * opening.hole / (opening.hole + opening.wall));
  for (TriangleId t : surface.triangles.ids())
    for (std::size_t i = 0; i < 3; ++i) {
      if (surface.neighbours[t][i].valid()) continue;
      ++diagnostic.count;
      if (diagnostic.triangles.size() < Diagnostic::kMaxListed &&
          (diagnostic.triangles.empty() || diagnostic.triangles.back() != surface.source[t]))
        diagnostic.triangles.push_back(surface.source[t]);
    }
  diagnostic.values = {{"open_percent", percent}, {"open_edges", static_cast<double>(diagnostic.count)}};
  diagnostic.message = "the surface is not closed: a hole near " + point_text(diagnostic.box.centre()) + " leaves " +
                       std::to_string(static_cast<int>(percent)) + " % of the volume's border open (" + std::to_string(diagnostic.count) +
                       " open edges in all)";
  throw MeshError(Failure::InvalidInput, std::move(diagnostic));
}

// The component of the nearest node that sees the point, pockets only when nothing else does; -1: none sees it.
std::int32_t component_of_point(const Vec3& p, const Dual& dual, const Components& components, const Locator& locator) {
  std::vector<std::pair<double, VertexId>> nearest;
  nearest.reserve(dual.mesh.position.size());
  for (VertexId v : dual.mesh.position.ids()) nearest.emplace_back((dual.mesh.position[v] - p).squaredNorm(), v);
  const std::size_t tried = std::min(kNearestNodes, nearest.size());
  std::partial_sort(nearest.begin(), nearest.begin() + static_cast<std::ptrdiff_t>(tried), nearest.end());
  std::int32_t pocket = -1;
  for (std::size_t i = 0; i < tried; ++i) {
    if (!sees(locator, p, dual.mesh.position[nearest[i].second])) continue;
    const std::int32_t c = components.of[nearest[i].second];
    if (components.size[static_cast<std::size_t>(c)] >= kPocket) return c;
    if (pocket < 0) pocket = c;
  }
  return pocket;
}

// Components next to the outside, also over nodes that lie on the surface.
std::vector<std::uint8_t> next_to_outside(const Components& components, const std::vector<std::uint8_t>& outside,
                                          const std::vector<Link>& links) {
  std::vector<std::uint8_t> next(outside.size(), 0);
  for (int pass = 0; pass < 2; ++pass) {
    const std::vector<std::uint8_t> before = next;
    const auto is_source = [&](std::int32_t c) {
      const auto i = static_cast<std::size_t>(c);
      return outside[i] != 0 || (before[i] != 0 && components.size[i] < kPocket);
    };
    for (const Link& link : links) {
      const std::int32_t a = components.of[link.a], b = components.of[link.b];
      if (is_source(a)) next[static_cast<std::size_t>(b)] = 1;
      if (is_source(b)) next[static_cast<std::size_t>(a)] = 1;
    }
  }
  return next;
}

struct Numbering {
  std::vector<std::int32_t> region;  // per component
  std::int32_t count = 0;
};

Numbering number_by_points(const Dual& dual, const Components& components, const std::vector<std::uint8_t>& outside,
                           const std::vector<Opening>& openings, const Surface& surface, const Locator& locator,
                           const std::vector<Vec3>& points, Context& context) {
  Numbering numbering{std::vector<std::int32_t>(outside.size(), kVoid), static_cast<std::int32_t>(points.size())};
  for (std::size_t i = 0; i < points.size(); ++i) {
    const std::string name = "seed point " + std::to_string(i + 1) + " " + point_text(surface.frame.to_input(points[i]));
    const std::string field = "volume.points[" + std::to_string(i) + "]";
    Box box;
    box.add(surface.frame.to_input(points[i]));
    const std::int32_t c = component_of_point(points[i], dual, components, locator);
    if (locator.closest(points[i], kHair).triangle.valid())
      throw_no_region(Reason::RegionNotFound, name + " lies on the surface itself: move it into the volume", field, box);
    if (c < 0) throw_no_region(Reason::RegionTooThin, name + " lies on the surface or in a gap narrower than the cells", field, box);
    if (outside[static_cast<std::size_t>(c)] != 0) {
      const bool leak = !surface.closed && std::abs(locator.winding_number(points[i])) > 0.5;
      throw_no_region(Reason::RegionNotFound,
                      name + (leak ? " leaks out: the surface round it is not closed" : " lies outside every closed surface"), field, box);
    }
    if (!openings.empty() && openings[static_cast<std::size_t>(c)].gapes())
      throw_open(openings[static_cast<std::size_t>(c)], surface, field);
    auto& region = numbering.region[static_cast<std::size_t>(c)];
    if (region < 0) {
      region = static_cast<std::int32_t>(i);
      continue;
    }
    Diagnostic same;
    same.reason = Reason::RegionNotFound;
    same.severity = Severity::Warning;
    same.message = name + " lies in the same region as seed point " + std::to_string(region + 1) + ": no region of its own";
    same.field = field;
    same.box = box;
    context.adjusted(std::move(same));
  }
  return numbering;
}

// What gapes is no bounded region; when nothing else is there, the widest opening is to blame.
Numbering number_bounded(const Components& components, const std::vector<std::uint8_t>& outside, const std::vector<Opening>& openings,
                         const Surface& surface, const std::vector<Link>& links, VolumeMode mode) {
  Numbering numbering{std::vector<std::int32_t>(outside.size(), kVoid), 0};
  std::vector<std::uint8_t> wanted(outside.size(), 1);
  if (mode == VolumeMode::Outermost) wanted = next_to_outside(components, outside, links);
  const Opening* widest = nullptr;
  for (std::size_t c = 0; c < outside.size(); ++c) {
    if (outside[c] != 0 || wanted[c] == 0 || components.size[c] < kPocket) continue;
    if (!openings.empty() && openings[c].gapes()) {
      if (widest == nullptr || openings[c].hole > widest->hole) widest = &openings[c];
      continue;
    }
    if (mode == VolumeMode::Solid) {
      numbering.region[c] = 0;
      numbering.count = 1;
    } else {
      numbering.region[c] = numbering.count++;
    }
  }
  if (numbering.count == 0 && widest != nullptr) throw_open(*widest, surface, "volume");
  return numbering;
}

// What the ends of cut links see of the surface: from one end the triangle that was hit, from the other the one hit from there.
std::vector<Sighting> sightings_of(const Dual& dual, const std::vector<Link>& links, const IdMap<VertexId, std::int32_t>& colour,
                                   const Surface& surface, const Locator& locator) {
  std::vector<std::array<Sighting, 2>> pairs(links.size());
  parallel_for(
      links.size(),
      [&](std::size_t i) {
        const Link& link = links[i];
        if (!link.hit.valid()) return;
        const Vec3 &a = dual.mesh.position[link.a], &b = dual.mesh.position[link.b];
        const auto sighting = [&](TriangleId t, VertexId from, const Vec3& along) {
          if (colour[from] == kUndecided) return Sighting{};
          return Sighting{t, along.dot(surface.normal[t]) < 0 ? 1 : 0, colour[from]};
        };
        pairs[i][0] = sighting(link.hit, link.a, b - a);
        if (const auto hit = crossing(locator, b, a)) pairs[i][1] = sighting(hit->triangle, link.b, a - b);
      },
      128);
  std::vector<Sighting> sightings;
  for (const auto& pair : pairs)
    for (const Sighting& s : pair)
      if (s.triangle.valid()) sightings.push_back(s);
  return sightings;
}

}  // namespace

bool sees(const Locator& locator, const Vec3& from, const Vec3& to) {
  // A seed or centre may itself lie within a hair of the surface, so only the far end is lengthened.
  const Vec3 d = to - from;
  return !(d.squaredNorm() > 0) || !locator.first_hit(from, d, 1 + kHair);
}

NodeColours colour_nodes(const Dual& dual, const Surface& surface, const Locator& locator, const VolumeSpec& volume, Context& context) {
  const std::vector<Link> links = links_near_surface(dual, locator);
  context.checkpoint();
  Components components = flood(dual, links, {});
  std::vector<std::uint8_t> outside = find_outside(dual, components);
  std::vector<Opening> openings;  // empty: no leak
  if (!surface.closed) {
    if (const auto side = leaked_side(dual, components, outside, locator); !side.empty()) {
      // Flood again, with the winding number's half level as a wall across the holes.
      Components walled = flood(dual, links, side);
      std::vector<std::uint8_t> still_outside(walled.size.size(), 0);
      for (VertexId v : dual.mesh.position.ids())
        if (side[v.index()] == 0 && outside[static_cast<std::size_t>(components.of[v])] != 0)
          still_outside[static_cast<std::size_t>(walled.of[v])] = 1;
      components = std::move(walled);
      openings = measure_openings(dual, components, side, links);
      outside = std::move(still_outside);
    }
  }
  context.checkpoint();
  const Numbering numbering = volume.mode == VolumeMode::Points
                                  ? number_by_points(dual, components, outside, openings, surface, locator, volume.points, context)
                                  : number_bounded(components, outside, openings, surface, links, volume.mode);
  if (numbering.count == 0)
    throw_no_region(
        surface.closed ? Reason::RegionTooThin : Reason::RegionNotFound,
        surface.closed ? "no volume is enclosed by the surface at this cell size" : "no volume is enclosed: the surface is not closed",
        "volume", {});
  NodeColours result;
  result.regions = numbering.count;
  result.colour.resize(dual.mesh.position.size());
  for (VertexId v : dual.mesh.position.ids()) {
    const auto c = static_cast<std::size_t>(components.of[v]);
    const std::int32_t region = numbering.region[c];
    result.colour[v] = region >= 0 ? region : (outside[c] == 0 && components.size[c] < kPocket ? kUndecided : kVoid);
  }
  result.bounds = judge_triangles(surface, sightings_of(dual, links, result.colour, surface, locator));
  return result;
}

}  // namespace strata
