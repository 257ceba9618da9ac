// What ends a command early: Ctrl-C, SIGTERM, the end of --timeout. Every call and every pause of the client looks here.
#pragma once

#include <atomic>
#include <chrono>
#include <condition_variable>
#include <mutex>
#include <random>
#include <thread>

namespace grpc {
class ClientContext;
}

namespace strata::client {

// Remembers the first SIGINT, SIGTERM or SIGHUP; the second ends the process at once.
void catch_signals();
// From now on the command may take this long; 0: no limit.
void limit_command(double seconds);

// The command should end: interrupted, or out of time.
[[nodiscard]] bool stopped();
// The signal that came first; 0: none.
[[nodiscard]] int interrupted_by();
// Throws CommandError(128 + signal) or CommandError(Timeout) when stopped().
void go_on();

// Cancels a call when the command should end, and when the other side has said nothing for too long.
class CallGuard {
 public:
  static constexpr std::chrono::seconds kSilence{120};
  explicit CallGuard(grpc::ClientContext& context, std::chrono::seconds silence = kSilence);
  CallGuard(const CallGuard&) = delete;
  CallGuard& operator=(const CallGuard&) = delete;
  // The other side is alive.
  void heard();

 private:
  using Clock = std::chrono::steady_clock;
  void guard(const std::stop_token& end, grpc::ClientContext& context, std::chrono::seconds silence);

  std::atomic<Clock::rep> heard_;
  std::mutex mutex_;
  std::condition_variable_any over_;
  std::jthread thread_;  // last: ends before the rest goes
};

// Waits longer after each fruitless try; progress resets it.
class Backoff {
 public:
  explicit Backoff(int tries) : tries_(tries), left_(tries) {}
  // False: no tries are left. Throws as go_on does.
  bool pause();
  void reset();

 private:
  int tries_, left_;
  std::chrono::milliseconds next_ = kFirst;
  std::minstd_rand random_{std::random_device{}()};

  static constexpr std::chrono::milliseconds kFirst{200};
  static constexpr std::chrono::milliseconds kLongest{10000};
};

}  // namespace strata::client
