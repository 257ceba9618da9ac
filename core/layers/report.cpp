#include "core/layers/report.h"

#include <algorithm>
#include <cmath>
#include <cstdio>

#include "core/base/context.h"
#include "core/layers/facets.h"

namespace strata {
namespace {

constexpr double kWorthTelling = 0.95;  // of the wished thickness

// Mean of the four lateral edges' components along the base's normal, as the referee measures it.
double first_height(const HexMesh& mesh, const FaceNeighbour& at, const QuadVertices& base) {
  const HexVertices& hex = mesh.hexes[at.hex];
  const Vec3 inward = -area_vector(mesh, base).normalized();
  double sum = 0;
  for (VertexId v : base)
    for (const auto& edge : kHexEdges) {
      const VertexId a = hex[static_cast<std::size_t>(edge[0])], b = hex[static_cast<std::size_t>(edge[1])];
      const VertexId other = a == v ? b : (b == v ? a : VertexId());
      if (other.valid() && std::find(base.begin(), base.end(), other) == base.end())
        sum += inward.dot(mesh.position[other] - mesh.position[v]);
    }
  return 0.25 * sum;
}

// Of the thickness of all layers wished, what the first `count` of them have.
double share_of_thickness(ResolvedLayers law, int count) {
  const double wished = law.total();
  law.count = std::min(law.count, count);
  return law.total() / wished;
}

// Small shares with the digits that tell them from nothing.
std::string percent(double x) {
  if (x <= 0 || x >= 0.01) return std::to_string(static_cast<int>(std::lround(100 * x))) + " %";
  char text[32];
  std::snprintf(text, sizeof text, "%.2g %%", 100 * x);
  return text;
}

}  // namespace

std::vector<PatchLayers> report_patches(const HexMesh& mesh, const GrownWall& wall, const IdMap<PatchId, PatchWish>& wishes) {
  struct Sums {
    double area = 0, covered = 0, height = 0, height_area = 0, fraction = 0, fraction_area = 0, least = 1;
    int count = 0;
  };
  IdMap<PatchId, Sums> sums(wishes.size());
  const Facets facets(mesh);
  for (FacetIndex f = 0; f < static_cast<FacetIndex>(facets.slots()); ++f) {
    if (!facets.exists(f)) continue;
    const PatchId patch = mesh.patch[quad_of(f)];
    if (!patch.valid() || wishes[patch].entry < 0) continue;
    const FrontIndex front = facets.front(f);
    const QuadVertices base = facets.vertices(f);
    const double area = area_vector(mesh, base).norm();
    Sums& s = sums[patch];
    s.area += area;
    if (front == kNoFront || wall.plan->group_of_front[static_cast<std::size_t>(front)] < 0) continue;
    const FaceNeighbour at = facets.hex_face(f);
    if (mesh.layer[at.hex] == 0) continue;
    s.covered += area;
    const LayerGroup& group = wall.plan->groups[static_cast<std::size_t>(wall.plan->group_of_front[static_cast<std::size_t>(front)])];
    const std::vector<VertexId>& wedge = group.wedge_vertices;
    s.count = group.count;
    double fraction = 0;
    int columns = 0, tips = 0;
    for (VertexId v : base) {
      tips += std::binary_search(wedge.begin(), wedge.end(), v);
      if (wall.fraction[v] >= 0) fraction += wall.fraction[v], ++columns;
    }
    if (columns > 0) {
      fraction *= share_of_thickness(wishes[patch].law, group.count) / columns;
      s.fraction += area * fraction;
      s.fraction_area += area;
      s.least = std::min(s.least, fraction);
    }
    if (tips > 1) continue;
    s.height += area * first_height(mesh, at, base);
    s.height_area += area;
  }
  std::vector<PatchLayers> result;
  for (PatchId p : wishes.ids()) {
    if (wishes[p].entry < 0) continue;
    const Sums& s = sums[p];
    PatchLayers layers;
    layers.patch = p;
    layers.wished = wishes[p].law;
    layers.count = s.count;
    layers.first_height_mean = s.height_area > 0 ? s.height / s.height_area : 0;
    layers.thickness_fraction_mean = s.fraction_area > 0 ? s.fraction / s.fraction_area : 0;
    layers.thickness_fraction_min = s.fraction_area > 0 ? s.least : 0;
    layers.coverage = s.area > 0 ? s.covered / s.area : 0;
    result.push_back(layers);
  }
  return result;
}

void tell_adjustments(const HexMesh& mesh, const std::vector<PatchLayers>& patches, const LayerPlan& plan,
                      const std::vector<std::uint8_t>& dropped, const Surface& surface, Context& context) {
  const IdMap<QuadId, QuadSides> sides = quad_sides(mesh);
  struct Place {
    Box box;
    double area = 0;
  };
  IdMap<PatchId, Place> gone(surface.patch_names.size()), whole(surface.patch_names.size());
  for (QuadId q : mesh.quads.ids()) {
    if (!mesh.patch[q].valid() || !mesh.chart[q].valid()) continue;
    const double area = area_vector(mesh, mesh.quads[q]).norm() / (surface.frame.scale * surface.frame.scale);
    const auto add = [&](Place& place) {
      place.area += area;
      for (VertexId v : mesh.quads[q]) place.box.add(surface.frame.to_input(mesh.position[v]));
    };
    add(whole[mesh.patch[q]]);
    const auto given_up = [&](FacetSide side) {
      const auto front = static_cast<std::size_t>(front_of(mesh.chart[q], side));
      if (front < dropped.size() && dropped[front] != 0) return true;
      // A front with layers, but none here: the place was left out.
      const HexId hex = side == FacetSide::Back ? sides[q].back : sides[q].front;
      return hex.valid() && plan.group_of_front[front] >= 0 && mesh.layer[hex] == 0;
    };
    if (given_up(FacetSide::Back) || given_up(FacetSide::Front)) add(gone[mesh.patch[q]]);
  }
  for (const PatchLayers& p : patches) {
    const std::string& name = surface.patch_names[p.patch];
    Diagnostic d;
    d.severity = Severity::Warning;
    d.patch = name;
    if (gone[p.patch].area > 0) {
      d.reason = Reason::LayersDropped;
      d.box = gone[p.patch].box;
      const double share = whole[p.patch].area > 0 ? gone[p.patch].area / whole[p.patch].area : 1;
      d.values = {{"area", gone[p.patch].area}, {"share", share}};
      d.message = "no layers on " + percent(share) + " of patch \"" + name + "\": they would have inverted hexes";
      context.adjusted(d);
    }
    if (p.coverage > 0 && p.thickness_fraction_mean < kWorthTelling) {
      d.reason = Reason::LayersThinned;
      d.box = whole[p.patch].box;
      d.values = {{"area", whole[p.patch].area}, {"fraction", p.thickness_fraction_mean}, {"least", p.thickness_fraction_min}};
      d.message = "layers on patch \"" + name + "\" have " + percent(p.thickness_fraction_mean) + " of the thickness wished on average, " +
                  percent(p.thickness_fraction_min) + " at the thinnest";
      context.adjusted(std::move(d));
    }
  }
}

}  // namespace strata
