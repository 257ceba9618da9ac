// The work of growing layers: sheets go in, open, gain their thickness, are cut.
#pragma once

#include <array>
#include <optional>
#include <span>
#include <utility>
#include <vector>

#include "core/layers/grow_layers.h"
#include "core/layers/growing_sheet.h"
#include "core/layers/inflate.h"
#include "core/layers/plan.h"
#include "core/layers/size_law.h"
#include "core/layers/slice.h"
#include "core/layers/wall.h"
#include "core/surface/locator.h"

namespace strata {

struct LayerRequest {
  const std::vector<LayerSpec>& entries;
  const IdMap<PatchId, PatchWish>& wishes;
  const Ground& ground;
  const Locator& locator;
  int rings;                           // of vertices that give way
  double thickest;                     // thickness that is asked for, over the local size
};

// One group's sheet.
struct GroupSheet {
  std::int32_t group = -1;
  HexId first;
  std::size_t count = 0;
  int blending = -1;                   // -1: not decided yet
  GrowingSheet growing;
  std::vector<ColumnLaw> laws;
  Columns measured;                    // those that stood before later sheets went in, and the gap in front of each
  std::vector<double> room;
};

class Grower {
 public:
  Grower(HexMesh mesh, LayerPlan plan, const LayerRequest& request, Context& context);

  // Puts the group's sheet in, without thickness. False: it would pinch; `failed` names the fronts.
  bool insert(std::int32_t group);
  // Lets the sheets that have no thickness yet open.
  void open();
  // Lets the columns on borders that end in wedges vanish; sheets with such borders must not be open yet.
  void collapse_wedges();
  // All sheets gain their thickness together.
  void inflate();
  // Cuts the sheets. Where a layer would not be positive, the columns round it are cut alike. Afterwards mesh, plan and fraction are the
  // result.
  void cut();

  HexMesh mesh;
  LayerPlan plan;
  std::vector<FrontIndex> failed;
  IdMap<VertexId, double> fraction;    // after cut: delivered over wished thickness at the foot of each column; negative: none there
  std::vector<std::pair<FrontIndex, FrontIndex>> crossed_badly;  // after cut: fronts of groups whose crossing is not positive somewhere
  [[nodiscard]] bool empty() const { return sheets_.empty(); }

 private:
  bool widen(const std::vector<VertexId>& pinches, std::int32_t group);
  void measure_feet(GroupSheet& sheet) const;
  [[nodiscard]] RoomRules room_rules() const;
  void decide_law(GroupSheet& sheet);
  // Gives up layers of the sheet's group, where its entry says so, until the rest fits nearly everywhere. False: nothing changed.
  bool give_up_layers(const GroupSheet& sheet);
  void forget_room_on_strips(GroupSheet& sheet) const;
  std::vector<std::vector<double>> hold_back(Reach reach, double growth, double slope);
  [[nodiscard]] const LayerSpec& entry_of(FrontIndex front) const;
  [[nodiscard]] std::vector<GrowingSheet> growing() const;
  [[nodiscard]] std::vector<Stack> stacks();
  void even_out(Stack& stack, std::int32_t sheet);
  void note_bad_crossing(std::span<const Guard::Crossing> crossings);

  const LayerRequest& request_;
  Context& context_;
  std::vector<std::int32_t> widened_;  // group a bare quad was given to, by quad; -1; kLeftBare
  std::vector<GroupSheet> sheets_;
  bool thick_;                         // layers far thicker than the walls' quads are wide
  double slope_;                       // largest change of thickness per unit length along the wall
  std::size_t opened_ = 0;             // sheets before it are open
  // Four columns of a sheet that are to be cut at the same fractions.
  struct Alike {
    std::int32_t sheet = -1;
    std::array<std::int32_t, 4> column{};
  };
  std::vector<Alike> alike_;
  [[nodiscard]] std::optional<Alike> prism_columns(std::int32_t prism) const;
};

}  // namespace strata
