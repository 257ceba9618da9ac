// From a wrapped staircase to the surface: first as if it were smooth, then with its features.
#pragma once

#include <optional>
#include <vector>

#include "core/base/diagnostic.h"
#include "core/mesh/crease_edge.h"
#include "core/mesh/hex_mesh.h"
#include "core/optimise/ground.h"

namespace strata {

class Context;

struct FitResult {
  HexMesh mesh;
  std::int64_t relaxed = 0;       // held vertices left off their geometry to stay valid
  double worst_off = 0;           // the farthest of them, over the local edge length
  std::int64_t far = 0;           // those farther than a quarter of the local edge
  std::int64_t held = 0;          // boundary vertices in all
  std::optional<Diagnostic> let_go{};  // where features were let go, for the user
  std::vector<Vec3> places{};      // centres of the hexes that had to be freed
  std::int64_t bad = 0;           // hexes whose scaled Jacobian, corners and centre, is not above kLeastJacobian

  // Whether so many vertices stay far off that the mesh cannot be said to follow the surface; fewer are an adjustment only.
  [[nodiscard]] bool is_relaxed() const { return static_cast<double>(far) > 1e-3 * static_cast<double>(held); }
};

// A hex counts as valid above this scaled Jacobian (Verdict's, corners and centre): far enough from zero that writing and reading a mesh
// cannot turn it.
inline constexpr double kLeastJacobian = 1e-4;

// Boundary vertices go to the closest point of the surface, features ignored, interior vertices follow. All hexes valid after, or
// as many as could be (the caller checks). `thin_places`: solid may be thinner than a cell, so that the closest place is on its far side.
// The ground's surface is `whole` or what of it bounds the meshed volumes; vertices over its openings are held by nothing, and that is told.
FitResult fit_to_smooth(HexMesh mesh, const Ground& ground, const Surface& whole, bool thin_places, Context& context);

// Labels every quad with chart and patch, matches corners to vertices and curves to edge paths, sets attachments.
struct Match {
  HexMesh mesh;
  std::vector<CreaseEdge> creases;  // edges of paths that labels do not show
  std::vector<CurveId> softened;  // curves that no edge path represents, ascending: too small for the cells, in each other's way, or let go
  IdMap<ChartId, ChartId> chart_of;  // the chart that each is labelled as: charts of one patch that only softened curves part are one
};
// `let_go`: by curve, 1: not to be represented; may be empty.
Match match_features(HexMesh mesh, const Ground& ground, const IdMap<CurveId, std::uint8_t>& let_go, Context& context);
// Tells the user which curves the mesh rounds off.
void report_softened(const std::vector<CurveId>& curves, const Ground& ground, Context& context);

// Creases inside one patch without which hexes could be better: the weakest or all near each, ascending. Faint creases inside one chart, often
// noise, are named for poor hexes; others only where many of their hexes are bad. Those already `let_go` (by curve) are not named again.
enum class GiveWay { Weakest, All };
struct Goals {  // scaled Jacobians of corners, not above which a hex counts as
  double bad = 0, poor = 0;
  double mediocre = 0;  // costs faint creases a few cells long only
};
std::vector<CurveId> creases_in_the_way(const HexMesh& mesh, const Features& features, const IdMap<CurveId, std::uint8_t>& let_go,
                                        GiveWay give_way, const Goals& goals);
// All creases inside one patch at these hexes or, where there are none, round them.
std::vector<CurveId> creases_near(const HexMesh& mesh, const std::vector<HexId>& hexes, const Features& features,
                                  const IdMap<CurveId, std::uint8_t>& let_go);

// Puts held vertices onto their corners, curves and charts and untangles what that inverts, as far as may be.
HexMesh arrive_at_features(HexMesh mesh, const Ground& ground, Context& context);
// Everything relaxes round held vertices, then a worst-first polish.
HexMesh settle_on_features(HexMesh mesh, const Ground& ground, Context& context);

// Frees hexes that are still bad, giving up as little as possible and only near them: first features (vertices slide on the surface), then
// the surface (vertices leave it and are led back, or at last only as near as hexes stay valid: those count as `relaxed`). `bad` of the result
// is 0 unless all that failed.
FitResult make_valid(HexMesh mesh, const Ground& ground, Context& context);

// Smallest scaled Jacobian of all hexes, corners and centres.
double worst_jacobian(const HexMesh& mesh);
// Hexes that are not valid, ascending.
std::vector<HexId> bad_hexes(const HexMesh& mesh);

}  // namespace strata
