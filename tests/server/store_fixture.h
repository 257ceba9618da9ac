// A folder for a store, gone with the test.
#pragma once

#include <filesystem>
#include <string>

#include "server/ids.h"
#include "server/refusal.h"

namespace strata::server {

class Folder {
 public:
  Folder() : path_((std::filesystem::temp_directory_path() / ("strata-store-" + random_id())).string()) {
    std::filesystem::create_directories(path_);
  }
  ~Folder() { std::filesystem::remove_all(path_); }
  Folder(const Folder&) = delete;
  Folder& operator=(const Folder&) = delete;
  [[nodiscard]] const std::string& path() const { return path_; }

 private:
  std::string path_;
};

// Why it was refused.
template <class Body>
std::string refusal_of(const Body& body) {
  try {
    body();
  } catch (const Refusal& refusal) {
    return refusal.reason;
  }
  return "accepted";
}

}  // namespace strata::server
