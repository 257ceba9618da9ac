#include "server/status.h"

#include <google/protobuf/util/time_util.h>

#include <string>

#include "google/rpc/error_details.pb.h"
#include "google/rpc/status.pb.h"
#include "server/convert.h"

namespace strata::server {
namespace {

constexpr std::size_t kMaxMessageBytes = 1024;  // twice in the details, once outside

grpc::StatusCode code_of(Failure failure) {
  switch (failure) {
    case Failure::InvalidInput: return grpc::StatusCode::INVALID_ARGUMENT;
    case Failure::LimitExceeded: return grpc::StatusCode::RESOURCE_EXHAUSTED;
    case Failure::Cancelled: return grpc::StatusCode::CANCELLED;
    case Failure::Internal: return grpc::StatusCode::INTERNAL;
  }
  return grpc::StatusCode::INTERNAL;
}

grpc::StatusCode code_of(Refused kind) {
  switch (kind) {
    case Refused::InvalidArgument: return grpc::StatusCode::INVALID_ARGUMENT;
    case Refused::NotFound: return grpc::StatusCode::NOT_FOUND;
    case Refused::AlreadyExists: return grpc::StatusCode::ALREADY_EXISTS;
    case Refused::FailedPrecondition: return grpc::StatusCode::FAILED_PRECONDITION;
    case Refused::ResourceExhausted: return grpc::StatusCode::RESOURCE_EXHAUSTED;
    case Refused::Unavailable: return grpc::StatusCode::UNAVAILABLE;
    case Refused::OutOfRange: return grpc::StatusCode::OUT_OF_RANGE;
    case Refused::DataLoss: return grpc::StatusCode::DATA_LOSS;
    case Refused::Unauthenticated: return grpc::StatusCode::UNAUTHENTICATED;
    case Refused::PermissionDenied: return grpc::StatusCode::PERMISSION_DENIED;
    case Refused::Unimplemented: return grpc::StatusCode::UNIMPLEMENTED;
  }
  return grpc::StatusCode::INTERNAL;
}

// Cuts without splitting a UTF-8 character.
std::string cut(std::string text, std::size_t at_most) {
  if (text.size() <= at_most) return text;
  std::size_t end = at_most - 3;
  while (end > 0 && (static_cast<unsigned char>(text[end]) & 0xC0) == 0x80) --end;
  return text.substr(0, end) + "...";
}

class StatusBuilder {
 public:
  StatusBuilder(grpc::StatusCode code, const std::string& reason, const std::string& message)
      : code_(code), message_(cut(message, kMaxMessageBytes)) {
    status_.set_code(code);
    status_.set_message(message_);
    google::rpc::ErrorInfo info;
    info.set_reason(reason);
    info.set_domain("strata");
    status_.add_details()->PackFrom(info);
  }

  StatusBuilder& field(const std::string& path) {
    if (path.empty()) return *this;
    google::rpc::BadRequest bad;
    auto& violation = *bad.add_field_violations();
    violation.set_field(cut(path, 256));
    violation.set_description(cut(message_, 256));
    return detail(bad);
  }
  StatusBuilder& retry(double seconds) {
    if (seconds <= 0) return *this;
    google::rpc::RetryInfo info;
    *info.mutable_retry_delay() = google::protobuf::util::TimeUtil::MillisecondsToDuration(static_cast<std::int64_t>(seconds * 1000));
    return detail(info);
  }
  StatusBuilder& diagnostic(v1::Diagnostic what) {
    what.set_message(message_);
    if (!fits(what)) what.clear_values();
    if (!fits(what)) what.clear_triangles();
    return detail(what);
  }
  [[nodiscard]] grpc::Status build() const { return {code_, message_, status_.SerializeAsString()}; }

 private:
  static constexpr std::size_t kAnyOverhead = 64;  // type URL and framing of a packed detail

  template <class Message>
  [[nodiscard]] bool fits(const Message& message) const {
    return status_.ByteSizeLong() + message.ByteSizeLong() + kAnyOverhead <= kMaxDetailBytes;
  }
  template <class Message>
  StatusBuilder& detail(const Message& message) {
    if (fits(message)) status_.add_details()->PackFrom(message);
    return *this;
  }

  grpc::StatusCode code_;
  std::string message_;
  google::rpc::Status status_;
};

}  // namespace

grpc::Status to_status(const MeshError& error) {
  const Diagnostic& diagnostic = error.diagnostic();
  return StatusBuilder(code_of(error.failure()), std::string(reason_name(diagnostic.reason)), error.what())
      .field(diagnostic.field)
      .diagnostic(to_wire(diagnostic))
      .build();
}

grpc::Status to_status(const Refusal& refusal) {
  return StatusBuilder(code_of(refusal.kind), refusal.reason, refusal.what()).field(refusal.field).retry(refusal.retry_seconds).build();
}

grpc::Status to_status(const v1::JobError& error) {
  return StatusBuilder(static_cast<grpc::StatusCode>(error.code()), error.reason(), error.message())
      .field(error.diagnostic().field())
      .diagnostic(error.diagnostic())
      .build();
}

std::string reason_in(const std::string& error_details) {
  google::rpc::Status status;
  google::rpc::ErrorInfo info;
  if (status.ParseFromString(error_details))
    for (const auto& detail : status.details())
      if (detail.UnpackTo(&info)) return info.reason();
  return {};
}

}  // namespace strata::server
