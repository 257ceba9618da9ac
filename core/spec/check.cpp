// Everything wrong with a specification, all at once: a user fixes a file once, not ten times.
#include <algorithm>
#include <cmath>
#include <cstdio>
#include <numbers>

#include "core/spec/mesh_spec.h"

namespace strata {
namespace {

constexpr double kPi = std::numbers::pi;
constexpr double kMostGrowth = 10;
constexpr int kMostLayers = 1000;
constexpr double kMostGapCells = 64;
constexpr int kMostMapNodes = 1024;  // along an axis
constexpr int kDeepest = 18;         // octree levels
constexpr std::size_t kLongestName = 60;  // of a patch name in a message: messages travel in headers
constexpr std::size_t kMostChecked = 64;  // longer names are not compared for a did-you-mean

std::string text(double value) {
  char buffer[32];
  std::snprintf(buffer, sizeof buffer, "%.6g", value);
  return buffer;
}

std::string quoted(const std::string& name) {
  return '"' + (name.size() <= kLongestName ? name : name.substr(0, kLongestName) + "...") + '"';
}

// Levenshtein distance.
std::size_t edits(const std::string& a, const std::string& b) {
  std::vector<std::size_t> row(b.size() + 1);
  for (std::size_t j = 0; j < row.size(); ++j) row[j] = j;
  for (std::size_t i = 0; i < a.size(); ++i) {
    std::size_t diagonal = row[0]++;
    for (std::size_t j = 0; j < b.size(); ++j) {
      const std::size_t change = diagonal + (a[i] != b[j]);
      diagonal = row[j + 1];
      row[j + 1] = std::min({row[j] + 1, row[j + 1] + 1, change});
    }
  }
  return row.back();
}

class Checker {
 public:
  explicit Checker(const std::vector<std::string>& names) : names_(names) {}

  void fault(Reason reason, const std::string& field, const std::string& what, const std::string& patch = {},
             std::vector<std::pair<std::string, double>> values = {}) {
    Diagnostic d;
    d.reason = reason;
    d.field = field;
    d.patch = patch;
    d.message = field + ": " + what;
    d.values = std::move(values);
    found.push_back(std::move(d));
  }

  void above(const std::string& field, double value, double limit) {
    if (!(value > limit) || !std::isfinite(value))
      fault(Reason::SpecInvalid, field, text(value) + " must be more than " + text(limit), {}, {{"value", value}});
  }
  void at_least(const std::string& field, double value, double limit) {
    if (!(value >= limit) || !std::isfinite(value))
      fault(Reason::SpecInvalid, field, text(value) + " must be at least " + text(limit), {}, {{"value", value}});
  }
  void at_most(const std::string& field, double value, double limit, double shown_per_unit = 1) {
    if (value > limit)
      fault(Reason::SpecInvalid, field, text(value * shown_per_unit) + " must be at most " + text(limit * shown_per_unit), {},
            {{"value", value * shown_per_unit}});
  }
  void between_angles(const std::string& field, double radians, double low, double high) {
    constexpr double kDegrees = 180 / kPi;
    if (!(radians > low) || !(radians < high))
      fault(Reason::SpecInvalid, field,
            text(radians * kDegrees) + " must lie between " + text(low * kDegrees) + " and " + text(high * kDegrees), {},
            {{"value", radians * kDegrees}});
  }
  void finite(const std::string& field, const Vec3& p) {
    if (!p.allFinite()) fault(Reason::SpecInvalid, field, "coordinates must be finite");
  }

  void patches(const std::string& field, const std::vector<std::string>& patterns) {
    if (patterns.empty()) fault(Reason::SpecInvalid, field, "name at least one patch");
    for (std::size_t i = 0; i < patterns.size(); ++i) {
      const std::string& pattern = patterns[i];
      const std::string at = field + "[" + std::to_string(i) + "]";
      if (std::any_of(names_.begin(), names_.end(), [&](const std::string& name) { return matches(pattern, name); })) continue;
      std::string what = "no patch is called " + quoted(pattern);
      if (const std::string close = nearest(pattern); !close.empty()) what += "; did you mean " + quoted(close) + "?";
      else what += listed();
      fault(Reason::PatchUnknown, at, what, pattern);
    }
  }

  std::vector<Diagnostic> found;

 private:
  // The name that the fewest edits lead to, when those are few against its length.
  [[nodiscard]] std::string nearest(const std::string& pattern) const {
    if (pattern.size() > kMostChecked) return {};
    std::string best;
    std::size_t fewest = std::max<std::size_t>(1, pattern.size() / 3) + 1;
    const auto lower = [](std::string s) {
      for (char& c : s)
        if (c >= 'A' && c <= 'Z') c = static_cast<char>(c - 'A' + 'a');
      return s;
    };
    for (const std::string& name : names_) {
      if (name.size() > kMostChecked) continue;
      const std::size_t n = std::min(edits(pattern, name), edits(lower(pattern), lower(name)));
      if (n >= fewest) continue;
      fewest = n;
      best = name;
    }
    return best;
  }
  [[nodiscard]] std::string listed() const {
    constexpr std::size_t kMostListed = 8;
    std::string out = "; the surface has ";
    for (std::size_t i = 0; i < names_.size() && i < kMostListed; ++i) out += (i ? ", " : "") + quoted(names_[i]);
    if (names_.size() > kMostListed) out += " and " + std::to_string(names_.size() - kMostListed) + " more";
    return names_.empty() ? std::string() : out;
  }

  const std::vector<std::string>& names_;
};

std::string at(const std::string& field, std::size_t i) { return field + "[" + std::to_string(i) + "]"; }

void check_volume(const VolumeSpec& volume, Checker& check) {
  if (volume.mode == VolumeMode::Points && volume.points.empty())
    check.fault(Reason::SpecInvalid, "volume.points", "mode \"points\" needs at least one point");
  for (std::size_t i = 0; i < volume.points.size(); ++i) check.finite(at("volume.points", i), volume.points[i]);
}

void check_background(const SizeMap& map, Checker& check) {
  const std::string field = "sizing.background";
  check.finite(field + ".min", map.min);
  check.finite(field + ".max", map.max);
  if (!((map.min.array() < map.max.array()).all())) check.fault(Reason::SpecInvalid, field, "min must be below max");
  std::size_t nodes = 1;
  for (const int n : map.counts) nodes *= static_cast<std::size_t>(std::clamp(n, 0, kMostMapNodes));
  if (map.counts.size() != 3 || std::any_of(map.counts.begin(), map.counts.end(), [](int n) { return n < 2 || n > kMostMapNodes; }))
    check.fault(Reason::SpecInvalid, field + ".counts", "must be three numbers from 2 to " + std::to_string(kMostMapNodes));
  else if (nodes != map.sizes.size())
    check.fault(Reason::SpecInvalid, field + ".sizes",
                "must hold " + std::to_string(nodes) + " sizes, one for each node, but holds " + std::to_string(map.sizes.size()));
  for (std::size_t i = 0; i < map.sizes.size(); ++i)
    if (!(map.sizes[i] > 0)) return check.above(at(field + ".sizes", i), map.sizes[i], 0);
}

void check_sizing(const SizingSpec& sizing, Checker& check) {
  if (sizing.max_size) check.above("sizing.max_size", *sizing.max_size, 0);
  if (sizing.min_size) check.above("sizing.min_size", *sizing.min_size, 0);
  if (sizing.max_size && sizing.min_size && *sizing.min_size > *sizing.max_size)
    check.fault(Reason::SpecInvalid, "sizing.min_size", text(*sizing.min_size) + " must be at most max_size " + text(*sizing.max_size), {},
                {{"min_size", *sizing.min_size}, {"max_size", *sizing.max_size}});
  for (std::size_t i = 0; i < sizing.patches.size(); ++i) {
    check.patches(at("sizing.patches", i) + ".patches", sizing.patches[i].patches);
    check.above(at("sizing.patches", i) + ".size", sizing.patches[i].size, 0);
  }
  if (sizing.curvature) check.between_angles("sizing.curvature_deg", *sizing.curvature, 0, kPi);
  if (sizing.gap_cells) {
    check.above("sizing.gap_cells", *sizing.gap_cells, 0);
    check.at_most("sizing.gap_cells", *sizing.gap_cells, kMostGapCells);
  }
  for (std::size_t i = 0; i < sizing.boxes.size(); ++i) {
    const BoxSize& box = sizing.boxes[i];
    const std::string field = at("sizing.boxes", i);
    check.finite(field + ".min", box.min);
    check.finite(field + ".max", box.max);
    if (!((box.min.array() <= box.max.array()).all())) check.fault(Reason::SpecInvalid, field, "min must not exceed max");
    check.above(field + ".size", box.size, 0);
  }
  for (std::size_t i = 0; i < sizing.spheres.size(); ++i) {
    const std::string field = at("sizing.spheres", i);
    check.finite(field + ".centre", sizing.spheres[i].centre);
    check.above(field + ".radius", sizing.spheres[i].radius, 0);
    check.above(field + ".size", sizing.spheres[i].size, 0);
  }
  for (std::size_t i = 0; i < sizing.cylinders.size(); ++i) {
    const CylinderSize& cylinder = sizing.cylinders[i];
    const std::string field = at("sizing.cylinders", i);
    check.finite(field + ".from", cylinder.from);
    check.finite(field + ".to", cylinder.to);
    if (cylinder.from == cylinder.to) check.fault(Reason::SpecInvalid, field, "from and to must differ");
    check.above(field + ".radius", cylinder.radius, 0);
    check.above(field + ".size", cylinder.size, 0);
  }
  for (std::size_t i = 0; i < sizing.curves.size(); ++i) {
    const std::string field = at("sizing.curves", i);
    if (sizing.curves[i].between.size() > 2) check.fault(Reason::SpecInvalid, field + ".between", "must be one or two patches");
    check.patches(field + ".between", sizing.curves[i].between);
    check.above(field + ".size", sizing.curves[i].size, 0);
  }
  if (sizing.background) check_background(*sizing.background, check);
  for (const auto& [field, level] : {std::pair("sizing.min_level", sizing.min_level), std::pair("sizing.max_level", sizing.max_level)}) {
    if (!level) continue;
    check.at_least(field, *level, 0);
    check.at_most(field, *level, kDeepest);
  }
  if (sizing.min_level && sizing.max_level && *sizing.min_level > *sizing.max_level)
    check.fault(Reason::SpecInvalid, "sizing.min_level", "must be at most max_level");
  check.above("sizing.gradation", sizing.gradation, 1);
  if (sizing.max_cells) check.at_least("sizing.max_cells", static_cast<double>(*sizing.max_cells), 1);
}

void check_layer(const LayerSpec& layer, const std::string& field, Checker& check) {
  check.patches(field + ".patches", layer.patches);
  const std::size_t before = check.found.size();
  if (layer.count) {
    check.at_least(field + ".count", *layer.count, 0);
    check.at_most(field + ".count", *layer.count, kMostLayers);
  }
  if (layer.first_height) check.above(field + ".first_height", *layer.first_height, 0);
  if (layer.last_height) check.above(field + ".last_height", *layer.last_height, 0);
  if (layer.total_thickness) check.above(field + ".total_thickness", *layer.total_thickness, 0);
  if (layer.growth) {
    check.at_least(field + ".growth", *layer.growth, 1);
    check.at_most(field + ".growth", *layer.growth, kMostGrowth);
  }
  if (check.found.size() == before) {
    try {
      resolve(layer, field);
    } catch (const MeshError& e) {
      check.found.push_back(e.diagnostic());
    }
  }
  for (std::size_t i = 0; i < layer.neighbours.size(); ++i)
    check.patches(at(field + ".neighbours", i) + ".patches", layer.neighbours[i].patches);
  if (layer.side) check.at_least(field + ".side", *layer.side, 1);
  if (layer.blending == Blending::Count) {
    check.at_least(field + ".blending", layer.blending_count, 1);
    check.at_most(field + ".blending", layer.blending_count, kMostLayers);
  }
  for (std::size_t i = 0; i < layer.give_up.size(); ++i)
    if (std::find(layer.give_up.begin(), layer.give_up.begin() + static_cast<std::ptrdiff_t>(i), layer.give_up[i]) !=
        layer.give_up.begin() + static_cast<std::ptrdiff_t>(i))
      check.fault(Reason::SpecInvalid, at(field + ".give_up", i), "is named twice");
  check.at_least(field + ".minimum_count", layer.minimum_count, 1);
  if (const int count = layer.count.value_or(kMostLayers); count > 0) check.at_most(field + ".minimum_count", layer.minimum_count, count);
}

// Entries for different sides of an interface may name the same patch.
void check_patches_in_two_entries(const MeshSpec& spec, const std::vector<std::string>& names, Checker& check) {
  const auto holds = [](const LayerSpec& layer, const std::string& name) {
    return std::any_of(layer.patches.begin(), layer.patches.end(), [&](const std::string& pattern) { return matches(pattern, name); });
  };
  for (const std::string& name : names)
    for (std::size_t j = 1; j < spec.layers.size(); ++j) {
      if (!holds(spec.layers[j], name)) continue;
      for (std::size_t i = 0; i < j; ++i) {
        if (!holds(spec.layers[i], name)) continue;
        if (spec.layers[i].side && spec.layers[j].side && *spec.layers[i].side != *spec.layers[j].side) continue;
        check.fault(Reason::PatchInTwoLayerEntries, at("layers", j) + ".patches",
                    "patch " + quoted(name) + " is already in layers[" + std::to_string(i) + "]", name);
        break;
      }
    }
}

}  // namespace

std::vector<Diagnostic> check(const MeshSpec& spec, const std::vector<std::string>& patch_names) {
  Checker checker(patch_names);
  check_volume(spec.volume, checker);
  check_sizing(spec.sizing, checker);
  checker.between_angles("features.ridge_angle_deg", spec.features.ridge_angle, 0, kPi);
  for (std::size_t i = 0; i < spec.layers.size(); ++i) check_layer(spec.layers[i], at("layers", i), checker);
  check_patches_in_two_entries(spec, patch_names, checker);
  return std::move(checker.found);
}

}  // namespace strata
