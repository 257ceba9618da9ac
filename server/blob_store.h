// Where surfaces and meshes lie. Blobs are written once, complete, and then only read and removed.
#pragma once

#include <chrono>
#include <cstdint>
#include <functional>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "server/caller.h"
#include "server/durability.h"

namespace strata::server {

struct BlobInfo {
  std::string id;
  std::int64_t size = 0;
  std::string sha256;  // 32 bytes
  std::string owner;   // owner_key of a tenant
};

// How the store knows a tenant: empty for the nameless one, else 16 characters of 0-9 and a-f, whatever the name.
std::string owner_key(std::string_view tenant);

struct UploadInfo {
  std::string id;
  std::int64_t size = 0;
  std::int64_t committed = 0;     // durable
  std::optional<BlobInfo> blob;   // once complete
  std::string owner;
};

// What lies here of one owner.
struct BlobUsage {
  std::int64_t stored = 0;     // bytes of blobs
  std::int64_t announced = 0;  // bytes that unfinished uploads have or will have
  int uploads = 0;             // unfinished
};

// A blob that is open: it stays readable even when removed meanwhile.
class BlobReader {
 public:
  virtual ~BlobReader() = default;
  // Fills `into` from `offset`; short only at the end of the blob.
  virtual std::size_t read(std::int64_t offset, std::span<char> into) const = 0;
};

// Bytes on their way to become a blob. Dropped without publish: nothing stays.
class BlobWriter {
 public:
  virtual ~BlobWriter() = default;
  virtual void write(std::string_view bytes) = 0;
  // Durable on return. Call at most once, last.
  virtual BlobInfo publish() = 0;
};

// Safe to call from any thread. Errors of the device are Refusals (STORAGE_FULL, STORAGE_FAILED).
class BlobStore {
 public:
  virtual ~BlobStore() = default;

  virtual std::unique_ptr<BlobWriter> create(const std::string& owner) = 0;
  virtual std::optional<BlobInfo> find(const std::string& id) const = 0;
  virtual std::optional<BlobInfo> find_digest(const std::string& sha256, const std::string& owner) const = 0;
  // Throws Refusal NOT_FOUND.
  virtual std::unique_ptr<BlobReader> open(const std::string& id) const = 0;
  // No error when it is not there.
  virtual void remove(const std::string& id) = 0;
  // Somebody has a use for it: it is not idle.
  virtual void touch(const std::string& id) = 0;
  // Blobs that nobody made or touched since.
  virtual std::vector<std::string> idle_since(std::chrono::system_clock::time_point when) const = 0;
  // Uploads that got no frame since are forgotten.
  virtual void drop_uploads_idle_since(std::chrono::system_clock::time_point when) = 0;

  // For writers in other processes. A path under which this process and its children can read the blob; throws as open().
  virtual std::string local_path(const std::string& id) const = 0;
  // A new folder for one such writer, who leaves files there named by their ids, synced.
  virtual std::string stage(const std::string& name) = 0;
  // Makes a blob of such a file. Durable on return.
  virtual void adopt(const std::string& folder, const BlobInfo& blob) = 0;
  // Removes the folder and what was not adopted.
  virtual void unstage(const std::string& folder) = 0;

  // On the device, less what the unfinished uploads of all owners announced: what came of those already counts twice, to be on the safe side.
  virtual std::int64_t free_bytes() const = 0;
  virtual BlobUsage usage(const std::string& owner) const = 0;

  // Uploads in pieces. `sha256` may be empty: then nothing is compared.
  virtual UploadInfo start_upload(std::int64_t size, const std::string& sha256, const std::string& owner) = 0;
  virtual std::optional<UploadInfo> find_upload(const std::string& id) const = 0;
  // Appends at `offset`, which must be the end of what was written. Throws Refusal: NOT_FOUND, OUT_OF_RANGE (wrong offset or beyond the
  // size). The last byte completes the upload; DATA_LOSS when the digest disagrees, and the upload is empty again.
  virtual UploadInfo write_upload(const std::string& id, std::int64_t offset, std::string_view bytes) = 0;
  // Makes what was written durable: the committed offset moves up.
  virtual UploadInfo commit_upload(const std::string& id) = 0;

  [[nodiscard]] virtual Durability durability() const = 0;
};

// Blobs of other tenants do not exist for a caller.
bool sees_blob(const Caller& caller, const BlobInfo& blob);

// Throws Refusal NOT_FOUND.
BlobInfo found_blob(const BlobStore& store, const std::string& id);

// The whole blob in memory.
std::vector<char> read_all(const BlobStore& store, const BlobInfo& blob);

// Files under `folder`: blobs/ID-DIGEST[-OWNER], uploads/ID-SIZE-DIGEST[-OWNER], temporary/. Written to a temporary file, synced, renamed, folder synced.
// Makes the folders; removes leftovers of earlier runs from temporary/.
std::unique_ptr<BlobStore> open_file_blob_store(const std::string& folder, Durability durability = Durability::PowerLoss);

}  // namespace strata::server
