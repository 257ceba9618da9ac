// Protobuf messages over pipes: four bytes of length, little-endian, then the message.
#pragma once

#include <google/protobuf/message_lite.h>

#include <cstddef>
#include <optional>
#include <string>
#include <string_view>

namespace strata::server {

inline constexpr std::size_t kMaxPipeMessage = std::size_t{64} << 20;

// False when the other end is gone. Blocks.
bool write_message(int fd, const google::protobuf::MessageLite& message);
// False at the end of the stream or when it is damaged. Blocks.
bool read_message(int fd, google::protobuf::MessageLite& message);

// For readers that must not block: takes bytes as they come, gives messages as they are complete.
class MessageSplitter {
 public:
  void add(std::string_view bytes) { bytes_ += bytes; }
  // The next whole message, when there is one.
  std::optional<std::string> next();
  // The stream announced a message no one sends: nothing more can be made of it.
  [[nodiscard]] bool damaged() const { return damaged_; }

 private:
  std::string bytes_;
  std::size_t at_ = 0;
  bool damaged_ = false;
};

}  // namespace strata::server
