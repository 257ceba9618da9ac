// The hexes with their centres in a slab are a sheet without pinches when the slab is as thick as a hex is along its normal n, that is
// h (|nx| + |ny| + |nz|): no vertex is then on both sides of it (Andres, Acharya, Sibata 1997: standard discrete planes). So where walls are
// nearer to each other, the slab is widened to this, on both sides alike.
#include "core/carve/thin_places.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <deque>
#include <numeric>
#include <optional>
#include <vector>

#include "core/base/parallel.h"
#include "core/mesh/adjacency.h"

namespace strata {
namespace {

constexpr double kSheet = 1.05;  // times the least thickness of a sheet: what walls lack in evenness
constexpr double kFacing = 0.5;  // cosine between a wall's normal and the way across: walls that meet at 60 degrees or less
constexpr double kUpright = 0.9;  // cosine between a wall's normal and the way to a centre beyond it: beyond rims and tips nothing is kept
// In cells:
constexpr double kFarthest = 0.9;  // centre beyond a wall: half a sheet along the diagonal
constexpr double kTip = 0.5;  // from the edge where walls would meet: nearer to it there is no place for a hex
constexpr double kThinnest = 0.05;
constexpr double kAcross = 2.0;  // walls farther apart have room
constexpr double kClear = 2.0;  // beyond a wall that hexes reach over: else they would meet those of the next
constexpr double kFill = 0.6;  // centre beyond a wall of hexes that make a sheet whole
constexpr double kUneven = 0.15;  // of a wall, from the plane through one of its points
constexpr double kHair = 1e-3;  // off a wall, not to hit it again

// The middle of the place that a hex is to stand for.
using Middle = std::optional<Vec3>;

// A hex near the surface that is not kept yet.
struct Candidate {
  HexId hex;
  std::array<Middle, 2> middle;  // of the thin place that its centre lies in, or lies beyond; once kept: of its region's, then none
  bool kept = false;
};

class Keeper {
 public:
  Keeper(const ThinPlaces& places, HexChoice& choice) : at_(places), choice_(choice) {
    const HexMesh& mesh = places.dual.mesh;
    const auto is_cut = [&](VertexId v) { return places.dual.cut[v] != 0; };
    for (HexId h : mesh.hexes.ids())
      if (choice.label[h] < 0 && std::any_of(mesh.hexes[h].begin(), mesh.hexes[h].end(), is_cut)) candidates_.push_back({h, {}});
  }

  void run() {
    parallel_for(candidates_.size(), [&](std::size_t i) { look_at(candidates_[i]); }, 64);
    const auto is_none = [](const Candidate& c) { return !c.middle[0] && !c.middle[1]; };
    candidates_.erase(std::remove_if(candidates_.begin(), candidates_.end(), is_none), candidates_.end());
    if (candidates_.empty()) return;
    follow_neighbours();
    mark_surroundings();
  }

 private:
  [[nodiscard]] const HexVertices& hex(HexId h) const { return at_.dual.mesh.hexes[h]; }
  [[nodiscard]] Vec3 centre(HexId h) const {
    Vec3 sum = Vec3::Zero();
    for (VertexId v : hex(h)) sum += at_.dual.mesh.position[v];
    return sum / 8;
  }
  [[nodiscard]] double cell_size(HexId h) const {
    double sum = 0;
    for (VertexId v : hex(h)) sum += static_cast<double>(at_.dual.cell_size[v]);
    return sum / 8;
  }
  [[nodiscard]] static double sheet(const Vec3& normal, double size) { return kSheet * size * normal.lpNorm<1>(); }

  // How far it is across from a wall's place to the next wall that faces it; nothing when there is none near, or a tip. The way across starts
  // at `start`, `before` of it lie behind.
  [[nodiscard]] std::optional<double> across(const Vec3& start, double before, const Vec3& way, double size) const {
    const auto hit = at_.locator.first_hit(start, way, kAcross * size);
    if (!hit) return {};
    const double thickness = before + hit->s, facing = std::abs(at_.surface.normal[hit->triangle].dot(way));
    if (facing < kFacing) return {};
    const double slope = std::sqrt(std::max(1 - facing * facing, 0.0)) / facing;
    if (thickness < std::max(kThinnest, kTip * slope) * size) return {};
    return thickness;
  }

  // The centre lies in a thin place.
  [[nodiscard]] Middle middle_inside(const Vec3& c, double size) const {
    const SurfacePoint wall = at_.walls.closest(c, size);
    if (!wall.triangle.valid() || !(wall.distance > kHair * size)) return {};
    const Vec3 way = (c - wall.position) / wall.distance;
    const auto thickness = across(c, wall.distance, way, size);
    if (!thickness || wall.distance < 0.5 * (*thickness - sheet(way, size))) return {};
    return c;
  }
  // The centre lies beyond a wall of a thin place: the nearest wall or, where others meet it, one that an axis leads to.
  [[nodiscard]] Middle middle_beyond(const Vec3& c, double size) const {
    const SurfacePoint nearest = at_.walls.closest(c, kFarthest * size);
    if (!nearest.triangle.valid()) return {};
    if (const Middle m = middle_behind(nearest, c, size)) return m;
    for (int axis = 0; axis < 3; ++axis)
      for (const double sign : {1.0, -1.0}) {
        const auto hit = at_.walls.first_hit(c, sign * Vec3::Unit(axis), 2 * kFarthest * size);
        if (!hit || hit->triangle == nearest.triangle) continue;
        const Vec3& normal = at_.surface.normal[hit->triangle];
        const Vec3 foot = c + hit->s * sign * normal[axis] * normal;
        const SurfacePoint wall = at_.walls.closest(foot, kUneven * size);
        if (!wall.triangle.valid()) continue;
        if (const Middle m = middle_behind(wall, c, size)) return m;
      }
    return {};
  }
  [[nodiscard]] Middle middle_behind(const SurfacePoint& wall, const Vec3& c, double size) const {
    const Vec3& normal = at_.surface.normal[wall.triangle];
    const double distance = (wall.position - c).norm();
    const bool on_wall = !(distance > kHair * size);
    const Vec3 way = on_wall ? Vec3(-normal) : Vec3((wall.position - c) / distance);
    if (std::abs(normal.dot(way)) < kUpright) return {};
    const auto thickness = across(wall.position + kHair * size * way, kHair * size, way, size);
    if (!thickness || distance > 0.5 * (sheet(way, size) - *thickness)) return {};
    if (at_.locator.first_hit(wall.position - kHair * size * way, -way, kClear * size)) return {};
    return wall.position + 0.5 * *thickness * way;
  }

  [[nodiscard]] std::int32_t region_seen(HexId h, const Vec3& from) const {
    for (VertexId v : hex(h))
      if (at_.colours.colour[v] >= 0 && sees(at_.locator, from, at_.dual.mesh.position[v])) return at_.colours.colour[v];
    return kVoid;
  }
  void keep(Candidate& c, std::int32_t region, const Middle& middle) {
    choice_.label[c.hex] = choice_.fillable[c.hex] = region;
    c.middle = {middle, {}};
    c.kept = true;
  }

  void look_at(Candidate& candidate) {
    const HexId h = candidate.hex;
    const Vec3 c = centre(h);
    const double size = cell_size(h);
    if (const std::int32_t region = choice_.fillable[h]; region >= 0) {
      if (const Middle m = middle_inside(c, size)) keep(candidate, region, m);
      return;
    }
    candidate.middle = {middle_inside(c, size), middle_beyond(c, size)};
    for (const Middle& m : candidate.middle)
      if (const std::int32_t region = m ? region_seen(h, *m) : kVoid; region >= 0) return keep(candidate, region, Middle(m));
  }

  // Candidates none of whose nodes lies in the region learn of it from neighbours. Where the cells are too coarse for nodes on either side to
  // see one another, hexes do: what they join is one region.
  void follow_neighbours() {
    const Surroundings round = surroundings();
    std::deque<std::size_t> queue;
    for (std::size_t i = 0; i < candidates_.size(); ++i)
      if (!candidates_[i].kept) queue.push_back(i);
    while (!queue.empty()) {
      Candidate& c = candidates_[queue.front()];
      queue.pop_front();
      if (c.kept || !learn(c, round)) continue;
      for (const HexId n : round.neighbours(c.hex))
        if (n.valid() && round.candidate[n] >= 0) queue.push_back(static_cast<std::size_t>(round.candidate[n]));
    }
    if (at_.colours.regions > 1) unite_regions(round);
  }
  // The hexes that touch candidates, and what lies across their faces.
  struct Surroundings {
    IdMap<HexId, std::int32_t> candidate;  // by hex of the whole mesh, or -1
    IdMap<HexId, HexId> in_part;
    std::vector<HexId> whole;
    FaceNeighbours across;
    [[nodiscard]] std::array<HexId, 6> neighbours(HexId h) const {
      std::array<HexId, 6> result;
      for (std::size_t f = 0; f < 6; ++f)
        if (const HexId n = across[in_part[h]][f].hex; n.valid()) result[f] = whole[n.index()];
      return result;
    }
  };
  [[nodiscard]] Surroundings surroundings() const {
    const HexMesh& mesh = at_.dual.mesh;
    Surroundings round{IdMap<HexId, std::int32_t>(mesh.hexes.size(), -1), IdMap<HexId, HexId>(mesh.hexes.size()), {}, {}};
    IdMap<VertexId, std::uint8_t> near(mesh.position.size(), std::uint8_t{0});
    for (std::size_t i = 0; i < candidates_.size(); ++i) {
      round.candidate[candidates_[i].hex] = static_cast<std::int32_t>(i);
      for (VertexId v : hex(candidates_[i].hex)) near[v] = 1;
    }
    HexMesh part;
    part.position.resize(mesh.position.size());
    for (HexId h : mesh.hexes.ids())
      if (std::any_of(hex(h).begin(), hex(h).end(), [&](VertexId v) { return near[v] != 0; })) {
        round.in_part[h] = part.hexes.push_back(hex(h));
        round.whole.push_back(h);
      }
    round.across = face_neighbours(part);
    return round;
  }
  // The region at a hex's middle, as far as it is known.
  [[nodiscard]] std::int32_t region_at(HexId h) const { return std::max(choice_.label[h], choice_.fillable[h]); }
  [[nodiscard]] Vec3 middle_of(HexId h, const Surroundings& round) const {
    const std::int32_t i = round.candidate[h];
    const Candidate* c = i >= 0 ? &candidates_[static_cast<std::size_t>(i)] : nullptr;
    return c != nullptr && c->kept ? *c->middle[0] : centre(h);
  }
  [[nodiscard]] bool learn(Candidate& c, const Surroundings& round) {
    for (const Middle& m : c.middle)
      for (const HexId n : round.neighbours(c.hex))
        if (m && n.valid() && region_at(n) >= 0 && sees(at_.locator, *m, middle_of(n, round))) {
          keep(c, region_at(n), Middle(m));
          return true;
        }
    return false;
  }

  void unite_regions(const Surroundings& round) {
    std::vector<std::int32_t> parent(static_cast<std::size_t>(at_.colours.regions));
    std::iota(parent.begin(), parent.end(), 0);
    const auto root = [&](std::int32_t r) {
      while (parent[static_cast<std::size_t>(r)] != r) r = parent[static_cast<std::size_t>(r)];
      return r;
    };
    const auto meet = [&](std::int32_t a, std::int32_t b, const Vec3& from, const Vec3& to) {
      if (b < 0 || root(a) == root(b) || !sees(at_.locator, from, to)) return;
      parent[static_cast<std::size_t>(std::max(root(a), root(b)))] = std::min(root(a), root(b));
    };
    for (const Candidate& c : candidates_) {
      if (!c.kept) continue;
      for (VertexId v : hex(c.hex)) meet(region_at(c.hex), at_.colours.colour[v], *c.middle[0], at_.dual.mesh.position[v]);
      for (const HexId n : round.neighbours(c.hex))
        if (n.valid()) meet(region_at(c.hex), region_at(n), *c.middle[0], middle_of(n, round));
    }
    for (auto* regions : {&choice_.label, &choice_.fillable})
      for (std::int32_t& r : *regions)
        if (r >= 0) r = root(r);
  }

  // Hexes round thin places may be added to make the sheet whole, also beyond walls where they have not far to go.
  void mark_surroundings() {
    const HexMesh& mesh = at_.dual.mesh;
    IdMap<VertexId, std::int32_t> region(mesh.position.size(), kVoid);
    for (const Candidate& c : candidates_)
      if (c.kept)
        for (VertexId v : hex(c.hex)) region[v] = std::max(region[v], choice_.label[c.hex]);
    parallel_for(
        mesh.hexes.size(),
        [&](std::size_t i) {
          const HexId h(i);
          std::int32_t beside = kVoid;
          for (VertexId v : hex(h)) beside = std::max(beside, region[v]);
          if (beside < 0) return;
          choice_.thin[h] = 1;
          const double size = cell_size(h);
          if (choice_.fillable[h] < 0 && at_.walls.closest(centre(h), kFill * size).triangle.valid()) choice_.fillable[h] = beside;
        },
        256);
  }

  const ThinPlaces& at_;
  HexChoice& choice_;
  std::vector<Candidate> candidates_;
};

}  // namespace

void keep_thin_places(const ThinPlaces& places, HexChoice& choice) {
  choice.thin.assign(places.dual.mesh.hexes.size(), 0);
  Keeper(places, choice).run();
}

}  // namespace strata
