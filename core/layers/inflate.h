// Making room: the tops of columns leave the wall and push the volume before them, never through a hex.
#pragma once

#include <array>
#include <limits>
#include <vector>

#include "core/layers/growing_sheet.h"
#include "core/layers/guard.h"
#include "core/layers/spread.h"
#include "core/mesh/adjacency.h"
#include "core/mesh/hex_mesh.h"
#include "core/optimise/ground.h"
#include "core/optimise/optimise.h"

namespace strata {

class Context;

enum class Reach { Needed, Full };   // what a column goes for: its physical layers, or blending too
enum class Settle {
  Around,   // the volume round the columns finds its place
  Along,    // the ends of columns too, on their ground: they heal poor walls, and leave their exact places for now
};

inline constexpr float kAhead = 0.2F;

// Moves the tops of open sheets towards their thickness. Made once for a mesh's connections.
class Inflation {
 public:
  // Vertices within `rings` rings of a top give way; `burden`: which of them how much.
  Inflation(const HexMesh& mesh, const std::vector<GrowingSheet>& sheets, const Ground& ground, int rings, Burden burden = Burden::Alike);
  Inflation(const Inflation&) = delete;
  Inflation& operator=(const Inflation&) = delete;

  // The way that nearly all tops have to go at most, over the local size.
  [[nodiscard]] double typical_way(const HexMesh& mesh, const std::vector<GrowingSheet>& sheets, Reach reach) const;

  // One step over `share` of the way. Hexes stay positive, and none that was better falls below `floor`: where it would, tops and what they
  // carry hold back. Then the volume settles, the ends of columns held.
  struct Step {
    Reach reach = Reach::Full;
    double share = 1;
    double floor = 0;
    int sweeps = 0;
    Settle settle = Settle::Around;
    double stride = std::numeric_limits<double>::infinity();  // most that a top goes, over the local size
    float ahead = kAhead;  // of the step, that a vertex may go further than one in the same hex
    bool late_only = false;  // settles only round tops that are not where they should be
  };
  struct Advanced {
    HexMesh mesh;
    double left = 0;  // what the tops held back by were short of the step's end, over their thickness, all together
  };
  [[nodiscard]] Advanced advance(HexMesh mesh, const std::vector<GrowingSheet>& sheets, const Step& step, Context& context) const;

 private:
  struct Goal {
    VertexId top;
    int sheets = 0;
    std::array<VertexId, 2> bottom;  // in the first two sheets it is a top of
    std::array<std::int32_t, 2> sheet{}, column{};
    VertexId common;  // below both
  };
  [[nodiscard]] IdMap<VertexId, Vec3> targets(const HexMesh& mesh, const std::vector<GrowingSheet>& sheets, Reach reach) const;
  [[nodiscard]] static double size_at(const Goal& goal, const std::vector<GrowingSheet>& sheets);
  // Ends of columns that may slide on their ground.
  [[nodiscard]] static IdMap<VertexId, std::uint8_t> sliding_ends(const HexMesh& mesh, const std::vector<GrowingSheet>& sheets);
  [[nodiscard]] static double thickness_of(const Goal& goal, const std::vector<GrowingSheet>& sheets, Reach reach);
  [[nodiscard]] HexMesh settle(HexMesh mesh, const std::vector<GrowingSheet>& sheets, const Step& step, const std::vector<VertexId>& late,
                               Context& context) const;
  [[nodiscard]] HexMesh move_safely(HexMesh mesh, const std::vector<GrowingSheet>& sheets, const IdMap<VertexId, Vec3>& move,
                                    const Step& step) const;

  const Ground* ground_;
  Neighbours neighbours_;
  const VertexStars<HexId>& stars_;
  std::vector<Goal> goals_;  // crossings after what they are made of
  Guard guard_;
  IdMap<VertexId, Role> role_;  // in the volume
  Spread spread_;
  Spread wall_;  // along the walls: the ends of strips push the feet of columns before them
  std::vector<VertexId> movers_;  // goals and carried
  std::vector<HexId> round_movers_;
};

// Height of a column normal to the wall, as it is.
double height_of(const HexMesh& mesh, const GrowingSheet& sheet, std::size_t column);

}  // namespace strata
