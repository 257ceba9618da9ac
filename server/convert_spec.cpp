// MeshSpec: wire <-> core.
#include <numbers>
#include <utility>

#include "core/spec/mesh_spec.h"
#include "server/convert.h"

namespace strata::server {
namespace {

constexpr double kRadiansPerDegree = std::numbers::pi / 180;

[[noreturn]] void refuse(const std::string& field, const std::string& message) {
  Diagnostic diagnostic;
  diagnostic.reason = Reason::SpecInvalid;
  diagnostic.field = field;
  diagnostic.message = field + ": " + message;
  throw MeshError(Failure::InvalidInput, std::move(diagnostic));
}

std::string indexed(const std::string& list, int i) { return list + "[" + std::to_string(i) + "]"; }

Vec3 vec(const v1::Vector3& p) { return {p.x(), p.y(), p.z()}; }
v1::Vector3 vec(const Vec3& p) {
  v1::Vector3 result;
  result.set_x(p.x());
  result.set_y(p.y());
  result.set_z(p.z());
  return result;
}

template <class Entry>
void need(const Entry& present, const std::string& field) {
  if (!present) refuse(field, "is required");
}

std::vector<std::string> names(const google::protobuf::RepeatedPtrField<std::string>& list) { return {list.begin(), list.end()}; }

VolumeMode mode_of(v1::VolumeSpec::Mode mode) {
  switch (mode) {
    case v1::VolumeSpec::MODE_POINTS: return VolumeMode::Points;
    case v1::VolumeSpec::MODE_UNSPECIFIED:
    case v1::VolumeSpec::MODE_ALL: return VolumeMode::All;
    case v1::VolumeSpec::MODE_OUTERMOST: return VolumeMode::Outermost;
    case v1::VolumeSpec::MODE_SOLID: return VolumeMode::Solid;
    default: refuse("volume.mode", "is not a known mode");
  }
}

SharpEdges sharp_edges_of(v1::FeatureSpec::SharpEdges choice) {
  switch (choice) {
    case v1::FeatureSpec::SHARP_EDGES_UNSPECIFIED:
    case v1::FeatureSpec::SHARP_EDGES_AUTO: return SharpEdges::Auto;
    case v1::FeatureSpec::SHARP_EDGES_EXACT: return SharpEdges::Exact;
    case v1::FeatureSpec::SHARP_EDGES_FILLET: return SharpEdges::Fillet;
    default: refuse("features.sharp_edges", "is not a known choice");
  }
}

Ending ending_of(v1::Ending ending, const std::string& field) {
  switch (ending) {
    case v1::ENDING_UNSPECIFIED:
    case v1::ENDING_AUTO: return Ending::Auto;
    case v1::ENDING_WEDGE: return Ending::Wedge;
    case v1::ENDING_IMPRINT: return Ending::Imprint;
    case v1::ENDING_CROSS_IMPRINT: return Ending::CrossImprint;
    case v1::ENDING_REGULAR: return Ending::Regular;
    default: refuse(field, "is not a known ending");
  }
}

Blending blending_of(v1::LayerSpec::Blending blending, const std::string& field) {
  switch (blending) {
    case v1::LayerSpec::BLENDING_UNSPECIFIED:
    case v1::LayerSpec::BLENDING_AUTO: return Blending::Auto;
    case v1::LayerSpec::BLENDING_NONE: return Blending::None;
    case v1::LayerSpec::BLENDING_COUNT: return Blending::Count;
    default: refuse(field, "is not a known choice");
  }
}

GiveUp give_up_of(int choice, const std::string& field) {
  switch (choice) {
    case v1::LayerSpec::GIVE_UP_GROWTH: return GiveUp::Growth;
    case v1::LayerSpec::GIVE_UP_FIRST_HEIGHT: return GiveUp::FirstHeight;
    case v1::LayerSpec::GIVE_UP_COUNT: return GiveUp::Count;
    default: refuse(field, "must be growth, first_height or count");
  }
}

SizingSpec sizing_of(const v1::SizingSpec& wire) {
  SizingSpec sizing;
  if (wire.has_max_size()) sizing.max_size = wire.max_size();
  if (wire.has_min_size()) sizing.min_size = wire.min_size();
  for (const auto& entry : wire.patches()) sizing.patches.push_back({names(entry.patches()), entry.size()});
  if (wire.has_curvature_deg()) sizing.curvature = wire.curvature_deg() * kRadiansPerDegree;
  if (wire.has_gap_cells()) sizing.gap_cells = wire.gap_cells();
  for (int i = 0; i < wire.boxes_size(); ++i) {
    const v1::BoxSize& box = wire.boxes(i);
    need(box.has_min(), indexed("sizing.boxes", i) + ".min");
    need(box.has_max(), indexed("sizing.boxes", i) + ".max");
    sizing.boxes.push_back({vec(box.min()), vec(box.max()), box.size()});
  }
  for (int i = 0; i < wire.spheres_size(); ++i) {
    const v1::SphereSize& sphere = wire.spheres(i);
    need(sphere.has_centre(), indexed("sizing.spheres", i) + ".centre");
    sizing.spheres.push_back({vec(sphere.centre()), sphere.radius(), sphere.size()});
  }
  for (int i = 0; i < wire.cylinders_size(); ++i) {
    const v1::CylinderSize& cylinder = wire.cylinders(i);
    need(cylinder.has_from(), indexed("sizing.cylinders", i) + ".from");
    need(cylinder.has_to(), indexed("sizing.cylinders", i) + ".to");
    sizing.cylinders.push_back({vec(cylinder.from()), vec(cylinder.to()), cylinder.radius(), cylinder.size()});
  }
  for (const auto& entry : wire.curves()) sizing.curves.push_back({names(entry.between()), entry.size()});
  if (wire.has_background()) {
    need(wire.background().has_min(), "sizing.background.min");
    need(wire.background().has_max(), "sizing.background.max");
    const v1::SizeMap& map = wire.background();
    sizing.background = {
        vec(map.min()), vec(map.max()), {map.counts().begin(), map.counts().end()}, {map.sizes().begin(), map.sizes().end()}};
  }
  if (wire.has_min_level()) sizing.min_level = wire.min_level();
  if (wire.has_max_level()) sizing.max_level = wire.max_level();
  if (wire.has_gradation()) sizing.gradation = wire.gradation();
  if (wire.has_max_cells()) sizing.max_cells = wire.max_cells();
  return sizing;
}

LayerSpec layer_of(const v1::LayerSpec& wire, const std::string& path) {
  LayerSpec layer;
  layer.patches = names(wire.patches());
  if (wire.has_count()) layer.count = wire.count();
  if (wire.has_first_height()) layer.first_height = wire.first_height();
  if (wire.has_last_height()) layer.last_height = wire.last_height();
  if (wire.has_total_thickness()) layer.total_thickness = wire.total_thickness();
  if (wire.has_growth()) layer.growth = wire.growth();
  layer.relative = wire.relative();
  layer.ending = ending_of(wire.ending(), path + ".ending");
  for (int i = 0; i < wire.neighbours_size(); ++i) {
    const std::string field = indexed(path + ".neighbours", i) + ".ending";
    layer.neighbours.push_back({names(wire.neighbours(i).patches()), ending_of(wire.neighbours(i).ending(), field)});
  }
  layer.push_wedge = wire.push_wedge();
  if (wire.has_side()) layer.side = wire.side();
  layer.blending = blending_of(wire.blending(), path + ".blending");
  layer.blending_count = wire.blending_count();
  for (int i = 0; i < wire.give_up_size(); ++i) layer.give_up.push_back(give_up_of(wire.give_up(i), indexed(path + ".give_up", i)));
  if (wire.has_minimum_count()) layer.minimum_count = wire.minimum_count();
  return layer;
}

v1::Ending to_wire(Ending ending) {
  switch (ending) {
    case Ending::Auto: return v1::ENDING_AUTO;
    case Ending::Wedge: return v1::ENDING_WEDGE;
    case Ending::Imprint: return v1::ENDING_IMPRINT;
    case Ending::CrossImprint: return v1::ENDING_CROSS_IMPRINT;
    case Ending::Regular: return v1::ENDING_REGULAR;
  }
  return v1::ENDING_UNSPECIFIED;
}

v1::VolumeSpec::Mode to_wire(VolumeMode mode) {
  switch (mode) {
    case VolumeMode::Points: return v1::VolumeSpec::MODE_POINTS;
    case VolumeMode::All: return v1::VolumeSpec::MODE_ALL;
    case VolumeMode::Outermost: return v1::VolumeSpec::MODE_OUTERMOST;
    case VolumeMode::Solid: return v1::VolumeSpec::MODE_SOLID;
  }
  return v1::VolumeSpec::MODE_UNSPECIFIED;
}

v1::FeatureSpec::SharpEdges to_wire(SharpEdges choice) {
  switch (choice) {
    case SharpEdges::Exact: return v1::FeatureSpec::SHARP_EDGES_EXACT;
    case SharpEdges::Fillet: return v1::FeatureSpec::SHARP_EDGES_FILLET;
    case SharpEdges::Auto: return v1::FeatureSpec::SHARP_EDGES_AUTO;
  }
  return v1::FeatureSpec::SHARP_EDGES_UNSPECIFIED;
}

v1::LayerSpec::Blending to_wire(Blending blending) {
  switch (blending) {
    case Blending::Auto: return v1::LayerSpec::BLENDING_AUTO;
    case Blending::None: return v1::LayerSpec::BLENDING_NONE;
    case Blending::Count: return v1::LayerSpec::BLENDING_COUNT;
  }
  return v1::LayerSpec::BLENDING_UNSPECIFIED;
}

v1::LayerSpec::GiveUp to_wire(GiveUp choice) {
  switch (choice) {
    case GiveUp::Growth: return v1::LayerSpec::GIVE_UP_GROWTH;
    case GiveUp::FirstHeight: return v1::LayerSpec::GIVE_UP_FIRST_HEIGHT;
    case GiveUp::Count: return v1::LayerSpec::GIVE_UP_COUNT;
  }
  return v1::LayerSpec::GIVE_UP_UNSPECIFIED;
}

void fill(const SizingSpec& sizing, v1::SizingSpec& wire) {
  if (sizing.max_size) wire.set_max_size(*sizing.max_size);
  if (sizing.min_size) wire.set_min_size(*sizing.min_size);
  for (const PatchSize& entry : sizing.patches) {
    v1::PatchSize& out = *wire.add_patches();
    out.mutable_patches()->Assign(entry.patches.begin(), entry.patches.end());
    out.set_size(entry.size);
  }
  if (sizing.curvature) wire.set_curvature_deg(*sizing.curvature / kRadiansPerDegree);
  if (sizing.gap_cells) wire.set_gap_cells(*sizing.gap_cells);
  for (const BoxSize& box : sizing.boxes) {
    v1::BoxSize& out = *wire.add_boxes();
    *out.mutable_min() = vec(box.min);
    *out.mutable_max() = vec(box.max);
    out.set_size(box.size);
  }
  for (const SphereSize& sphere : sizing.spheres) {
    v1::SphereSize& out = *wire.add_spheres();
    *out.mutable_centre() = vec(sphere.centre);
    out.set_radius(sphere.radius);
    out.set_size(sphere.size);
  }
  for (const CylinderSize& cylinder : sizing.cylinders) {
    v1::CylinderSize& out = *wire.add_cylinders();
    *out.mutable_from() = vec(cylinder.from);
    *out.mutable_to() = vec(cylinder.to);
    out.set_radius(cylinder.radius);
    out.set_size(cylinder.size);
  }
  for (const CurveSize& entry : sizing.curves) {
    v1::CurveSize& out = *wire.add_curves();
    out.mutable_between()->Assign(entry.between.begin(), entry.between.end());
    out.set_size(entry.size);
  }
  if (sizing.background) {
    v1::SizeMap& out = *wire.mutable_background();
    *out.mutable_min() = vec(sizing.background->min);
    *out.mutable_max() = vec(sizing.background->max);
    out.mutable_counts()->Assign(sizing.background->counts.begin(), sizing.background->counts.end());
    out.mutable_sizes()->Assign(sizing.background->sizes.begin(), sizing.background->sizes.end());
  }
  if (sizing.min_level) wire.set_min_level(*sizing.min_level);
  if (sizing.max_level) wire.set_max_level(*sizing.max_level);
  wire.set_gradation(sizing.gradation);
  if (sizing.max_cells) wire.set_max_cells(*sizing.max_cells);
}

void fill(const LayerSpec& layer, v1::LayerSpec& wire) {
  wire.mutable_patches()->Assign(layer.patches.begin(), layer.patches.end());
  if (layer.count) wire.set_count(*layer.count);
  if (layer.first_height) wire.set_first_height(*layer.first_height);
  if (layer.last_height) wire.set_last_height(*layer.last_height);
  if (layer.total_thickness) wire.set_total_thickness(*layer.total_thickness);
  if (layer.growth) wire.set_growth(*layer.growth);
  wire.set_relative(layer.relative);
  wire.set_ending(to_wire(layer.ending));
  for (const NeighbourEnding& neighbour : layer.neighbours) {
    v1::NeighbourEnding& out = *wire.add_neighbours();
    out.mutable_patches()->Assign(neighbour.patches.begin(), neighbour.patches.end());
    out.set_ending(to_wire(neighbour.ending));
  }
  wire.set_push_wedge(layer.push_wedge);
  if (layer.side) wire.set_side(*layer.side);
  wire.set_blending(to_wire(layer.blending));
  wire.set_blending_count(layer.blending_count);
  for (const GiveUp choice : layer.give_up) wire.add_give_up(to_wire(choice));
  wire.set_minimum_count(layer.minimum_count);
}

}  // namespace

MeshSpec from_wire(const v1::MeshSpec& wire) {
  MeshSpec spec;
  spec.volume.mode = mode_of(wire.volume().mode());
  for (const v1::Vector3& p : wire.volume().points()) spec.volume.points.push_back(vec(p));
  spec.sizing = sizing_of(wire.sizing());
  if (wire.features().has_ridge_angle_deg()) spec.features.ridge_angle = wire.features().ridge_angle_deg() * kRadiansPerDegree;
  spec.features.sharp_edges = sharp_edges_of(wire.features().sharp_edges());
  for (int i = 0; i < wire.layers_size(); ++i) spec.layers.push_back(layer_of(wire.layers(i), indexed("layers", i)));
  spec.seed = wire.seed();
  return spec;
}

v1::MeshSpec to_wire(const MeshSpec& spec) {
  v1::MeshSpec wire;
  wire.mutable_volume()->set_mode(to_wire(spec.volume.mode));
  for (const Vec3& p : spec.volume.points) *wire.mutable_volume()->add_points() = vec(p);
  fill(spec.sizing, *wire.mutable_sizing());
  wire.mutable_features()->set_ridge_angle_deg(spec.features.ridge_angle / kRadiansPerDegree);
  wire.mutable_features()->set_sharp_edges(to_wire(spec.features.sharp_edges));
  for (const LayerSpec& layer : spec.layers) fill(layer, *wire.add_layers());
  wire.set_seed(spec.seed);
  return wire;
}

}  // namespace strata::server
