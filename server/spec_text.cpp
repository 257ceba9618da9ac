// The way back: a typed specification as the JSON that parse_spec reads.
#include <google/protobuf/descriptor.h>

#include <algorithm>
#include <cctype>
#include <nlohmann/json.hpp>
#include <vector>

#include "server/spec_json.h"

namespace strata::server {
namespace {

using Json = nlohmann::ordered_json;
using google::protobuf::FieldDescriptor;
using google::protobuf::Message;

Json object_of(const Message& message);

// "cross_imprint" for ENDING_CROSS_IMPRINT: without what it shares with ENDING_UNSPECIFIED.
std::string word_of(const google::protobuf::EnumValueDescriptor& value) {
  const std::string zero = value.type()->FindValueByNumber(0)->name();
  std::string word = value.name().substr(zero.size() - std::string("UNSPECIFIED").size());
  std::transform(word.begin(), word.end(), word.begin(), [](unsigned char c) { return static_cast<char>(std::tolower(c)); });
  return word;
}

Json of_message(const Message& message) {
  if (message.GetDescriptor() != v1::Vector3::descriptor()) return object_of(message);
  const auto& point = static_cast<const v1::Vector3&>(message);
  return {point.x(), point.y(), point.z()};
}

// The value of a field; of its entry `i`, when it is repeated.
Json value_of(const Message& message, const FieldDescriptor& field, int i) {
  const auto& reflection = *message.GetReflection();
  const bool one = i < 0;
  switch (field.cpp_type()) {
    case FieldDescriptor::CPPTYPE_DOUBLE:
      return one ? reflection.GetDouble(message, &field) : reflection.GetRepeatedDouble(message, &field, i);
    case FieldDescriptor::CPPTYPE_INT32:
      return one ? reflection.GetInt32(message, &field) : reflection.GetRepeatedInt32(message, &field, i);
    case FieldDescriptor::CPPTYPE_INT64:
      return one ? reflection.GetInt64(message, &field) : reflection.GetRepeatedInt64(message, &field, i);
    case FieldDescriptor::CPPTYPE_UINT64:
      return one ? reflection.GetUInt64(message, &field) : reflection.GetRepeatedUInt64(message, &field, i);
    case FieldDescriptor::CPPTYPE_BOOL: return one ? reflection.GetBool(message, &field) : reflection.GetRepeatedBool(message, &field, i);
    case FieldDescriptor::CPPTYPE_STRING:
      return one ? reflection.GetString(message, &field) : reflection.GetRepeatedString(message, &field, i);
    case FieldDescriptor::CPPTYPE_ENUM:
      return word_of(one ? *reflection.GetEnum(message, &field) : *reflection.GetRepeatedEnum(message, &field, i));
    case FieldDescriptor::CPPTYPE_MESSAGE:
      return of_message(one ? reflection.GetMessage(message, &field) : reflection.GetRepeatedMessage(message, &field, i));
    default: return nullptr;  // the specification has no others
  }
}

Json object_of(const Message& message) {
  std::vector<const FieldDescriptor*> fields;
  message.GetReflection()->ListFields(message, &fields);
  Json object = Json::object();
  for (const FieldDescriptor* field : fields) {
    Json& value = object[field->name()];
    if (!field->is_repeated()) {
      value = value_of(message, *field, -1);
      continue;
    }
    value = Json::array();
    for (int i = 0; i < message.GetReflection()->FieldSize(message, field); ++i) value.push_back(value_of(message, *field, i));
  }
  if (message.GetDescriptor() == v1::LayerSpec::descriptor()) {
    const auto& layer = static_cast<const v1::LayerSpec&>(message);
    if (layer.blending() == v1::LayerSpec::BLENDING_COUNT) object["blending"] = layer.blending_count();
    object.erase("blending_count");
  }
  return object;
}

}  // namespace

std::string spec_text(const v1::MeshSpec& spec) { return object_of(spec).dump(1, ' ', false, Json::error_handler_t::replace) + "\n"; }

}  // namespace strata::server
