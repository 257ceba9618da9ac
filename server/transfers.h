// Uploads and downloads under way. Each holds a file open: there is a limit to them, and those whose clients neither take nor send anything
// any more are ended. A client that comes back goes on where it stopped.
#pragma once

#include <grpcpp/grpcpp.h>

#include <atomic>
#include <chrono>
#include <condition_variable>
#include <memory>
#include <mutex>
#include <set>
#include <thread>

namespace strata::server {

class Transfers {
 public:
  using Clock = std::chrono::steady_clock;

  // One call that transfers. It tells when it waits for its client, and when it does not. Safe to call from any thread.
  class Ticket {
   public:
    ~Ticket();
    Ticket(const Ticket&) = delete;
    Ticket& operator=(const Ticket&) = delete;
    void waits_for_client();
    void works();

   private:
    friend class Transfers;
    Ticket(Transfers& transfers, grpc::CallbackServerContext& context) : transfers_(transfers), context_(context) {}

    Transfers& transfers_;
    grpc::CallbackServerContext& context_;
    std::atomic<Clock::rep> waiting_since_ = 0;  // 0: it does not
  };

  // At most `most` at once, fewer when the process may not open so many files; a client may let a call wait for so many seconds.
  Transfers(int most, double stall_seconds);
  ~Transfers();
  Transfers(const Transfers&) = delete;
  Transfers& operator=(const Transfers&) = delete;

  // To be dropped before the call is done. Throws Refusal RESOURCE_EXHAUSTED.
  std::unique_ptr<Ticket> begin(grpc::CallbackServerContext& context);

 private:
  void sweep();
  void end_stalled();

  const std::size_t most_;
  const std::chrono::milliseconds patience_;
  // To cancel a call may run its last callback, which drops its ticket, on the same thread.
  std::recursive_mutex mutex_;
  std::set<Ticket*> open_;
  std::mutex sleeping_;
  std::condition_variable wake_;
  bool stopping_ = false;
  std::thread sweeper_;  // goes first
};

}  // namespace strata::server
