// Whatever comes through the pipes of a worker, the server splits it into the same messages however it is cut, and reads any backtrace.
#include <cstddef>
#include <cstdint>
#include <cstdlib>
#include <string>
#include <vector>

#include "server/backtrace.h"
#include "server/pipe_messages.h"
#include "strata/worker/v1/worker.pb.h"

namespace {

std::vector<std::string> split(const std::string& bytes, std::size_t step) {
  strata::server::MessageSplitter splitter;
  std::vector<std::string> messages;
  for (std::size_t at = 0; at < bytes.size(); at += step) {
    splitter.add(bytes.substr(at, step));
    while (auto message = splitter.next()) messages.push_back(std::move(*message));
  }
  return messages;
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  const std::string bytes(reinterpret_cast<const char*>(data), size);
  const std::vector<std::string> messages = split(bytes, size + 1);
  if (messages != split(bytes, 3)) std::abort();
  strata::worker::v1::Report report;
  for (const std::string& message : messages) static_cast<void>(report.ParseFromString(message));
  static_cast<void>(strata::server::backtrace_in("== backtrace\n" + bytes, ""));
  return 0;
}
