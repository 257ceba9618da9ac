// Specification files (docs/formats.md) and the typed message.
#pragma once

#include <string>
#include <string_view>
#include <vector>

#include "strata/v1/spec.pb.h"

namespace strata::server {

inline constexpr std::size_t kMaxSpecBytes = std::size_t{1} << 20;

// Every key known, every type right, whole numbers whole; ranges are core's check(). Throws MeshError(InvalidInput, SpecInvalid) whose
// diagnostic names the path, such as layers[1].frist_height, and for unknown keys the key that was probably meant.
v1::MeshSpec parse_spec(std::string_view json);

// The way back: what parse_spec reads as the same message.
std::string spec_text(const v1::MeshSpec& spec);

// The closest of `known` to `word`, when close enough to be a typing error; else empty.
std::string did_you_mean(std::string_view word, const std::vector<std::string_view>& known);

}  // namespace strata::server
