#include "core/layers/spread.h"

#include <algorithm>
#include <functional>

#include "core/base/parallel.h"
#include "core/mesh/hex.h"

namespace strata {
namespace {

constexpr int kSweeps = 12;  // of Jacobi, from a start that decays ring by ring
constexpr int kMostIterations = 200;    // of conjugate gradients
constexpr double kSolved = 1e-3;        // of the residual at the start
constexpr double kLeastSquare = 1e-24;  // of edges, in the working frame: columns that are not open yet

}  // namespace

Spread::Spread(const HexMesh& mesh, const VertexStars<HexId>& stars, const IdMap<VertexId, Role>& role, int rings, Burden burden) {
  reach(mesh, stars, role, rings, nullptr);
  if (burden == Burden::BySize) weigh(mesh);
}

Spread::Spread(const HexMesh& mesh, const VertexStars<HexId>& stars, const IdMap<VertexId, Role>& role, int rings, const Among& among) {
  reach(mesh, stars, role, rings, &among);
}

void Spread::reach(const HexMesh& mesh, const VertexStars<HexId>& stars, const IdMap<VertexId, Role>& role, int rings, const Among* among) {
  const auto counts = [&](VertexId v) { return among == nullptr || among->vertices[v] != 0; };
  const auto joined = [&](VertexId a, VertexId b) {
    if (among == nullptr) return true;
    const auto& apart = among->apart;
    return !std::binary_search(apart.begin(), apart.end(), std::pair(a, b)) &&
           !std::binary_search(apart.begin(), apart.end(), std::pair(b, a));
  };
  IdMap<VertexId, std::uint8_t> reached(mesh.position.size(), 0);
  std::vector<VertexId> front;
  for (VertexId v : role.ids())
    if (role[v] == Role::Driven && counts(v)) reached[v] = 1, front.push_back(v);
  for (int ring = 0; ring < rings && !front.empty(); ++ring) {
    std::vector<VertexId> next;
    for (VertexId v : front)
      for (HexId h : stars.of(v))
        for (VertexId w : mesh.hexes[h])
          if (!reached[w] && counts(w)) reached[w] = 1, next.push_back(w);
    std::sort(next.begin(), next.end());
    for (VertexId v : next)
      if (role[v] == Role::Carried) carried_.push_back(v);
    ring_end_.push_back(carried_.size());
    front = std::move(next);
  }
  std::vector<std::vector<VertexId>> beside(carried_.size());
  parallel_for(carried_.size(), [&](std::size_t i) {
    const VertexId v = carried_[i];
    for (HexId h : stars.of(v)) {
      const HexVertices& hex = mesh.hexes[h];
      const auto corner = static_cast<std::size_t>(std::find(hex.begin(), hex.end(), v) - hex.begin());
      for (const std::int8_t n : kHexCorners[corner])
        if (const VertexId w = hex[static_cast<std::size_t>(n)]; counts(w) && joined(v, w)) beside[i].push_back(w);
    }
    std::sort(beside[i].begin(), beside[i].end());
    beside[i].erase(std::unique(beside[i].begin(), beside[i].end()), beside[i].end());
  });
  first_.push_back(0);
  for (const std::vector<VertexId>& b : beside) {
    neighbours_.insert(neighbours_.end(), b.begin(), b.end());
    first_.push_back(static_cast<std::int32_t>(neighbours_.size()));
  }
}

void Spread::fill(IdMap<VertexId, Vec3>& move) const {
  const auto rings = static_cast<double>(ring_end_.size());
  for (VertexId v : carried_) move[v] = Vec3::Zero();
  const auto mean = [&](std::size_t i) {
    Vec3 sum = Vec3::Zero();
    for (auto k = static_cast<std::size_t>(first_[i]); k < static_cast<std::size_t>(first_[i + 1]); ++k) sum += move[neighbours_[k]];
    return Vec3(sum / std::max(first_[i + 1] - first_[i], 1));
  };
  std::vector<Vec3> fresh(carried_.size());
  const auto update = [&](std::size_t begin, std::size_t end, const auto& value) {
    parallel_for(end - begin, [&](std::size_t i) { fresh[begin + i] = value(begin + i); });
    parallel_for(end - begin, [&](std::size_t i) { move[carried_[begin + i]] = fresh[begin + i]; });
  };
  // Start: each ring takes its share of the longest move under it.
  std::size_t begin = 0;
  for (std::size_t ring = 0; ring < ring_end_.size(); ++ring) {
    const double left = (rings - static_cast<double>(ring)) / (rings + 1 - static_cast<double>(ring));
    update(begin, ring_end_[ring], [&](std::size_t i) {
      Vec3 sum = Vec3::Zero();
      int count = 0;
      for (auto k = static_cast<std::size_t>(first_[i]); k < static_cast<std::size_t>(first_[i + 1]); ++k)
        if (const Vec3& m = move[neighbours_[k]]; m.squaredNorm() > 0) sum += m, ++count;
      return Vec3(sum * (left / std::max(count, 1)));
    });
    begin = ring_end_[ring];
  }
  if (!weight_.empty()) return solve(move);
  for (int sweep = 0; sweep < kSweeps; ++sweep) update(0, carried_.size(), mean);
}

// Springs along edges, with the stiffness of rods whose section does not grow with their length.
void Spread::weigh(const HexMesh& mesh) {
  slot_.assign(mesh.position.size(), -1);
  for (std::size_t i = 0; i < carried_.size(); ++i) slot_[carried_[i]] = static_cast<std::int32_t>(i);
  weight_.resize(neighbours_.size());
  parallel_for(carried_.size(), [&](std::size_t i) {
    for (auto k = static_cast<std::size_t>(first_[i]); k < static_cast<std::size_t>(first_[i + 1]); ++k) {
      const double length = (mesh.position[neighbours_[k]] - mesh.position[carried_[i]]).norm();
      weight_[k] = 1 / std::max(length * length, kLeastSquare);
    }
  });
}

// Conjugate gradients, scaled by the diagonal, from the moves that are there.
void Spread::solve(IdMap<VertexId, Vec3>& move) const {
  const std::size_t n = carried_.size();
  std::vector<Vec3> residual(n), direction(n), image(n);
  std::vector<double> diagonal(n);
  const auto spokes = [&](std::size_t i, const auto& body) {
    for (auto k = static_cast<std::size_t>(first_[i]); k < static_cast<std::size_t>(first_[i + 1]); ++k) body(k);
  };
  const auto dot = [&](const std::vector<Vec3>& a, const std::vector<Vec3>& b, bool scaled) {
    return parallel_reduce(n, 0.0, [&](std::size_t i) { return a[i].dot(b[i]) / (scaled ? diagonal[i] : 1); }, std::plus<>());
  };
  parallel_for(n, [&](std::size_t i) {
    residual[i] = Vec3::Zero();
    diagonal[i] = 0;
    spokes(i, [&](std::size_t k) {
      residual[i] += weight_[k] * (move[neighbours_[k]] - move[carried_[i]]);
      diagonal[i] += weight_[k];
    });
    diagonal[i] = std::max(diagonal[i], kLeastSquare);
    direction[i] = residual[i] / diagonal[i];
  });
  double rho = dot(residual, residual, true);
  const double enough = rho * kSolved * kSolved;
  for (int iteration = 0; iteration < kMostIterations && rho > enough && rho > 0; ++iteration) {
    parallel_for(n, [&](std::size_t i) {
      image[i] = Vec3::Zero();
      spokes(i, [&](std::size_t k) {
        const std::int32_t j = slot_[neighbours_[k]];
        image[i] += weight_[k] * (direction[i] - (j < 0 ? Vec3(Vec3::Zero()) : direction[static_cast<std::size_t>(j)]));
      });
    });
    const double alpha = rho / dot(direction, image, false);
    parallel_for(n, [&](std::size_t i) {
      move[carried_[i]] += alpha * direction[i];
      residual[i] -= alpha * image[i];
    });
    const double next = dot(residual, residual, true), beta = next / rho;
    parallel_for(n, [&](std::size_t i) { direction[i] = residual[i] / diagonal[i] + beta * direction[i]; });
    rho = next;
  }
}

}  // namespace strata
