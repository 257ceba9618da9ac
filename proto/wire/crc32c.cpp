#include "proto/wire/crc32c.h"

#include <array>
#include <cstring>
#include <string>

#if defined(__x86_64__)
#include <nmmintrin.h>
#endif

namespace strata::wire {
namespace {

constexpr std::uint32_t kPolynomial = 0x82F63B78;  // Castagnoli, reflected

constexpr std::array<std::uint32_t, 256> make_table() {
  std::array<std::uint32_t, 256> table{};
  for (std::uint32_t i = 0; i < 256; ++i) {
    std::uint32_t c = i;
    for (int bit = 0; bit < 8; ++bit) c = (c >> 1) ^ ((c & 1) != 0 ? kPolynomial : 0);
    table[i] = c;
  }
  return table;
}

std::uint32_t by_table(std::string_view bytes, std::uint32_t crc) {
  static constexpr auto kTable = make_table();
  for (const char byte : bytes) crc = (crc >> 8) ^ kTable[(crc ^ static_cast<unsigned char>(byte)) & 0xff];
  return crc;
}

#if defined(__x86_64__)
constexpr std::size_t kLane = 4096;

// What a lane of zeros makes of a checksum: linear over the bits, so the four bytes can be looked up one by one.
class LaneOfZeros {
 public:
  LaneOfZeros() {
    const std::string zeros(kLane, '\0');
    std::array<std::uint32_t, 32> of_bit{};
    for (std::size_t bit = 0; bit < of_bit.size(); ++bit) of_bit[bit] = by_table(zeros, std::uint32_t{1} << bit);
    for (std::size_t byte = 0; byte < 4; ++byte)
      for (std::size_t value = 0; value < 256; ++value)
        for (std::size_t bit = 0; bit < 8; ++bit)
          if ((value >> bit & 1) != 0) of_byte_[byte][value] ^= of_bit[8 * byte + bit];
  }
  [[nodiscard]] std::uint32_t after(std::uint32_t crc) const {
    return of_byte_[0][crc & 0xff] ^ of_byte_[1][crc >> 8 & 0xff] ^ of_byte_[2][crc >> 16 & 0xff] ^ of_byte_[3][crc >> 24];
  }

 private:
  std::array<std::array<std::uint32_t, 256>, 4> of_byte_{};
};

__attribute__((target("sse4.2"))) std::uint64_t add_word(std::uint64_t crc, const char* at) {
  std::uint64_t word;
  std::memcpy(&word, at, sizeof word);
  return _mm_crc32_u64(crc, word);
}

// The instruction answers after three cycles and takes a new word every one: three lanes side by side keep it busy.
__attribute__((target("sse4.2"))) std::uint32_t by_instruction(std::string_view bytes, std::uint32_t crc) {
  static const LaneOfZeros lane;
  const char* at = bytes.data();
  std::size_t left = bytes.size();
  for (; left >= 3 * kLane; left -= 3 * kLane, at += 3 * kLane) {
    std::uint64_t first = crc, second = 0, third = 0;
    for (std::size_t i = 0; i < kLane; i += 8) {
      first = add_word(first, at + i);
      second = add_word(second, at + kLane + i);
      third = add_word(third, at + 2 * kLane + i);
    }
    crc =
        lane.after(lane.after(static_cast<std::uint32_t>(first)) ^ static_cast<std::uint32_t>(second)) ^ static_cast<std::uint32_t>(third);
  }
  std::uint64_t wide = crc;
  for (; left >= 8; left -= 8, at += 8) wide = add_word(wide, at);
  return by_table({at, left}, static_cast<std::uint32_t>(wide));
}
#endif

}  // namespace

std::uint32_t crc32c(std::string_view bytes, std::uint32_t before) {
#if defined(__x86_64__)
  if (__builtin_cpu_supports("sse4.2")) return ~by_instruction(bytes, ~before);
#endif
  return ~by_table(bytes, ~before);
}

}  // namespace strata::wire
