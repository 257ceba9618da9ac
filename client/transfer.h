// Surfaces up, meshes down: in checksummed frames, resumed where they broke off.
#pragma once

#include <functional>
#include <string>

#include "client/connection.h"

namespace strata::client {

using TransferProgress = std::function<void(std::int64_t done, std::int64_t total)>;

// Uploads a file; returns its blob id. Goes on from the committed offset after a lost connection, up to `retries` times without progress.
std::string upload(Connection& connection, const std::string& path, int retries, const TransferProgress& progress);

// Downloads a blob into `path`: into path.part first, verified frame by frame and as a whole, then renamed. A .part of the same blob left
// by an earlier run is continued.
void download(Connection& connection, const v1::Blob& blob, const std::string& path, int retries, const TransferProgress& progress);

// Removes what a broken download of `path` left, when nothing can continue it.
void discard_partial(const std::string& path);

}  // namespace strata::client
