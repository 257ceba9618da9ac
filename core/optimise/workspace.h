// What the sweeps work on: the mesh, who may move in which order, which hexes are bad, where held vertices stand. Private to the room.
#pragma once

#include <cstdint>
#include <optional>
#include <vector>

#include "core/mesh/adjacency.h"
#include "core/mesh/hex_mesh.h"
#include "core/optimise/freedom.h"
#include "core/optimise/grains.h"
#include "core/optimise/optimise.h"
#include "core/optimise/star.h"

namespace strata {

class Context;

// Of a held vertex.
struct Foot {
  Vec3 direction = Vec3::Zero();  // chart: normal; curve: tangent
  std::int32_t hint = -1;
  bool on_ground = true;
};

inline constexpr double kOnGround = 1e-9;  // working frame: well above rounding, far below any edge

class Workspace {
 public:
  Workspace(HexMesh& mesh, const OptimiseRequest& request, int rings, bool project);

  // body(vertex, star) for every active vertex, colour after colour of grains. True from the body: the vertex moved, its neighbours wake up.
  // A vertex that did not move falls asleep. Returns how many moved.
  template <class Body>
  std::int64_t sweep(const Body& body, const Context& context);
  // Everybody awake again.
  void wake_all();
  // Only vertices within so many rings of what is named take part in the next sweep; moves wake no others.
  void wake_only_near(const std::vector<HexId>& hexes, int rings);
  void wake_only_near_bad(int rings);
  void wake_only_near_off_ground(int rings);
  // Held vertices that may move and are off their ground go there, whatever becomes of their hexes.
  void put_on_ground();

  void gather(VertexId v, Star& star) const;
  // Moves v by d, keeps the record of bad corners.
  void move(VertexId v, const Star& star, const Vec3& d);
  void recount_bad();
  // Not strict: hexes that are sound need not stay so, until strict again.
  void keep_sound(bool strict) { strict_ = strict; }
  // Where everything stands, to come back to.
  struct Snapshot {
    IdMap<VertexId, Vec3> position;
    IdMap<HexId, std::uint8_t> bad;
    std::vector<Foot> feet;
  };
  [[nodiscard]] Snapshot snapshot() const { return {mesh_.position, bad_, feet_}; }
  void restore(Snapshot snapshot);

  [[nodiscard]] std::int64_t inverted() const;  // hexes with a corner determinant not above Star::kFlat
  [[nodiscard]] std::int64_t off_ground() const;  // held vertices that may move but are not on their ground yet
  [[nodiscard]] const Ground* ground() const { return request_.ground; }
  [[nodiscard]] Attachment attachment(VertexId v) const { return mesh_.attachment[v]; }
  [[nodiscard]] const Vec3& position(VertexId v) const { return mesh_.position[v]; }
  [[nodiscard]] Foot& foot(VertexId v) { return feet_[static_cast<std::size_t>(foot_of_[v])]; }
  [[nodiscard]] const HexMesh& mesh() const { return mesh_; }
  // Where a vertex may go that nothing holds: anywhere, or along an open skin that slides.
  [[nodiscard]] Freedom freedom_of_free(VertexId v) const;

 private:
  void choose(int rings, bool project);
  void scale_targets();
  void stand();
  void wake_round(VertexId v);
  // Adds to `reached` all that lies within so many rings of those in `front`.
  void reach_out(std::vector<VertexId> front, int rings, IdMap<VertexId, std::uint8_t>& reached) const;

  bool strict_ = true;
  HexMesh& mesh_;
  const OptimiseRequest& request_;
  std::optional<Neighbours> own_neighbours_;
  const Neighbours& neighbours_;
  const VertexStars<HexId>& star_;
  Grains own_grains_;
  const Grains& grains_;
  VertexStars<QuadId> skin_;  // empty unless there is an open skin that slides
  IdMap<HexId, std::array<float, 3>> inverse_target_;  // scaled so that determinants of good hexes are about 1
  IdMap<HexId, std::uint8_t> bad_;  // bit per corner
  IdMap<VertexId, std::uint8_t> movable_, active_;
  bool everybody_ = true;  // false: only those with near_ set may be woken
  IdMap<VertexId, std::uint8_t> near_;
  IdMap<HexId, std::uint8_t> takes_part_;  // hexes with a vertex that may move: the others are not looked at
  IdMap<VertexId, std::int32_t> foot_of_;
  std::vector<Foot> feet_;
};

}  // namespace strata

#include "core/optimise/workspace_sweep.h"
