// Writes that share their syncs.
#pragma once

#include <condition_variable>
#include <exception>
#include <functional>
#include <mutex>
#include <utility>
#include <vector>

#include "server/sqlite.h"

namespace strata::server {

// Runs writes one after the other. Those that come while one is being synced share the next transaction and its sync.
class WriteQueue {
 public:
  explicit WriteQueue(const Database& database) : database_(database) {}

  // Durable on return; throws what `body` throws.
  void run(const std::function<void()>& body) {
    Write mine{body, nullptr, false};
    std::unique_lock lock(mutex_);
    waiting_.push_back(&mine);
    while (!mine.done) {
      if (busy_) {
        changed_.wait(lock);
        continue;
      }
      busy_ = true;
      const std::vector<Write*> batch = std::exchange(waiting_, {});
      lock.unlock();
      commit(batch);
      lock.lock();
      for (Write* write : batch) write->done = true;
      busy_ = false;
      changed_.notify_all();
    }
    lock.unlock();
    if (mine.error) std::rethrow_exception(mine.error);
  }

 private:
  struct Write {
    const std::function<void()>& body;
    std::exception_ptr error;
    bool done;
  };

  void commit(const std::vector<Write*>& batch) const {
    try {
      database_.in_transaction([&] {
        for (const Write* write : batch) write->body();
      });
    } catch (...) {
      for (Write* write : batch) commit_alone(*write, batch.size());  // one of them fails: the others need not
    }
  }

  void commit_alone(Write& write, std::size_t batch) const {
    try {
      if (batch == 1) throw;
      database_.in_transaction(write.body);
    } catch (...) {
      write.error = std::current_exception();
    }
  }

  const Database& database_;
  std::mutex mutex_;
  std::condition_variable changed_;
  std::vector<Write*> waiting_;
  bool busy_ = false;
};

}  // namespace strata::server
