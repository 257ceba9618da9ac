#pragma once

#include "core/base/context.h"
#include "core/base/parallel.h"
#include "core/optimise/workspace.h"

namespace strata {

template <class Body>
std::int64_t Workspace::sweep(const Body& body, const Context& context) {
  std::int64_t moved = 0;
  for (const std::vector<std::uint32_t>& colour : grains_.colours) {
    std::vector<std::int64_t> moved_in(colour.size(), 0);
    parallel_for(
        colour.size(),
        [&](std::size_t i) {
          if (context.cancelled()) return;
          Star star;
          std::int64_t count = 0;
          for (std::uint32_t at = grains_.first[colour[i]]; at != grains_.first[colour[i] + 1]; ++at) {
            const VertexId v = grains_.order[at];
            if (active_[v] == 0) continue;
            active_[v] = 0;
            gather(v, star);
            if (!body(v, star)) continue;
            active_[v] = 1;
            wake_round(v);
            ++count;
          }
          moved_in[i] = count;
        },
        1);
    for (const std::int64_t m : moved_in) moved += m;
    context.checkpoint();
  }
  return moved;
}

}  // namespace strata
