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
constexpr double kGain = 0.001;    // of it, for which a round's mesh is better than that of an earlier one, which has more creases
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

// Scaled Jacobian as far as it counts; below 0 for a mesh that does not follow the surface, and lower for one that is not valid.
double worth_of(const FitResult& fit) {
  const double worst = std::min(kGood, worst_corner(fit.mesh));
  if (fit.bad > 0) return -2;
  return fit.is_relaxed() ? worst - 1 : worst;
}

}  // namespace

MergedGround::MergedGround(const Ground& of, const IdMap<ChartId, ChartId>& into)
    : features(merge_charts(of.features(), into)), ground(of.surface(), features) {}

FeatureFit fit_features(const HexMesh& smooth, const Ground& ground, Context& context) {
  const Features& features = ground.features();
  FeatureFit best;
  double best_worth = -3;
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
    const std::vector<CurveId> in_the_way =
        may_let_go ? creases_in_the_way(mesh, features, let_go, rule, kSettled) : std::vector<CurveId>();

    const std::vector<CurveId> last_resort =  // all creases round what cannot be valid on them
        round < kMostRounds ? creases_near(mesh, bad_hexes(mesh), features, let_go) : std::vector<CurveId>();
    fit.result = make_valid(std::move(mesh), here, context);
    const double worth = worth_of(fit.result);
    if (worth < kGood && give_way(in_the_way, let_go)) {
      if (worth > best_worth + kGain) best = std::move(fit), best_worth = worth;
      continue;
    }
    if (worth < 0 && give_way(last_resort, let_go)) {
      if (worth > best_worth + kGain) best = std::move(fit), best_worth = worth;
      continue;
    }
    if (worth > best_worth + kGain) best = std::move(fit);
    best.rounds = round + 1;
    return best;
  }
}

}  // namespace strata
