// A worker whose mesher does what the first patch of the surface says, as real ones should not: the other side of process_runner_test.
#include <unistd.h>

#include <atomic>
#include <chrono>
#include <csignal>
#include <cstdlib>
#include <stdexcept>
#include <string>
#include <thread>
#include <vector>

#include "core/mesher.h"
#include "server/worker.h"
#include "tests/server/fake_mesher.h"

namespace strata::server {

// With external names and out of line, so that backtraces can name them.
void break_down_here(int signal);
void loop_for_ever();
[[gnu::noinline]] void break_down_here(int signal) {
  raise(signal);
  std::atomic_signal_fence(std::memory_order_seq_cst);  // no tail call: this frame stays on the stack
}

[[gnu::noinline]] void loop_for_ever() {
  for (std::atomic<int> turns = 0;; ++turns) {
  }
}

namespace {

void ask_for(std::size_t bytes) {
  std::vector<std::vector<char>> pieces;
  constexpr std::size_t kPiece = std::size_t{64} << 20;
  for (std::size_t got = 0; got < bytes; got += kPiece) pieces.emplace_back(kPiece, 'x');
}

Outcome misbehave(const TriangleSoup& soup, const MeshSpec& spec, Context& context, const Observer& observer) {
  const std::string& what = soup.patch_names.front();
  if (what == "segv_at_once") break_down_here(SIGSEGV);
  if (what == "loop_at_once") loop_for_ever();
  if (what == "allocate_at_once") ask_for(std::size_t{100} << 30);
  Estimate estimate;
  estimate.memory_bytes = what == "greedy" ? std::int64_t{1} << 50 : std::int64_t{1} << 20;
  observer.on_estimate(estimate);
  context.begin(Stage::FitToSmooth);
  if (what == "segv") break_down_here(SIGSEGV);
  if (what == "abort") break_down_here(SIGABRT);
  if (what == "killed") break_down_here(SIGKILL);
  if (what == "exit") _exit(3);
  if (what == "loop") loop_for_ever();
  if (what == "allocate") ask_for(std::size_t{100} << 30);
  if (what == "throw") throw std::runtime_error("thrown by the mesher");
  if (what == "once" && std::getenv("STRATA_TEST_MARK") != nullptr && unlink(std::getenv("STRATA_TEST_MARK")) == 0)
    break_down_here(SIGSEGV);
  if (what == "wait")
    for (;; std::this_thread::sleep_for(std::chrono::milliseconds(2))) context.progress(0.5, 1);
  if (what == "slow") std::this_thread::sleep_for(std::chrono::milliseconds(500));
  FakeMesher good;
  return good.door().generate(soup, spec, context, {});
}

}  // namespace
}  // namespace strata::server

int main(int argc, char** argv) {
  using namespace strata::server;
  if (!is_worker(argc, argv)) return 2;
  return worker_main({misbehave, FakeMesher().door().check_request, {}}, argv);
}
