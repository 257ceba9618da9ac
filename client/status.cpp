#include "client/status.h"

#include <grpcpp/grpcpp.h>

#include <algorithm>
#include <nlohmann/json.hpp>
#include <sstream>

#include "client/report.h"
#include "google/rpc/error_details.pb.h"
#include "google/rpc/status.pb.h"

namespace strata::client {
namespace {

ExitCode exit_code(int grpc_code) {
  switch (grpc_code) {
    case grpc::OK: return ExitCode::Ok;
    case grpc::CANCELLED: return ExitCode::Cancelled;
    case grpc::INVALID_ARGUMENT:
    case grpc::OUT_OF_RANGE:
    case grpc::FAILED_PRECONDITION: return ExitCode::InputRejected;
    case grpc::NOT_FOUND: return ExitCode::NotFound;
    case grpc::PERMISSION_DENIED:
    case grpc::UNAUTHENTICATED: return ExitCode::NotAuthorised;
    case grpc::RESOURCE_EXHAUSTED: return ExitCode::Overload;
    case grpc::UNIMPLEMENTED: return ExitCode::VersionMismatch;
    case grpc::DEADLINE_EXCEEDED:
    case grpc::UNAVAILABLE: return ExitCode::Unreachable;
    case grpc::DATA_LOSS: return ExitCode::Integrity;
    default: return ExitCode::Bug;
  }
}

const char* hint_for(ExitCode code) {
  switch (code) {
    case ExitCode::Unreachable: return "the server may be restarting; jobs it accepted go on: run the command again";
    case ExitCode::Overload: return "try again later, or with larger sizes";
    case ExitCode::VersionMismatch: return "client and server differ in version: strata version --of-server";
    case ExitCode::NotFound: return "strata list shows the jobs there are";
    default: return "";
  }
}

std::string ranges(const v1::Diagnostic& d) {
  std::ostringstream out;
  if (d.triangles_size() > 0) {
    out << "; triangles";
    for (int i = 0; i < d.triangles_size() && i < 5; ++i) out << ' ' << d.triangles(i);
    if (d.count() > 5 || d.triangles_size() > 5) out << " ...";
  }
  if (d.has_box()) {
    const auto& a = d.box().min();
    const auto& b = d.box().max();
    out << "; within (" << a.x() << ", " << a.y() << ", " << a.z() << ") .. (" << b.x() << ", " << b.y() << ", " << b.z() << ")";
  }
  return out.str();
}

}  // namespace

// Names come from files: nothing in them may steer the terminal.
std::string printable(std::string text) {
  std::replace_if(text.begin(), text.end(), [](unsigned char c) { return (c < 0x20 && c != '\n') || c == 0x7f; }, '?');
  return text;
}

std::string safe_dump(const nlohmann::json& json) { return json.dump(-1, ' ', false, nlohmann::json::error_handler_t::replace); }

std::string describe(const v1::Diagnostic& d) {
  std::string text = d.reason();
  if (!d.patch().empty()) text += " on patch " + d.patch();
  if (!d.field().empty() && d.message().find(d.field()) == std::string::npos) text += " at " + d.field();
  return printable(text + ": " + d.message() + ranges(d));
}

CommandError command_error(const grpc::Status& status, const std::string& doing) {
  google::rpc::Status details;
  std::string reason, where;
  nlohmann::json diagnostics = nlohmann::json::array();
  if (details.ParseFromString(status.error_details())) {
    for (const auto& any : details.details()) {
      google::rpc::ErrorInfo info;
      google::rpc::BadRequest bad;
      v1::Diagnostic diagnostic;
      if (any.UnpackTo(&info)) reason = info.reason();
      if (any.UnpackTo(&bad))
        for (const auto& violation : bad.field_violations())
          if (status.error_message().find(violation.field()) == std::string::npos)
            where += "\n  " + violation.field() + ": " + violation.description();
      if (any.UnpackTo(&diagnostic)) {
        where += ranges(diagnostic);
        diagnostics.push_back(to_json(diagnostic));
      }
    }
  }
  const ExitCode code = exit_code(status.error_code());
  std::string message = status.error_message().empty() ? "the call failed" : status.error_message();
  if (!reason.empty()) message = reason + ": " + message;
  return CommandError(code, printable(message + where) + (doing.empty() ? "" : " (while " + doing + ")"), hint_for(code), reason)
      .with_details(safe_dump(diagnostics));
}

CommandError command_error(const v1::Job& job) {
  const v1::JobError& error = job.error();
  if (job.state() == v1::JOB_STATE_CANCELLED) return {ExitCode::Cancelled, "job " + job.job_id() + " was cancelled", "", error.reason()};
  const ExitCode code = error.code() == grpc::INVALID_ARGUMENT     ? ExitCode::InputRejected
                        : error.code() == grpc::RESOURCE_EXHAUSTED ? ExitCode::Overload
                                                                   : ExitCode::JobFailed;
  std::string message = error.has_diagnostic() ? describe(error.diagnostic()) : error.reason() + ": " + error.message();
  const std::string hint =
      code == ExitCode::InputRejected ? "strata check shows everything that is wrong with a surface and a specification" : "";
  return CommandError(code, printable(message), hint, error.reason())
      .with_details(safe_dump(error.has_diagnostic() ? nlohmann::json::array({to_json(error.diagnostic())}) : nlohmann::json::array()));
}

bool transient(const grpc::Status& status) { return status.error_code() == grpc::UNAVAILABLE || status.error_code() == grpc::ABORTED; }

}  // namespace strata::client
