#include "client/interrupt.h"

#include <grpcpp/grpcpp.h>
#include <unistd.h>

#include <algorithm>
#include <csignal>

#include "client/exit_code.h"

namespace strata::client {
namespace {

using Clock = std::chrono::steady_clock;
using std::chrono::milliseconds;

constexpr milliseconds kLook{50};

// A signal handler reaches nothing but globals.
std::atomic<int> first_signal{0};
std::atomic<Clock::rep> end_of_time{0};  // 0: none

void remember(int signal) {
  int none = 0;
  if (!first_signal.compare_exchange_strong(none, signal)) _exit(128 + signal);
}

bool out_of_time() {
  const Clock::rep end = end_of_time;
  return end != 0 && Clock::now().time_since_epoch().count() > end;
}

}  // namespace

void catch_signals() {
  struct sigaction action{};
  action.sa_handler = remember;
  for (int signal : {SIGINT, SIGTERM, SIGHUP}) sigaction(signal, &action, nullptr);
}

void limit_command(double seconds) {
  if (seconds > 0)
    end_of_time =
        (Clock::now() + std::chrono::duration_cast<Clock::duration>(std::chrono::duration<double>(seconds))).time_since_epoch().count();
}

int interrupted_by() { return first_signal; }
bool stopped() { return first_signal != 0 || out_of_time(); }

void go_on() {
  const int signal = first_signal;
  if (signal != 0) throw CommandError(static_cast<ExitCode>(128 + signal), "interrupted");
  if (out_of_time()) throw CommandError(ExitCode::Timeout, "the time of --timeout is over");
}

CallGuard::CallGuard(grpc::ClientContext& context, std::chrono::seconds silence)
    : heard_(Clock::now().time_since_epoch().count()),
      thread_([this, &context, silence](const std::stop_token& end) { guard(end, context, silence); }) {}

void CallGuard::heard() { heard_ = Clock::now().time_since_epoch().count(); }

void CallGuard::guard(const std::stop_token& end, grpc::ClientContext& context, std::chrono::seconds silence) {
  std::unique_lock lock(mutex_);
  while (!over_.wait_for(lock, end, kLook, [&] { return end.stop_requested(); })) {
    const auto quiet = Clock::now() - Clock::time_point(Clock::duration(heard_.load()));
    if (stopped() || quiet > silence) return context.TryCancel();
    if (end.stop_requested()) return;
  }
}

bool Backoff::pause() {
  if (left_-- <= 0) return false;
  // Jitter, so that many clients do not come back together.
  const auto until = Clock::now() + next_ * std::uniform_int_distribution<>(75, 125)(random_) / 100;
  next_ = std::min(2 * next_, kLongest);
  for (go_on(); Clock::now() < until; go_on()) std::this_thread::sleep_for(std::min<Clock::duration>(kLook, until - Clock::now()));
  return true;
}

void Backoff::reset() {
  left_ = tries_;
  next_ = kFirst;
}

}  // namespace strata::client
