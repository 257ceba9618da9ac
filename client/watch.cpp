#include "client/watch.h"

#include <grpcpp/grpcpp.h>

#include <algorithm>
#include <chrono>
#include <optional>

#include "client/exit_code.h"
#include "client/interrupt.h"
#include "client/status.h"

namespace strata::client {
namespace {

constexpr std::chrono::seconds kSilence{60};  // six heartbeats without a word: the connection is dead

void show(const v1::WatchJobResponse& event, ProgressView& view) {
  switch (event.event_case()) {
    case v1::WatchJobResponse::kSnapshot: view.state(event.snapshot().state(), event.snapshot().queue_position()); break;
    case v1::WatchJobResponse::kStateChanged:
      view.state(event.state_changed().state(), event.state_changed().queue_position());
      if (event.state_changed().attempt() > 1) view.tried_again(event.state_changed().attempt());
      break;
    case v1::WatchJobResponse::kEstimate: view.estimate(event.estimate()); break;
    case v1::WatchJobResponse::kProgress: view.progress(event.progress()); break;
    case v1::WatchJobResponse::kStageEnded: view.stage_ended(event.stage_ended()); break;
    case v1::WatchJobResponse::kQuality: view.quality(event.quality().quality()); break;
    case v1::WatchJobResponse::kAdjustment: view.adjustment(event.adjustment()); break;
    case v1::WatchJobResponse::kHeartbeat:
    case v1::WatchJobResponse::kDone:
    case v1::WatchJobResponse::EVENT_NOT_SET: break;
  }
}

// One stream, from `sequence` on as far as the connection holds. The job, when it ended.
std::optional<v1::Job> follow(Connection& connection, const std::string& job_id, const WatchOptions& options, ProgressView& view,
                              std::int64_t& sequence, Backoff& backoff, grpc::Status& status) {
  grpc::ClientContext context;
  CallGuard guard(context, kSilence);
  v1::WatchJobRequest request;
  request.set_job_id(job_id);
  request.set_after_sequence(sequence);
  const auto stream = connection.jobs->WatchJob(&context, request);
  v1::WatchJobResponse event;
  std::optional<v1::Job> done;
  while (stream->Read(&event)) {
    guard.heard();
    // A snapshot comes with every new stream and is no progress.
    if (event.sequence() > sequence || event.has_heartbeat()) backoff.reset();
    const bool news = event.sequence() > sequence || event.has_done();
    sequence = std::max(sequence, event.sequence());
    if (news && options.on_event) options.on_event(event);
    show(event, view);
    if (event.has_done()) done = std::move(*event.mutable_done());
  }
  status = stream->Finish();
  return done;
}

}  // namespace

v1::Job watch(Connection& connection, const std::string& job_id, const WatchOptions& options, ProgressView& view) {
  std::int64_t sequence = 0;
  Backoff backoff(options.retries);
  for (;;) {
    grpc::Status status;
    std::optional<v1::Job> done = follow(connection, job_id, options, view, sequence, backoff, status);
    if (done) {
      view.clear();
      return std::move(*done);
    }
    go_on();
    if (connection.own && !connection.own->running())
      throw CommandError(ExitCode::JobFailed, "the private stratad died:\n" + connection.own->log());
    const bool cut = status.ok() || transient(status) || status.error_code() == grpc::CANCELLED;
    if (!cut || !backoff.pause()) {
      if (status.ok()) status = {grpc::UNAVAILABLE, "the server ends the stream before the job"};
      throw command_error(status, "watching job " + job_id);
    }
  }
}

}  // namespace strata::client
