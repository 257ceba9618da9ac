// A position in binary data whose numbers may be in the other byte order.
#pragma once

#include <algorithm>
#include <cstring>
#include <span>

#include "core/io/read_error.h"

namespace strata::io {

enum class ByteOrder { Native, Swapped };

class ByteCursor {
 public:
  ByteCursor(std::span<const char> bytes, std::size_t at, ByteOrder order) : bytes_(bytes), at_(at), order_(order) {}

  [[nodiscard]] std::size_t offset() const { return at_; }
  [[nodiscard]] std::size_t bytes_left() const { return bytes_.size() - at_; }
  [[nodiscard]] Place place() const { return Place::byte(at_); }
  // The offset must lie inside the data or at its end.
  void seek(std::size_t offset) { at_ = offset; }

  // The next number; `what` names it when the data ends first.
  template <class T>
  T next(const char* what) {
    if (bytes_left() < sizeof(T)) refuse(Reason::FileMalformed, place(), std::string("the file ends where ") + what + " is expected");
    char raw[sizeof(T)];
    std::memcpy(raw, bytes_.data() + at_, sizeof(T));
    if (order_ == ByteOrder::Swapped) std::reverse(raw, raw + sizeof(T));
    at_ += sizeof(T);
    T value;
    std::memcpy(&value, raw, sizeof(T));
    return value;
  }

 private:
  std::span<const char> bytes_;
  std::size_t at_;
  ByteOrder order_;
};

}  // namespace strata::io
