// Every field of a specification with a value that it cannot have, one after the other, found in the descriptors: refused by the name of that field.
#include <google/protobuf/descriptor.h>
#include <google/protobuf/message.h>
#include <gtest/gtest.h>

#include <limits>
#include <set>
#include <string>
#include <vector>

#include "core/spec/mesh_spec.h"
#include "server/convert.h"
#include "server/spec_json.h"

namespace strata::server {
namespace {

using google::protobuf::FieldDescriptor;
using google::protobuf::Message;

// Has every message once.
constexpr const char* kGood = R"({
  "volume": {"mode": "points", "points": [[0.1, 0.1, 0.1]]},
  "sizing": {"max_size": 0.5, "min_size": 0.01, "patches": [{"patches": ["*"], "size": 0.2}], "curvature_deg": 15, "gap_cells": 3,
             "boxes": [{"min": [0,0,0], "max": [1,1,1], "size": 0.3}], "spheres": [{"centre": [0,0,0], "radius": 2, "size": 0.4}],
             "cylinders": [{"from": [0,0,0], "to": [0,0,1], "radius": 3, "size": 0.6}], "curves": [{"between": ["*"], "size": 0.05}],
             "background": {"min": [0,0,0], "max": [1,2,3], "counts": [2,2,2], "sizes": [1,2,3,4,5,6,7,8]},
             "min_level": 3, "max_level": 9, "gradation": 1.5, "max_cells": 100000},
  "features": {"ridge_angle_deg": 30, "sharp_edges": "fillet"},
  "layers": [{"patches": ["*"], "count": 3, "first_height": 0.01, "growth": 1.2, "ending": "auto", "side": 1, "blending": 3,
              "neighbours": [{"patches": ["*"], "ending": "regular"}], "give_up": ["count"], "minimum_count": 2}]})";

// Any value of these is one.
const std::set<std::string> kAnything = {"seed", "layers[0].relative", "layers[0].push_wedge"};

using Path = std::vector<const FieldDescriptor*>;

// As errors name it: the first of each list.
std::string name_of(const Path& path) {
  std::string name;
  for (const FieldDescriptor* field : path) {
    if (!name.empty()) name += '.';
    name += field->name();
    const bool is_leaf = field == path.back();
    if (field->is_repeated() && !is_leaf) name += "[0]";
  }
  return name;
}

void collect(const google::protobuf::Descriptor& type, const Path& above, std::vector<Path>& paths) {
  for (int i = 0; i < type.field_count(); ++i) {
    Path path = above;
    path.push_back(type.field(i));
    if (kAnything.contains(name_of(path))) continue;
    const auto* part = type.field(i)->message_type();
    if (part != nullptr) collect(*part, path, paths);
    const bool is_required = part == v1::Vector3::descriptor() && !type.field(i)->is_repeated();
    if (part == nullptr || is_required) paths.push_back(path);
  }
}

// No number, one too small, a choice that is none, an empty list of names, nothing where something is required.
void spoil(Message& message, const FieldDescriptor& field) {
  const auto& reflection = *message.GetReflection();
  const bool first = field.is_repeated();
  constexpr double kNan = std::numeric_limits<double>::quiet_NaN();
  switch (field.cpp_type()) {
    case FieldDescriptor::CPPTYPE_STRING:
    case FieldDescriptor::CPPTYPE_MESSAGE: return reflection.ClearField(&message, &field);
    case FieldDescriptor::CPPTYPE_DOUBLE:
      return first ? reflection.SetRepeatedDouble(&message, &field, 0, kNan) : reflection.SetDouble(&message, &field, kNan);
    case FieldDescriptor::CPPTYPE_INT32:
      return first ? reflection.SetRepeatedInt32(&message, &field, 0, -1) : reflection.SetInt32(&message, &field, -1);
    case FieldDescriptor::CPPTYPE_INT64: return reflection.SetInt64(&message, &field, -1);
    case FieldDescriptor::CPPTYPE_ENUM:
      return first ? reflection.SetRepeatedEnumValue(&message, &field, 0, 99) : reflection.SetEnumValue(&message, &field, 99);
    default: FAIL() << field.full_name() << ": no wrong value is known for its type";
  }
}

v1::MeshSpec spoiled(const Path& path) {
  v1::MeshSpec spec = parse_spec(kGood);
  Message* message = &spec;
  for (const FieldDescriptor* field : path) {
    if (field == path.back()) break;
    const auto& reflection = *message->GetReflection();
    message = field->is_repeated() ? reflection.MutableRepeatedMessage(message, field, 0) : reflection.MutableMessage(message, field);
  }
  spoil(*message, *path.back());
  return spec;
}

// The field that is told to be wrong; empty: none.
std::string refused_field(const v1::MeshSpec& wire) {
  try {
    for (const Diagnostic& finding : check(from_wire(wire), {"wall"})) {
      EXPECT_EQ(finding.reason, Reason::SpecInvalid) << finding.message;
      EXPECT_EQ(finding.message.rfind(finding.field, 0), 0u) << finding.message;
      return finding.field;
    }
  } catch (const MeshError& error) {
    EXPECT_EQ(error.failure(), Failure::InvalidInput);
    EXPECT_EQ(error.diagnostic().reason, Reason::SpecInvalid);
    return error.diagnostic().field;
  }
  return {};
}

// A coordinate is told by its point, the count of blending layers by "blending", one of a list by its number.
bool names(const std::string& told, const std::string& field) {
  constexpr std::size_t kLongestTail = 6;  // "_count"
  const bool is_it = field.rfind(told, 0) == 0 && field.size() - told.size() <= kLongestTail;
  return !told.empty() && (is_it || told == field + "[0]");
}

TEST(SpecFields, EachWithAWrongValueIsRefusedByItsName) {
  ASSERT_EQ(refused_field(parse_spec(kGood)), "") << "so it is the one field each time";
  std::vector<Path> paths;
  collect(*v1::MeshSpec::descriptor(), {}, paths);
  EXPECT_GE(paths.size(), 60u);
  for (const Path& path : paths) {
    const std::string told = refused_field(spoiled(path));
    EXPECT_TRUE(names(told, name_of(path))) << name_of(path) << " was called '" << told << "'";
  }
}

}  // namespace
}  // namespace strata::server
