// A frame that came over the wire, whatever it holds, is opened to bytes that fit its checksum within the size allowed, or refused; and what is
// sealed opens to the same bytes.
#include <cstddef>
#include <cstdint>
#include <cstdlib>
#include <string>

#include "proto/wire/crc32c.h"
#include "proto/wire/frame.h"

namespace {

namespace wire = strata::wire;
namespace v1 = strata::v1;

constexpr std::int64_t kMost = 1 << 16;

void require(bool holds) {
  if (!holds) std::abort();
}

void open_any(v1::Frame frame) {
  if (wire::open_frame(frame, kMost) != wire::FrameFault::None) return;
  require(!frame.data().empty() && static_cast<std::int64_t>(frame.data().size()) <= kMost);
  require(frame.codec() == v1::CODEC_UNSPECIFIED && frame.crc32c() == wire::crc32c(frame.data()));
}

void there_and_back(const std::string& bytes, v1::Codec codec) {
  if (bytes.empty() || static_cast<std::int64_t>(bytes.size()) > kMost) return;
  v1::Frame frame;
  frame.set_data(bytes);
  wire::seal_frame(frame, codec);
  require(wire::open_frame(frame, kMost) == wire::FrameFault::None);
  require(frame.data() == bytes);
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  const std::string bytes(reinterpret_cast<const char*>(data), size);
  v1::Frame frame;
  if (frame.ParseFromString(bytes)) open_any(frame);
  // As packed data whose sender says it is right: the first two bytes are the size it claims.
  if (size > 2) {
    v1::Frame packed;
    packed.set_codec(v1::CODEC_ZSTD);
    packed.set_decoded_size(data[0] + 256 * data[1]);
    packed.set_data(bytes.substr(2));
    open_any(packed);
  }
  there_and_back(bytes, v1::CODEC_UNSPECIFIED);
  there_and_back(bytes, v1::CODEC_ZSTD);
  return 0;
}
