// A bounding-volume hierarchy by binned surface-area heuristic. Answers never depend on the shape of the tree: a query
// takes the minimum over triangles of a value computed from that triangle alone, and boxes are pruned conservatively.
#include "core/surface/locator.h"

#include <algorithm>
#include <array>
#include <cassert>
#include <cmath>
#include <numbers>
#include <numeric>
#include <utility>

#include "core/base/parallel.h"
#include "core/base/triangle_geometry.h"

namespace strata {
namespace {

constexpr std::int32_t kLeafSize = 4;   // triangles; 4 was as fast as 2 and halves the nodes
constexpr int kBins = 16;               // candidate planes per split
constexpr std::int32_t kSerial = 4096;  // triangles below which a subtree is built by one task
constexpr int kStack = 128;             // pending nodes: depth is bounded by kMaxDepth, one sibling a level
constexpr int kMaxDepth = 100;          // beyond, split by count (bad luck with coincident centroids)
constexpr double kFar = 3;              // of its radii, a cluster is far: errors of 0.02; Barill et al. 2018 use 2 with more terms
// Pruning keeps boxes that are further by rounding only, so that equal distances are all seen.
constexpr double kRounding = 1 + 1e-12;

struct Item {
  Box box;
  Vec3 centroid;
  TriangleId triangle;
};

double half_area(const Box& box) {
  if (box.empty()) return 0;
  const Vec3 e = box.extent();
  return e.x() * e.y() + e.y() * e.z() + e.z() * e.x();
}

double squared_distance(const Box& box, const Vec3& p) { return (box.min - p).cwiseMax(p - box.max).cwiseMax(0.0).squaredNorm(); }

struct Bin {
  Box box;
  std::int32_t count = 0;
};

// Reorders items[first, last) and returns where the second half begins.
std::int32_t split(std::vector<Item>& items, std::int32_t first, std::int32_t last, int depth) {
  const auto begin = items.begin() + first, end = items.begin() + last;
  Box centroids;
  for (auto it = begin; it != end; ++it) centroids.add(it->centroid);
  int axis = 0;
  const double length = centroids.extent().maxCoeff(&axis);
  const std::int32_t middle = first + (last - first) / 2;
  const auto by_count = [&] {
    std::nth_element(begin, items.begin() + middle, end, [axis](const Item& a, const Item& b) {
      return std::pair(a.centroid[axis], a.triangle) < std::pair(b.centroid[axis], b.triangle);
    });
    return middle;
  };
  if (!(length > 0) || depth > kMaxDepth / 2) return by_count();

  const double to_bin = kBins * (1 - 1e-9) / length;
  const double low = centroids.min[axis];
  const auto bin_of = [&](const Item& item) { return std::clamp(static_cast<int>((item.centroid[axis] - low) * to_bin), 0, kBins - 1); };
  std::array<Bin, kBins> bins;
  for (auto it = begin; it != end; ++it) {
    Bin& bin = bins[static_cast<std::size_t>(bin_of(*it))];
    bin.box.add(it->box);
    ++bin.count;
  }
  std::array<double, kBins> cost_right{};
  Bin sweep;
  for (int b = kBins - 1; b > 0; --b) {
    sweep.box.add(bins[static_cast<std::size_t>(b)].box);
    sweep.count += bins[static_cast<std::size_t>(b)].count;
    cost_right[static_cast<std::size_t>(b)] = half_area(sweep.box) * sweep.count;
  }
  sweep = {};
  int best = 0;
  double best_cost = std::numeric_limits<double>::infinity();
  for (int b = 1; b < kBins; ++b) {
    sweep.box.add(bins[static_cast<std::size_t>(b - 1)].box);
    sweep.count += bins[static_cast<std::size_t>(b - 1)].count;
    const double cost = half_area(sweep.box) * sweep.count + cost_right[static_cast<std::size_t>(b)];
    if (sweep.count > 0 && sweep.count < last - first && cost < best_cost) {
      best_cost = cost;
      best = b;
    }
  }
  if (best == 0) return by_count();
  const auto cut = std::partition(begin, end, [&](const Item& item) { return bin_of(item) < best; });
  return static_cast<std::int32_t>(cut - items.begin());
}

// Woop, Benthin, Wald: "Watertight ray/triangle intersection", JCGT 2013: neighbouring triangles agree on their common edge.
struct Ray {
  Vec3 origin, direction, inverse;
  int kx, ky, kz;
  double sx, sy, sz;

  Ray(const Vec3& p, const Vec3& d) : origin(p), direction(d), inverse(d.cwiseInverse()) {
    d.cwiseAbs().maxCoeff(&kz);
    kx = (kz + 1) % 3;
    ky = (kx + 1) % 3;
    if (d[kz] < 0) std::swap(kx, ky);
    sx = d[kx] / d[kz];
    sy = d[ky] / d[kz];
    sz = 1 / d[kz];
  }

  // s of the hit, or a negative number.
  [[nodiscard]] double meets(const Vec3& pa, const Vec3& pb, const Vec3& pc) const {
    const Vec3 a = pa - origin, b = pb - origin, c = pc - origin;
    const double ax = a[kx] - sx * a[kz], ay = a[ky] - sy * a[kz];
    const double bx = b[kx] - sx * b[kz], by = b[ky] - sy * b[kz];
    const double cx = c[kx] - sx * c[kz], cy = c[ky] - sy * c[kz];
    const double u = cx * by - cy * bx, v = ax * cy - ay * cx, w = bx * ay - by * ax;
    if ((u < 0 || v < 0 || w < 0) && (u > 0 || v > 0 || w > 0)) return -1;
    const double det = u + v + w;
    if (det == 0) return -1;
    return (u * sz * a[kz] + v * sz * b[kz] + w * sz * c[kz]) / det;
  }

  [[nodiscard]] bool meets(const Box& box, double limit) const {
    double from = 0, to = limit;
    for (int i = 0; i < 3; ++i) {
      if (direction[i] == 0) {
        if (origin[i] < box.min[i] || origin[i] > box.max[i]) return false;
        continue;
      }
      double near = (box.min[i] - origin[i]) * inverse[i], far = (box.max[i] - origin[i]) * inverse[i];
      if (near > far) std::swap(near, far);
      from = std::max(from, near);
      to = std::min(to, far * kRounding);
    }
    return from <= to;
  }
};

}  // namespace

Locator::Locator(const Surface& surface)
    : Locator(surface, [&] {
        std::vector<TriangleId> all(surface.triangles.size());
        for (std::size_t i = 0; i < all.size(); ++i) all[i] = TriangleId(i);
        return all;
      }()) {}

Locator::Locator(const Surface& surface, std::vector<TriangleId> triangles) : surface_(&surface), order_(std::move(triangles)) {
  const auto count = static_cast<std::int32_t>(order_.size());
  if (count == 0) return;
  if (order_.size() != surface.triangles.size()) {
    members_ = order_;
    std::sort(members_.begin(), members_.end());
  }
  std::vector<Item> items(order_.size());
  parallel_for(items.size(), [&](std::size_t i) {
    const auto corners = surface.corners(order_[i]);
    for (const Vec3& c : corners) items[i].box.add(c);
    items[i].centroid = items[i].box.centre();
    items[i].triangle = order_[i];
  });

  // The top of the tree is split by one thread, the subtrees below by tasks; their nodes are joined in order.
  struct Job {
    std::int32_t node, first, last;
    int depth;
  };
  const auto grow = [&](std::vector<Node>& nodes, Job root, std::int32_t small, std::vector<Job>* later) {
    std::vector<Job> open = {root};
    while (!open.empty()) {
      const Job job = open.back();
      open.pop_back();
      if (later && job.last - job.first <= small) {
        later->push_back(job);
        continue;
      }
      if (job.last - job.first <= kLeafSize) {
        Node& leaf = nodes[static_cast<std::size_t>(job.node)];
        leaf.first = job.first;
        leaf.count = job.last - job.first;
        continue;
      }
      const std::int32_t middle = split(items, job.first, job.last, job.depth);
      const auto child = static_cast<std::int32_t>(nodes.size());
      nodes[static_cast<std::size_t>(job.node)].first = child;
      nodes.resize(nodes.size() + 2);
      open.push_back({child + 1, middle, job.last, job.depth + 1});
      open.push_back({child, job.first, middle, job.depth + 1});
    }
  };
  nodes_.resize(1);
  std::vector<Job> jobs;
  grow(nodes_, {0, 0, count, 0}, kSerial, &jobs);
  std::vector<std::vector<Node>> subtrees(jobs.size());
  parallel_for(
      jobs.size(),
      [&](std::size_t j) {
        subtrees[j].resize(1);
        grow(subtrees[j], {0, jobs[j].first, jobs[j].last, jobs[j].depth}, 0, nullptr);
      },
      1);
  for (std::size_t j = 0; j < jobs.size(); ++j) {
    const auto offset = static_cast<std::int32_t>(nodes_.size()) - 1;  // local node 1 becomes the next free one
    for (Node& node : subtrees[j])
      if (node.count == 0) node.first += offset;
    nodes_[static_cast<std::size_t>(jobs[j].node)] = subtrees[j].front();
    nodes_.insert(nodes_.end(), subtrees[j].begin() + 1, subtrees[j].end());
  }
  corners_.resize(items.size());
  parallel_for(items.size(), [&](std::size_t i) {
    order_[i] = items[i].triangle;
    corners_[i] = surface.corners(order_[i]);
  });

  // Children come after their parent: one backward sweep fills the boxes and dipoles.
  std::vector<double> area(nodes_.size(), 0);
  for (std::size_t n = nodes_.size(); n-- > 0;) {
    Node& node = nodes_[n];
    Vec3 moment = Vec3::Zero();
    if (node.count > 0) {
      for (std::int32_t i = node.first; i < node.first + node.count; ++i) {
        const auto& [a, b, c] = corners_[static_cast<std::size_t>(i)];
        const Vec3 vector_area = 0.5 * (b - a).cross(c - a);
        const double size = vector_area.norm();
        node.box.add(items[static_cast<std::size_t>(i)].box);
        node.dipole += vector_area;
        moment += size * (a + b + c) / 3;
        area[n] += size;
      }
    } else {
      for (const std::size_t child : {static_cast<std::size_t>(node.first), static_cast<std::size_t>(node.first) + 1}) {
        node.box.add(nodes_[child].box);
        node.dipole += nodes_[child].dipole;
        moment += area[child] * nodes_[child].dipole_centre;
        area[n] += area[child];
      }
    }
    node.dipole_centre = area[n] > 0 ? Vec3(moment / area[n]) : node.box.centre();
    node.radius = (node.box.max - node.dipole_centre).cwiseMax(node.dipole_centre - node.box.min).norm();
  }
}

SurfacePoint Locator::closest(const Vec3& p, double bound, TriangleId hint) const {
  SurfacePoint best;
  if (nodes_.empty()) return best;
  double best2 = bound * bound;  // squared; infinity stays infinity
  if (hint.valid() && (members_.empty() || std::binary_search(members_.begin(), members_.end(), hint))) {
    // Tightens the search only: the hint wins if no triangle beats it in (distance, id), and it is met again on the way.
    const auto [a, b, c] = surface_->corners(hint);
    const double d2 = (closest_on_triangle(p, a, b, c) - p).squaredNorm();
    best2 = std::min(best2, d2);
  }
  const auto consider = [&](std::int32_t leaf_first, std::int32_t leaf_count) {
    for (std::int32_t i = leaf_first; i < leaf_first + leaf_count; ++i) {
      const auto& [a, b, c] = corners_[static_cast<std::size_t>(i)];
      const Vec3 q = closest_on_triangle(p, a, b, c);
      const double d2 = (q - p).squaredNorm();
      const TriangleId t = order_[static_cast<std::size_t>(i)];
      if (d2 > best2 || (d2 == best2 && best.triangle.valid() && best.triangle < t)) continue;
      best2 = d2;
      best.position = q;
      best.triangle = t;
    }
  };
  struct Entry {
    std::int32_t node;
    double d2;
  };
  std::array<Entry, kStack> stack;
  int top = 0;
  stack[static_cast<std::size_t>(top++)] = {0, squared_distance(nodes_[0].box, p)};
  while (top > 0) {
    const Entry entry = stack[static_cast<std::size_t>(--top)];
    if (entry.d2 > best2 * kRounding) continue;
    const Node& node = nodes_[static_cast<std::size_t>(entry.node)];
    if (node.count > 0) {
      consider(node.first, node.count);
      continue;
    }
    Entry near = {node.first, squared_distance(nodes_[static_cast<std::size_t>(node.first)].box, p)};
    Entry far = {node.first + 1, squared_distance(nodes_[static_cast<std::size_t>(node.first) + 1].box, p)};
    if (far.d2 < near.d2) std::swap(near, far);
    assert(top + 2 <= kStack && "the tree is deeper than kMaxDepth");
    if (far.d2 <= best2 * kRounding) stack[static_cast<std::size_t>(top++)] = far;
    if (near.d2 <= best2 * kRounding) stack[static_cast<std::size_t>(top++)] = near;
  }
  if (best.triangle.valid()) best.distance = std::sqrt(best2);
  return best;
}

std::optional<Locator::Hit> Locator::first_hit(const Vec3& p, const Vec3& d, double limit) const {
  if (nodes_.empty() || !(d.squaredNorm() > 0)) return std::nullopt;
  const Ray ray(p, d);
  Hit best{limit, TriangleId()};
  std::array<std::int32_t, kStack> stack;
  int top = 0;
  stack[static_cast<std::size_t>(top++)] = 0;
  while (top > 0) {
    const Node& node = nodes_[static_cast<std::size_t>(stack[static_cast<std::size_t>(--top)])];
    if (!ray.meets(node.box, best.s)) continue;
    if (node.count == 0) {
      // The child whose centre comes first is opened first.
      const Vec3 between =
          nodes_[static_cast<std::size_t>(node.first) + 1].box.centre() - nodes_[static_cast<std::size_t>(node.first)].box.centre();
      const bool left_first = between.dot(d) >= 0;
      stack[static_cast<std::size_t>(top++)] = node.first + (left_first ? 1 : 0);
      stack[static_cast<std::size_t>(top++)] = node.first + (left_first ? 0 : 1);
      continue;
    }
    for (std::int32_t i = node.first; i < node.first + node.count; ++i) {
      const auto& [a, b, c] = corners_[static_cast<std::size_t>(i)];
      const double s = ray.meets(a, b, c);
      const TriangleId t = order_[static_cast<std::size_t>(i)];
      if (!(s > 0) || s > best.s || (s == best.s && best.triangle.valid() && best.triangle < t)) continue;
      best = {s, t};
    }
  }
  if (!best.triangle.valid()) return std::nullopt;
  return best;
}

double Locator::winding_number(const Vec3& p) const {
  if (nodes_.empty()) return 0;
  double angle = 0;
  std::array<std::int32_t, kStack> stack;
  int top = 0;
  stack[static_cast<std::size_t>(top++)] = 0;
  while (top > 0) {
    const Node& node = nodes_[static_cast<std::size_t>(stack[static_cast<std::size_t>(--top)])];
    const Vec3 r = node.dipole_centre - p;
    const double r2 = r.squaredNorm();
    if (r2 > kFar * kFar * node.radius * node.radius) {
      angle += r.dot(node.dipole) / (r2 * std::sqrt(r2));
    } else if (node.count == 0) {
      stack[static_cast<std::size_t>(top++)] = node.first + 1;
      stack[static_cast<std::size_t>(top++)] = node.first;
    } else {
      for (std::int32_t i = node.first; i < node.first + node.count; ++i) {
        const auto& [a, b, c] = corners_[static_cast<std::size_t>(i)];
        angle += solid_angle(p, a, b, c);
      }
    }
  }
  return angle / (4 * std::numbers::pi);
}

void Locator::overlapping(const Box& box, std::vector<TriangleId>& out) const {
  if (nodes_.empty()) return;
  const auto begin = static_cast<std::ptrdiff_t>(out.size());
  const auto meet = [&](const Vec3& min, const Vec3& max) {
    return (min.array() <= box.max.array()).all() && (max.array() >= box.min.array()).all();
  };
  std::array<std::int32_t, kStack> stack;
  int top = 0;
  stack[static_cast<std::size_t>(top++)] = 0;
  while (top > 0) {
    const Node& node = nodes_[static_cast<std::size_t>(stack[static_cast<std::size_t>(--top)])];
    if (!meet(node.box.min, node.box.max)) continue;
    if (node.count == 0) {
      stack[static_cast<std::size_t>(top++)] = node.first + 1;
      stack[static_cast<std::size_t>(top++)] = node.first;
      continue;
    }
    for (std::int32_t i = node.first; i < node.first + node.count; ++i) {
      const auto& [a, b, c] = corners_[static_cast<std::size_t>(i)];
      if (meet(a.cwiseMin(b).cwiseMin(c), a.cwiseMax(b).cwiseMax(c))) out.push_back(order_[static_cast<std::size_t>(i)]);
    }
  }
  std::sort(out.begin() + begin, out.end());
}

}  // namespace strata
