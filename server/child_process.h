// A child process with pipes on its three standard files.
#pragma once

#include <sys/resource.h>
#include <sys/types.h>

#include <optional>
#include <string>
#include <utility>
#include <vector>

namespace strata::server {

// A file descriptor that closes itself.
class Fd {
 public:
  Fd() = default;
  explicit Fd(int fd) : fd_(fd) {}
  ~Fd() { close(); }
  Fd(Fd&& other) noexcept : fd_(other.fd_) { other.fd_ = -1; }
  Fd& operator=(Fd&& other) noexcept;
  [[nodiscard]] int get() const { return fd_; }
  // From now on the caller closes it.
  int release() { return std::exchange(fd_, -1); }
  void close();

 private:
  int fd_ = -1;
};

struct ChildEnd {
  int status = 0;  // of waitpid
  rusage usage{};
};

// Spawned, never forked: gRPC's threads do not survive a fork. Killed and reaped by the destructor at the latest.
class ChildProcess {
 public:
  // Throws std::system_error.
  ChildProcess(const std::string& program, const std::vector<std::string>& words);
  ~ChildProcess();
  ChildProcess(const ChildProcess&) = delete;
  ChildProcess& operator=(const ChildProcess&) = delete;

  [[nodiscard]] int input() const { return input_.get(); }    // write end
  [[nodiscard]] int output() const { return output_.get(); }  // read ends, non-blocking
  [[nodiscard]] int errors() const { return errors_.get(); }
  void kill(int signal) const;
  // To its main thread.
  void kill_main_thread(int signal) const;
  // Waits for the end.
  ChildEnd wait();

 private:
  pid_t pid_ = -1;
  Fd input_, output_, errors_;
  std::optional<ChildEnd> end_;
};

}  // namespace strata::server
