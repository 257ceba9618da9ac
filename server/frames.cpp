#include "server/frames.h"

#include <algorithm>

#include "proto/wire/crc32c.h"
#include "server/refusal.h"

namespace strata::server {

void fill_frame(const BlobReader& reader, std::int64_t offset, std::int64_t end, v1::Frame& frame) {
  const std::int64_t stop = std::min(end, (offset / wire::kFrameBytes + 1) * wire::kFrameBytes);
  std::string& data = *frame.mutable_data();
  data.resize(static_cast<std::size_t>(stop - offset));
  if (reader.read(offset, data) != data.size())
    throw Refusal(Refused::DataLoss, "BLOB_TRUNCATED", "the stored blob is shorter than it was");
  frame.set_offset(offset);
  frame.set_crc32c(wire::crc32c(data));
}

void check_frame(const v1::Frame& frame, const WireLimits& limits) {
  const auto size = static_cast<std::int64_t>(frame.data().size());
  if (size == 0 || size > limits.max_frame_bytes)
    throw Refusal(Refused::InvalidArgument, "FRAME_INVALID",
                  "a frame has 1 to " + std::to_string(limits.max_frame_bytes) + " bytes, not " + std::to_string(size))
        .at("frame.data");
  if (wire::crc32c(frame.data()) != frame.crc32c())
    throw Refusal(Refused::DataLoss, "FRAME_CRC_MISMATCH",
                  "the frame at offset " + std::to_string(frame.offset()) + " was damaged on its way: send it again")
        .at("frame.crc32c");
}

void check_upload(std::int64_t size, const std::string& sha256, const WireLimits& limits) {
  if (size < 1) throw Refusal(Refused::InvalidArgument, "REQUEST_INVALID", "size_bytes must be at least 1").at("size_bytes");
  if (size > limits.max_upload_bytes)
    throw Refusal(Refused::ResourceExhausted, "UPLOAD_TOO_LARGE",
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
