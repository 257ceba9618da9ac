#include "core/fit_features.h"

#include <algorithm>
#include <utility>

#include "core/base/context.h"
#include "core/buffer/wrap.h"
#include "core/features/merge_charts.h"

namespace strata {
namespace {

constexpr int kLetGoRounds = 4;  // of letting creases go, before what is left is freed on the spot
constexpr int kMostRounds = 7;   // in all: where hexes are not valid, or the mesh off the surface for it, all creases round them go
constexpr std::size_t kFew = 64; // bad hexes, that freeing the vertices round them costs less than any crease
constexpr double kGood = 0.40;     // scaled Jacobian: more is worth no crease
constexpr double kFair = 0.2;      // scaled Jacobian, from which on a round that gains nothing is the last
constexpr int kMostStale = 2;      // of such rounds below it
constexpr double kGain = 0.001;    // of it, for which a round's mesh is better than that of an earlier one
constexpr double kLengthWorth = 0.1;  // scaled Jacobian that the length of all curves is worth
constexpr Goals kArrived{};        // what is inverted still
constexpr Goals kSettled{.bad = 0.03, .poor = 0.30, .mediocre = kGood};

bool is_identity(const IdMap<ChartId, ChartId>& map) {
  for (ChartId c : map.ids())
    if (map[c] != c) return false;
  return true;
}

// True: there were some.
bool give_way(const std::vector<CurveId>& creases, IdMap<CurveId, std::uint8_t>& let_go) {
  for (CurveId c : creases) let_go[c] = 1;
  return !creases.empty();
}

double share_of_length(const std::vector<CurveId>& some, const Features& features) {
  double length = 0, whole = 0;
  for (CurveId c : some) length += features.curves[c].length;
  for (const Curve& c : features.curves) whole += c.length;
  return whole > 0 ? length / whole : 0;
}

// Scaled Jacobian as far as it counts, less what the softened curves were worth; lower for a mesh that does not follow the surface, and lowest
// for one that is not valid.
double worth_of(const FeatureFit& fit, const Features& features) {
  if (fit.result.bad > 0) return -2;
  const double worth = std::min(kGood, worst_jacobian(fit.result.mesh)) - kLengthWorth * share_of_length(fit.softened, features);
  return fit.result.is_relaxed() ? worth - 1 : worth;
}

}  // namespace

MergedGround::MergedGround(const Ground& of, const IdMap<ChartId, ChartId>& into)
    : features(merge_charts(of.features(), into)), ground(of.surface(), features) {}

FeatureFit fit_features(const HexMesh& smooth, const Ground& ground, Context& context) {
  const Features& features = ground.features();
  FeatureFit best;
  double best_worth = -3;
  int stale = 0;  // rounds in a row that gained nothing
  IdMap<CurveId, std::uint8_t> let_go(features.curves.size(), 0);
  for (int round = 0;; ++round) {
    FeatureFit fit;
    Match matched = match_features(smooth, ground, let_go, context);
    if (!is_identity(matched.chart_of)) fit.merged = std::make_unique<const MergedGround>(ground, matched.chart_of);
    fit.softened = std::move(matched.softened);
    const Ground& here = fit.merged ? fit.merged->ground : ground;
    if (round == 0) context.begin(Stage::WrapRidges);
    HexMesh mesh = wrap_ridges(std::move(matched.mesh), here.features(), matched.creases, context);
    if (round == 0) context.begin(Stage::FitToFeatures);

    const bool may_let_go = round < kLetGoRounds;
    const GiveWay rule = round == 0 ? GiveWay::Weakest : GiveWay::All;
    mesh = arrive_at_features(std::move(mesh), here, context);
    if (may_let_go && bad_hexes(mesh).size() > kFew && give_way(creases_in_the_way(mesh, features, let_go, rule, kArrived), let_go))
      continue;
    mesh = settle_on_features(std::move(mesh), here, context);
    const std::vector<CurveId> before_freeing =
        may_let_go ? creases_in_the_way(mesh, features, let_go, rule, kSettled) : std::vector<CurveId>();

    const std::vector<CurveId> last_resort =  // all creases round what cannot be valid on them
        round < kMostRounds ? creases_near(mesh, bad_hexes(mesh), features, let_go) : std::vector<CurveId>();
    fit.result = make_valid(std::move(mesh), here, context);
    const double worth = worth_of(fit, features);
    const bool is_valid = fit.result.bad == 0 && !fit.result.is_relaxed();
    std::vector<CurveId> in_the_way;
    if (may_let_go && is_valid) in_the_way = creases_in_the_way(fit.result.mesh, features, let_go, GiveWay::Weakest, kSettled);
    if (in_the_way.empty() && worth < kFair) in_the_way = before_freeing;
    const bool wins = worth > best_worth + kGain;
    if (wins) best = std::move(fit), best_worth = worth;
    stale = wins ? 0 : stale + 1;
    if (stale < (best_worth < kFair ? kMostStale : 1) && give_way(in_the_way, let_go)) continue;
    if (!is_valid && give_way(last_resort, let_go)) continue;
    best.rounds = round + 1;
    return best;
  }
}

}  // namespace strata
