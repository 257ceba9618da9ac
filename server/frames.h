// Cutting blobs into frames and checking the frames that come.
#pragma once

#include <cstdint>

#include "server/blob_store.h"
#include "server/services.h"
#include "strata/v1/blob.pb.h"

namespace strata::server {

// Fills the frame that begins at `offset` and ends before `end` or at the next multiple of 1 MiB.
void fill_frame(const BlobReader& reader, std::int64_t offset, std::int64_t end, v1::Frame& frame);

// Throws Refusal: DATA_LOSS FRAME_CRC_MISMATCH, INVALID_ARGUMENT when empty or too large.
void check_frame(const v1::Frame& frame, const WireLimits& limits);

void check_upload(std::int64_t size, const std::string& sha256, const WireLimits& limits);

v1::Blob to_wire(const BlobInfo& blob);

}  // namespace strata::server
