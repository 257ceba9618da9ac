// What a failure of ours needs to be looked into: the surface, the specification and the record of a job that ended with an internal error, kept
// where an administrator finds them.
#pragma once

#include <memory>
#include <string>

#include "server/blob_store.h"
#include "server/job_runner.h"

namespace strata::server {

struct BundleOptions {
  std::string folder;  // of all bundles
  int most = 20;  // the oldest go first; 0: none are kept
  std::string generator;  // version written into them
};

// A runner around a runner. A job that fails by a crash or a broken promise leaves FOLDER/TIME-JOB/ with surface.*, spec.json, job.json and a
// README that says how to run it again; the error names the bundle. The result must not outlive `runner` or `blobs`.
std::unique_ptr<JobRunner> keep_bundles(JobRunner& runner, const BlobStore& blobs, BundleOptions options);

}  // namespace strata::server
