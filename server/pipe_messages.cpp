#include "server/pipe_messages.h"

#include <unistd.h>

#include <cerrno>
#include <cstdint>

namespace strata::server {
namespace {

constexpr std::size_t kHeader = 4;

bool write_all(int fd, std::string_view bytes) {
  while (!bytes.empty()) {
    const ssize_t n = ::write(fd, bytes.data(), bytes.size());
    if (n < 0 && errno == EINTR) continue;
    if (n < 0) return false;
    bytes.remove_prefix(static_cast<std::size_t>(n));
  }
  return true;
}

bool read_all(int fd, char* into, std::size_t size) {
  while (size > 0) {
    const ssize_t n = ::read(fd, into, size);
    if (n < 0 && errno == EINTR) continue;
    if (n <= 0) return false;
    into += n;
    size -= static_cast<std::size_t>(n);
  }
  return true;
}

std::size_t length_of(const char* header) {
  std::uint32_t length = 0;
  for (std::size_t i = kHeader; i-- > 0;) length = length << 8 | static_cast<unsigned char>(header[i]);
  return length;
}

}  // namespace

bool write_message(int fd, const google::protobuf::MessageLite& message) {
  std::string bytes(kHeader, '\0');
  if (!message.AppendToString(&bytes)) return false;
  std::size_t length = bytes.size() - kHeader;
  if (length > kMaxPipeMessage) return false;
  for (std::size_t i = 0; i < kHeader; ++i, length >>= 8) bytes[i] = static_cast<char>(length & 0xFF);
  return write_all(fd, bytes);
}

bool read_message(int fd, google::protobuf::MessageLite& message) {
  char header[kHeader];
  if (!read_all(fd, header, kHeader)) return false;
  const std::size_t length = length_of(header);
  if (length > kMaxPipeMessage) return false;
  std::string bytes(length, '\0');
  return read_all(fd, bytes.data(), length) && message.ParseFromString(bytes);
}

std::optional<std::string> MessageSplitter::next() {
  if (damaged_ || bytes_.size() - at_ < kHeader) return {};
  const std::size_t length = length_of(bytes_.data() + at_);
  damaged_ = length > kMaxPipeMessage;
  if (damaged_ || bytes_.size() - at_ - kHeader < length) return {};
  std::string message = bytes_.substr(at_ + kHeader, length);
  at_ += kHeader + length;
  if (at_ == bytes_.size() || at_ > kMaxPipeMessage / 64) {
    bytes_.erase(0, at_);
    at_ = 0;
  }
  return message;
}

}  // namespace strata::server
