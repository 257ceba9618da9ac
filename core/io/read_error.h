// How readers refuse a file: one exception type, always with the place and what was expected there.
#pragma once

#include <cstddef>
#include <cstdint>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "core/base/diagnostic.h"

namespace strata::io {

// A line (counted from 1) of a text file, or a byte offset (counted from 0) of a binary one.
struct Place {
  enum class Unit { Line, Byte, None };
  Unit unit = Unit::None;
  std::int64_t at = 0;

  static Place line(std::int64_t number) { return {Unit::Line, number}; }
  static Place byte(std::size_t offset) { return {Unit::Byte, static_cast<std::int64_t>(offset)}; }
};

using Values = std::vector<std::pair<std::string, double>>;

// Throws MeshError(InvalidInput) with the message "line 12: ...".
[[noreturn]] void refuse(Reason reason, Place place, const std::string& message, Values values = {});

// Text of the file made safe for a message: quoted, cut to a few dozen characters, unprintable bytes as '?'.
std::string shown(std::string_view text);

// Throws MeshError(LimitExceeded, FileTooLarge) when a file holds more of something than an index can name.
void require_indexable(std::size_t count, std::string_view what);

inline bool has_room(std::uint64_t count, std::size_t bytes_left, std::size_t least_bytes) { return count <= bytes_left / least_bytes; }
// Throws FileMalformed when a header promises more records than the bytes behind it can hold, so that no header's count
// ever decides an allocation. `least_bytes` is what one record takes at the least.
void require_room(std::uint64_t count, std::size_t bytes_left, std::size_t least_bytes, std::string_view what, Place place);

// Throws SurfaceIndexOutOfRange; `index` and `count` as the file writes them.
[[noreturn]] void refuse_index(Place place, std::string_view element, std::int64_t index, std::size_t count);

}  // namespace strata::io
