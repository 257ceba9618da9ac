// What a hex will be worth once its sheets are cut into layers.
#pragma once

#include <array>
#include <cstdint>
#include <span>
#include <vector>

#include "core/layers/growing_sheet.h"
#include "core/optimise/optimise.h"

namespace strata {

// Which columns cross which hexes: made once for a mesh's connections, asked with any positions.
class Guard {
 public:
  Guard(const HexMesh& mesh, const std::vector<GrowingSheet>& sheets);

  struct Crossing {
    std::int32_t sheet = -1;
    std::uint8_t axis = 0;
    bool reversed = false;                      // the wall is at the end of the axis
    std::array<std::int32_t, 4> column{};       // on each of the four edges along the axis
  };
  // The sheets that cross a hex.
  [[nodiscard]] std::span<const Crossing> crossings(HexId h) const {
    return {crossings_.data() + first_[h], crossings_.data() + first_[HexId(h.value + 1)]};
  }

  // Smallest scaled Jacobian at the corners of the hex and, for each sheet that crosses it, at those of its first layer and of what lies
  // above the physical layers.
  [[nodiscard]] double quality(const HexMesh& mesh, const std::vector<GrowingSheet>& sheets, HexId h) const {
    return quality(mesh.hexes[h], mesh.position, sheets, h);
  }
  // The same with its vertices elsewhere.
  [[nodiscard]] double quality(const HexVertices& hex, const IdMap<VertexId, Vec3>& position, const std::vector<GrowingSheet>& sheets,
                               HexId h) const;
  // Hexes in sheets want the thickness their columns want, the others are cubes.
  [[nodiscard]] IdMap<HexId, HexTarget> targets(const std::vector<GrowingSheet>& sheets) const;
  [[nodiscard]] bool crossed(HexId h) const { return first_[h] < first_[HexId(h.value + 1)]; }

  // Of all sheets: tip, foot and top of a column, the same on the other side; in that order they wind as corners 0, 1, 2 of a hex.
  using Prism = std::array<VertexId, 6>;
  [[nodiscard]] const std::vector<Prism>& prisms() const { return prisms_; }
  // Smallest scaled Jacobian at its six corners; positive: so are the wedge hexes it is cut into at equal fractions.
  [[nodiscard]] static double prism_quality(const HexMesh& mesh, const Prism& prism);

 private:
  IdMap<HexId, std::int32_t> first_;            // crossings of h: first_[h] .. first_[h + 1]
  std::vector<Crossing> crossings_;
  std::vector<Prism> prisms_;
};

}  // namespace strata
