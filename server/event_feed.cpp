#include "server/event_feed.h"

#include <utility>

#include "server/timestamps.h"

namespace strata::server {

FeedOptions feed_options(const v1::WatchJobRequest& request) {
  FeedOptions options;
  if (request.after_sequence() < 0) throw invalid_field("after_sequence", "must not be negative");
  options.after_sequence = request.after_sequence();
  if (request.heartbeat_seconds() != 0) {
    if (!(request.heartbeat_seconds() >= 1 && request.heartbeat_seconds() <= 60))
      throw invalid_field("heartbeat_seconds", "must be 1 to 60");
    options.heartbeat = std::chrono::duration<double>(request.heartbeat_seconds());
  }
  if (request.min_interval_seconds() != 0) {
    if (!(request.min_interval_seconds() >= 0.1 && request.min_interval_seconds() <= 60))
      throw invalid_field("min_interval_seconds", "must be 0.1 to 60");
    options.min_interval = std::chrono::duration<double>(request.min_interval_seconds());
  }
  return options;
}

EventFeed::EventFeed(const JobDesk& desk, std::string job_id, const FeedOptions& options)
    : desk_(desk), job_id_(std::move(job_id)), options_(options), seen_(options.after_sequence) {}

std::optional<v1::WatchJobResponse> EventFeed::next() {
  const Clock::time_point now = Clock::now();
  v1::WatchJobResponse message;
  const auto give = [&] {
    last_given_ = now;
    if (message.sequence() > 0) seen_ = message.sequence();
    if (!message.has_time()) *message.mutable_time() = timestamp_now();
    return std::optional(std::move(message));
  };

  if (finished_) return {};
  if (!begun_) {
    begun_ = true;
    *message.mutable_snapshot() = desk_.get(Caller{}, job_id_);  // who watches was let in
    return give();
  }
  if (pending_.empty() && !done_) {
    News news = desk_.news(job_id_, seen_, now - last_progress_ >= options_.min_interval);
    pending_.assign(std::make_move_iterator(news.events.begin()), std::make_move_iterator(news.events.end()));
    done_ = std::move(news.done);
  }
  if (!pending_.empty()) {
    message = std::move(pending_.front());
    pending_.pop_front();
    if (message.has_progress()) last_progress_ = now;
    return give();
  }
  if (done_) {
    finished_ = true;
    message.set_sequence(done_->last_sequence());
    *message.mutable_done() = std::move(*done_);
    return give();
  }
  if (now - last_given_ < options_.heartbeat) return {};
  message.mutable_heartbeat();
  return give();
}

}  // namespace strata::server
