#include "core/layers/slice.h"

#include <algorithm>
#include <array>

#include "core/base/parallel.h"
#include "core/mesh/hex.h"
#include "core/quality/quality.h"

namespace strata {
namespace {

constexpr double kInOrder = 0.2;          // of a piece of a column, that is left of it on the ground
constexpr double kWedgePush = 0.3;        // of the pair's height: opens the corner at the middle point from 180 to 147 degrees
constexpr double kOnGround = 0.01;        // of a column's length: ends of a column that is on its ground are nearer than that
constexpr double kMostWedgePush = 0.2;    // of the distance to the tip: what the next column can spare
constexpr double kWedgeQuality = 0.3;     // scaled Jacobian: poorer wedge hexes look for a better middle point
constexpr std::array kWedgePushes{0.05, 0.15, 0.3, 0.45, 0.6, 0.8, 1.0, 1.3, 1.6};  // of the push, that they try
constexpr int kWedgeSweeps = 3;

// The points of the columns of the stack being cut.
struct Cut {
  const Stack* stack;
  IdMap<VertexId, std::int32_t> column_on;   // column that stands on a vertex, or -1
  VertexId first_new;
  [[nodiscard]] int cells() const { return stack->cells; }
  [[nodiscard]] bool is_column(VertexId bottom, VertexId top) const {
    const std::int32_t c = column_on[bottom];
    return c >= 0 && stack->columns.top[static_cast<std::size_t>(c)] == top;
  }
  // Point i = 0 .. cells of the column on `bottom`.
  [[nodiscard]] VertexId point(VertexId bottom, int i) const {
    const auto c = static_cast<std::size_t>(column_on[bottom]);
    if (i == 0) return bottom;
    if (i == cells()) return stack->columns.top[c];
    return VertexId(first_new.index() + c * static_cast<std::size_t>(cells() - 1) + static_cast<std::size_t>(i - 1));
  }
};

// Which axis of the hex the sheet crosses, and whether its wall is at the axis' end.
struct Crossing {
  int axis = -1;
  bool reversed = false;
};
Crossing crossing_of(const Cut& cut, const HexVertices& hex) {
  for (int axis = 0; axis < 3; ++axis) {
    const auto& edge = kHexEdges[static_cast<std::size_t>(axis) * 4];
    const VertexId a = hex[static_cast<std::size_t>(edge[0])], b = hex[static_cast<std::size_t>(edge[1])];
    if (cut.is_column(a, b)) return {axis, false};
    if (cut.is_column(b, a)) return {axis, true};
  }
  return {};
}

// What the points of each column are held by: nothing, a chart, or a curve, from the quads beside the column.
std::vector<Attachment> column_attachments(const HexMesh& mesh, const Cut& cut) {
  const Columns& columns = cut.stack->columns;
  std::vector<Attachment> held(columns.size());
  std::vector<ChartId> chart(columns.size());
  for (QuadId q : mesh.quads.ids())
    for (std::size_t i = 0; i < 4; ++i) {
      VertexId a = mesh.quads[q][i], b = mesh.quads[q][(i + 1) & 3];
      if (!cut.is_column(a, b)) std::swap(a, b);
      if (!cut.is_column(a, b)) continue;
      const auto c = static_cast<std::size_t>(cut.column_on[a]);
      if (held[c].hold == Hold::Free) {
        held[c] = {Hold::Chart, mesh.chart[q].value};
        chart[c] = mesh.chart[q];
      } else if (chart[c] != mesh.chart[q]) {
        const Attachment &low = mesh.attachment[a], &high = mesh.attachment[b];
        if (high.hold == Hold::Curve) held[c] = high;
        else if (low.hold == Hold::Curve) held[c] = low;
      }
    }
  return held;
}

void place_points(HexMesh& mesh, const Cut& cut, const Ground& ground) {
  const Columns& columns = cut.stack->columns;
  const std::vector<Attachment> held = column_attachments(mesh, cut);
  const auto inner = static_cast<std::size_t>(cut.cells() - 1), cells = static_cast<std::size_t>(cut.cells());
  mesh.position.resize(mesh.position.size() + columns.size() * inner, Vec3::Zero());
  mesh.attachment.resize(mesh.position.size());
  if (inner == 0) return;
  parallel_for(columns.size(), [&](std::size_t c) {
    const Vec3 from = mesh.position[columns.bottom[c]], to = mesh.position[columns.top[c]];
    // Between ends that stay off the ground there is no way along it.
    const auto off = [&](const Vec3& p) { return (p - ground.project(held[c], p).position).norm(); };
    const bool straight = c < cut.stack->straight.size() && cut.stack->straight[c] != 0;
    const bool along = held[c].hold != Hold::Free && !straight && std::max(off(from), off(to)) <= kOnGround * (to - from).norm();
    const auto point = [&](std::size_t i) { return VertexId(cut.first_new.index() + c * inner + i); };
    const auto level = [&](std::size_t i) { return cut.stack->level[c * cells + i]; };
    bool in_order = true;
    double before = 0;   // of the way from end to end
    for (std::size_t i = 0; i < inner; ++i) {
      const Vec3 p = from + level(i) * (to - from);
      mesh.attachment[point(i)] = held[c];
      mesh.position[point(i)] = along ? ground.project(held[c], p).position : p;
      const double way = (mesh.position[point(i)] - from).dot(to - from) / (to - from).squaredNorm();
      in_order = in_order && way - before >= kInOrder * (level(i) - (i > 0 ? level(i - 1) : 0));
      before = way;
    }
    // Where the ground has a kink, points would come to lie on each other.
    if (in_order && 1 - before >= kInOrder * (1 - level(inner - 1))) return;
    for (std::size_t i = 0; i < inner; ++i) mesh.position[point(i)] = from + level(i) * (to - from);
  });
}

void cut_hexes(Sliced& sliced, const Cut& cut) {
  HexMesh& mesh = sliced.mesh;
  const std::size_t count = mesh.hexes.size();
  std::vector<Crossing> crossing(count);
  std::vector<std::int64_t> at(count);
  parallel_for(count, [&](std::size_t h) {
    crossing[h] = crossing_of(cut, mesh.hexes[HexId(h)]);
    at[h] = crossing[h].axis < 0 ? 1 : cut.cells();
  });
  const auto total = static_cast<std::size_t>(exclusive_scan(at));
  IdMap<HexId, HexVertices> hexes(total);
  IdMap<HexId, RegionId> region(total);
  IdMap<HexId, std::uint16_t> layer(total);
  IdMap<HexId, HexId> parent(total);
  IdMap<HexId, std::int32_t> prism(total);
  parallel_for(count, [&](std::size_t h) {
    const HexVertices& old = mesh.hexes[HexId(h)];
    const std::uint16_t under = mesh.layer[HexId(h)];
    const auto first = static_cast<std::size_t>(at[h]);
    const Crossing x = crossing[h];
    const int cells = x.axis < 0 ? 1 : cut.cells();
    for (int k = 0; k < cells; ++k) {
      const HexId id(first + static_cast<std::size_t>(k));
      region[id] = mesh.region[HexId(h)];
      parent[id] = sliced.parent[HexId(h)];
      prism[id] = sliced.prism[HexId(h)];
      hexes[id] = old;
      layer[id] = under;
      if (x.axis < 0) continue;
      const auto here = static_cast<std::uint16_t>(k + 1);
      layer[id] = under == 0 ? here : std::min(under, here);
      for (std::size_t e = 0; e < 4; ++e) {
        const auto& edge = kHexEdges[static_cast<std::size_t>(x.axis) * 4 + e];
        const auto low = static_cast<std::size_t>(edge[x.reversed ? 1 : 0]), high = static_cast<std::size_t>(edge[x.reversed ? 0 : 1]);
        hexes[id][low] = cut.point(old[low], k);
        hexes[id][high] = cut.point(old[low], k + 1);
      }
    }
  });
  mesh.hexes = std::move(hexes);
  mesh.region = std::move(region);
  mesh.layer = std::move(layer);
  sliced.parent = std::move(parent);
  sliced.prism = std::move(prism);
}

void cut_quads(HexMesh& mesh, const Cut& cut) {
  IdMap<QuadId, QuadVertices> quads;
  IdMap<QuadId, PatchId> patch;
  IdMap<QuadId, ChartId> chart;
  const auto add = [&](const QuadVertices& q, QuadId from) {
    quads.push_back(q);
    patch.push_back(mesh.patch[from]);
    chart.push_back(mesh.chart[from]);
  };
  for (QuadId q : mesh.quads.ids()) {
    const QuadVertices& quad = mesh.quads[q];
    // Edge (a, b) is a column, standing on a or on b; so is the opposite edge (d, c).
    int found = -1;
    bool reversed = false;
    for (int i = 0; i < 2 && found < 0; ++i) {
      const VertexId a = quad[static_cast<std::size_t>(i)], b = quad[static_cast<std::size_t>(i + 1)];
      if (cut.is_column(a, b)) found = i;
      else if (cut.is_column(b, a)) found = i, reversed = true;
    }
    if (found < 0) {
      add(quad, q);
      continue;
    }
    const auto a = static_cast<std::size_t>(found), b = (a + 1) & 3, c = (a + 2) & 3, d = (a + 3) & 3;
    for (int k = 0; k < cut.cells(); ++k) {
      QuadVertices piece;
      const VertexId low1 = quad[reversed ? b : a], low2 = quad[reversed ? c : d];
      piece[reversed ? b : a] = cut.point(low1, k);
      piece[reversed ? a : b] = cut.point(low1, k + 1);
      piece[reversed ? c : d] = cut.point(low2, k);
      piece[reversed ? d : c] = cut.point(low2, k + 1);
      add(piece, q);
    }
  }
  mesh.quads = std::move(quads);
  mesh.patch = std::move(patch);
  mesh.chart = std::move(chart);
}

// Where the cut sheet is crossed by another one, the other's columns now stand on the new points as well.
void continue_columns(const Cut& cut, Stack& other) {
  const Columns& crossed = cut.stack->columns;
  const auto cells = static_cast<std::size_t>(cut.cells()), other_cells = static_cast<std::size_t>(other.cells);
  struct New {
    VertexId bottom, top;
    std::size_t low, high;   // the columns it lies between
    double at;
  };
  std::vector<New> fresh;
  for (std::size_t c = 0; c < crossed.size(); ++c) {
    const std::int32_t low = other.columns.find(crossed.bottom[c]), high = other.columns.find(crossed.top[c]);
    if (low < 0 || high < 0) continue;
    const VertexId over = other.columns.top[static_cast<std::size_t>(low)];
    if (cut.column_on[over] < 0 || !cut.is_column(over, other.columns.top[static_cast<std::size_t>(high)])) continue;
    for (int i = 1; i < cut.cells(); ++i)
      fresh.push_back({cut.point(crossed.bottom[c], i), cut.point(over, i), static_cast<std::size_t>(low), static_cast<std::size_t>(high),
                       cut.stack->level[c * cells + static_cast<std::size_t>(i - 1)]});
  }
  // New vertices have the largest ids, in the order of their columns: the list stays sorted.
  for (const New& n : fresh) {
    other.columns.bottom.push_back(n.bottom);
    other.columns.top.push_back(n.top);
    if (!other.straight.empty()) other.straight.push_back(std::max(other.straight[n.low], other.straight[n.high]));
    for (std::size_t i = 0; i < other_cells; ++i)
      other.level.push_back((1 - n.at) * other.level[n.low * other_cells + i] + n.at * other.level[n.high * other_cells + i]);
  }
}

// Cross-section of a wedge hex: the tip, then points 2j, 2j+1, 2j+2 of the column. `first`: what the stack's first prism is counted as.
void add_wedge_hexes(Sliced& sliced, const Cut& cut, std::int32_t first) {
  HexMesh& mesh = sliced.mesh;
  for (std::size_t p = 0; p < cut.stack->prisms.hexes.size(); ++p) {
    const HexVertices& prism = cut.stack->prisms.hexes[p];
    const std::size_t i = tip_of(prism);
    const VertexId a = prism[i], b = prism[(i + 1) & 3], c = prism[(i + 2) & 3], d = prism[(i + 3) & 3];
    for (int k = 0; k + 2 <= cut.cells(); k += 2) {
      mesh.hexes.push_back(
          {a, cut.point(d, k), cut.point(d, k + 1), cut.point(d, k + 2), b, cut.point(c, k), cut.point(c, k + 1), cut.point(c, k + 2)});
      mesh.region.push_back(cut.stack->prisms.region[p]);
      mesh.layer.push_back(static_cast<std::uint16_t>(k + 1));
      sliced.parent.push_back({});
      sliced.prism.push_back(first + static_cast<std::int32_t>(p));
    }
  }
}

// Middle points of pairs of layers, and the way each may go away from the tip.
struct Middles {
  std::vector<VertexId> vertex;  // ascending
  std::vector<Vec3> start, push;
};

Middles middles_of(const HexMesh& mesh, const Cut& cut) {
  IdMap<VertexId, Vec3> away(mesh.position.size(), Vec3::Zero());
  std::vector<VertexId> feet;
  for (const HexVertices& prism : cut.stack->prisms.hexes) {
    const std::size_t i = tip_of(prism);
    const VertexId a = prism[i], b = prism[(i + 1) & 3], c = prism[(i + 2) & 3], d = prism[(i + 3) & 3];
    away[c] += mesh.position[c] - mesh.position[b];
    away[d] += mesh.position[d] - mesh.position[a];
    feet.push_back(c), feet.push_back(d);
  }
  std::sort(feet.begin(), feet.end());
  feet.erase(std::unique(feet.begin(), feet.end()), feet.end());
  Middles middles;
  for (VertexId foot : feet) {
    const Vec3 up = (mesh.position[cut.point(foot, cut.cells())] - mesh.position[foot]).normalized();
    Vec3 out = away[foot] * 0.5;   // two prisms share a foot
    out -= up * up.dot(out);
    const double room = kMostWedgePush * out.norm();
    for (int k = 1; k < cut.cells(); k += 2) {
      const double pair = (mesh.position[cut.point(foot, k + 1)] - mesh.position[cut.point(foot, k - 1)]).norm();
      const VertexId middle = cut.point(foot, k);
      if (mesh.attachment[middle].hold != Hold::Free) continue;
      middles.vertex.push_back(middle);
      middles.start.push_back(mesh.position[middle]);
      middles.push.push_back(out.normalized() * std::min(kWedgePush * pair, room));
    }
  }
  return middles;
}

// Moves the middle points away from the tip, so that wedge hexes have no straight corner: as far as is best for the poorest hex round each.
// Where columns lean away from the tip, the corners beside the middle point pay for what it gains.
void push_middles(HexMesh& mesh, const Cut& cut) {
  const Middles middles = middles_of(mesh, cut);
  if (middles.vertex.empty()) return;
  IdMap<VertexId, std::int32_t> slot(mesh.position.size(), -1);
  for (std::size_t m = 0; m < middles.vertex.size(); ++m) slot[middles.vertex[m]] = static_cast<std::int32_t>(m);
  std::vector<std::vector<HexId>> round(middles.vertex.size());
  for (HexId h : mesh.hexes.ids())
    for (VertexId v : mesh.hexes[h])
      if (slot[v] >= 0) round[static_cast<std::size_t>(slot[v])].push_back(h);
  const auto poorest = [&](std::size_t m) {
    double worst = 1;
    for (HexId h : round[m]) {
      std::array<Vec3, 8> corners;
      for (std::size_t c = 0; c < 8; ++c) corners[c] = mesh.position[mesh.hexes[h][c]];
      worst = std::min(worst, corner_scaled_jacobian(corners));
    }
    return worst;
  };
  for (std::size_t m = 0; m < middles.vertex.size(); ++m) mesh.position[middles.vertex[m]] += middles.push[m];
  for (int sweep = 0; sweep < kWedgeSweeps; ++sweep)
    for (std::size_t m = 0; m < middles.vertex.size(); ++m) {
      Vec3& p = mesh.position[middles.vertex[m]];
      Vec3 best = p;
      double best_quality = poorest(m);
      if (best_quality > kWedgeQuality) continue;
      for (const double share : kWedgePushes) {
        p = middles.start[m] + share * middles.push[m];
        if (const double quality = poorest(m); quality > best_quality) best_quality = quality, best = p;
      }
      p = best;
    }
}

}  // namespace

Sliced slice(HexMesh mesh, std::vector<Stack> stacks, const Ground& ground) {
  Sliced sliced;
  sliced.parent.resize(mesh.hexes.size());
  sliced.prism.resize(mesh.hexes.size(), -1);
  for (HexId h : sliced.parent.ids()) sliced.parent[h] = h;
  sliced.mesh = std::move(mesh);
  std::int32_t prisms = 0;
  for (std::size_t s = 0; s < stacks.size(); ++s) {
    const Stack& stack = stacks[s];
    Cut cut{&stack, IdMap<VertexId, std::int32_t>(sliced.mesh.position.size(), -1), sliced.mesh.position.next_id()};
    for (std::size_t c = 0; c < stack.columns.size(); ++c) cut.column_on[stack.columns.bottom[c]] = static_cast<std::int32_t>(c);
    place_points(sliced.mesh, cut, ground);
    cut.column_on.resize(sliced.mesh.position.size(), -1);
    for (std::size_t t = s + 1; t < stacks.size(); ++t) continue_columns(cut, stacks[t]);
    cut_hexes(sliced, cut);
    cut_quads(sliced.mesh, cut);
    add_wedge_hexes(sliced, cut, prisms);
    push_middles(sliced.mesh, cut);
    prisms += static_cast<std::int32_t>(stack.prisms.hexes.size());
  }
  return sliced;
}

}  // namespace strata
