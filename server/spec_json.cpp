#include "server/spec_json.h"

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <functional>
#include <limits>
#include <nlohmann/json.hpp>
#include <numeric>
#include <utility>

#include "core/base/diagnostic.h"

namespace strata::server {
namespace {

using Json = nlohmann::json;

[[noreturn]] void refuse(const std::string& path, const std::string& message) {
  Diagnostic diagnostic;
  diagnostic.reason = Reason::SpecInvalid;
  diagnostic.field = path;
  diagnostic.message = path.empty() ? message : path + ": " + message;
  throw MeshError(Failure::InvalidInput, std::move(diagnostic));
}

std::size_t edit_distance(std::string_view a, std::string_view b) {
  std::vector<std::size_t> row(b.size() + 1);
  std::iota(row.begin(), row.end(), std::size_t{0});
  for (std::size_t i = 1; i <= a.size(); ++i) {
    std::size_t diagonal = std::exchange(row[0], i);
    for (std::size_t j = 1; j <= b.size(); ++j) {
      const std::size_t change = diagonal + (a[i - 1] == b[j - 1] ? 0 : 1);
      diagonal = std::exchange(row[j], std::min({change, row[j] + 1, row[j - 1] + 1}));
    }
  }
  return row.back();
}

std::string list_of(const std::vector<std::string_view>& words) {
  std::string text;
  for (const std::string_view word : words) text += (text.empty() ? "" : ", ") + std::string(word);
  return text;
}

std::string shown(const Json& value) {
  std::string text = value.dump(-1, ' ', true, Json::error_handler_t::replace);
  return text.size() > 40 ? text.substr(0, 37) + "..." : text;
}

// A value and where it stands in the document.
struct At {
  const Json& value;
  std::string path;

  [[nodiscard]] At item(std::size_t i) const { return {value[i], path + "[" + std::to_string(i) + "]"}; }
  [[nodiscard]] std::string path_of(const std::string& key) const { return path.empty() ? key : path + "." + key; }
  [[nodiscard]] At member(const std::string& key) const { return {value[key], path_of(key)}; }
};

double number(const At& at) {
  if (!at.value.is_number()) refuse(at.path, "must be a number, not " + shown(at.value));
  const double value = at.value.get<double>();
  if (!std::isfinite(value)) refuse(at.path, "must be a finite number");
  return value;
}

std::int64_t whole_number(const At& at) {
  const double value = number(at);
  if (value != std::floor(value) || std::abs(value) > 9007199254740992.0)  // 2^53: exact in every JSON reader
    refuse(at.path, "must be a whole number, not " + shown(at.value));
  return static_cast<std::int64_t>(value);
}

std::int32_t small_number(const At& at) {
  const std::int64_t value = whole_number(at);
  if (value < std::numeric_limits<std::int32_t>::min() || value > std::numeric_limits<std::int32_t>::max())
    refuse(at.path, shown(at.value) + " is out of range");
  return static_cast<std::int32_t>(value);
}

bool yes_or_no(const At& at) {
  if (!at.value.is_boolean()) refuse(at.path, "must be true or false, not " + shown(at.value));
  return at.value.get<bool>();
}

std::string text(const At& at) {
  if (!at.value.is_string()) refuse(at.path, "must be a string, not " + shown(at.value));
  return at.value.get<std::string>();
}

v1::Vector3 point(const At& at) {
  if (!at.value.is_array() || at.value.size() != 3) refuse(at.path, "must be a point [x, y, z], not " + shown(at.value));
  v1::Vector3 result;
  result.set_x(number(at.item(0)));
  result.set_y(number(at.item(1)));
  result.set_z(number(at.item(2)));
  return result;
}

void each(const At& at, const std::function<void(const At&)>& read) {
  if (!at.value.is_array()) refuse(at.path, "must be a list, not " + shown(at.value));
  for (std::size_t i = 0; i < at.value.size(); ++i) read(at.item(i));
}

template <class E>
using Words = std::vector<std::pair<std::string_view, E>>;

template <class E>
E word_of(const At& at, const Words<E>& words) {
  const std::string word = text(at);
  std::vector<std::string_view> known;
  for (const auto& [name, value] : words) {
    if (name == word) return value;
    known.push_back(name);
  }
  const std::string meant = did_you_mean(word, known);
  refuse(at.path, "\"" + word + "\" is not one of " + list_of(known) + (meant.empty() ? "" : "; did you mean \"" + meant + "\"?"));
}

// The keys of an object and how each is read.
using Keys = std::vector<std::pair<std::string_view, std::function<void(const At&)>>>;

void object(const At& at, const Keys& keys, const std::vector<std::string_view>& required = {}) {
  if (!at.value.is_object()) refuse(at.path, "must be an object, not " + shown(at.value));
  for (const auto& [key, value] : at.value.items()) {
    const auto found = std::find_if(keys.begin(), keys.end(), [&, k = key](const auto& entry) { return entry.first == k; });
    const At member = at.member(key);
    if (found != keys.end()) {
      found->second(member);
      continue;
    }
    std::vector<std::string_view> known;
    for (const auto& entry : keys) known.push_back(entry.first);
    const std::string meant = did_you_mean(key, known);
    refuse(member.path, "unknown key" + (meant.empty() ? "; known here: " + list_of(known) : "; did you mean \"" + meant + "\"?"));
  }
  for (const std::string_view key : required)
    if (!at.value.contains(std::string(key))) refuse(at.path_of(std::string(key)), "is required");
}

const Words<v1::VolumeSpec::Mode> kModes = {{"points", v1::VolumeSpec::MODE_POINTS},
                                            {"all", v1::VolumeSpec::MODE_ALL},
                                            {"outermost", v1::VolumeSpec::MODE_OUTERMOST},
                                            {"solid", v1::VolumeSpec::MODE_SOLID}};
const Words<v1::FeatureSpec::SharpEdges> kSharpEdges = {{"exact", v1::FeatureSpec::SHARP_EDGES_EXACT},
                                                        {"fillet", v1::FeatureSpec::SHARP_EDGES_FILLET},
                                                        {"auto", v1::FeatureSpec::SHARP_EDGES_AUTO}};
const Words<v1::Ending> kEndings = {{"auto", v1::ENDING_AUTO},
                                    {"wedge", v1::ENDING_WEDGE},
                                    {"imprint", v1::ENDING_IMPRINT},
                                    {"cross_imprint", v1::ENDING_CROSS_IMPRINT},
                                    {"regular", v1::ENDING_REGULAR}};
const Words<v1::LayerSpec::GiveUp> kGiveUps = {{"growth", v1::LayerSpec::GIVE_UP_GROWTH},
                                               {"first_height", v1::LayerSpec::GIVE_UP_FIRST_HEIGHT},
                                               {"count", v1::LayerSpec::GIVE_UP_COUNT}};

template <class Message>
void read_patch_names(const At& at, Message& message) {
  each(at, [&](const At& name) { message.add_patches(text(name)); });
  if (message.patches().empty()) refuse(at.path, "must name at least one patch");
}

void read_volume(const At& at, v1::VolumeSpec& volume) {
  object(at, {{"mode", [&](const At& a) { volume.set_mode(word_of(a, kModes)); }},
              {"points", [&](const At& a) { each(a, [&](const At& p) { *volume.add_points() = point(p); }); }}});
}

void read_sizing(const At& at, v1::SizingSpec& sizing) {
  const auto read_patch_size = [&](const At& a) {
    v1::PatchSize& entry = *sizing.add_patches();
    object(a, {{"patches", [&](const At& p) { read_patch_names(p, entry); }}, {"size", [&](const At& s) { entry.set_size(number(s)); }}},
           {"patches", "size"});
  };
  const auto read_box = [&](const At& a) {
    v1::BoxSize& box = *sizing.add_boxes();
    object(a,
           {{"min", [&](const At& p) { *box.mutable_min() = point(p); }},
            {"max", [&](const At& p) { *box.mutable_max() = point(p); }},
            {"size", [&](const At& s) { box.set_size(number(s)); }}},
           {"min", "max", "size"});
  };
  const auto read_sphere = [&](const At& a) {
    v1::SphereSize& sphere = *sizing.add_spheres();
    object(a,
           {{"centre", [&](const At& p) { *sphere.mutable_centre() = point(p); }},
            {"radius", [&](const At& r) { sphere.set_radius(number(r)); }},
            {"size", [&](const At& s) { sphere.set_size(number(s)); }}},
           {"centre", "radius", "size"});
  };
  const auto read_cylinder = [&](const At& a) {
    v1::CylinderSize& cylinder = *sizing.add_cylinders();
    object(a,
           {{"from", [&](const At& p) { *cylinder.mutable_from() = point(p); }},
            {"to", [&](const At& p) { *cylinder.mutable_to() = point(p); }},
            {"radius", [&](const At& r) { cylinder.set_radius(number(r)); }},
            {"size", [&](const At& s) { cylinder.set_size(number(s)); }}},
           {"from", "to", "radius", "size"});
  };
  const auto read_curve = [&](const At& a) {
    v1::CurveSize& curve = *sizing.add_curves();
    object(a,
           {{"between", [&](const At& p) { each(p, [&](const At& n) { curve.add_between(text(n)); }); }},
            {"size", [&](const At& s) { curve.set_size(number(s)); }}},
           {"between", "size"});
  };
  const auto read_map = [&](const At& a) {
    v1::SizeMap& map = *sizing.mutable_background();
    object(a,
           {{"min", [&](const At& p) { *map.mutable_min() = point(p); }},
            {"max", [&](const At& p) { *map.mutable_max() = point(p); }},
            {"counts", [&](const At& c) { each(c, [&](const At& n) { map.add_counts(small_number(n)); }); }},
            {"sizes", [&](const At& s) { each(s, [&](const At& n) { map.add_sizes(number(n)); }); }}},
           {"min", "max", "counts", "sizes"});
  };
  object(at, {{"max_size", [&](const At& a) { sizing.set_max_size(number(a)); }},
              {"min_size", [&](const At& a) { sizing.set_min_size(number(a)); }},
              {"patches", [&](const At& a) { each(a, read_patch_size); }},
              {"curvature_deg", [&](const At& a) { sizing.set_curvature_deg(number(a)); }},
              {"gap_cells", [&](const At& a) { sizing.set_gap_cells(number(a)); }},
              {"boxes", [&](const At& a) { each(a, read_box); }},
              {"spheres", [&](const At& a) { each(a, read_sphere); }},
              {"cylinders", [&](const At& a) { each(a, read_cylinder); }},
              {"curves", [&](const At& a) { each(a, read_curve); }},
              {"background", read_map},
              {"min_level", [&](const At& a) { sizing.set_min_level(small_number(a)); }},
              {"max_level", [&](const At& a) { sizing.set_max_level(small_number(a)); }},
              {"gradation", [&](const At& a) { sizing.set_gradation(number(a)); }},
              {"max_cells", [&](const At& a) { sizing.set_max_cells(whole_number(a)); }}});
}

void read_features(const At& at, v1::FeatureSpec& features) {
  object(at, {{"ridge_angle_deg", [&](const At& a) { features.set_ridge_angle_deg(number(a)); }},
              {"sharp_edges", [&](const At& a) { features.set_sharp_edges(word_of(a, kSharpEdges)); }}});
}

// "both" or a region reference.
void read_side(const At& at, v1::LayerSpec& layer) {
  if (at.value == "both") return;
  if (at.value.is_string()) refuse(at.path, "must be \"both\" or a region number, not " + shown(at.value));
  layer.set_side(small_number(at));
}

// "auto", "none" or a count.
void read_blending(const At& at, v1::LayerSpec& layer) {
  if (at.value.is_number()) {
    layer.set_blending(v1::LayerSpec::BLENDING_COUNT);
    layer.set_blending_count(small_number(at));
    return;
  }
  const Words<v1::LayerSpec::Blending> words = {{"auto", v1::LayerSpec::BLENDING_AUTO}, {"none", v1::LayerSpec::BLENDING_NONE}};
  layer.set_blending(word_of(at, words));
}

void read_layer(const At& at, v1::LayerSpec& layer) {
  const auto read_neighbour = [&](const At& a) {
    v1::NeighbourEnding& neighbour = *layer.add_neighbours();
    object(a,
           {{"patches", [&](const At& p) { read_patch_names(p, neighbour); }},
            {"ending", [&](const At& e) { neighbour.set_ending(word_of(e, kEndings)); }}},
           {"patches", "ending"});
  };
  object(at,
         {{"patches", [&](const At& a) { read_patch_names(a, layer); }},
          {"count", [&](const At& a) { layer.set_count(small_number(a)); }},
          {"first_height", [&](const At& a) { layer.set_first_height(number(a)); }},
          {"growth", [&](const At& a) { layer.set_growth(number(a)); }},
          {"last_height", [&](const At& a) { layer.set_last_height(number(a)); }},
          {"total_thickness", [&](const At& a) { layer.set_total_thickness(number(a)); }},
          {"relative", [&](const At& a) { layer.set_relative(yes_or_no(a)); }},
          {"ending", [&](const At& a) { layer.set_ending(word_of(a, kEndings)); }},
          {"neighbours", [&](const At& a) { each(a, read_neighbour); }},
          {"push_wedge", [&](const At& a) { layer.set_push_wedge(yes_or_no(a)); }},
          {"side", [&](const At& a) { read_side(a, layer); }},
          {"blending", [&](const At& a) { read_blending(a, layer); }},
          {"give_up", [&](const At& a) { each(a, [&](const At& g) { layer.add_give_up(word_of(g, kGiveUps)); }); }},
          {"minimum_count", [&](const At& a) { layer.set_minimum_count(small_number(a)); }}},
         {"patches"});
}

v1::MeshSpec read_spec(const At& at) {
  v1::MeshSpec spec;
  const auto read_seed = [&](const At& a) {
    const std::int64_t seed = whole_number(a);
    if (seed < 0) refuse(a.path, "must not be negative");
    spec.set_seed(static_cast<std::uint64_t>(seed));
  };
  object(at, {{"volume", [&](const At& a) { read_volume(a, *spec.mutable_volume()); }},
              {"sizing", [&](const At& a) { read_sizing(a, *spec.mutable_sizing()); }},
              {"features", [&](const At& a) { read_features(a, *spec.mutable_features()); }},
              {"layers", [&](const At& a) { each(a, [&](const At& l) { read_layer(l, *spec.add_layers()); }); }},
              {"seed", read_seed}});
  return spec;
}

}  // namespace

std::string did_you_mean(std::string_view word, const std::vector<std::string_view>& known) {
  std::string_view best;
  std::size_t best_distance = std::max<std::size_t>(2, word.size() / 3) + 1;
  for (const std::string_view candidate : known) {
    const bool cut_short = word.size() >= 3 && candidate.substr(0, word.size()) == word;  // "ridge_angle" for "ridge_angle_deg"
    const std::size_t distance = cut_short ? 1 : edit_distance(word, candidate);
    if (distance < best_distance && distance < candidate.size()) {
      best_distance = distance;
      best = candidate;
    }
  }
  return std::string(best);
}

v1::MeshSpec parse_spec(std::string_view json) {
  if (json.size() > kMaxSpecBytes) refuse("", "the specification is larger than 1 MiB");
  Json document;
  try {
    document = Json::parse(json);
  } catch (const Json::exception& error) {
    const std::string what = error.what();  // "[json.exception.parse_error.101] parse error at line 1, column 2: ..."
    const std::size_t from = what.find("] ");
    refuse("", "the specification is not JSON: " + (from == std::string::npos ? what : what.substr(from + 2)));
  }
  return read_spec({document, ""});
}

}  // namespace strata::server
