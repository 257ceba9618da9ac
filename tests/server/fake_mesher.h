// A mesher for tests of the service: quick, and as slow as they want.
#pragma once

#include <atomic>
#include <functional>

#include "server/mesher_door.h"

namespace strata::server {

// A door behind which a unit cube is "meshed" to one hex; with `hold`, only after release(), looking at the context all the while.
class FakeMesher {
 public:
  [[nodiscard]] MesherDoor door();
  void hold() { held_ = true; }
  void release() { held_ = false; }
  int hexes = 1;  // in the mesh it makes
  std::int64_t needed_memory = 0;
  std::function<void()> on_generate = [] {};
  std::function<void(const Context&)> before_estimate = [](const Context&) {};

 private:
  Outcome generate(const TriangleSoup& soup, Context& context);
  void tell_estimate(const TriangleSoup& soup, const Observer& observer) const;
  std::atomic<bool> held_ = false;
};

}  // namespace strata::server
