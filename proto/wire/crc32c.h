// The checksum of frames: CRC32C (Castagnoli), as RFC 3720 defines it.
#pragma once

#include <cstdint>
#include <string_view>

namespace strata::wire {

// crc32c("123456789") is 0xE3069283. `before` continues: crc32c(b, crc32c(a)) is crc32c(a + b).
std::uint32_t crc32c(std::string_view bytes, std::uint32_t before = 0);

// Senders cut blobs at multiples of this.
inline constexpr std::int64_t kFrameBytes = std::int64_t{1} << 20;

}  // namespace strata::wire
