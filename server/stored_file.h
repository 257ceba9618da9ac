// Files of the blob store, here and in worker processes: synced, with the errors of the device as Refusals.
#pragma once

#include <functional>
#include <memory>
#include <span>
#include <string>
#include <string_view>

#include "server/blob_store.h"

namespace strata::server {

// Throws Refusal STORAGE_FULL or STORAGE_FAILED by errno.
[[noreturn]] void device_failed(const std::string& doing);

// An open file; closes itself.
class File {
 public:
  File(const std::string& path, int flags);
  ~File();
  File(const File&) = delete;
  File& operator=(const File&) = delete;

  void write(std::int64_t offset, std::string_view bytes) const;
  std::size_t read(std::int64_t offset, std::span<char> into) const;
  void sync() const;
  // Has the disk begin with these bytes, so that sync() has less to wait for.
  void begin_sync(std::int64_t offset, std::int64_t size) const;
  void truncate(std::int64_t size) const;

 private:
  int fd_;
};

void sync_folder(const std::string& folder);

std::unique_ptr<BlobReader> open_file(const std::string& path);

// Writes FOLDER/ID, a new id. publish() makes the file as durable as asked and hands it to `published`; without publish() it is removed.
std::unique_ptr<BlobWriter> write_file(const std::string& folder, Durability durability,
                                       std::function<void(const std::string& path, const BlobInfo&)> published);

}  // namespace strata::server
