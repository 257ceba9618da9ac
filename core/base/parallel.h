// Deterministic parallel loops: the only file that knows TBB. Results never depend on the number of threads: blocks have
// a fixed size, partial results are joined in block order, sorts are total orders.
#pragma once

#include <oneapi/tbb/blocked_range.h>
#include <oneapi/tbb/parallel_for.h>
#include <oneapi/tbb/parallel_sort.h>
#include <oneapi/tbb/partitioner.h>
#include <oneapi/tbb/task_arena.h>

#include <algorithm>
#include <cstddef>
#include <functional>
#include <vector>

namespace strata {

inline constexpr std::size_t kGrain = 1024;  // indices a task takes at least; small enough to cancel in milliseconds

// body(begin, end) over fixed blocks of [0, count).
template <class Body>
void parallel_blocks(std::size_t count, const Body& body, std::size_t grain = kGrain) {
  if (count <= grain) {
    if (count > 0) body(std::size_t{0}, count);
    return;
  }
  const std::size_t blocks = (count + grain - 1) / grain;
  tbb::parallel_for(tbb::blocked_range<std::size_t>(0, blocks), [&](const tbb::blocked_range<std::size_t>& range) {
    for (std::size_t b = range.begin(); b != range.end(); ++b) body(b * grain, std::min(count, (b + 1) * grain));
  });
}

// body(i) for i in [0, count).
template <class Body>
void parallel_for(std::size_t count, const Body& body, std::size_t grain = kGrain) {
  parallel_blocks(
      count,
      [&](std::size_t begin, std::size_t end) {
        for (std::size_t i = begin; i != end; ++i) body(i);
      },
      grain);
}

// join(...join(join(identity, f(0)), f(1))..., f(count-1)) with fixed blocks: bit-equal for any thread count.
template <class T, class Map, class Join>
T parallel_reduce(std::size_t count, T identity, const Map& map, const Join& join, std::size_t grain = kGrain) {
  const std::size_t blocks = (count + grain - 1) / grain;
  std::vector<T> partial(blocks, identity);
  parallel_blocks(
      count,
      [&](std::size_t begin, std::size_t end) {
        T sum = identity;
        for (std::size_t i = begin; i != end; ++i) sum = join(sum, map(i));
        partial[begin / grain] = sum;
      },
      grain);
  T total = identity;
  for (const T& p : partial) total = join(total, p);
  return total;
}

// In place: counts become offsets (exclusive scan); returns the total. values gets no extra entry.
template <class Int>
Int exclusive_scan(std::vector<Int>& values) {
  Int sum = 0;
  for (Int& v : values) {
    const Int n = v;
    v = sum;
    sum += n;
  }
  return sum;
}

// Sorts by a total order (ties must be impossible or between equal values).
template <class It, class Less = std::less<>>
void parallel_sort(It begin, It end, Less less = {}) {
  tbb::parallel_sort(begin, end, less);
}

// Runs body() on this thread with at most `threads` threads (this one included) for every loop inside.
template <class Body>
void with_threads(int threads, const Body& body) {
  tbb::task_arena arena(threads);
  arena.execute(body);
}

}  // namespace strata
