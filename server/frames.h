// Cutting blobs into frames and checking the frames that come.
#pragma once

#include <cstdint>
#include <memory>
#include <utility>

#include "proto/wire/frame.h"
#include "server/blob_store.h"
#include "server/services.h"
#include "strata/v1/blob.pb.h"

namespace strata::server {

// Sends a blob, or a part of it, frame by frame.
class FrameCutter {
 public:
  FrameCutter() = default;
  FrameCutter(std::unique_ptr<BlobReader> reader, std::int64_t from, std::int64_t end, v1::Codec codec)
      : reader_(std::move(reader)), at_(from), end_(end), choice_(codec) {}

  [[nodiscard]] bool more() const { return at_ < end_; }
  // The next one, up to the next multiple of 1 MiB. Throws Refusal DATA_LOSS when the blob is shorter than it was.
  void cut(v1::Frame& frame);

 private:
  std::unique_ptr<BlobReader> reader_;
  std::int64_t at_ = 0, end_ = 0;
  wire::PackingChoice choice_{v1::CODEC_UNSPECIFIED};
};

// Which of them to use: the one that packs best, or none.
v1::Codec best_codec(const google::protobuf::RepeatedField<int>& accepted);
inline constexpr v1::Codec kCodecs[] = {v1::CODEC_ZSTD};

// Turns a frame that came into its plain form. Throws Refusal: DATA_LOSS FRAME_CRC_MISMATCH; INVALID_ARGUMENT when empty or too large;
// UNIMPLEMENTED CODEC_UNSUPPORTED.
void open_frame(v1::Frame& frame, const WireLimits& limits);

void check_upload(std::int64_t size, const std::string& sha256, const WireLimits& limits);

v1::Blob to_wire(const BlobInfo& blob);

}  // namespace strata::server
