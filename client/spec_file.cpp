#include "client/spec_file.h"

#include <yaml-cpp/yaml.h>

#include <charconv>
#include <filesystem>
#include <fstream>
#include <nlohmann/json.hpp>
#include <sstream>

#include "client/exit_code.h"
#include "client/status.h"

namespace strata::client {
namespace {

using nlohmann::json;

// What is quoted is text ("!" is yaml-cpp's tag for that); the rest is what JSON would make of it.
json scalar(const YAML::Node& node) {
  const std::string& text = node.Scalar();
  if (node.Tag() == "!") return text;
  if (text == "true" || text == "false") return text == "true";
  if (text.empty() || text == "null" || text == "~") return nullptr;
  std::int64_t whole = 0;
  const char* end = text.data() + text.size();
  if (const auto [stop, error] = std::from_chars(text.data(), end, whole); error == std::errc() && stop == end) return whole;
  double number = 0;
  if (const auto [stop, error] = std::from_chars(text.data(), end, number); error == std::errc() && stop == end) return number;
  return text;
}

json to_json(const YAML::Node& node) {
  if (node.IsScalar()) return scalar(node);
  if (node.IsSequence()) {
    json list = json::array();
    for (const YAML::Node& item : node) list.push_back(to_json(item));
    return list;
  }
  json map = json::object();
  for (const auto& entry : node) map[entry.first.as<std::string>()] = to_json(entry.second);
  return map;
}

bool is_yaml(const std::string& path) {
  const std::string ending = std::filesystem::path(path).extension().string();
  return ending == ".yaml" || ending == ".yml";
}

}  // namespace

std::string spec_json_of(const std::string& path) {
  std::ifstream in(path, std::ios::binary);
  std::ostringstream text;
  text << in.rdbuf();
  if (!in) throw CommandError(ExitCode::Usage, "'" + path + "' (the specification) cannot be read");
  if (!is_yaml(path)) return text.str();
  try {
    return safe_dump(to_json(YAML::Load(text.str())));
  } catch (const YAML::Exception& error) {
    throw CommandError(ExitCode::InputRejected, "'" + path + "' is no YAML: " + error.what());
  }
}

}  // namespace strata::client
