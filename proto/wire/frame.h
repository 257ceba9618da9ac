// Frames of uploads and downloads, as both ends pack and open them. What an offset, a length or a checksum speaks of is always the plain
// bytes: packing is between the two ends of one connection, and may change from frame to frame.
#pragma once

#include <cstdint>

#include "strata/v1/blob.pb.h"

namespace strata::wire {

// Readies a frame that has its offset and its plain data: adds the checksum, and packs the data with `codec` when that makes it smaller by a
// tenth at least.
void seal_frame(v1::Frame& frame, v1::Codec codec);

enum class FrameFault {
  None,
  Size,  // empty, or more than `most` bytes, packed or plain
  Codec,  // unknown
  Damaged,  // does not unpack to the bytes that the checksum is of
};
// Turns `frame` into its plain form. Never makes room for more than `most` bytes, whatever the frame says of itself.
FrameFault open_frame(v1::Frame& frame, std::int64_t most);

// Tells a sender whether to pack the next frame: after one that did not shrink, a few go as they are.
class PackingChoice {
 public:
  explicit PackingChoice(v1::Codec codec) : codec_(codec) {}
  [[nodiscard]] v1::Codec next() const { return plain_left_ > 0 ? v1::CODEC_UNSPECIFIED : codec_; }
  void sent(const v1::Frame& frame);

 private:
  v1::Codec codec_;
  int plain_left_ = 0;
};

}  // namespace strata::wire
