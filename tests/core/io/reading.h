// Reading from a text in a test, and what a refusal says.
#pragma once

#include <cstring>
#include <optional>
#include <string>
#include <string_view>

#include "core/base/diagnostic.h"
#include "core/io/surface_io.h"

namespace strata::test {

inline TriangleSoup read(std::string_view text, io::SurfaceFormat format) {
  return io::read_surface(std::span<const char>(text.data(), text.size()), format);
}

struct Refusal {
  Reason reason;
  std::string message;
};

// What the reader said when it refused; empty when it read the file.
inline std::optional<Refusal> refusal(std::string_view text, io::SurfaceFormat format) {
  try {
    read(text, format);
    return std::nullopt;
  } catch (const MeshError& error) {
    return Refusal{error.diagnostic().reason, error.what()};
  }
}

// Appends the bytes of a number, turned round for files of the other byte order.
enum class Bytes { AsIs, Swapped };
template <class T>
void append(std::string& out, T value, Bytes order = Bytes::AsIs) {
  std::string raw(sizeof(T), '\0');
  std::memcpy(raw.data(), &value, sizeof(T));
  if (order == Bytes::Swapped) raw.assign(raw.rbegin(), raw.rend());
  out += raw;
}

}  // namespace strata::test
