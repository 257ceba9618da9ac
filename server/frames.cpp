#include "server/frames.h"

#include <algorithm>

#include "proto/wire/crc32c.h"
#include "server/refusal.h"

namespace strata::server {

void FrameCutter::cut(v1::Frame& frame) {
  const std::int64_t stop = std::min(end_, (at_ / wire::kFrameBytes + 1) * wire::kFrameBytes);
  std::string& data = *frame.mutable_data();
  data.resize(static_cast<std::size_t>(stop - at_));
  if (reader_->read(at_, data) != data.size()) throw Refusal(Refused::DataLoss, "BLOB_TRUNCATED", "the stored blob is shorter than it was");
  frame.set_offset(at_);
  at_ = stop;
  wire::seal_frame(frame, choice_.next());
  choice_.sent(frame);
}

v1::Codec best_codec(const google::protobuf::RepeatedField<int>& accepted) {
  const bool zstd = std::find(accepted.begin(), accepted.end(), v1::CODEC_ZSTD) != accepted.end();
  return zstd ? v1::CODEC_ZSTD : v1::CODEC_UNSPECIFIED;
}

void open_frame(v1::Frame& frame, const WireLimits& limits) {
  switch (wire::open_frame(frame, limits.max_frame_bytes)) {
    case wire::FrameFault::None: return;
    case wire::FrameFault::Size:
      throw Refusal(Refused::InvalidArgument, "FRAME_INVALID",
                    "a frame has 1 to " + std::to_string(limits.max_frame_bytes) + " bytes, packed and plain, not " +
                        std::to_string(std::max<std::int64_t>(static_cast<std::int64_t>(frame.data().size()), frame.decoded_size())))
          .at("frame.data");
    case wire::FrameFault::Codec:
      throw Refusal(Refused::Unimplemented, "CODEC_UNSUPPORTED",
                    "frames packed with codec " + std::to_string(frame.codec()) + " cannot be read here: send them as they are")
          .at("frame.codec");
    case wire::FrameFault::Damaged:
      throw Refusal(Refused::DataLoss, "FRAME_CRC_MISMATCH",
                    "the frame at offset " + std::to_string(frame.offset()) + " was damaged on its way: send it again")
          .at("frame.crc32c");
  }
}

void check_upload(std::int64_t size, const std::string& sha256, const WireLimits& limits) {
  if (size < 1) throw Refusal(Refused::InvalidArgument, "REQUEST_INVALID", "size_bytes must be at least 1").at("size_bytes");
  if (size > limits.max_upload_bytes)
    throw Refusal(Refused::InvalidArgument, "UPLOAD_TOO_LARGE",  // it will not be smaller when it comes again
                  "uploads are limited to " + std::to_string(limits.max_upload_bytes) + " bytes")
        .at("size_bytes");
  if (!sha256.empty() && sha256.size() != 32)
    throw Refusal(Refused::InvalidArgument, "REQUEST_INVALID", "sha256 has 32 bytes").at("sha256");
}

v1::Blob to_wire(const BlobInfo& blob) {
  v1::Blob wire;
  wire.set_blob_id(blob.id);
  wire.set_size_bytes(blob.size);
  wire.set_sha256(blob.sha256);
  return wire;
}

}  // namespace strata::server
