#include "core/optimise/workspace.h"

#include <algorithm>
#include <atomic>
#include <utility>

#include "core/base/parallel.h"

namespace strata {

Neighbours::Neighbours(const HexMesh& mesh) : star(hexes_round_vertices(mesh)), local(star.elements.size()) {
  parallel_for(mesh.position.size(), [&](std::size_t i) {
    const VertexId v(i);
    for (std::int64_t s = star.offset[i]; s < star.offset[i + 1]; ++s) {
      const HexVertices& hex = mesh.hexes[star.elements[static_cast<std::size_t>(s)]];
      std::uint8_t l = 0;
      while (hex[l] != v) ++l;
      local[static_cast<std::size_t>(s)] = l;
    }
  });
}

Workspace::Workspace(HexMesh& mesh, const OptimiseRequest& request, int rings, bool project)
    : mesh_(mesh),
      request_(request),
      own_neighbours_(request.neighbours == nullptr ? std::optional<Neighbours>(mesh) : std::nullopt),
      neighbours_(own_neighbours_ ? *own_neighbours_ : *request.neighbours),
      star_(neighbours_.star),
      grains_(neighbours_.grains.order.empty() ? own_grains_ : neighbours_.grains) {
  const auto is_open = [&](const QuadVertices& q) {
    return std::any_of(q.begin(), q.end(), [&](VertexId v) { return mesh.attachment[v].hold == Hold::Free; });
  };
  if (request.open_skin == OpenSkin::Slides && std::any_of(mesh.quads.begin(), mesh.quads.end(), is_open))
    skin_ = quads_round_vertices(mesh);
  choose(rings, project);
  if (&grains_ == &own_grains_) own_grains_ = make_grains(mesh_, movable_);
  active_ = movable_;
  scale_targets();
  recount_bad();
  stand();
}

void Workspace::reach_out(std::vector<VertexId> front, int rings, IdMap<VertexId, std::uint8_t>& reached) const {
  std::vector<VertexId> next;
  for (int ring = 0; ring < rings; ++ring) {
    next.clear();
    for (const VertexId v : front)
      for (const HexId h : star_.of(v))
        for (const VertexId n : mesh_.hexes[h])
          if (reached[n] == 0) {
            reached[n] = 1;
            next.push_back(n);
          }
    front.swap(next);
  }
}

void Workspace::choose(int rings, bool project) {
  const std::size_t count = mesh_.position.size();
  IdMap<VertexId, std::uint8_t> near;
  const bool everywhere = request_.seeds == nullptr || rings < 0;
  if (!everywhere) {
    near = *request_.seeds;
    std::vector<VertexId> front;
    for (const VertexId v : near.ids())
      if (near[v] != 0) front.push_back(v);
    reach_out(std::move(front), rings, near);
  }
  movable_.assign(count, 0);
  parallel_for(count, [&](std::size_t i) {
    const VertexId v(i);
    if ((!everywhere && near[v] == 0) || star_.of(v).empty() || star_.of(v).size() > Star::kMaxHexes) return;
    if (request_.movable != nullptr && (*request_.movable)[v] == 0) return;
    const Hold hold = mesh_.attachment[v].hold;
    const bool may = hold == Hold::Free || (hold != Hold::Fixed && request_.ground != nullptr && (hold != Hold::Corner || project));
    movable_[v] = may ? 1 : 0;
  });
  takes_part_.assign(mesh_.hexes.size(), 0);
  parallel_for(mesh_.hexes.size(), [&](std::size_t i) {
    for (const VertexId v : mesh_.hexes[HexId(i)])
      if (movable_[v] != 0) takes_part_[HexId(i)] = 1;
  });
}

// The longest of the three mean axis lengths, measured in targets, becomes 1: determinants are then comparable across sizes, and hexes
// without thickness have a scale too.
void Workspace::scale_targets() {
  inverse_target_.resize(mesh_.hexes.size());
  parallel_for(mesh_.hexes.size(), [&](std::size_t i) {
    const HexId h(i);
    if (takes_part_[h] == 0) return;
    std::array<double, 3> target{1, 1, 1};
    if (request_.targets != nullptr)
      for (std::size_t k = 0; k < 3; ++k) target[k] = static_cast<double>((*request_.targets)[h][k]);
    double scale = 0;
    for (std::size_t axis = 0; axis < 3; ++axis) {
      double sum = 0;
      for (std::size_t e = 4 * axis; e < 4 * axis + 4; ++e) {
        const auto& edge = kHexEdges[e];
        sum += (mesh_.position[mesh_.hexes[h][static_cast<std::size_t>(edge[0])]] -
                mesh_.position[mesh_.hexes[h][static_cast<std::size_t>(edge[1])]])
                   .norm();
      }
      scale = std::max(scale, sum / 4 / target[axis]);
    }
    if (!(scale > 0)) scale = 1;  // a hex shrunk to a point: any scale will do
    for (std::size_t k = 0; k < 3; ++k) inverse_target_[h][k] = static_cast<float>(1 / (target[k] * scale));
  });
}

void Workspace::recount_bad() {
  bad_.assign(mesh_.hexes.size(), 0);
  parallel_for(mesh_.hexes.size(), [&](std::size_t i) {
    const HexId h(i);
    if (takes_part_[h] == 0) return;
    const HexVertices& hex = mesh_.hexes[h];
    const auto& w = inverse_target_[h];
    const double W = static_cast<double>(w[0]) * static_cast<double>(w[1]) * static_cast<double>(w[2]);
    for (std::size_t c = 0; c < 8; ++c) {
      const Vec3& p = mesh_.position[hex[c]];
      const auto edge = [&](std::size_t k) -> Vec3 { return mesh_.position[hex[static_cast<std::size_t>(kHexCorners[c][k])]] - p; };
      if (!(W * edge(0).cross(edge(1)).dot(edge(2)) > Star::kFlat)) bad_[h] = static_cast<std::uint8_t>(bad_[h] | (1u << c));
    }
  });
}

void Workspace::restore(Snapshot snapshot) {
  mesh_.position = std::move(snapshot.position);
  bad_ = std::move(snapshot.bad);
  feet_ = std::move(snapshot.feet);
}

void Workspace::stand() {
  foot_of_.assign(mesh_.position.size(), -1);
  std::vector<VertexId> held;
  for (const VertexId v : mesh_.position.ids())
    if (movable_[v] != 0 && mesh_.attachment[v].hold != Hold::Free) {
      foot_of_[v] = static_cast<std::int32_t>(held.size());
      held.push_back(v);
    }
  feet_.resize(held.size());
  parallel_for(held.size(), [&](std::size_t i) {
    const Vec3& p = mesh_.position[held[i]];
    const Foothold at = request_.ground->project(mesh_.attachment[held[i]], p);
    feet_[i] = {at.direction, at.hint, (at.position - p).norm() <= kOnGround};
  });
}

void Workspace::gather(VertexId v, Star& star) const {
  star.clear();
  std::array<const Vec3*, 7> p;
  p[0] = &mesh_.position[v];
  for (std::int64_t s = star_.offset[v.index()]; s < star_.offset[v.index() + 1]; ++s) {
    const HexId h = star_.elements[static_cast<std::size_t>(s)];
    const StarPattern& pattern = kStarPatterns[neighbours_.local[static_cast<std::size_t>(s)]];
    const HexVertices& hex = mesh_.hexes[h];
    for (std::size_t k = 0; k < 6; ++k) p[k + 1] = &mesh_.position[hex[static_cast<std::size_t>(pattern.vertex[k])]];
    const auto& w = inverse_target_[h];
    const auto along = [&](std::size_t k) { return static_cast<double>(w[static_cast<std::size_t>(pattern.axis[k])]); };
    star.add_hex(p, {along(0), along(1), along(2)}, strict_ && bad_[h] == 0);
  }
  star.complete();
}

// A move across the vector area of the quads round the vertex changes no volume.
Freedom Workspace::freedom_of_free(VertexId v) const {
  if (skin_.offset.empty() || skin_.of(v).empty()) return {};
  Vec3 area = Vec3::Zero();
  for (const QuadId q : skin_.of(v)) {
    const QuadVertices& c = mesh_.quads[q];
    area += (mesh_.position[c[2]] - mesh_.position[c[0]]).cross(mesh_.position[c[3]] - mesh_.position[c[1]]);
  }
  return freedom_of(Hold::Chart, area.normalized());
}

void Workspace::move(VertexId v, const Star& star, const Vec3& d) {
  mesh_.position[v] += d;
  if (star.all_sound()) return;  // and stays so
  int hex = 0;
  for (std::int64_t s = star_.offset[v.index()]; s < star_.offset[v.index() + 1]; ++s, ++hex) {
    const HexId h = star_.elements[static_cast<std::size_t>(s)];
    const std::uint8_t own = neighbours_.local[static_cast<std::size_t>(s)];
    const StarPattern& pattern = kStarPatterns[own];
    for (int k = 0; k < 4; ++k) {
      const auto corner = k == 0 ? own : static_cast<std::uint8_t>(pattern.vertex[static_cast<std::size_t>(k - 1)]);
      const auto bit = static_cast<std::uint8_t>(1u << corner);
      if (star.determinant(hex, k, d) > Star::kFlat) bad_[h] = static_cast<std::uint8_t>(bad_[h] & ~bit);
      else bad_[h] = static_cast<std::uint8_t>(bad_[h] | bit);
    }
  }
}

// Vertices of other grains that run now are not neighbours; two of them may wake a third at once, to the same value.
void Workspace::wake_round(VertexId v) {
  for (const HexId h : star_.of(v))
    for (const VertexId n : mesh_.hexes[h])
      if (movable_[n] != 0 && (everybody_ || near_[n] != 0)) std::atomic_ref<std::uint8_t>(active_[n]).store(1, std::memory_order_relaxed);
}

void Workspace::wake_all() {
  everybody_ = true;
  active_ = movable_;
}

void Workspace::wake_only_near(const std::vector<HexId>& hexes, int rings) {
  everybody_ = false;
  near_.assign(mesh_.position.size(), 0);
  std::vector<VertexId> front;
  for (const HexId h : hexes)
    for (const VertexId v : mesh_.hexes[h])
      if (near_[v] == 0) {
        near_[v] = 1;
        front.push_back(v);
      }
  reach_out(std::move(front), rings, near_);
  parallel_for(near_.size(),
               [&](std::size_t i) { active_[VertexId(i)] = static_cast<std::uint8_t>(near_[VertexId(i)] & movable_[VertexId(i)]); });
}

void Workspace::wake_only_near_bad(int rings) {
  std::vector<HexId> hexes;
  for (const HexId h : bad_.ids())
    if (bad_[h] != 0) hexes.push_back(h);
  wake_only_near(hexes, rings);
}

void Workspace::wake_only_near_off_ground(int rings) {
  std::vector<HexId> hexes;
  for (const VertexId v : foot_of_.ids())
    if (foot_of_[v] >= 0 && !feet_[static_cast<std::size_t>(foot_of_[v])].on_ground)
      for (const HexId h : star_.of(v)) hexes.push_back(h);
  wake_only_near(hexes, rings - 1);
}

void Workspace::put_on_ground() {
  parallel_for(foot_of_.size(), [&](std::size_t i) {
    const VertexId v(i);
    if (foot_of_[v] < 0 || feet_[static_cast<std::size_t>(foot_of_[v])].on_ground) return;
    Foot& foot = feet_[static_cast<std::size_t>(foot_of_[v])];
    const Foothold at = request_.ground->project(mesh_.attachment[v], mesh_.position[v], foot.hint);
    mesh_.position[v] = at.position;
    foot = {at.direction, at.hint, true};
  });
  scale_targets();
  recount_bad();
}

std::int64_t Workspace::inverted() const {
  return parallel_reduce(bad_.size(), std::int64_t{0}, [&](std::size_t i) { return std::int64_t{bad_[HexId(i)] != 0}; }, std::plus<>());
}

std::int64_t Workspace::off_ground() const {
  return std::count_if(feet_.begin(), feet_.end(), [](const Foot& f) { return !f.on_ground; });
}

}  // namespace strata
