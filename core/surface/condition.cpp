// Reads downwards: check, frame, repairs, orientation, tables.
#include <algorithm>
#include <cmath>
#include <cstdio>
#include <utility>

#include "core/base/context.h"
#include "core/base/parallel.h"
#include "core/surface/draft.h"
#include "core/surface/surface.h"

namespace strata {
namespace {

// One vertex this many times further out than the typical one leaves nothing of the rest at any affordable cell size.
constexpr double kLargestCoordinate = 1e30;  // squares of lengths must not overflow in the float formats that read the mesh
constexpr double kOutlier = 1e6;

std::string text(double value) {
  char buffer[32];
  std::snprintf(buffer, sizeof buffer, "%.6g", value);
  return buffer;
}
std::string text(const Vec3& p) { return "(" + text(p.x()) + ", " + text(p.y()) + ", " + text(p.z()) + ")"; }

[[noreturn]] void refuse(Reason reason, std::string message, const Box& box = {}, std::vector<std::int64_t> triangles = {}) {
  Diagnostic d;
  d.reason = reason;
  d.severity = Severity::Error;
  d.message = std::move(message);
  d.box = box;
  d.count = static_cast<std::int64_t>(triangles.size());
  if (triangles.size() > Diagnostic::kMaxListed) triangles.resize(Diagnostic::kMaxListed);
  d.triangles = std::move(triangles);
  throw MeshError(Failure::InvalidInput, std::move(d));
}

void check_values(const TriangleSoup& soup) {
  if (soup.triangles.empty()) refuse(Reason::SurfaceEmpty, "the surface has no triangles");
  if (soup.patch.size() != soup.triangles.size())
    refuse(Reason::SurfaceIndexOutOfRange, "the surface has " + std::to_string(soup.triangles.size()) + " triangles but " +
                                               std::to_string(soup.patch.size()) + " patch references");
  const auto points = static_cast<std::int64_t>(soup.points.size());
  const auto patches = static_cast<std::int64_t>(soup.patch_names.size());
  for (std::size_t t = 0; t < soup.triangles.size(); ++t) {
    const auto id = static_cast<std::int64_t>(t);
    for (const std::int32_t p : soup.triangles[t]) {
      if (p < 0 || p >= points)
        refuse(Reason::SurfaceIndexOutOfRange,
               "triangle " + std::to_string(t) + " names point " + std::to_string(p) + " of " + std::to_string(points), {}, {id});
      if (!soup.points[static_cast<std::size_t>(p)].allFinite())
        refuse(Reason::SurfaceNonFinite, "point " + std::to_string(p) + " of triangle " + std::to_string(t) + " is not finite", {}, {id});
    }
    if (soup.patch[t] < 0 || soup.patch[t] >= patches)
      refuse(Reason::SurfaceIndexOutOfRange,
             "triangle " + std::to_string(t) + " names patch " + std::to_string(soup.patch[t]) + " of " + std::to_string(patches), {},
             {id});
  }
}

// The vertex that makes the box, when it lies kOutlier times further out than half of the vertices do.
void refuse_outliers(const TriangleSoup& soup) {
  const auto middle_of = [](std::vector<double> values) {
    const auto middle = values.begin() + static_cast<std::ptrdiff_t>(values.size() / 2);
    std::nth_element(values.begin(), middle, values.end());
    return *middle;
  };
  std::vector<char> used(soup.points.size(), 0);
  for (const auto& t : soup.triangles)
    for (const std::int32_t p : t) used[static_cast<std::size_t>(p)] = 1;
  Vec3 middle;
  std::vector<double> values;
  for (int i = 0; i < 3; ++i) {
    values.clear();
    for (std::size_t p = 0; p < used.size(); ++p)
      if (used[p]) values.push_back(soup.points[p][i]);
    middle[i] = middle_of(values);
  }
  values.clear();
  std::size_t worst = 0;
  double furthest = -1;
  for (std::size_t p = 0; p < used.size(); ++p) {
    if (!used[p]) continue;
    const double d = (soup.points[p] - middle).lpNorm<Eigen::Infinity>();
    values.push_back(d);
    if (d > furthest) {
      furthest = d;
      worst = p;
    }
  }
  const double typical = middle_of(values);
  if (!(furthest > kOutlier * typical) || !(typical > 0)) return;
  Box place;
  place.add(soup.points[worst]);
  refuse(Reason::SurfaceExtentUnusable,
         "vertex " + text(soup.points[worst]) + " lies " + text(furthest / typical) + " times further out than the typical vertex", place);
}

Draft framed(TriangleSoup& soup) {
  Box box;
  for (const auto& t : soup.triangles)
    for (const std::int32_t p : t) box.add(soup.points[static_cast<std::size_t>(p)]);
  if (const double largest = std::max(-box.min.minCoeff(), box.max.maxCoeff()); largest >= kLargestCoordinate)
    refuse(Reason::SurfaceExtentUnusable,
           "coordinates reach " + text(largest) + ", but must stay below " + text(kLargestCoordinate) + ": choose a larger unit", box);
  const Vec3 extent = box.extent();
  const double longest = extent.maxCoeff();
  if (!std::isfinite(longest) || !(longest > 0))
    refuse(Reason::SurfaceExtentUnusable, "the surface has no usable extent: its longest side is " + text(longest), box);
  int exponent = 0;
  if (std::frexp(longest, &exponent) == 0.5) --exponent;  // longest = m 2^e with m in [0.5, 1); the house wants (0.5, 1]
  Draft draft;
  draft.frame.scale = std::ldexp(1.0, -exponent);
  draft.frame.origin = 0.5 * box.min + 0.5 * box.max;
  if (!std::isnormal(draft.frame.scale))
    refuse(Reason::SurfaceExtentUnusable, "the surface's longest side, " + text(longest) + ", is out of range", box);
  if (extent.minCoeff() < kFlatDistance * longest)
    refuse(Reason::SurfaceExtentUnusable,
           "the surface is flat and bounds no volume: its box measures " + text(extent.x()) + " x " + text(extent.y()) + " x " +
               text(extent.z()),
           box);
  refuse_outliers(soup);
  draft.points = std::move(soup.points);
  // Unused points may be anything; they get no say and must not overflow.
  parallel_for(draft.points.size(), [&](std::size_t i) {
    const Vec3 p = draft.frame.to_work(draft.points[i]);
    draft.points[i] = p.allFinite() ? Vec3(p + Vec3::Zero()) : Vec3::Zero();  // -0 + 0 = 0: equal coordinates have equal bytes
  });
  draft.triangles = std::move(soup.triangles);
  draft.patch = std::move(soup.patch);
  draft.source.resize(draft.triangles.size());
  for (std::size_t t = 0; t < draft.source.size(); ++t) draft.source[t] = static_cast<std::int64_t>(t);
  return draft;
}

void report(Context& context, const Draft& draft, Repair repair, Reason reason, Severity severity, const std::string& what) {
  if (repair.count == 0) return;
  Diagnostic d;
  d.reason = reason;
  d.severity = severity;
  d.count = repair.count;
  d.box = draft.frame.to_input(repair.box);
  d.message = std::to_string(repair.count) + " " + what;
  if (!d.box.empty()) d.message += ", near " + text(d.box.centre());
  d.values = {{"count", static_cast<double>(repair.count)}};
  std::sort(repair.triangles.begin(), repair.triangles.end());
  repair.triangles.erase(std::unique(repair.triangles.begin(), repair.triangles.end()), repair.triangles.end());
  if (repair.triangles.size() > Diagnostic::kMaxListed) repair.triangles.resize(Diagnostic::kMaxListed);
  d.triangles = std::move(repair.triangles);
  context.adjusted(std::move(d));
}

void join(Repair& a, const Repair& b) {
  a.count += b.count;
  a.triangles.insert(a.triangles.end(), b.triangles.begin(), b.triangles.end());
  a.box.add(b.box);
}

void repair(Draft& draft, Context& context) {
  const std::int64_t read = static_cast<std::int64_t>(draft.size());
  weld_equal(draft);
  context.progress(0.3);
  const std::int64_t welded = weld_borders(draft);
  if (welded > 0)
    report(context, draft, {{}, {}, welded}, Reason::SurfaceNotClosed, Severity::Info, "border points were welded across small gaps");
  Repair degenerate = collapse_needles(draft);
  join(degenerate, drop_flat(draft));
  if (2 * degenerate.count > read)
    refuse(Reason::SurfaceExtentUnusable,
           std::to_string(degenerate.count) + " of " + std::to_string(read) +
               " triangles have no area at the precision of the coordinates; move the surface nearer to the origin or write more digits",
           draft.frame.to_input(degenerate.box), degenerate.triangles);
  report(context, draft, std::move(degenerate), Reason::SurfaceDegenerateTriangles, Severity::Info, "triangles without area were dropped");
  Duplicates duplicates = drop_duplicates(draft);
  report(context, draft, std::move(duplicates.same), Reason::SurfaceDuplicateTriangles, Severity::Info, "repeated triangles were dropped");
  report(context, draft, std::move(duplicates.opposite), Reason::SurfaceDuplicateTriangles, Severity::Info,
         "triangles lay face to face on others; one of each pair was kept");
  context.progress(0.5);
  report(context, draft, split_at_hanging_points(draft), Reason::SurfaceNotClosed, Severity::Info,
         "triangles were split at vertices that lay on their edges");
  report(context, draft, orient(draft), Reason::SurfaceInconsistentOrientation, Severity::Info, "triangles were turned round");
  report(context, draft, cap_openings(draft), Reason::SurfaceNotClosed, Severity::Warning,
         "openings of the surface were closed, with the patch of what is round them");
  report(context, draft, drop_sheets(draft), Reason::SurfaceSheetDropped, Severity::Warning,
         "triangles of open sheets that bound no volume were dropped");
  if (draft.size() == 0) refuse(Reason::SurfaceEmpty, "no triangle of the surface has an area");
}

// Triangles by patch, then by where they lie, each from its first corner in that order: what is numbered after them, such as charts and
// corners, does not depend on the order of the file.
void put_in_order(Draft& draft) {
  const auto before = [&](std::int32_t a, std::int32_t b) {
    const Vec3 &p = draft.points[static_cast<std::size_t>(a)], &q = draft.points[static_cast<std::size_t>(b)];
    return std::lexicographical_compare(p.data(), p.data() + 3, q.data(), q.data() + 3);
  };
  parallel_for(draft.size(), [&](std::size_t t) {
    auto& corners = draft.triangles[t];
    std::rotate(corners.begin(), std::min_element(corners.begin(), corners.end(), before), corners.end());
  });
  std::vector<std::size_t> order(draft.size());
  for (std::size_t t = 0; t < order.size(); ++t) order[t] = t;
  parallel_sort(order.begin(), order.end(), [&](std::size_t a, std::size_t b) {
    if (draft.patch[a] != draft.patch[b]) return draft.patch[a] < draft.patch[b];
    const auto &x = draft.triangles[a], &y = draft.triangles[b];
    for (std::size_t i = 0; i < 3; ++i) {
      if (before(x[i], y[i])) return true;
      if (before(y[i], x[i])) return false;
    }
    return draft.source[a] < draft.source[b];
  });
  const Draft from = draft;
  parallel_for(order.size(), [&](std::size_t t) {
    draft.triangles[t] = from.triangles[order[t]];
    draft.patch[t] = from.patch[order[t]];
    draft.source[t] = from.source[order[t]];
  });
}

void report_edges(const Draft& draft, const std::vector<Side>& sides, Context& context) {
  Repair open, crowded;
  for_each_edge(sides, [&](std::size_t first, std::size_t last) {
    if (last - first == 2) return;
    Repair& where = last - first == 1 ? open : crowded;
    ++where.count;
    for (std::size_t i = first; i < last; ++i) where.triangles.push_back(draft.source[static_cast<std::size_t>(sides[i].triangle)]);
    for (const std::int32_t p : {sides[first].low, sides[first].high}) where.box.add(draft.points[static_cast<std::size_t>(p)]);
  });
  report(context, draft, std::move(open), Reason::SurfaceNotClosed, Severity::Warning, "edges of the surface are open");
  report(context, draft, std::move(crowded), Reason::SurfaceNonManifold, Severity::Info, "edges have more than two triangles");
}

}  // namespace

void connect(Surface& surface) {
  std::vector<std::array<std::int32_t, 3>> triangles;
  triangles.reserve(surface.triangles.size());
  for (const TrianglePoints& t : surface.triangles) triangles.push_back({t[0].value, t[1].value, t[2].value});
  const std::vector<Side> sides = sorted_sides(triangles);
  surface.neighbours.assign(triangles.size(), EdgeNeighbours{});
  surface.closed = true;
  for_each_edge(sides, [&](std::size_t first, std::size_t last) {
    if (last - first == 1) surface.closed = false;
    if (last - first != 2) return;
    const Side &a = sides[first], &b = sides[first + 1];
    surface.neighbours[TriangleId(a.triangle)][static_cast<std::size_t>(a.side)] = TriangleId(b.triangle);
    surface.neighbours[TriangleId(b.triangle)][static_cast<std::size_t>(b.side)] = TriangleId(a.triangle);
  });
  surface.component = IdMap<TriangleId, std::int32_t>(components(triangles, sides));
  surface.component_count = 0;
  for (const std::int32_t c : surface.component) surface.component_count = std::max(surface.component_count, c + 1);
}

Surface condition(TriangleSoup soup, Context& context) {
  check_values(soup);
  Draft draft = framed(soup);
  repair(draft, context);
  put_in_order(draft);
  context.progress(0.7);

  Surface surface;
  surface.frame = draft.frame;
  surface.patch_names = IdMap<PatchId, std::string>(std::move(soup.patch_names));

  // Points in order of first use; the unused vanish.
  std::vector<PointId> number(draft.points.size());
  surface.triangles.resize(draft.size());
  for (std::size_t t = 0; t < draft.size(); ++t)
    for (std::size_t i = 0; i < 3; ++i) {
      const auto p = static_cast<std::size_t>(draft.triangles[t][i]);
      if (!number[p].valid()) {
        number[p] = surface.points.push_back(draft.points[p]);
        surface.box.add(draft.points[p]);
      }
      surface.triangles[TriangleId(t)][i] = number[p];
    }

  surface.longest_side = surface.box.extent().maxCoeff();

  report_edges(draft, sorted_sides(draft.triangles), context);
  connect(surface);
  surface.patch.resize(draft.size());
  surface.normal.resize(draft.size());
  parallel_for(draft.size(), [&](std::size_t i) {
    const TriangleId t(i);
    surface.patch[t] = PatchId(draft.patch[i]);
    const auto [a, b, c] = surface.corners(t);
    surface.normal[t] = (b - a).cross(c - a).normalized();
  });
  surface.source = IdMap<TriangleId, std::int64_t>(std::move(draft.source));
  context.progress(1);
  return surface;
}

}  // namespace strata
