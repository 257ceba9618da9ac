// What a request must be before anybody looks at whether there is room for it now: well formed, and no more than this server could ever do.
#pragma once

#include <atomic>
#include <chrono>
#include <cstdint>
#include <optional>
#include <string>

#include "server/blob_store.h"
#include "server/caller.h"
#include "server/checker.h"
#include "server/estimates.h"
#include "server/mesher_door.h"
#include "server/refusal.h"
#include "strata/v1/job.pb.h"

namespace strata::server {

// A field of a request is wrong.
Refusal invalid_field(const std::string& field, const std::string& message);

// SHA-256.
std::string digest_of(const std::string& bytes);

// Equal requests have equal fingerprints.
std::string fingerprint_of(const v1::CreateJobRequest& request);

inline constexpr int kMaxLabels = 32;  // of a job

struct AdmissionOptions {
  std::int64_t max_inline_surface_bytes = std::int64_t{1} << 20;
  std::int64_t memory_budget_bytes = 0;  // of all jobs together; 0: no limit
  std::int64_t max_cells = 0;  // of a job's octree, unless it asks for fewer; 0: no limit
  int threads = 1;  // of a check
  std::chrono::duration<double> estimate_within{10};  // else a job is admitted without
};

// Look at a surface to price its job, which takes a while, unless this rises; null: only costs that are known from before count.
using PriceUnless = const std::atomic<bool>*;

// Safe to call from any thread.
class Admission {
 public:
  Admission(const BlobStore& blobs, Checker& checker, MesherDoor mesher, const AdmissionOptions& options);

  // Throws Refusal or MeshError(InvalidInput). On return the specification is typed and complete and there is at least one output.
  void check(const Caller& caller, v1::CreateJobRequest& request) const;
  // What a checked request would cost, when that can be told. Throws MeshError or JobRefused (RESOURCE_EXHAUSTED, MEMORY_BUDGET_EXCEEDED, with
  // the figures) when it could never run here.
  std::optional<v1::Estimate> cost(const v1::CreateJobRequest& request, PriceUnless unless);
  // What a run found out.
  void learn(const v1::CreateJobRequest& request, const v1::Estimate& estimate);
  // Throws Refusal, MeshError or JobRefused.
  v1::ValidateJobResponse validate(const Caller& caller, const v1::ValidateJobRequest& request, const std::atomic<bool>& cancelled);

  [[nodiscard]] const AdmissionOptions& options() const { return options_; }

 private:
  [[nodiscard]] v1::MeshSpec checked_spec(v1::MeshSpec wire) const;
  void check_surface(const Caller& caller, const v1::Surface& surface) const;
  [[nodiscard]] std::string cost_key(const v1::Surface& surface, const v1::MeshSpec& spec) const;

  const BlobStore& blobs_;
  Checker& checker_;
  const MesherDoor mesher_;
  const AdmissionOptions options_;
  Estimates estimates_;
};

}  // namespace strata::server
