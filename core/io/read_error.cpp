#include "core/io/read_error.h"

#include <limits>

namespace strata::io {
namespace {

constexpr std::size_t kMostQuoted = 40;  // characters of the file repeated in a message; messages travel in headers

std::string prefix(Place place) {
  switch (place.unit) {
    case Place::Unit::Line: return "line " + std::to_string(place.at) + ": ";
    case Place::Unit::Byte: return "byte " + std::to_string(place.at) + ": ";
    case Place::Unit::None: return {};
  }
  return {};
}

[[noreturn]] void raise(Failure failure, Reason reason, Place place, const std::string& message, Values values) {
  if (place.unit == Place::Unit::Line) values.emplace_back("line", static_cast<double>(place.at));
  if (place.unit == Place::Unit::Byte) values.emplace_back("byte", static_cast<double>(place.at));
  Diagnostic diagnostic;
  diagnostic.reason = reason;
  diagnostic.message = prefix(place) + message;
  diagnostic.values = std::move(values);
  throw MeshError(failure, std::move(diagnostic));
}

}  // namespace

void refuse(Reason reason, Place place, const std::string& message, Values values) {
  raise(Failure::InvalidInput, reason, place, message, std::move(values));
}

std::string shown(std::string_view text) {
  std::string out = "'";
  for (char c : text.substr(0, kMostQuoted)) out += c >= ' ' && c <= '~' ? c : '?';
  if (text.size() > kMostQuoted) out += "...";
  return out + "'";
}

void require_indexable(std::size_t count, std::string_view what) {
  constexpr auto kMost = static_cast<std::size_t>(std::numeric_limits<std::int32_t>::max());
  if (count <= kMost) return;
  raise(Failure::LimitExceeded, Reason::FileTooLarge, {},
        std::to_string(count) + " " + std::string(what) + " are more than the " + std::to_string(kMost) + " supported",
        {{"count", static_cast<double>(count)}, {"limit", static_cast<double>(kMost)}});
}

void require_room(std::uint64_t count, std::size_t bytes_left, std::size_t least_bytes, std::string_view what, Place place) {
  const std::uint64_t most = bytes_left / least_bytes;
  if (count <= most) return;
  refuse(Reason::FileMalformed, place,
         "the file promises " + std::to_string(count) + " " + std::string(what) + " but the " + std::to_string(bytes_left) +
             " bytes left hold at most " + std::to_string(most),
         {{"promised", static_cast<double>(count)}, {"most", static_cast<double>(most)}, {"bytes_left", static_cast<double>(bytes_left)}});
}

void refuse_index(Place place, std::string_view element, std::int64_t index, std::size_t count) {
  refuse(Reason::SurfaceIndexOutOfRange, place,
         std::string(element) + " names vertex " + std::to_string(index) + ", but there are " + std::to_string(count),
         {{"index", static_cast<double>(index)}, {"vertices", static_cast<double>(count)}});
}

}  // namespace strata::io
