#include "core/fit/routes.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <numbers>
#include <numeric>
#include <tuple>
#include <utility>

namespace strata {
namespace {

// In cells:
constexpr double kShortestTail = 0.6;     // a crease that ends in the open: one edge can show it
constexpr double kShortestLoop = 4.0;     // a closed crease
constexpr double kCornerDistance = 0.15;  // corners closer than this along a curve are one: anything longer still makes a sound, flat quad
constexpr double kNarrowest = 0.15;  // width of a strip between two creases
constexpr double kShadowed = 0.8;  // of a crease's length, that runs beside a longer one: the mesh cannot show both
constexpr int kShadowSamples = 8;
constexpr double kFacing = 2;  // widths of a strip: its two sides are no farther apart
constexpr double kFlat = 0.05;  // width of a strip that may be a step far lower than a cell
constexpr double kLeastTurn = std::numbers::pi / 8;  // of the surface across a strip whose one side was left out: less is no crease
constexpr double kSmallestChart = 0.7;  // area of a chart, in cells' faces
constexpr double kDissolveTurn = std::numbers::pi / 4;  // a corner with two curves left that turn by less is none any more
constexpr int kSizeSamples = 5;  // of the mesh size along a curve

struct Link {  // a curve of the graph of curves and corners
  bool alive = true;
  bool border = false;
  double size = 0;
  double turn = 0;  // of the surface across it, convex or concave by sign; with that of the side of a strip that was left out in its favour
};

struct Step {
  CurveId curve;
  bool backwards = false;
};

struct Chain {
  std::vector<Step> steps;
  CornerId first, last;  // invalid: closed with no corner
  bool closed = false;
  bool border = false;
  double length = 0, size = 0, turn = 0;
  Box box;
  [[nodiscard]] double sharpness() const { return std::abs(turn); }
};

class Pruner {
 public:
  Pruner(const Ground& ground, const IdMap<CurveId, std::uint8_t>& let_go, const std::function<double(const Vec3&)>& size_at)
      : surface_(ground.surface()),
        features_(ground.features()),
        links_(features_.curves.size()),
        contracted_(features_.curves.size(), std::uint8_t{0}),
        united_(features_.corners.size()),
        altered_(features_.corners.size(), std::uint8_t{0}),
        ends_(features_.corners.size()),
        chart_root_(features_.chart_count()),
        area_(features_.chart_count(), 0.0) {
    for (CurveId c : features_.curves.ids()) {
      const Curve& curve = features_.curves[c];
      Link& link = links_[c];
      link.alive = let_go.empty() || let_go[c] == 0;
      const auto patch = [&](ChartId chart) { return chart.valid() ? features_.patch_of_chart[chart] : PatchId(); };
      link.border = !curve.manifold || patch(curve.left) != patch(curve.right);
      link.turn = std::numbers::pi - curve.dihedral_mean;
      const auto n = curve.points.size();
      for (int i = 0; i < kSizeSamples; ++i)
        link.size +=
            size_at(surface_.points[curve.points[std::min(n - 1, n * static_cast<std::size_t>(i) / (kSizeSamples - 1))]]) / kSizeSamples;
    }
    for (CornerId c : united_.ids()) united_[c] = c;
    for (ChartId c : chart_root_.ids()) chart_root_[c] = c;
    for (CurveId c : features_.curves.ids()) {
      if (links_[c].alive) continue;
      join_charts(features_.curves[c]);
      for (const CornerId end : {features_.curves[c].first, features_.curves[c].last})
        if (end.valid()) altered_[end] = 1;
    }
    for (TriangleId t : features_.chart.ids()) {
      const auto [a, b, c] = surface_.corners(t);
      if (features_.chart[t].valid()) area_[root(features_.chart[t])] += 0.5 * (b - a).cross(c - a).norm();
    }
  }

  RoutePlan run() {
    // Cheap rules first: what they leave out changes what the later ones see.
    do {
      make_chains();
    } while (drop_tails() || unite_corners() || drop_shadows() || open_narrow_charts());
    return plan();
  }

 private:
  [[nodiscard]] CornerId root(CornerId c) const {
    while (c.valid() && united_[c] != c) c = united_[c];
    return c;
  }
  [[nodiscard]] ChartId root(ChartId c) const {
    while (c.valid() && chart_root_[c] != c) c = chart_root_[c];
    return c;
  }
  [[nodiscard]] CornerId start(const Step& s) const {
    return root(s.backwards ? features_.curves[s.curve].last : features_.curves[s.curve].first);
  }
  [[nodiscard]] CornerId end(const Step& s) const { return start({s.curve, !s.backwards}); }

  // Direction in which the step leaves its start, over about one cell.
  [[nodiscard]] Vec3 departure(const Step& s) const {
    const Curve& curve = features_.curves[s.curve];
    const auto n = curve.points.size();
    const auto at = [&](std::size_t i) -> const Vec3& { return surface_.points[curve.points[s.backwards ? n - 1 - i : i]]; };
    for (std::size_t i = 1; i < n; ++i)
      if ((at(i) - at(0)).norm() > links_[s.curve].size || i + 1 == n) return (at(i) - at(0)).normalized();
    return Vec3::Zero();
  }

  // Two curves are left where there were more, and one goes on where the other ends.
  [[nodiscard]] bool dissolves(CornerId c) const {
    const auto& ends = ends_[c];
    if (ends.size() != 2 || ends[0].curve == ends[1].curve) return false;
    const Link &a = links_[ends[0].curve], &b = links_[ends[1].curve];
    if (a.border != b.border || features_.curves[ends[0].curve].manifold != features_.curves[ends[1].curve].manifold) return false;
    if (features_.corners[c].curves.size() == 2 && !altered_[c]) return false;  // a corner in its own right
    return departure(ends[0]).dot(-departure(ends[1])) > std::cos(kDissolveTurn);
  }
  void make_chains() {
    for (auto& ends : ends_) ends.clear();
    for (CurveId c : links_.ids()) {
      if (!links_[c].alive) continue;
      for (const bool backwards : {false, true})
        if (const CornerId at = start({c, backwards}); at.valid()) ends_[at].push_back({c, backwards});
    }
    chains_.clear();
    IdMap<CurveId, std::uint8_t> done(links_.size(), std::uint8_t{0});
    IdMap<CornerId, std::uint8_t> through(ends_.size(), std::uint8_t{0});
    for (CornerId c : ends_.ids()) through[c] = dissolves(c) ? 1 : 0;
    const auto follow = [&](Step s) {
      Chain chain;
      chain.first = start(s);
      while (true) {
        chain.steps.push_back(s);
        done[s.curve] = 1;
        const CornerId at = end(s);
        chain.last = at;
        if (!at.valid() || through[at] == 0) break;
        const auto& ends = ends_[at];
        const Step next = ends[0].curve == s.curve ? ends[1] : ends[0];
        if (done[next.curve]) break;
        s = next;
      }
      chain.closed = !chain.first.valid() || chain.first == chain.last;
      if (chain.first.valid() && through[chain.first]) chain.first = chain.last = CornerId();  // a ring of curves
      for (const Step& step : chain.steps) {
        const Link& link = links_[step.curve];
        const double length = features_.curves[step.curve].length;
        chain.length += length;
        chain.size += length * link.size;
        chain.turn += length * link.turn;
        chain.border = link.border;
        for (PointId p : features_.curves[step.curve].points) chain.box.add(surface_.points[p]);
      }
      chain.size /= chain.length;
      chain.turn /= chain.length;
      chains_.push_back(std::move(chain));
    };
    for (CornerId c : ends_.ids())
      if (!through[c])
        for (const Step& s : ends_[c])
          if (!done[s.curve]) follow(s);
    for (CurveId c : links_.ids())
      if (links_[c].alive && !done[c]) follow({c, false});
  }

  void join_charts(const Curve& curve) {
    const ChartId a = root(curve.left), b = root(curve.right);
    if (!a.valid() || !b.valid() || a == b) return;
    const auto [kept, gone] = std::minmax(a, b);
    chart_root_[gone] = kept;
    area_[kept] += area_[gone];
  }
  void drop(const Chain& chain) {
    for (const Step& s : chain.steps) {
      links_[s.curve].alive = false;
      join_charts(features_.curves[s.curve]);
    }
  }

  bool drop_tails() {
    bool any = false;
    for (const Chain& chain : chains_) {
      if (chain.border) continue;
      const double cells = chain.length / chain.size;
      bool small = false;
      if (chain.closed) small = cells < kShortestLoop;
      else {
        small = cells < kShortestTail && (ends_[chain.first].size() == 1 || ends_[chain.last].size() == 1);
      }
      if (small) drop(chain);
      any = any || small;
    }
    return any;
  }

  bool unite_corners() {
    std::vector<const Chain*> shorts;
    for (const Chain& chain : chains_)
      if (!chain.closed && chain.length < kCornerDistance * chain.size) shorts.push_back(&chain);
    std::sort(shorts.begin(), shorts.end(), [](const Chain* a, const Chain* b) {
      return std::tie(a->length, a->steps.front().curve) < std::tie(b->length, b->steps.front().curve);
    });
    IdMap<CornerId, std::uint8_t> busy(ends_.size(), std::uint8_t{0});
    bool any = false;
    for (const Chain* chain : shorts) {
      if (busy[chain->first] || busy[chain->last]) continue;
      // A corner that more curves need is the stronger one.
      const auto rank = [&](CornerId c) { return std::make_pair(-static_cast<std::ptrdiff_t>(ends_[c].size()), c); };
      const auto [kept, gone] =
          rank(chain->first) < rank(chain->last) ? std::pair(chain->first, chain->last) : std::pair(chain->last, chain->first);
      busy[kept] = busy[gone] = 1;
      united_[gone] = kept;
      altered_[kept] = 1;
      for (const Step& s : chain->steps) {
        links_[s.curve].alive = false;
        contracted_[s.curve] = 1;
      }
      any = true;
    }
    return any;
  }

  [[nodiscard]] Vec3 middle_of(const Chain& chain) const {
    const std::vector<PointId>& points = features_.curves[chain.steps[chain.steps.size() / 2].curve].points;
    const std::size_t half = points.size() / 2;
    return 0.5 * (surface_.points[points[half]] + surface_.points[points[half > 0 ? half - 1 : 0]]);
  }
  // Whether the place is within `reach` of the chain.
  [[nodiscard]] bool is_near(const Chain& chain, const Vec3& p, double reach) const {
    if ((p - p.cwiseMax(chain.box.min).cwiseMin(chain.box.max)).norm() > reach) return false;
    return std::any_of(chain.steps.begin(), chain.steps.end(), [&](const Step& s) {
      const Curve& curve = features_.curves[s.curve];
      for (std::size_t i = 0; i + (curve.closed ? 0 : 1) < curve.points.size(); ++i) {
        const Vec3 &a = surface_.points[curve.points[i]], d = surface_.points[curve.points[(i + 1) % curve.points.size()]] - a;
        const double t = d.squaredNorm() > 0 ? std::clamp((p - a).dot(d) / d.squaredNorm(), 0.0, 1.0) : 0;
        if ((a + t * d - p).norm() <= reach) return true;
      }
      return false;
    });
  }
  // Places along a chain, ends left out: they meet others.
  [[nodiscard]] std::vector<Vec3> samples_of(const Chain& chain) const {
    std::vector<Vec3> line;
    for (const Step& s : chain.steps) {
      const Curve& curve = features_.curves[s.curve];
      const std::size_t n = curve.points.size(), count = n + (curve.closed ? 1 : 0);
      for (std::size_t i = 0; i < count; ++i) line.push_back(surface_.points[curve.points[(s.backwards ? 2 * n - 1 - i : i) % n]]);
    }
    std::vector<Vec3> samples;
    const double apart = chain.length / kShadowSamples;
    double next = 0.5 * apart;  // along the line from its point i
    for (std::size_t i = 0; i + 1 < line.size(); ++i) {
      const Vec3 way = line[i + 1] - line[i];
      const double length = way.norm();
      for (; next <= length; next += apart) samples.emplace_back(line[i] + next / length * way);
      next -= length;
    }
    return samples;
  }
  [[nodiscard]] std::array<ChartId, 2> charts_of(const Chain& chain) const {
    const Curve& curve = features_.curves[chain.steps.front().curve];
    return {root(curve.left), root(curve.right)};
  }
  // A crease that runs beside a longer one, far nearer than a cell, across an arm of a chart that may be wide elsewhere.
  bool drop_shadows() {
    IdMap<ChartId, std::vector<const Chain*>> round(chart_root_.size());
    for (const Chain& chain : chains_) {
      const auto [left, right] = charts_of(chain);
      if (left.valid()) round[left].push_back(&chain);
      if (right.valid() && right != left) round[right].push_back(&chain);
    }
    bool any = false;
    for (const Chain& chain : chains_) {
      if (chain.border) continue;
      const double reach = kNarrowest * chain.size;
      const std::vector<Vec3> samples = samples_of(chain);
      const auto hides = [&](const Chain* by) {
        const bool stronger = std::make_tuple(by->border, by->length, chain.steps.front().curve) >
                              std::make_tuple(chain.border, chain.length, by->steps.front().curve);
        return stronger && links_[by->steps.front().curve].alive && runs_beside(samples, *by, reach);
      };
      for (const ChartId chart : charts_of(chain)) {
        if (!chart.valid()) continue;
        const auto by = std::find_if(round[chart].begin(), round[chart].end(), hides);
        if (by == round[chart].end()) continue;
        drop(chain);
        if (!(*by)->border && runs_beside(samples_of(**by), chain, kFlat * chain.size)) add_turn(**by, chain.turn);
        any = true;
        break;
      }
    }
    return any;
  }
  [[nodiscard]] bool runs_beside(const std::vector<Vec3>& samples, const Chain& other, double reach) const {
    auto misses = static_cast<int>((1 - kShadowed) * kShadowSamples);
    return std::all_of(samples.begin(), samples.end(), [&](const Vec3& p) { return is_near(other, p, reach) || misses-- > 0; });
  }

  // One side of a strip is left out: across the other the surface turns by both. Where that is next to nothing, a step much lower than a
  // cell, the other goes too.
  void add_turn(const Chain& to, double turn) {
    for (const Step& s : to.steps) links_[s.curve].turn += turn;
    if (std::abs(to.turn + turn) < kLeastTurn) drop(to);
  }
  void leave_out(const Chain& gone, ChartId strip, double reach) {
    for (const Chain& chain : chains_) {
      const auto [left, right] = charts_of(chain);
      if (&chain == &gone || chain.border || (left != strip && right != strip)) continue;
      if (is_near(gone, middle_of(chain), reach)) add_turn(chain, gone.turn);
    }
    drop(gone);
  }

  // A chart too narrow or too small for a cell is joined to the neighbour across its least sharp border.
  bool open_narrow_charts() {
    struct Rim {
      double length = 0, size = 0;
      const Chain* weakest = nullptr;
    };
    IdMap<ChartId, Rim> rims(chart_root_.size());
    for (const Chain& chain : chains_) {
      const Curve& curve = features_.curves[chain.steps.front().curve];
      const ChartId left = root(curve.left), right = root(curve.right);
      if (left == right) continue;
      for (const ChartId c : {left, right}) {
        if (!c.valid()) continue;
        Rim& rim = rims[c];
        rim.length += chain.length;
        rim.size += chain.length * chain.size;
        if (chain.border) continue;
        // Long borders count: opening the short end of a strip would not widen it.
        const auto weight = [](const Chain& x) { return x.sharpness() / x.length; };
        if (rim.weakest == nullptr || weight(chain) < weight(*rim.weakest)) rim.weakest = &chain;
      }
    }
    bool any = false;
    IdMap<ChartId, std::uint8_t> busy(rims.size(), std::uint8_t{0});
    for (ChartId c : rims.ids()) {
      const Rim& rim = rims[c];
      if (rim.weakest == nullptr) continue;
      const double size = rim.size / rim.length;
      if (area_[c] >= kSmallestChart * size * size && 2 * area_[c] >= kNarrowest * size * rim.length) continue;
      const Curve& curve = features_.curves[rim.weakest->steps.front().curve];
      const ChartId left = root(curve.left), right = root(curve.right);
      if (busy[left] || busy[right]) continue;
      busy[left] = busy[right] = 1;
      leave_out(*rim.weakest, c, std::min(kFacing * 2 * area_[c] / rim.length, kFlat * size));
      any = true;
    }
    return any;
  }

  RoutePlan plan() {
    RoutePlan plan;
    plan.contracted = contracted_;
    plan.stands_for.assign(features_.corners.size(), CornerId());
    for (const Chain& chain : chains_) {
      Route route;
      route.closed = chain.closed;
      route.first = chain.first;
      route.last = chain.last;
      route.border = chain.border;
      route.length = chain.length;
      route.size = chain.size;
      for (const Step& s : chain.steps) {
        const Curve& curve = features_.curves[s.curve];
        route.curves.push_back(s.curve);
        const auto n = curve.points.size();
        const std::size_t count = curve.closed ? n + 1 : n;
        for (std::size_t i = route.points.empty() ? 0 : 1; i < count; ++i)
          route.points.push_back(surface_.points[curve.points[s.backwards ? (2 * n - 1 - i + (curve.closed ? 1 : 0)) % n : i % n]]);
      }
      route.line = Polyline(route.points);
      plan.routes.push_back(std::move(route));
    }
    IdMap<CornerId, std::uint8_t> kept(features_.corners.size(), std::uint8_t{0});
    for (const Route& route : plan.routes)
      for (const CornerId c : {route.first, route.last})
        if (c.valid()) kept[c] = 1;
    for (CornerId c : kept.ids())
      if (features_.corners[c].curves.empty() || kept[root(c)]) plan.stands_for[c] = root(c);
    std::vector<std::size_t> order(plan.routes.size());
    std::iota(order.begin(), order.end(), std::size_t{0});
    const auto rank = [&](std::size_t i) { return std::make_tuple(!plan.routes[i].border, -plan.routes[i].length, i); };
    std::sort(order.begin(), order.end(), [&](std::size_t a, std::size_t b) { return rank(a) < rank(b); });
    std::vector<Route> sorted;
    sorted.reserve(order.size());
    for (const std::size_t i : order) sorted.push_back(std::move(plan.routes[i]));
    plan.routes = std::move(sorted);
    return plan;
  }

  const Surface& surface_;
  const Features& features_;
  IdMap<CurveId, Link> links_;
  IdMap<CurveId, std::uint8_t> contracted_;
  IdMap<CornerId, CornerId> united_;
  IdMap<CornerId, std::uint8_t> altered_;  // others were united with it
  IdMap<CornerId, std::vector<Step>> ends_;  // of alive curves, by united corner
  IdMap<ChartId, ChartId> chart_root_;
  IdMap<ChartId, double> area_;
  std::vector<Chain> chains_;
};

}  // namespace

RoutePlan plan_routes(const Ground& ground, const IdMap<CurveId, std::uint8_t>& let_go, const std::function<double(const Vec3&)>& size_at) {
  return Pruner(ground, let_go, size_at).run();
}

}  // namespace strata
