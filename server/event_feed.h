// What one watcher gets to see, in order: snapshot, events after a sequence, heartbeats, done. Pull only: whoever reads slowly finds newer
// progress, never a queue.
#pragma once

#include <chrono>
#include <cstdint>
#include <deque>
#include <optional>
#include <string>

#include "server/job_desk.h"

namespace strata::server {

struct FeedOptions {
  std::int64_t after_sequence = 0;
  std::chrono::duration<double> heartbeat{10};
  std::chrono::duration<double> min_interval{0.1};
};

// Throws Refusal when they make no sense.
FeedOptions feed_options(const v1::WatchJobRequest& request);

class EventFeed {
 public:
  EventFeed(const JobDesk& desk, std::string job_id, const FeedOptions& options);

  // The next message, when there is one now. Throws Refusal NOT_FOUND when there is no such job (any more).
  std::optional<v1::WatchJobResponse> next();
  // `done` was given out.
  [[nodiscard]] bool finished() const { return finished_; }

 private:
  using Clock = std::chrono::steady_clock;

  const JobDesk& desk_;
  const std::string job_id_;
  const FeedOptions options_;
  std::int64_t seen_;
  std::deque<v1::WatchJobResponse> pending_;
  std::optional<v1::Job> done_;
  Clock::time_point last_given_ = Clock::now(), last_progress_;
  bool begun_ = false, finished_ = false;
};

}  // namespace strata::server
