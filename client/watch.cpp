#include "client/watch.h"

#include <grpcpp/grpcpp.h>
#include <signal.h>

#include <algorithm>
#include <chrono>
#include <thread>

#include "client/exit_code.h"
#include "client/status.h"

namespace strata::client {

std::atomic<int> interrupted{0};

namespace {

constexpr auto kSilence = std::chrono::seconds(60);  // six heartbeats without a word: the connection is dead
constexpr auto kLook = std::chrono::milliseconds(100);

void remember(int signal) {
  if (interrupted.exchange(signal) != 0) _exit(128 + signal);  // the second time at once
}

void show(const v1::WatchJobResponse& event, ProgressView& view) {
  switch (event.event_case()) {
    case v1::WatchJobResponse::kSnapshot:
      view.state(event.snapshot().state(), event.snapshot().queue_position());
      break;
    case v1::WatchJobResponse::kStateChanged:
      view.state(event.state_changed().state(), event.state_changed().queue_position());
      break;
    case v1::WatchJobResponse::kProgress: view.progress(event.progress()); break;
    case v1::WatchJobResponse::kStageEnded: view.stage_ended(event.stage_ended()); break;
    case v1::WatchJobResponse::kQuality: view.quality(event.quality().quality()); break;
    case v1::WatchJobResponse::kAdjustment: view.adjustment(event.adjustment()); break;
    case v1::WatchJobResponse::kHeartbeat:
    case v1::WatchJobResponse::kDone:
    case v1::WatchJobResponse::EVENT_NOT_SET: break;
  }
}

}  // namespace

void catch_signals() {
  struct sigaction action {};
  action.sa_handler = remember;
  sigaction(SIGINT, &action, nullptr);
  sigaction(SIGTERM, &action, nullptr);
}

v1::Job watch(Connection& connection, const std::string& job_id, const WatchOptions& options, ProgressView& view) {
  using Clock = std::chrono::steady_clock;
  const auto started = Clock::now();
  std::int64_t sequence = 0;
  int tries = 0;
  for (;;) {
    grpc::ClientContext context;
    v1::WatchJobRequest request;
    request.set_job_id(job_id);
    request.set_after_sequence(sequence);
    const auto stream = connection.jobs->WatchJob(&context, request);
    // Reading blocks, so a second thread looks after interrupts, the time limit and silence.
    std::atomic<bool> over{false}, out_of_time{false};
    std::atomic<Clock::rep> heard{Clock::now().time_since_epoch().count()};
    std::thread guard([&] {
      while (!over) {
        const auto now = Clock::now();
        const bool silent = now - Clock::time_point(Clock::duration(heard.load())) > kSilence;
        out_of_time = options.limit_seconds > 0 && now - started > std::chrono::duration<double>(options.limit_seconds);
        if (interrupted != 0 || silent || out_of_time) {
          context.TryCancel();
          return;
        }
        std::this_thread::sleep_for(kLook);
      }
    });
    v1::WatchJobResponse event;
    bool done = false;
    v1::Job job;
    while (stream->Read(&event)) {
      heard = Clock::now().time_since_epoch().count();
      tries = 0;
      if (event.sequence() > 0) {
        sequence = std::max(sequence, event.sequence());
        if (options.on_event) options.on_event(event);
      }
      show(event, view);
      if (event.has_done()) {
        done = true;
        job = event.done();
      }
    }
    const grpc::Status status = stream->Finish();
    over = true;
    guard.join();
    if (done) {
      view.clear();
      return job;
    }
    const int signal = interrupted;
    if (signal != 0) throw CommandError(static_cast<ExitCode>(128 + signal), "interrupted");
    if (out_of_time) throw CommandError(ExitCode::Timeout, "job " + job_id + " has not ended in time; it goes on", "strata watch " + job_id);
    if (connection.own && !connection.own->running())
      throw CommandError(ExitCode::JobFailed, "the private stratad died:\n" + connection.own->log());
    const bool cut = status.ok() || transient(status) || status.error_code() == grpc::CANCELLED;
    if (!cut || ++tries > options.retries) throw command_error(status, "watching job " + job_id);
    std::this_thread::sleep_for(std::chrono::milliseconds(200) * (1 << std::min(tries, 5)));
  }
}

}  // namespace strata::client
