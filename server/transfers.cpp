#include "server/transfers.h"

#include <spdlog/spdlog.h>
#include <sys/resource.h>

#include <algorithm>
#include <string>
#include <vector>

#include "server/refusal.h"

namespace strata::server {
namespace {

constexpr double kRetrySeconds = 5;

// An eighth of the files that the process may open; connections have most of the others.
std::size_t within_files(int most) {
  rlimit files{};
  getrlimit(RLIMIT_NOFILE, &files);
  if (files.rlim_cur == RLIM_INFINITY) return static_cast<std::size_t>(most);
  return std::clamp<std::size_t>(files.rlim_cur / 8, 1, static_cast<std::size_t>(most));
}

}  // namespace

Transfers::Ticket::~Ticket() {
  const std::lock_guard lock(transfers_.mutex_);
  transfers_.open_.erase(this);
}

void Transfers::Ticket::waits_for_client() { waiting_since_ = Clock::now().time_since_epoch().count(); }
void Transfers::Ticket::works() { waiting_since_ = 0; }

Transfers::Transfers(int most, double stall_seconds)
    : most_(within_files(most)), patience_(static_cast<std::int64_t>(1000 * stall_seconds)), sweeper_([this] { sweep(); }) {}

Transfers::~Transfers() {
  {
    const std::lock_guard lock(sleeping_);
    stopping_ = true;
  }
  wake_.notify_one();
  sweeper_.join();
}

std::unique_ptr<Transfers::Ticket> Transfers::begin(grpc::CallbackServerContext& context) {
  std::unique_ptr<Ticket> ticket(new Ticket(*this, context));
  const std::lock_guard lock(mutex_);
  if (open_.size() >= most_)
    throw Refusal(Refused::ResourceExhausted, "TOO_MANY_TRANSFERS",
                  std::to_string(open_.size()) + " uploads and downloads are under way already")
        .retry_after(kRetrySeconds);
  open_.insert(ticket.get());
  return ticket;
}

void Transfers::sweep() {
  std::unique_lock lock(sleeping_);
  while (!wake_.wait_for(lock, patience_ / 8, [this] { return stopping_; })) end_stalled();
}

void Transfers::end_stalled() {
  const std::lock_guard lock(mutex_);
  const Clock::rep limit = (Clock::now() - patience_).time_since_epoch().count();
  const std::vector<Ticket*> all(open_.begin(), open_.end());
  for (Ticket* ticket : all) {
    if (!open_.contains(ticket)) continue;  // ended with one before it
    const Clock::rep since = ticket->waiting_since_;
    if (since == 0 || since > limit) continue;
    ticket->works();  // once is enough
    spdlog::info(R"("msg":"transfer ended: its client stopped","peer":"{}")", ticket->context_.peer());
    ticket->context_.TryCancel();
  }
}

}  // namespace strata::server
