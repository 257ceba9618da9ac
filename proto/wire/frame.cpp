#include "proto/wire/frame.h"

#include <zstd.h>

#include <string>
#include <string_view>
#include <utility>

#include "proto/wire/crc32c.h"

namespace strata::wire {
namespace {

constexpr int kLevel = 1;       // 250 MB/s a core and more; higher ones cost more time than they save on any network this is for
constexpr std::size_t kTelling = 4096;  // bytes; a smaller frame that does not shrink says nothing of the next
constexpr int kPlainFrames = 15;  // after one that did not shrink

bool smaller(std::size_t packed, std::size_t plain) { return packed + packed / 9 <= plain; }

std::string zstd(std::string_view bytes) {
  std::string packed(ZSTD_compressBound(bytes.size()), '\0');
  const std::size_t size = ZSTD_compress(packed.data(), packed.size(), bytes.data(), bytes.size(), kLevel);
  if (ZSTD_isError(size) != 0) return std::string(bytes);
  packed.resize(size);
  return packed;
}

bool unzstd(const std::string& packed, std::string& plain) {
  return ZSTD_decompress(plain.data(), plain.size(), packed.data(), packed.size()) == plain.size();
}

}  // namespace

void seal_frame(v1::Frame& frame, v1::Codec codec) {
  frame.set_crc32c(crc32c(frame.data()));
  frame.clear_codec();
  frame.clear_decoded_size();
  if (codec != v1::CODEC_ZSTD) return;
  std::string packed = zstd(frame.data());
  if (!smaller(packed.size(), frame.data().size())) return;
  frame.set_codec(v1::CODEC_ZSTD);
  frame.set_decoded_size(static_cast<std::int32_t>(frame.data().size()));
  frame.set_data(std::move(packed));
}

FrameFault open_frame(v1::Frame& frame, std::int64_t most) {
  const auto size = static_cast<std::int64_t>(frame.data().size());
  if (size < 1 || size > most) return FrameFault::Size;
  if (frame.codec() == v1::CODEC_ZSTD) {
    if (frame.decoded_size() < 1 || frame.decoded_size() > most) return FrameFault::Size;
    std::string plain(static_cast<std::size_t>(frame.decoded_size()), '\0');
    if (!unzstd(frame.data(), plain)) return FrameFault::Damaged;
    frame.set_data(std::move(plain));
    frame.clear_codec();
    frame.clear_decoded_size();
  } else if (frame.codec() != v1::CODEC_UNSPECIFIED) {
    return FrameFault::Codec;
  }
  return crc32c(frame.data()) == frame.crc32c() ? FrameFault::None : FrameFault::Damaged;
}

void PackingChoice::sent(const v1::Frame& frame) {
  if (plain_left_ > 0) --plain_left_;
  else if (codec_ != v1::CODEC_UNSPECIFIED && frame.data().size() >= kTelling && frame.codec() == v1::CODEC_UNSPECIFIED)
    plain_left_ = kPlainFrames;
}

}  // namespace strata::wire
