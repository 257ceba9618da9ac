#include "core/carve/part_pinches.h"

#include <algorithm>
#include <array>
#include <deque>
#include <span>
#include <vector>

#include "core/base/parallel.h"
#include "core/carve/colour.h"

namespace strata {
namespace {

// The hexes round a vertex and which of them share a face there: the link of the vertex, a sphere cut in triangles.
class Link {
 public:
  Link(const HexMesh& mesh, const FaceNeighbours& neighbours, const VertexStars<HexId>& star, VertexId v) : hexes_(star.of(v)) {
    beside_.resize(hexes_.size());
    for (std::size_t i = 0; i < hexes_.size(); ++i)
      for (int f = 0; f < 6; ++f) {
        const QuadVertices q = face_vertices(mesh.hexes[hexes_[i]], f);
        if (std::find(q.begin(), q.end(), v) == q.end()) continue;
        const HexId other = neighbours[hexes_[i]][static_cast<std::size_t>(f)].hex;
        if (!other.valid()) continue;
        beside_[i].push_back(static_cast<std::size_t>(std::lower_bound(hexes_.begin(), hexes_.end(), other) - hexes_.begin()));
      }
  }

  [[nodiscard]] std::size_t size() const { return hexes_.size(); }
  [[nodiscard]] HexId hex(std::size_t i) const { return hexes_[i]; }

  using Fan = std::vector<std::size_t>;  // ascending
  // Connected sets of the members, largest first, of equal ones that with the smallest hex.
  template <class IsMember>
  [[nodiscard]] std::vector<Fan> fans(const IsMember& is_member) const {
    std::vector<Fan> result;
    std::vector<std::uint8_t> seen(size(), 0);
    for (std::size_t first = 0; first < size(); ++first) {
      if (seen[first] != 0 || !is_member(first)) continue;
      Fan fan{first};
      seen[first] = 1;
      for (std::size_t at = 0; at < fan.size(); ++at)
        for (std::size_t other : beside_[fan[at]])
          if (seen[other] == 0 && is_member(other)) {
            seen[other] = 1;
            fan.push_back(other);
          }
      std::sort(fan.begin(), fan.end());
      result.push_back(std::move(fan));
    }
    std::stable_sort(result.begin(), result.end(), [](const Fan& a, const Fan& b) { return a.size() > b.size(); });
    return result;
  }

  // The fewest steps from one fan to any hex of the others, ends left out. Empty when they are not joined at all.
  [[nodiscard]] Fan way_between(const Fan& from, std::span<const Fan> others) const {
    constexpr std::size_t kUnseen = static_cast<std::size_t>(-1);
    std::vector<std::size_t> before(size(), kUnseen);
    std::vector<std::uint8_t> is_end(size(), 0);
    for (const Fan& fan : others)
      for (std::size_t i : fan) is_end[i] = 1;
    std::deque<std::size_t> queue(from.begin(), from.end());
    for (std::size_t i : from) before[i] = i;
    while (!queue.empty()) {
      const std::size_t at = queue.front();
      queue.pop_front();
      if (is_end[at] != 0) {
        Fan way;
        for (std::size_t i = before[at]; before[i] != i; i = before[i]) way.push_back(i);
        return way;
      }
      for (std::size_t other : beside_[at])
        if (before[other] == kUnseen) {
          before[other] = at;
          queue.push_back(other);
        }
    }
    return {};
  }

 private:
  std::span<const HexId> hexes_;
  std::vector<std::vector<std::size_t>> beside_;
};

constexpr std::uint8_t kChanges = 2;  // of a hex to another region

class Parter {
 public:
  Parter(const HexMesh& mesh, const VertexStars<HexId>& star, const FaceNeighbours& neighbours, IdMap<HexId, std::int32_t>& label)
      : mesh_(mesh),
        star_(star),
        neighbours_(neighbours),
        label_(label),
        changes_(mesh.hexes.size(), std::uint8_t{0}),
        queued_(mesh.position.size(), std::uint8_t{0}) {}

  bool run() {
    find_pinched();
    const bool any = !queue_.empty();
    while (!queue_.empty()) {
      const VertexId v = queue_.front();
      queue_.pop_front();
      queued_[v] = 0;
      for (HexId h : to_drop(v)) drop(h);
    }
    return any;
  }

 private:
  void find_pinched() {
    parallel_for(queued_.size(), [&](std::size_t v) { queued_[VertexId(v)] = to_drop(VertexId(v)).empty() ? 0 : 1; }, 256);
    for (VertexId v : queued_.ids())
      if (queued_[v] != 0) queue_.push_back(v);
  }
  // To the label across most of its faces, so that no void opens between regions; after some changes to the void, which ends it.
  [[nodiscard]] std::int32_t label_instead(HexId h) const {
    if (changes_[h] >= kChanges) return kVoid;
    std::array<std::int32_t, 6> around;
    for (std::size_t f = 0; f < 6; ++f) around[f] = neighbours_[h][f].hex.valid() ? label_[neighbours_[h][f].hex] : kVoid;
    std::int32_t best = kVoid;
    std::ptrdiff_t most = std::count(around.begin(), around.end(), kVoid);
    for (const std::int32_t label : around) {
      const std::ptrdiff_t count = std::count(around.begin(), around.end(), label);
      if (label == label_[h] || count < most || (count == most && label >= best)) continue;
      best = label;
      most = count;
    }
    return best;
  }
  void drop(HexId h) {
    label_[h] = label_instead(h);
    ++changes_[h];
    for (VertexId v : mesh_.hexes[h]) {
      if (queued_[v] != 0) continue;
      queued_[v] = 1;
      queue_.push_back(v);
    }
  }

  // The least that must go for the first fault of v; empty: v is clean.
  [[nodiscard]] std::vector<HexId> to_drop(VertexId v) const {
    const auto hexes = star_.of(v);
    if (std::all_of(hexes.begin(), hexes.end(), [&](HexId h) { return label_[h] == label_[hexes[0]]; })) return {};
    const Link link(mesh_, neighbours_, star_, v);
    const auto label = [&](std::size_t i) { return label_[link.hex(i)]; };
    std::vector<std::int32_t> regions;
    for (HexId h : hexes)
      if (label_[h] >= 0) regions.push_back(label_[h]);
    std::sort(regions.begin(), regions.end());
    regions.erase(std::unique(regions.begin(), regions.end()), regions.end());
    for (const std::int32_t region : regions) {
      const auto inner = link.fans([&](std::size_t i) { return label(i) == region; });
      if (inner.size() > 1) return all_but_first(link, inner);
      const auto outer = link.fans([&](std::size_t i) { return label(i) != region; });
      if (outer.size() > 1) {
        const auto way = link.way_between(outer[0], std::span(outer).subspan(1));
        return way.empty() ? hexes_of(link, inner[0]) : hexes_of(link, way);
      }
      const auto others = link.fans([&](std::size_t i) { return label(i) >= 0 && label(i) != region; });
      if (others.size() > 1) return all_but_first(link, others);
    }
    return {};
  }
  [[nodiscard]] static std::vector<HexId> hexes_of(const Link& link, const Link::Fan& fan) {
    std::vector<HexId> hexes;
    for (std::size_t i : fan) hexes.push_back(link.hex(i));
    return hexes;
  }
  [[nodiscard]] static std::vector<HexId> all_but_first(const Link& link, const std::vector<Link::Fan>& fans) {
    std::vector<HexId> hexes;
    for (std::size_t f = 1; f < fans.size(); ++f)
      for (std::size_t i : fans[f]) hexes.push_back(link.hex(i));
    return hexes;
  }

  const HexMesh& mesh_;
  const VertexStars<HexId>& star_;
  const FaceNeighbours& neighbours_;
  IdMap<HexId, std::int32_t>& label_;
  IdMap<HexId, std::uint8_t> changes_;
  IdMap<VertexId, std::uint8_t> queued_;
  std::deque<VertexId> queue_;
};

}  // namespace

bool part_pinches(const HexMesh& mesh, const VertexStars<HexId>& star, const FaceNeighbours& neighbours,
                  IdMap<HexId, std::int32_t>& label) {
  return Parter(mesh, star, neighbours, label).run();
}

}  // namespace strata
