// Sharp features of the surface: charts bounded by curves, curves bounded by corners.
#pragma once

#include <string>
#include <vector>

#include "core/base/ids.h"
#include "core/base/vec3.h"
#include "core/surface/surface.h"

namespace strata {

class Context;

struct FeatureOptions {
  double ridge_angle = 0.6981317007977318;  // 40 degrees: an edge whose normals turn by more is sharp (radians)
  bool round_sharp = false;  // ridges inside a patch whose faces stand at less than kSharpRidge are no features: the mesh rounds them
};
inline constexpr double kSharpRidge = 1.0471975511965976;  // 60 degrees

// Ridges left out because they are to be rounded.
struct RoundedRidges {
  double length = 0;             // working frame
  double sharpest = kSharpRidge; // angle between the faces, radians
  Box box;                       // working frame
};

struct Curve {
  std::vector<PointId> points;   // polyline; closed curves do not repeat the first point
  bool closed = false;
  CornerId first, last;          // invalid when closed (a closed curve may pass one corner: then both are that corner)
  ChartId left, right;           // charts on either side, seen along the polyline with normals up; equal for a dangling crease
  bool manifold = true;          // exactly two triangles at every edge
  double length = 0;
  // Interior dihedral angle measured inside the volume the normals point out of, radians, length-weighted mean, min and max:
  // pi on a flat patch border, pi/2 on a cube, 3pi/2 in a re-entrant corner.
  double dihedral_mean = 0, dihedral_min = 0, dihedral_max = 0;
};

struct ChartAngle {
  ChartId chart;
  double angle = 0;              // of the chart's triangles round the corner, radians
};
struct Corner {
  PointId point;
  std::vector<CurveId> curves;   // incident curves; a curve that starts and ends here is listed twice; may be empty (cone tip)
  std::vector<ChartAngle> charts;  // round it, ascending
  // 0 for charts that do not touch it.
  [[nodiscard]] double angle_of(ChartId chart) const {
    for (const ChartAngle& c : charts)
      if (c.chart == chart) return c.angle;
    return 0;
  }
};

struct Features {
  IdMap<CurveId, Curve> curves;
  IdMap<CornerId, Corner> corners;
  IdMap<TriangleId, ChartId> chart;        // sized like the surface's triangles
  IdMap<ChartId, PatchId> patch_of_chart;
  RoundedRidges rounded;
  [[nodiscard]] std::size_t chart_count() const { return patch_of_chart.size(); }
};

// Ridges by dihedral angle with hysteresis, patch borders, non-manifold edges (open ones are none); corners where curves meet, turn sharply
// or end, and cone tips. Deterministic.
Features detect_features(const Surface& surface, const FeatureOptions& options, Context& context);

}  // namespace strata
