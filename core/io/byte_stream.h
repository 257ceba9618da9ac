// Output in pieces of about 1 MiB: no writer ever holds a whole file.
#pragma once

#include <cstring>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "core/base/parallel.h"
#include "core/io/mesh_io.h"

namespace strata::io {

class ByteStream {
 public:
  explicit ByteStream(const ByteSink& sink) : sink_(sink) { buffer_.reserve(kPieceBytes); }

  void write(std::string_view bytes) {
    while (!bytes.empty()) {
      const std::string_view part = bytes.substr(0, kPieceBytes - buffer_.size());
      buffer_.insert(buffer_.end(), part.begin(), part.end());
      bytes.remove_prefix(part.size());
      if (buffer_.size() == kPieceBytes) flush();
    }
  }
  // Hands over what is left. A stream that is not finished (an exception passed by) loses its tail, never invents one.
  void finish() {
    if (!buffer_.empty()) flush();
  }

 private:
  static constexpr std::size_t kPieceBytes = std::size_t{1} << 20;

  void flush() {
    sink_(std::span<const char>(buffer_));
    buffer_.clear();
  }

  const ByteSink& sink_;
  std::vector<char> buffer_;
};

// Appends the bytes of a number as the machine has them.
template <class T>
void append(std::string& out, T value) {
  char raw[sizeof(T)];
  std::memcpy(raw, &value, sizeof(T));
  out.append(raw, sizeof(T));
}

// Writes the elements 0 .. count - 1: format(begin, end, text) appends some of them to a text, many texts at a time, written in order.
template <class Format>
void write_parallel(ByteStream& stream, std::size_t count, const Format& format) {
  constexpr std::size_t kBlock = 4096;  // elements: some 100 KiB of text
  constexpr std::size_t kBatch = 32;    // blocks in memory at a time
  std::vector<std::string> texts(kBatch);
  for (std::size_t first = 0; first < count; first += kBlock * kBatch) {
    const std::size_t here = std::min(count - first, kBlock * kBatch);
    const std::size_t blocks = (here + kBlock - 1) / kBlock;
    parallel_for(
        blocks,
        [&](std::size_t b) {
          texts[b].clear();
          format(first + b * kBlock, first + std::min(here, (b + 1) * kBlock), texts[b]);
        },
        1);
    for (std::size_t b = 0; b < blocks; ++b) stream.write(texts[b]);
  }
}

}  // namespace strata::io
