// A call that streams to its client, one message at a time.
#pragma once

#include <grpcpp/grpcpp.h>

#include <memory>
#include <mutex>
#include <optional>

#include "server/job_desk.h"
#include "server/status.h"

namespace strata::server {

// `compose` gives the next one, when there is one. Pokes come from the desk.
// The call owns itself until OnDone; the desk only ever holds it weakly.
template <class Reactor, class Response>
class StreamingCall : public Reactor, public Watcher, public std::enable_shared_from_this<StreamingCall<Reactor, Response>> {
 public:
  void poke() final {
    std::optional<grpc::Status> ending;
    {
      const std::lock_guard lock(mutex_);
      if (!streaming_ || writing_ || finished_) return;
      bool composed = false;
      const grpc::Status status = gone_ ? grpc::Status::CANCELLED : status_of([&] { composed = compose(response_); });
      if (!status.ok()) ending = status;
      else if (composed) writing_ = true;
      else if (complete()) ending = final_status();
      else return;
      finished_ = ending.has_value();
    }
    // Last, and without the lock: the call may end, and this object with it, on another thread.
    if (ending) this->Finish(*ending);
    else this->StartWrite(&response_);
  }

  void OnWriteDone(bool ok) final {
    {
      const std::lock_guard lock(mutex_);
      writing_ = false;
      if (!ok) gone_ = true;
    }
    poke();
  }

  void OnCancel() final {
    client_left();
    {
      const std::lock_guard lock(mutex_);
      gone_ = true;
    }
    poke();
  }

  void OnDone() final {
    over();
    self_.reset();
  }

 protected:
  void own_itself() { self_ = this->shared_from_this(); }
  void start_streaming() {
    {
      const std::lock_guard lock(mutex_);
      streaming_ = true;
    }
    poke();
  }
  void fail(const grpc::Status& status) {
    {
      const std::lock_guard lock(mutex_);
      if (finished_) return;
      finished_ = true;
    }
    this->Finish(status);
  }

 private:
  virtual bool compose(Response& response) = 0;
  [[nodiscard]] virtual bool complete() const = 0;
  [[nodiscard]] virtual grpc::Status final_status() const { return grpc::Status::OK; }
  virtual void client_left() {}
  // The call's context goes next; this object may stay a little longer in the desk's hands.
  virtual void over() {}

  std::mutex mutex_;
  bool streaming_ = false, writing_ = false, finished_ = false, gone_ = false;
  Response response_;
  std::shared_ptr<StreamingCall> self_;
};

}  // namespace strata::server
