#include "server/staged_blobs.h"

#include <unistd.h>

#include <stdexcept>
#include <utility>

#include "server/stored_file.h"

namespace strata::server {
namespace {

class StagedBlobs final : public BlobStore {
 public:
  StagedBlobs(BlobInfo surface, std::string surface_path, std::string folder, Durability durability)
      : surface_(std::move(surface)), surface_path_(std::move(surface_path)), folder_(std::move(folder)), durability_(durability) {}

  std::unique_ptr<BlobWriter> create(const std::string&) override {
    return write_file(folder_, durability_, [](const std::string&, const BlobInfo&) {});
  }
  std::optional<BlobInfo> find(const std::string& id) const override { return id == surface_.id ? std::optional(surface_) : std::nullopt; }
  std::unique_ptr<BlobReader> open(const std::string&) const override { return open_file(surface_path_); }
  void remove(const std::string& id) override { ::unlink((folder_ + "/" + id).c_str()); }

  // The rest is the server's.
  std::optional<BlobInfo> find_digest(const std::string&, const std::string&) const override { return {}; }
  void touch(const std::string&) override {}
  std::vector<std::string> idle_since(std::chrono::system_clock::time_point) const override { return {}; }
  void drop_uploads_idle_since(std::chrono::system_clock::time_point) override {}
  std::string local_path(const std::string&) const override { return surface_path_; }
  std::string stage(const std::string&) override { not_here(); }
  void adopt(const std::string&, const BlobInfo&) override { not_here(); }
  void unstage(const std::string&) override { not_here(); }
  std::int64_t free_bytes() const override { return 0; }
  BlobUsage usage(const std::string&) const override { return {}; }
  UploadInfo start_upload(std::int64_t, const std::string&, const std::string&) override { not_here(); }
  std::optional<UploadInfo> find_upload(const std::string&) const override { return {}; }
  UploadInfo write_upload(const std::string&, std::int64_t, std::string_view) override { not_here(); }
  UploadInfo commit_upload(const std::string&) override { not_here(); }
  Durability durability() const override { return durability_; }

 private:
  [[noreturn]] static void not_here() { throw std::logic_error("a worker has no uploads"); }

  const BlobInfo surface_;
  const std::string surface_path_, folder_;
  const Durability durability_;
};

}  // namespace

std::unique_ptr<BlobStore> make_staged_blobs(BlobInfo surface, std::string surface_path, std::string folder, Durability durability) {
  return std::make_unique<StagedBlobs>(std::move(surface), std::move(surface_path), std::move(folder), durability);
}

}  // namespace strata::server
