#include "core/carve/clean_skin.h"

#include <algorithm>
#include <array>
#include <deque>
#include <map>
#include <span>
#include <vector>

#include "core/carve/colour.h"
#include "core/carve/part_pinches.h"
#include "core/mesh/adjacency.h"

namespace strata {
namespace {

constexpr int kFlips = 2;            // changes of a hex; the last is to void
constexpr int kBackedNeighbours = 5; // a neighbour held by so many faces can lose one: the erosion does not run on
constexpr int kMaxValence = 6;       // of boundary vertices
constexpr std::size_t kFragment = 8; // hexes

class Cleaner {
 public:
  Cleaner(const HexMesh& mesh, HexChoice& choice)
      : mesh_(mesh),
        label_(choice.label),
        fillable_(choice.fillable),
        thin_(choice.thin),
        star_(hexes_round_vertices(mesh)),
        neighbours_(face_neighbours(mesh)),
        flips_(mesh.hexes.size(), std::uint8_t{0}),
        queued_(mesh.position.size(), std::uint8_t{0}) {}

  void run() {
    for (VertexId v : mesh_.position.ids()) push(v);
    settle();
    // Fragments may touch nothing any more once they are gone, but what they touched may now stick out.
    while (drop_fragments()) settle();
    // What the rules above leave, mostly where regions meet, is only cut away from here on.
    while (part_pinches(mesh_, star_, neighbours_, label_) && drop_fragments()) {
    }
  }

 private:
  void push(VertexId v) {
    if (queued_[v] != 0) return;
    queued_[v] = 1;
    queue_.push_back(v);
  }
  void settle() {
    while (!queue_.empty()) {
      const VertexId v = queue_.front();
      queue_.pop_front();
      queued_[v] = 0;
      if (mixed(v)) clean(v);
    }
  }
  [[nodiscard]] bool mixed(VertexId v) const {
    const auto hexes = star_.of(v);
    return std::any_of(hexes.begin(), hexes.end(), [&](HexId h) { return label_[h] != label_[hexes[0]]; });
  }
  [[nodiscard]] std::int32_t label_across(HexId h, int face) const {
    const HexId other = neighbours_[h][static_cast<std::size_t>(face)].hex;
    return other.valid() ? label_[other] : kVoid;
  }
  [[nodiscard]] int faces_to(HexId h, std::int32_t label) const {
    int count = 0;
    for (int f = 0; f < 6; ++f) count += label_across(h, f) == label ? 1 : 0;
    return count;
  }
  void relabel(HexId h, std::int32_t label) {
    label_[h] = label;
    ++flips_[h];
    for (VertexId v : mesh_.hexes[h]) push(v);
  }
  // To the region that holds most of its other faces, else to the void; the last change is to the void.
  void drop(HexId h) {
    std::int32_t best = kVoid;
    int most = faces_to(h, kVoid);
    for (int f = 0; f < 6 && flips_[h] + 1 < kFlips; ++f) {
      const std::int32_t other = label_across(h, f);
      if (other < 0 || other == label_[h]) continue;
      const int count = faces_to(h, other);
      if (count > most || (count == most && best >= 0 && other < best)) {
        best = other;
        most = count;
      }
    }
    relabel(h, best);
  }
  [[nodiscard]] bool may_fill(HexId h, std::int32_t region) const { return label_[h] == kVoid && flips_[h] == 0 && fillable_[h] == region; }

  [[nodiscard]] bool thin(HexId h) const { return !thin_.empty() && thin_[h] != 0; }

  [[nodiscard]] bool sticks_out(HexId h) const {
    std::array<int, 6> held{};
    int count = 0;
    for (int f = 0; f < 6; ++f)
      if (label_across(h, f) == label_[h]) held[static_cast<std::size_t>(count++)] = f;
    if (count > 2 || (count == 2 && held[1] == opposite_face(held[0]))) return false;
    if (count == 2 && thin(h)) return false;
    // Held by one face or two neighbouring ones: a bump or the end of a step when a holder is well backed. Else it is the end of a
    // thin rod or plate, which would be eaten up from there.
    for (int i = 0; i < count; ++i) {
      const HexId holder = neighbours_[h][static_cast<std::size_t>(held[static_cast<std::size_t>(i)])].hex;
      if (faces_to(holder, label_[holder]) >= kBackedNeighbours) return true;
    }
    return false;
  }

  void clean(VertexId v) {
    const auto hexes = star_.of(v);
    for (HexId h : hexes) {
      if (label_[h] >= 0 && sticks_out(h)) return drop(h);
      if (label_[h] == kVoid && fillable_[h] >= 0 && may_fill(h, fillable_[h]) && faces_to(h, fillable_[h]) >= 5)
        return relabel(h, fillable_[h]);
    }
    for (std::size_t i = 0; i < hexes.size(); ++i) {
      const std::int32_t region = label_[hexes[i]];
      const auto same = [&](HexId h) { return label_[h] == region; };
      if (region < 0 || std::any_of(hexes.begin(), hexes.begin() + static_cast<std::ptrdiff_t>(i), same)) continue;
      if (!clean_region(v, hexes, region)) return;
    }
  }

  // Face-connected fans round v of hexes in the region and of the rest, as lists of hexes, largest first.
  struct Fans {
    std::vector<std::vector<HexId>> in, out;
    int valence = 0;  // boundary faces at v
  };
  [[nodiscard]] Fans fans_round(VertexId v, std::span<const HexId> hexes, std::int32_t region) const {
    Fans fans;
    std::vector<int> group(hexes.size(), -1);
    for (std::size_t i = 0; i < hexes.size(); ++i) {
      if (group[i] >= 0) continue;
      const bool in = label_[hexes[i]] == region;
      std::vector<HexId> fan;
      std::vector<std::size_t> todo{i};
      group[i] = static_cast<int>(i);
      while (!todo.empty()) {
        const HexId h = hexes[todo.back()];
        todo.pop_back();
        fan.push_back(h);
        for (int f = 0; f < 6; ++f) {
          const QuadVertices q = face_vertices(mesh_.hexes[h], f);
          if (std::find(q.begin(), q.end(), v) == q.end()) continue;
          const HexId other = neighbours_[h][static_cast<std::size_t>(f)].hex;
          const bool other_in = other.valid() && label_[other] == region;
          if (in != other_in) {
            if (in) ++fans.valence;
            continue;
          }
          if (!other.valid()) continue;
          const auto at = static_cast<std::size_t>(std::lower_bound(hexes.begin(), hexes.end(), other) - hexes.begin());
          if (group[at] >= 0) continue;
          group[at] = static_cast<int>(i);
          todo.push_back(at);
        }
      }
      std::sort(fan.begin(), fan.end());
      (in ? fans.in : fans.out).push_back(std::move(fan));
    }
    const auto larger = [](const auto& a, const auto& b) { return a.size() != b.size() ? a.size() > b.size() : a < b; };
    std::sort(fans.in.begin(), fans.in.end(), larger);
    std::sort(fans.out.begin(), fans.out.end(), larger);
    return fans;
  }

  // False when something was changed: the vertex comes again.
  bool clean_region(VertexId v, std::span<const HexId> hexes, std::int32_t region) {
    const Fans fans = fans_round(v, hexes, region);
    const bool pinched = fans.in.size() > 1 || fans.out.size() > 1;
    if (!pinched && fans.valence <= kMaxValence && fans.valence != 2) return true;
    // One hex that fills the gap is the smallest change.
    if (fans.out.size() > 1 && fans.out.back().size() == 1 && may_fill(fans.out.back()[0], region)) {
      relabel(fans.out.back()[0], region);
      return false;
    }
    if (fans.out.size() > 1 && fill_thin(fans.out.back(), region)) return false;
    if (fans.in.size() > 1) {
      if (bridge(hexes, fans.in, region)) return false;
      for (HexId h : fans.in.back()) drop(h);
      return false;
    }
    if (!pinched && !fill_best(hexes, region)) return drop_most_exposed(hexes, region, fans.valence);
    if (pinched) drop_most_exposed(hexes, region, kMaxValence + 1);
    return false;
  }

  bool fill_thin(const std::vector<HexId>& fan, std::int32_t region) {
    if (!std::all_of(fan.begin(), fan.end(), [&](HexId h) { return thin(h) && may_fill(h, region); })) return false;
    for (HexId h : fan) relabel(h, region);
    return true;
  }
  // Joins two fans by the hex between them, that with most neighbours in the region.
  bool bridge(std::span<const HexId> hexes, const std::vector<std::vector<HexId>>& fans, std::int32_t region) {
    const auto fan_of = [&](HexId h) {
      return std::find_if(fans.begin(), fans.end(), [&](const auto& fan) { return std::binary_search(fan.begin(), fan.end(), h); });
    };
    HexId best;
    for (HexId h : hexes) {
      if (!thin(h) || !may_fill(h, region) || (best.valid() && faces_to(h, region) <= faces_to(best, region))) continue;
      auto first = fans.end();
      for (const FaceNeighbour& n : neighbours_[h]) {
        const auto fan = n.hex.valid() ? fan_of(n.hex) : fans.end();
        if (fan == fans.end()) continue;
        if (first == fans.end()) first = fan;
        if (fan != first) best = h;
      }
    }
    if (best.valid()) relabel(best, region);
    return best.valid();
  }

  bool fill_best(std::span<const HexId> hexes, std::int32_t region) {
    HexId best;
    int most = 2;  // a hex with fewer kept neighbours would itself stick out
    for (HexId h : hexes)
      if (may_fill(h, region) && faces_to(h, region) > most) {
        best = h;
        most = faces_to(h, region);
      }
    if (best.valid()) relabel(best, region);
    return best.valid();
  }

  bool drop_most_exposed(std::span<const HexId> hexes, std::int32_t region, int valence) {
    HexId worst;
    int fewest = 7;
    for (HexId h : hexes)
      if (label_[h] == region && faces_to(h, region) < fewest) {
        worst = h;
        fewest = faces_to(h, region);
      }
    // A crowded but manifold vertex is no reason to cut into the flat of a surface.
    if (valence <= kMaxValence && fewest >= kBackedNeighbours) return true;
    drop(worst);
    return false;
  }

  struct Piece {
    std::int32_t region;
    std::vector<HexId> hexes;
  };
  [[nodiscard]] std::vector<Piece> pieces() const {
    IdMap<HexId, std::uint8_t> seen(mesh_.hexes.size(), std::uint8_t{0});
    std::vector<Piece> result;
    for (HexId first : mesh_.hexes.ids()) {
      if (seen[first] != 0 || label_[first] < 0) continue;
      Piece piece{label_[first], {first}};
      seen[first] = 1;
      for (std::size_t i = 0; i < piece.hexes.size(); ++i)
        for (const FaceNeighbour& n : neighbours_[piece.hexes[i]])
          if (n.hex.valid() && seen[n.hex] == 0 && label_[n.hex] == piece.region) {
            seen[n.hex] = 1;
            piece.hexes.push_back(n.hex);
          }
      result.push_back(std::move(piece));
    }
    return result;
  }
  // The label beyond most of a piece's faces: a crumb inside another region leaves no cavity there.
  [[nodiscard]] std::int32_t label_round(const Piece& piece) const {
    std::map<std::int32_t, int> faces;
    for (HexId h : piece.hexes)
      for (int f = 0; f < 6; ++f)
        if (const std::int32_t other = label_across(h, f); other != piece.region) ++faces[other];
    const auto fewer = [](const auto& a, const auto& b) { return a.second < b.second; };
    return faces.empty() ? kVoid : std::max_element(faces.begin(), faces.end(), fewer)->first;
  }
  // The largest piece of a region stays whatever its size: a coarse mesh is better than none.
  bool drop_fragments() {
    const std::vector<Piece> all = pieces();
    std::map<std::int32_t, std::size_t> largest;  // of each region, the first of equal ones
    for (std::size_t i = 0; i < all.size(); ++i) {
      const auto [at, fresh] = largest.try_emplace(all[i].region, i);
      if (!fresh && all[i].hexes.size() > all[at->second].hexes.size()) at->second = i;
    }
    bool dropped = false;
    for (std::size_t i = 0; i < all.size(); ++i) {
      if (all[i].hexes.size() >= kFragment || largest[all[i].region] == i) continue;
      const std::int32_t instead = label_round(all[i]);
      for (HexId h : all[i].hexes) {
        const bool again = flips_[h] >= kFlips;
        flips_[h] = kFlips;
        relabel(h, again ? kVoid : instead);
      }
      dropped = true;
    }
    return dropped;
  }

  const HexMesh& mesh_;
  IdMap<HexId, std::int32_t>& label_;
  const IdMap<HexId, std::int32_t>& fillable_;
  const IdMap<HexId, std::uint8_t>& thin_;
  VertexStars<HexId> star_;
  FaceNeighbours neighbours_;
  IdMap<HexId, std::uint8_t> flips_;
  IdMap<VertexId, std::uint8_t> queued_;
  std::deque<VertexId> queue_;
};

}  // namespace

void clean_skin(const HexMesh& mesh, HexChoice& choice) { Cleaner(mesh, choice).run(); }

}  // namespace strata
