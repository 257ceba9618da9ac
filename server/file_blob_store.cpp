#include <fcntl.h>
#include <sys/stat.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <cstring>
#include <filesystem>
#include <map>
#include <mutex>
#include <utility>

#include "proto/wire/crc32c.h"
#include "proto/wire/sha256.h"
#include "server/blob_store.h"
#include "server/ids.h"
#include "server/refusal.h"
#include "server/stored_file.h"

namespace strata::server {
namespace {

namespace fs = std::filesystem;

std::string hex(const std::string& bytes) {
  static constexpr char kDigits[] = "0123456789abcdef";
  std::string text;
  for (const unsigned char byte : bytes) {
    text += kDigits[byte >> 4];
    text += kDigits[byte & 15];
  }
  return text;
}

std::string unhex(std::string_view text) {
  const auto digit = [](char c) { return c <= '9' ? c - '0' : c - 'a' + 10; };
  std::string bytes;
  for (std::size_t i = 0; i + 1 < text.size(); i += 2) bytes += static_cast<char>(digit(text[i]) * 16 + digit(text[i + 1]));
  return bytes;
}

std::string digest_of(const File& file, std::int64_t size) {
  wire::Sha256 sha;
  std::vector<char> buffer(wire::kFrameBytes);
  for (std::int64_t at = 0; at < size;) {
    const std::size_t n = file.read(at, buffer);
    if (n == 0) break;
    sha.add({buffer.data(), n});
    at += static_cast<std::int64_t>(n);
  }
  return sha.finish();
}

class FileBlobStore final : public BlobStore {
 public:
  FileBlobStore(const std::string& folder, Durability durability)
      : durability_(durability), blobs_(folder + "/blobs"), uploads_(folder + "/uploads"), temporary_(folder + "/temporary") {
    fs::remove_all(temporary_);
    for (const std::string& f : {blobs_, uploads_, temporary_}) fs::create_directories(f);
    for (const auto& entry : fs::directory_iterator(blobs_)) remember_blob(entry);
    for (const auto& entry : fs::directory_iterator(uploads_)) remember_upload(entry);
  }

  std::unique_ptr<BlobWriter> create(const std::string& owner) override;
  void publish(const std::string& path, const BlobInfo& blob);

  std::optional<BlobInfo> find(const std::string& id) const override {
    const std::lock_guard lock(mutex_);
    const auto found = known_.find(id);
    return found == known_.end() ? std::nullopt : std::optional(found->second);
  }

  std::optional<BlobInfo> find_digest(const std::string& sha256, const std::string& owner) const override {
    const std::lock_guard lock(mutex_);
    for (auto at = by_digest_.lower_bound({sha256, ""}); at != by_digest_.end() && at->first.first == sha256; ++at)
      if (const BlobInfo& blob = known_.at(at->first.second); blob.owner == owner) return blob;
    return {};
  }

  void touch(const std::string& id) override {
    const auto blob = find(id);
    if (blob) ::utimensat(AT_FDCWD, path_of(*blob).c_str(), nullptr, 0);
  }

  std::vector<std::string> idle_since(std::chrono::system_clock::time_point when) const override {
    std::vector<BlobInfo> all;
    {
      const std::lock_guard lock(mutex_);
      for (const auto& [id, blob] : known_) all.push_back(blob);
    }
    std::vector<std::string> idle;
    for (const BlobInfo& blob : all)
      if (last_change(path_of(blob)) < when) idle.push_back(blob.id);
    return idle;
  }

  // An upload's lock may be held by a writer that waits for the store's: never the other way round.
  void drop_uploads_idle_since(std::chrono::system_clock::time_point when) override {
    std::vector<std::shared_ptr<Upload>> all;
    {
      const std::lock_guard lock(mutex_);
      for (const auto& [id, upload] : known_uploads_) all.push_back(upload);
    }
    for (const std::shared_ptr<Upload>& upload : all) {
      const Dropped dropped = drop_when_idle(*upload, when);
      if (dropped == Dropped::No) continue;
      const std::lock_guard lock(mutex_);
      known_uploads_.erase(upload->info.id);
      if (dropped == Dropped::Unfinished) count_upload(upload->info.owner, upload->info.size, -1);
    }
  }

  std::unique_ptr<BlobReader> open(const std::string& id) const override {
    const auto blob = find(id);
    if (!blob) throw Refusal(Refused::NotFound, "BLOB_NOT_FOUND", "there is no blob " + shown(id)).at("blob_id");
    return open_file(path_of(*blob));
  }

  void remove(const std::string& id) override {
    const std::lock_guard lock(mutex_);
    const auto found = known_.find(id);
    if (found == known_.end()) return;
    ::unlink(path_of(found->second).c_str());
    by_digest_.erase({found->second.sha256, id});
    usage_[found->second.owner].stored -= found->second.size;
    known_.erase(found);
  }

  std::string local_path(const std::string& id) const override {
    const auto blob = find(id);
    if (!blob) throw Refusal(Refused::NotFound, "BLOB_NOT_FOUND", "there is no blob " + shown(id)).at("blob_id");
    return fs::absolute(path_of(*blob));
  }

  std::string stage(const std::string& name) override {
    const std::string folder = fs::absolute(temporary_ + "/" + name);
    std::error_code error;
    fs::create_directories(folder, error);
    if (error) throw Refusal(Refused::Unavailable, "STORAGE_FAILED", "cannot make a folder for results: " + error.message()).retry_after(5);
    return folder;
  }

  void adopt(const std::string& folder, const BlobInfo& blob) override { publish(folder + "/" + blob.id, blob); }

  void unstage(const std::string& folder) override {
    std::error_code ignored;  // what stays is removed at the next start
    fs::remove_all(folder, ignored);
  }

  std::int64_t free_bytes() const override {
    std::error_code error;
    const auto space = fs::space(blobs_, error);
    if (error) return 0;
    const std::lock_guard lock(mutex_);
    return std::max<std::int64_t>(0, static_cast<std::int64_t>(space.available) - announced_);
  }

  BlobUsage usage(const std::string& owner) const override {
    const std::lock_guard lock(mutex_);
    const auto found = usage_.find(owner);
    return found == usage_.end() ? BlobUsage() : found->second;
  }

  UploadInfo start_upload(std::int64_t size, const std::string& sha256, const std::string& owner) override {
    auto upload = std::make_shared<Upload>();
    upload->info.id = random_id();
    upload->info.size = size;
    upload->info.owner = owner;
    upload->expected = sha256;
    upload->path = uploads_ + "/" + upload->info.id + "-" + std::to_string(size) + "-" + hex(sha256) + suffix(owner);
    static_cast<void>(File(upload->path, O_RDWR | O_CREAT | O_EXCL));
    sync_folder(uploads_);
    const std::lock_guard lock(mutex_);
    known_uploads_[upload->info.id] = upload;
    count_upload(owner, size, +1);
    return upload->info;
  }

  std::optional<UploadInfo> find_upload(const std::string& id) const override {
    const auto upload = upload_of(id);
    if (!upload) return {};
    const std::lock_guard lock(upload->mutex);
    return upload->info;
  }

  UploadInfo write_upload(const std::string& id, std::int64_t offset, std::string_view bytes) override {
    const auto upload = upload_or_refuse(id);
    const std::lock_guard lock(upload->mutex);
    if (upload->info.blob) return upload->info;
    if (offset != upload->written)
      throw Refusal(Refused::OutOfRange, "OFFSET_MISMATCH",
                    "the upload goes on at offset " + std::to_string(upload->written) + ", not " + std::to_string(offset))
          .at("frame.offset");
    if (static_cast<std::int64_t>(bytes.size()) > upload->info.size - offset)
      throw Refusal(Refused::OutOfRange, "UPLOAD_TOO_LONG", "the upload was announced with " + std::to_string(upload->info.size) + " bytes")
          .at("frame.data");
    if (!upload->file) upload->file = std::make_unique<File>(upload->path, O_RDWR);
    upload->file->write(offset, bytes);
    upload->written += static_cast<std::int64_t>(bytes.size());
    if (upload->hashed == offset) {  // else the digest is computed from the file at the end
      upload->sha.add(bytes);
      upload->hashed = upload->written;
    }
    if (upload->written == upload->info.size) or_go_back(*upload, [&] { complete(*upload); });
    else if (upload->written - upload->info.committed >= kSyncEvery) or_go_back(*upload, [&] { commit(*upload); });
    return upload->info;
  }

  Durability durability() const override { return durability_; }

  UploadInfo commit_upload(const std::string& id) override {
    const auto upload = upload_or_refuse(id);
    const std::lock_guard lock(upload->mutex);
    if (!upload->info.blob) or_go_back(*upload, [&] { commit(*upload); });
    upload->file.reset();  // many uploads may wait to be continued
    return upload->info;
  }

 private:
  static constexpr std::int64_t kSyncEvery = std::int64_t{16} << 20;  // bytes lost at most by a crash, against the cost of a sync

  struct Upload {
    std::mutex mutex;
    UploadInfo info;
    std::string expected;  // digest; empty: any
    std::string path;
    std::unique_ptr<File> file;  // open while somebody writes
    std::int64_t written = 0;
    std::int64_t hashed = 0;
    wire::Sha256 sha;
    std::chrono::system_clock::time_point completed;
  };

  static std::string shown(const std::string& id) { return is_id(id) ? id : "with such a name"; }

  static std::string suffix(const std::string& owner) { return owner.empty() ? "" : "-" + owner; }
  std::string path_of(const BlobInfo& blob) const { return blobs_ + "/" + blob.id + "-" + hex(blob.sha256) + suffix(blob.owner); }

  // Of a file that is gone: long ago.
  static std::chrono::system_clock::time_point last_change(const std::string& path) {
    struct stat status{};
    if (::stat(path.c_str(), &status) != 0) return {};
    return std::chrono::system_clock::from_time_t(status.st_mtime);
  }

  std::shared_ptr<Upload> upload_of(const std::string& id) const {
    const std::lock_guard lock(mutex_);
    const auto found = known_uploads_.find(id);
    return found == known_uploads_.end() ? nullptr : found->second;
  }

  std::shared_ptr<Upload> upload_or_refuse(const std::string& id) const {
    auto upload = upload_of(id);
    if (!upload) throw Refusal(Refused::NotFound, "UPLOAD_NOT_FOUND", "there is no upload " + shown(id)).at("upload_id");
    return upload;
  }

  enum class Dropped { No, Unfinished, Finished };
  static Dropped drop_when_idle(Upload& upload, std::chrono::system_clock::time_point when) {
    const std::lock_guard lock(upload.mutex);
    if (upload.info.blob) return upload.completed < when ? Dropped::Finished : Dropped::No;
    if (last_change(upload.path) >= when) return Dropped::No;
    ::unlink(upload.path.c_str());
    return Dropped::Unfinished;
  }

  // With the store's lock. `by` is 1 for one that begins, -1 for one that is no longer unfinished.
  void count_upload(const std::string& owner, std::int64_t size, int by) {
    BlobUsage& usage = usage_[owner];
    usage.announced += by * size;
    usage.uploads += by;
    announced_ += by * size;
  }
  void count_blob(const BlobInfo& blob) {
    if (known_.emplace(blob.id, blob).second) usage_[blob.owner].stored += blob.size;
    by_digest_[{blob.sha256, blob.id}] = true;
  }

  // What the disk did not take has to come again: the kernel may have dropped it, and a client goes on at the committed offset.
  template <class Step>
  static void or_go_back(Upload& upload, const Step& step) {
    try {
      step();
    } catch (...) {
      upload.written = upload.info.committed;
      upload.sha = wire::Sha256();
      upload.hashed = upload.written == 0 ? 0 : -1;
      throw;
    }
  }

  void commit(Upload& upload) const {
    if (upload.info.committed == upload.written) return;
    sync(*upload.file);
    upload.info.committed = upload.written;
  }

  void complete(Upload& upload) {
    sync(*upload.file);
    const std::string digest = upload.hashed == upload.written ? upload.sha.finish() : digest_of(*upload.file, upload.written);
    if (!upload.expected.empty() && digest != upload.expected) {
      upload.file->truncate(0);
      upload.info.committed = 0;
      throw Refusal(Refused::DataLoss, "DIGEST_MISMATCH", "the bytes that came have another SHA-256 than announced: send them again")
          .at("sha256");
    }
    const BlobInfo blob{random_id(), upload.info.size, digest, upload.info.owner};
    publish(upload.path, blob);
    {
      const std::lock_guard lock(mutex_);
      count_upload(upload.info.owner, upload.info.size, -1);
    }
    upload.info.blob = blob;
    upload.completed = std::chrono::system_clock::now();
    upload.info.committed = upload.info.size;
    upload.file.reset();
  }

  static std::vector<std::string> parts_of(const std::string& name) {
    std::vector<std::string> parts(1);
    for (const char c : name) {
      if (c == '-') parts.emplace_back();
      else parts.back() += c;
    }
    return parts;
  }

  void remember_blob(const fs::directory_entry& entry) {
    const std::vector<std::string> parts = parts_of(entry.path().filename());
    if (parts.size() < 2 || parts.size() > 3 || !is_id(parts[0]) || parts[1].size() != 64) return;
    count_blob({parts[0], static_cast<std::int64_t>(entry.file_size()), unhex(parts[1]), parts.size() == 3 ? parts[2] : ""});
  }

  void remember_upload(const fs::directory_entry& entry) {
    const std::vector<std::string> parts = parts_of(entry.path().filename());
    if (parts.size() < 3 || parts.size() > 4 || !is_id(parts[0])) return;
    auto upload = std::make_shared<Upload>();
    upload->info.id = parts[0];
    upload->info.size = std::strtoll(parts[1].c_str(), nullptr, 10);
    upload->expected = unhex(parts[2]);
    upload->info.owner = parts.size() == 4 ? parts[3] : "";
    upload->path = entry.path();
    upload->written = upload->info.committed = std::min(static_cast<std::int64_t>(entry.file_size()), upload->info.size);
    upload->hashed = upload->written == 0 ? 0 : -1;
    known_uploads_[upload->info.id] = upload;
    count_upload(upload->info.owner, upload->info.size, +1);
  }

  void sync(const File& file) const {
    if (durability_ == Durability::PowerLoss) file.sync();
  }
  void sync_folder(const std::string& folder) const {
    if (durability_ == Durability::PowerLoss) server::sync_folder(folder);
  }

  const Durability durability_;
  const std::string blobs_, uploads_, temporary_;
  mutable std::mutex mutex_;
  std::map<std::string, BlobInfo> known_;
  std::map<std::pair<std::string, std::string>, bool> by_digest_;  // (digest, id)
  std::map<std::string, std::shared_ptr<Upload>> known_uploads_;
  std::map<std::string, BlobUsage> usage_;  // by owner
  std::int64_t announced_ = 0;              // by unfinished uploads of all owners
};

std::unique_ptr<BlobWriter> FileBlobStore::create(const std::string& owner) {
  return write_file(temporary_, durability_, [this, owner](const std::string& path, BlobInfo blob) {
    blob.owner = owner;
    publish(path, blob);
  });
}

void FileBlobStore::publish(const std::string& path, const BlobInfo& blob) {
  if (::rename(path.c_str(), path_of(blob).c_str()) != 0) device_failed("cannot publish a blob");
  try {
    sync_folder(blobs_);
  } catch (...) {
    ::rename(path_of(blob).c_str(), path.c_str());  // it is no blob yet
    throw;
  }
  const std::lock_guard lock(mutex_);
  count_blob(blob);
}

}  // namespace

BlobInfo found_blob(const BlobStore& store, const std::string& id) {
  auto blob = is_id(id) ? store.find(id) : std::nullopt;
  if (!blob) throw Refusal(Refused::NotFound, "BLOB_NOT_FOUND", "there is no such blob").at("blob_id");
  return std::move(*blob);
}

std::vector<char> read_all(const BlobStore& store, const BlobInfo& blob) {
  std::vector<char> bytes(static_cast<std::size_t>(blob.size));
  if (store.open(blob.id)->read(0, bytes) != bytes.size())
    throw Refusal(Refused::DataLoss, "BLOB_TRUNCATED", "blob " + blob.id + " is shorter than when it was stored");
  return bytes;
}

bool sees_blob(const Caller& caller, const BlobInfo& blob) { return caller.role == Role::Admin || blob.owner == owner_key(caller.tenant); }

std::string owner_key(std::string_view tenant) {
  if (tenant.empty()) return {};
  wire::Sha256 sha;
  sha.add(tenant);
  return hex(sha.finish()).substr(0, 16);
}

std::unique_ptr<BlobStore> open_file_blob_store(const std::string& folder, Durability durability) {
  return std::make_unique<FileBlobStore>(folder, durability);
}

}  // namespace strata::server
