#include "server/admission.h"

#include <google/protobuf/io/coded_stream.h>
#include <google/protobuf/io/zero_copy_stream_impl_lite.h>

#include <set>
#include <utility>

#include "proto/wire/sha256.h"
#include "server/convert.h"
#include "server/ids.h"
#include "server/spec_json.h"

namespace strata::server {
namespace {

constexpr std::size_t kMaxRequestId = 128;
constexpr std::size_t kMaxDisplayName = 256;
constexpr int kMaxLabels = 32;
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
v1::MeshSpec typed_spec(const Request& request, const MesherDoor& mesher) {
  const v1::MeshSpec wire = request.has_spec_json() ? parse_spec(request.spec_json()) : request.spec();
  const MeshSpec spec = from_wire(wire);
  for (Diagnostic& finding : mesher.check_spec(spec, {})) {
    // Which patches there are is known when the surface has been read.
    if (finding.severity != Severity::Error || finding.reason == Reason::PatchUnknown) continue;
    throw MeshError(Failure::InvalidInput, std::move(finding));
  }
  return to_wire(spec);
}

}  // namespace

Refusal invalid_field(const std::string& field, const std::string& message) {
  return Refusal(Refused::InvalidArgument, "REQUEST_INVALID", field + ": " + message).at(field);
}

std::string fingerprint_of(const v1::CreateJobRequest& request) {
  std::string bytes;
  {
    google::protobuf::io::StringOutputStream stream(&bytes);
    google::protobuf::io::CodedOutputStream coded(&stream);
    coded.SetSerializationDeterministic(true);
    request.SerializeToCodedStream(&coded);
  }
  wire::Sha256 sha;
  sha.add(bytes);
  return sha.finish();
}

Admission::Admission(const BlobStore& blobs, MesherDoor mesher, std::int64_t max_inline_surface_bytes)
    : blobs_(blobs), mesher_(std::move(mesher)), max_inline_surface_bytes_(max_inline_surface_bytes) {}

v1::MeshSpec Admission::checked_spec(const v1::CreateJobRequest& request) const { return typed_spec(request, mesher_); }
v1::MeshSpec Admission::checked_spec(const v1::ValidateJobRequest& request) const { return typed_spec(request, mesher_); }

void Admission::check_surface(const Caller& caller, const v1::Surface& surface) const {
  check_wire_surface(surface);
  switch (surface.source_case()) {
    case v1::Surface::SOURCE_NOT_SET: throw invalid_field("surface", "needs a blob_id or data");
    case v1::Surface::kData:
      if (static_cast<std::int64_t>(surface.data().size()) > max_inline_surface_bytes_)
        throw invalid_field("surface.data", "is larger than " + std::to_string(max_inline_surface_bytes_) + " bytes: upload it");
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
  v1::MeshSpec spec = checked_spec(request);
  *request.mutable_spec() = std::move(spec);
}

}  // namespace strata::server
