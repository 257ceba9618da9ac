// The blobs of a worker process: one surface to read, results into a folder from which the server takes them.
#pragma once

#include <memory>
#include <string>

#include "server/blob_store.h"

namespace strata::server {

std::unique_ptr<BlobStore> make_staged_blobs(BlobInfo surface, std::string surface_path, std::string folder, Durability durability);

}  // namespace strata::server
