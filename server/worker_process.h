// This side of a worker process: what it is told, what it says, how it ended.
#pragma once

#include <functional>
#include <string>

#include "server/backtrace.h"
#include "server/child_process.h"
#include "server/pipe_messages.h"
#include "strata/worker/v1/worker.pb.h"

namespace strata::server {

class WorkerProcess {
 public:
  using Hear = std::function<void(strata::worker::v1::Report&)>;

  // Throws std::system_error.
  explicit WorkerProcess(const std::string& program);

  // A worker that is gone already is noticed by look().
  void tell(const strata::worker::v1::Command& command);
  // Hears what has come and does not wait. False when the worker said its last: then end() comes soon.
  bool look(const Hear& hear);
  // For news, some milliseconds at most.
  void wait_a_little() const;
  void kill() const;
  // Makes it say where it is, if it still can.
  void ask_where() const;
  // Waits for the end.
  ChildEnd end();
  // Where it said it was when it crashed or was asked; empty: it said nothing.
  [[nodiscard]] std::string backtrace() const { return backtrace_in(errors_, program_); }

 private:
  void keep_errors();

  const std::string program_;
  ChildProcess child_;
  MessageSplitter reports_;
  std::string errors_;
};

[[nodiscard]] bool ran_out_of_memory(const ChildEnd& end);
// "signal 11 (Segmentation fault)".
[[nodiscard]] std::string how_it_ended(const ChildEnd& end);

}  // namespace strata::server
