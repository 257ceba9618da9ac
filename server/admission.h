// What a request must be before anybody looks at whether there is room for it.
#pragma once

#include <string>

#include "server/blob_store.h"
#include "server/caller.h"
#include "server/mesher_door.h"
#include "server/refusal.h"
#include "strata/v1/job.pb.h"

namespace strata::server {

// A field of a request is wrong.
Refusal invalid_field(const std::string& field, const std::string& message);

// Equal requests have equal fingerprints.
std::string fingerprint_of(const v1::CreateJobRequest& request);

class Admission {
 public:
  Admission(const BlobStore& blobs, MesherDoor mesher, std::int64_t max_inline_surface_bytes);

  // Throws Refusal or MeshError(InvalidInput). On return the specification is typed and complete and there is at least one output.
  void check(const Caller& caller, v1::CreateJobRequest& request) const;
  // The parts that ValidateJob shares.
  [[nodiscard]] v1::MeshSpec checked_spec(const v1::CreateJobRequest& request) const;
  [[nodiscard]] v1::MeshSpec checked_spec(const v1::ValidateJobRequest& request) const;
  void check_surface(const Caller& caller, const v1::Surface& surface) const;
  [[nodiscard]] std::int64_t max_inline_surface_bytes() const { return max_inline_surface_bytes_; }

 private:
  const BlobStore& blobs_;
  const MesherDoor mesher_;
  const std::int64_t max_inline_surface_bytes_;
};

}  // namespace strata::server
