#include "server/admission.h"

#include <grpcpp/support/status_code_enum.h>

#include <cmath>
#include <set>
#include <thread>
#include <utility>

#include "core/mesher.h"
#include "proto/wire/sha256.h"
#include "server/canonical.h"
#include "server/convert.h"
#include "server/ids.h"
#include "server/job_error.h"
#include "server/memory_ledger.h"
#include "server/spec_json.h"

namespace strata::server {
namespace {

constexpr std::size_t kMaxRequestId = 128;
constexpr std::size_t kMaxDisplayName = 256;
constexpr std::size_t kMaxLabel = 128;
constexpr int kMaxPriority = 10;

void check_labels(const v1::CreateJobRequest& request) {
  if (request.request_id().size() > kMaxRequestId) throw invalid_field("request_id", "is longer than 128 characters");
  if (request.display_name().size() > kMaxDisplayName) throw invalid_field("display_name", "is longer than 256 characters");
  if (static_cast<int>(request.labels_size()) > kMaxLabels) throw invalid_field("labels", "are more than 32");
  for (const auto& [key, value] : request.labels())
    if (key.empty() || key.size() > kMaxLabel || value.size() > kMaxLabel)
      throw invalid_field("labels", "keys and values have 1 to 128 characters");
}

void check_outputs(v1::CreateJobRequest& request) {
  if (request.outputs().empty()) request.add_outputs(v1::OUTPUT_FORMAT_BLOCKS);
  std::set<int> seen;
  for (int i = 0; i < request.outputs_size(); ++i) {
    const std::string field = "outputs[" + std::to_string(i) + "]";
    const int format = request.outputs(i);
    if (format == v1::OUTPUT_FORMAT_UNSPECIFIED || !v1::OutputFormat_IsValid(format)) throw invalid_field(field, "is not a known format");
    if (!seen.insert(format).second) throw invalid_field(field, "is asked for twice");
  }
}

template <class Request>
v1::MeshSpec spec_in(const Request& request) {
  return request.has_spec_json() ? parse_spec(request.spec_json()) : request.spec();
}

v1::MeshSpec typed_spec(const v1::MeshSpec& wire, const MesherDoor& mesher) {
  const MeshSpec spec = from_wire(wire);
  for (Diagnostic& finding : mesher.check_spec(spec, {})) {
    // Which patches there are is known when the surface has been read.
    if (finding.severity != Severity::Error || finding.reason == Reason::PatchUnknown) continue;
    throw MeshError(Failure::InvalidInput, std::move(finding));
  }
  return to_wire(spec);
}

// Rings after a while, for what should not take longer, or when something else does.
class Alarm {
 public:
  Alarm(std::chrono::duration<double> after, const std::atomic<bool>& other)
      : thread_([this, after, &other](const std::stop_token& stop) {
          const auto until = std::chrono::steady_clock::now() + after;
          while (!stop.stop_requested() && !other && std::chrono::steady_clock::now() < until) std::this_thread::sleep_for(kLook);
          rang_ = true;
        }) {}
  [[nodiscard]] const std::atomic<bool>& rang() const { return rang_; }

 private:
  static constexpr std::chrono::milliseconds kLook{5};

  std::atomic<bool> rang_ = false;
  std::jthread thread_;
};

}  // namespace

Refusal invalid_field(const std::string& field, const std::string& message) {
  return Refusal(Refused::InvalidArgument, "REQUEST_INVALID", field + ": " + message).at(field);
}

std::string digest_of(const std::string& bytes) {
  wire::Sha256 sha;
  sha.add(bytes);
  return sha.finish();
}

std::string fingerprint_of(const v1::CreateJobRequest& request) { return digest_of(canonical_bytes(request)); }

Admission::Admission(const BlobStore& blobs, Checker& checker, MesherDoor mesher, const AdmissionOptions& options)
    : blobs_(blobs), checker_(checker), mesher_(std::move(mesher)), options_(options) {}

v1::MeshSpec Admission::checked_spec(v1::MeshSpec wire) const {
  if (options_.max_cells > 0) {
    auto& sizing = *wire.mutable_sizing();
    if (!sizing.has_max_cells() || sizing.max_cells() > options_.max_cells) sizing.set_max_cells(options_.max_cells);
  }
  return typed_spec(wire, mesher_);
}

void Admission::check_surface(const Caller& caller, const v1::Surface& surface) const {
  check_wire_surface(surface);
  switch (surface.source_case()) {
    case v1::Surface::SOURCE_NOT_SET: throw invalid_field("surface", "needs a blob_id or data");
    case v1::Surface::kData:
      if (static_cast<std::int64_t>(surface.data().size()) > options_.max_inline_surface_bytes)
        throw invalid_field("surface.data", "is larger than " + std::to_string(options_.max_inline_surface_bytes) + " bytes: upload it");
      return;
    case v1::Surface::kBlobId: {
      const auto blob = is_id(surface.blob_id()) ? blobs_.find(surface.blob_id()) : std::nullopt;
      if (!blob || !sees_blob(caller, *blob))
        throw Refusal(Refused::NotFound, "BLOB_NOT_FOUND", "surface.blob_id: there is no such blob").at("surface.blob_id");
    }
  }
}

void Admission::check(const Caller& caller, v1::CreateJobRequest& request) const {
  check_labels(request);
  check_outputs(request);
  check_surface(caller, request.surface());
  if (request.max_threads() < 0) throw invalid_field("max_threads", "must not be negative");
  if (!(request.time_limit_seconds() >= 0)) throw invalid_field("time_limit_seconds", "must not be negative");
  if (!(request.result_ttl_seconds() >= 0)) throw invalid_field("result_ttl_seconds", "must not be negative");
  if (std::abs(request.priority()) > kMaxPriority) throw invalid_field("priority", "must be -10 to 10");
  v1::MeshSpec spec = checked_spec(spec_in(request));
  *request.mutable_spec() = std::move(spec);
}

std::string Admission::cost_key(const v1::Surface& surface, const v1::MeshSpec& spec) const {
  if (surface.has_data()) return Estimates::key(digest_of(surface.data()), surface, spec);
  const auto blob = blobs_.find(surface.blob_id());
  return Estimates::key(blob ? blob->sha256 : surface.blob_id(), surface, spec);
}

std::optional<v1::Estimate> Admission::cost(const v1::CreateJobRequest& request, PriceUnless unless) {
  const std::string key = cost_key(request.surface(), request.spec());
  if (auto known = estimates_.find(key)) {
    refuse_what_never_fits(known->memory_bytes(), options_.memory_budget_bytes);
    return known;
  }
  if (unless == nullptr) return {};
  const Alarm alarm(options_.estimate_within, *unless);
  const CheckOrder order{request.surface(), request.spec(), options_.threads, CheckDepth::Cost};
  Checked checked = checker_.check(order, alarm.rang());
  if (checked.error && checked.error->code() == grpc::StatusCode::RESOURCE_EXHAUSTED) throw JobRefused(std::move(*checked.error));
  if (checked.error || !checked.report.has_estimate()) return {};  // what is wrong is said by the run
  estimates_.remember(key, checked.report.estimate());
  return std::move(*checked.report.mutable_estimate());
}

void Admission::learn(const v1::CreateJobRequest& request, const v1::Estimate& estimate) {
  estimates_.remember(cost_key(request.surface(), request.spec()), estimate);
}

v1::ValidateJobResponse Admission::validate(const Caller& caller, const v1::ValidateJobRequest& request,
                                            const std::atomic<bool>& cancelled) {
  check_surface(caller, request.surface());
  v1::ValidateJobResponse response;
  v1::MeshSpec spec;
  try {
    spec = checked_spec(spec_in(request));
  } catch (const MeshError& error) {
    if (error.failure() != Failure::InvalidInput) throw;
    *response.add_findings() = to_wire(error.diagnostic());
    return response;
  }
  Checked checked = checker_.check({request.surface(), spec, options_.threads, CheckDepth::All}, cancelled);
  if (checked.error && checked.error->code() != grpc::StatusCode::RESOURCE_EXHAUSTED) throw JobRefused(std::move(*checked.error));
  response = std::move(checked.report);
  if (checked.error) {
    response.set_acceptable(false);
    *response.add_findings() = std::move(*checked.error->mutable_diagnostic());
  }
  if (response.has_estimate()) estimates_.remember(cost_key(request.surface(), spec), response.estimate());
  *response.mutable_effective_spec() = std::move(spec);
  return response;
}

}  // namespace strata::server
