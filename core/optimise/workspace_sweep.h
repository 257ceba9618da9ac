#pragma once

#include "core/base/context.h"
#include "core/base/parallel.h"
#include "core/optimise/workspace.h"

namespace strata {

template <class Body>
std::int64_t Workspace::sweep(const Body& body, const Context& context) {
  constexpr std::size_t kVisits = 128;  // a task's vertices: some 0.2 ms
  std::int64_t moved = 0;
  for (const std::vector<VertexId>& colour : colours_) {
    std::vector<std::int64_t> moved_in((colour.size() + kVisits - 1) / kVisits, 0);
    parallel_blocks(
        colour.size(),
        [&](std::size_t begin, std::size_t end) {
          if (context.cancelled()) return;
          Star star;
          std::int64_t count = 0;
          for (std::size_t i = begin; i != end; ++i) {
            const VertexId v = colour[i];
            if (active_[v] == 0) continue;
            active_[v] = 0;
            gather(v, star);
            if (star.hexes() == 0 || !body(v, star)) continue;
            active_[v] = 1;
            wake_round(v);
            ++count;
          }
          moved_in[begin / kVisits] = count;
        },
        kVisits);
    for (const std::int64_t m : moved_in) moved += m;
    context.checkpoint();
  }
  return moved;
}

}  // namespace strata
