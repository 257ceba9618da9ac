// The digest of blobs: SHA-256, computed as the bytes pass.
#pragma once

#include <memory>
#include <string>
#include <string_view>

namespace strata::wire {

class Sha256 {
 public:
  Sha256();
  ~Sha256();
  Sha256(Sha256&&) noexcept;
  Sha256& operator=(Sha256&&) noexcept;

  void add(std::string_view bytes);
  // The 32 bytes; afterwards the object starts over.
  std::string finish();

 private:
  struct State;
  std::unique_ptr<State> state_;
};

}  // namespace strata::wire
