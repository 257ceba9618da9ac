#include <utility>

#include "server/check_run.h"

namespace strata::server {
namespace {

class ThreadChecker final : public Checker {
 public:
  ThreadChecker(const BlobStore& blobs, MesherDoor mesher, std::int64_t memory_budget_bytes)
      : blobs_(blobs), mesher_(std::move(mesher)), memory_budget_bytes_(memory_budget_bytes) {}

  Checked check(const CheckOrder& order, const std::atomic<bool>& cancelled) override {
    const auto bytes = [&] { return bytes_of(order.surface); };
    return run_check(order, bytes, memory_budget_bytes_, mesher_, cancelled);
  }

 private:
  std::vector<char> bytes_of(const v1::Surface& surface) const {
    if (surface.has_data()) return {surface.data().begin(), surface.data().end()};
    return read_all(blobs_, found_blob(blobs_, surface.blob_id()));
  }

  const BlobStore& blobs_;
  const MesherDoor mesher_;
  const std::int64_t memory_budget_bytes_;
};

}  // namespace

std::unique_ptr<Checker> make_thread_checker(const BlobStore& blobs, MesherDoor mesher, std::int64_t memory_budget_bytes) {
  return std::make_unique<ThreadChecker>(blobs, std::move(mesher), memory_budget_bytes);
}

}  // namespace strata::server
