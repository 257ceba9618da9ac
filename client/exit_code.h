// What a script learns from the exit status. Frozen: docs/formats.md lists them.
#pragma once

#include <stdexcept>
#include <string>
#include <utility>

namespace strata::client {

enum class ExitCode {
  Ok = 0,
  JobFailed = 1,
  Usage = 2,
  InputRejected = 3,
  NotAuthorised = 4,
  NotFound = 5,
  Unreachable = 6,
  Timeout = 7,
  Cancelled = 8,
  QualityMissed = 9,
  Overload = 10,
  Integrity = 11,
  LocalIo = 12,
  VersionMismatch = 13,
  Bug = 70,
};

// Ends the command: says what is wrong, where, and what to do.
class CommandError : public std::runtime_error {
 public:
  CommandError(ExitCode code, const std::string& message, std::string hint = {}, std::string reason = {})
      : std::runtime_error(message), code_(code), hint_(std::move(hint)), reason_(std::move(reason)) {}
  [[nodiscard]] ExitCode code() const { return code_; }
  [[nodiscard]] const std::string& hint() const { return hint_; }
  [[nodiscard]] const std::string& reason() const { return reason_; }
  // A JSON array of diagnostics; empty: none.
  [[nodiscard]] const std::string& details() const { return details_; }
  CommandError& with_details(std::string json) {
    details_ = std::move(json);
    return *this;
  }

 private:
  ExitCode code_;
  std::string hint_;
  std::string reason_;  // UPPER_SNAKE, when the server gave one
  std::string details_;
};

}  // namespace strata::client
