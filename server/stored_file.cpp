#include "server/stored_file.h"

#include <fcntl.h>
#include <sys/stat.h>
#include <unistd.h>

#include <cerrno>
#include <cstring>
#include <utility>

#include "proto/wire/sha256.h"
#include "server/ids.h"
#include "server/refusal.h"

namespace strata::server {

void device_failed(const std::string& doing) {
  const int error = errno;
  const bool full = error == ENOSPC || error == EDQUOT;
  throw Refusal(full ? Refused::ResourceExhausted : Refused::Unavailable, full ? "STORAGE_FULL" : "STORAGE_FAILED",
                doing + ": " + std::strerror(error))
      .retry_after(full ? 60 : 5);
}

File::File(const std::string& path, int flags) : fd_(::open(path.c_str(), flags | O_CLOEXEC, 0600)) {
  if (fd_ < 0) device_failed("cannot open a stored file");
}
File::~File() { ::close(fd_); }

void File::write(std::int64_t offset, std::string_view bytes) const {
  while (!bytes.empty()) {
    const ssize_t n = ::pwrite(fd_, bytes.data(), bytes.size(), offset);
    if (n < 0 && errno == EINTR) continue;
    if (n < 0) device_failed("cannot write a blob");
    bytes.remove_prefix(static_cast<std::size_t>(n));
    offset += n;
  }
}

std::size_t File::read(std::int64_t offset, std::span<char> into) const {
  std::size_t done = 0;
  while (done < into.size()) {
    const ssize_t n = ::pread(fd_, into.data() + done, into.size() - done, offset + static_cast<std::int64_t>(done));
    if (n < 0 && errno == EINTR) continue;
    if (n < 0) device_failed("cannot read a blob");
    if (n == 0) break;
    done += static_cast<std::size_t>(n);
  }
  return done;
}

void File::sync() const {
  if (::fsync(fd_) != 0) device_failed("cannot make a blob durable");
}

void File::begin_sync(std::int64_t offset, std::int64_t size) const {
  static_cast<void>(::sync_file_range(fd_, offset, size, SYNC_FILE_RANGE_WRITE));  // what fails here, fails in sync() too
}

void File::truncate(std::int64_t size) const {
  if (::ftruncate(fd_, size) != 0) device_failed("cannot empty an upload");
}

void sync_folder(const std::string& folder) {
  const File directory(folder, O_RDONLY | O_DIRECTORY);
  directory.sync();
}

namespace {

class FileReader final : public BlobReader {
 public:
  explicit FileReader(const std::string& path) : file_(path, O_RDONLY) {}
  std::size_t read(std::int64_t offset, std::span<char> into) const override { return file_.read(offset, into); }

 private:
  File file_;
};

class FileWriter final : public BlobWriter {
 public:
  using Published = std::function<void(const std::string&, const BlobInfo&)>;

  FileWriter(const std::string& folder, Durability durability, Published published)
      : durability_(durability),
        published_to_(std::move(published)),
        id_(random_id()),
        path_(folder + "/" + id_),
        file_(path_, O_RDWR | O_CREAT | O_EXCL) {}
  ~FileWriter() override {
    if (!published_) ::unlink(path_.c_str());
  }

  void write(std::string_view bytes) override {
    sha_.add(bytes);
    if (buffer_.size() + bytes.size() <= kBuffer) {
      buffer_ += bytes;
      return;
    }
    flush();
    if (bytes.size() >= kBuffer) {
      put(bytes);
    } else {
      buffer_ = bytes;
    }
  }

  BlobInfo publish() override {
    flush();
    if (durability_ == Durability::PowerLoss) file_.sync();
    BlobInfo blob{id_, written_, sha_.finish(), {}};
    published_to_(path_, blob);
    published_ = true;
    return blob;
  }

 private:
  static constexpr std::size_t kBuffer = std::size_t{1} << 20;  // writers of text write in small pieces

  static constexpr std::int64_t kBeginSync = std::int64_t{8} << 20;

  void flush() {
    put(buffer_);
    buffer_.clear();
  }

  void put(std::string_view bytes) {
    file_.write(written_, bytes);
    written_ += static_cast<std::int64_t>(bytes.size());
    if (durability_ != Durability::PowerLoss || written_ - begun_ < kBeginSync) return;
    file_.begin_sync(begun_, written_ - begun_);
    begun_ = written_;
  }

  const Durability durability_;
  Published published_to_;
  std::string id_, path_;
  File file_;
  std::string buffer_;
  wire::Sha256 sha_;
  std::int64_t written_ = 0;
  std::int64_t begun_ = 0;  // the disk has begun with what lies before
  bool published_ = false;
};

}  // namespace

std::unique_ptr<BlobReader> open_file(const std::string& path) { return std::make_unique<FileReader>(path); }

std::unique_ptr<BlobWriter> write_file(const std::string& folder, Durability durability,
                                       std::function<void(const std::string&, const BlobInfo&)> published) {
  return std::make_unique<FileWriter>(folder, durability, std::move(published));
}

}  // namespace strata::server
