// STL comes in two forms with one ending, and binary headers may begin with "solid". The size decides first, then the look.
#include <algorithm>
#include <cstdint>
#include <cstring>

#include "core/io/read_error.h"
#include "core/io/surface_readers.h"
#include "core/io/text_cursor.h"

namespace strata::io {
namespace {

constexpr std::size_t kHeaderBytes = 84;    // 80 of free text and a count
constexpr std::size_t kTriangleBytes = 50;  // normal, three corners, attribute
constexpr std::size_t kLook = 1024;         // bytes looked at for control characters; a binary triangle or two are in there

bool size_fits_binary(std::span<const char> bytes) {
  if (bytes.size() < kHeaderBytes) return false;
  std::uint32_t count = 0;
  std::memcpy(&count, bytes.data() + 80, sizeof(count));
  return bytes.size() == kHeaderBytes + kTriangleBytes * static_cast<std::uint64_t>(count);
}

bool looks_like_text(std::span<const char> bytes) {
  TextCursor cursor(as_text(bytes));
  if (!is_keyword(cursor.word(), "solid")) return false;
  const auto is_control = [](char c) {
    const auto u = static_cast<unsigned char>(c);
    return u < 9 || (u > 13 && u < 32);
  };
  const auto look = bytes.first(std::min(bytes.size(), kLook));
  return std::none_of(look.begin(), look.end(), is_control);
}

}  // namespace

TriangleSoup read_stl(std::span<const char> bytes) {
  if (size_fits_binary(bytes)) return read_stl_binary(bytes);
  if (looks_like_text(bytes)) return read_stl_ascii(bytes);
  if (bytes.size() >= kHeaderBytes) return read_stl_binary(bytes);
  refuse(Reason::FileMalformed, Place::byte(0),
         "neither ASCII STL, which begins with 'solid', nor binary STL, whose header takes 84 bytes; the file has " +
             std::to_string(bytes.size()),
         {{"size", static_cast<double>(bytes.size())}});
}

}  // namespace strata::io
