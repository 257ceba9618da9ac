#include "core/fit_features.h"

#include <utility>

#include "core/base/context.h"
#include "core/buffer/wrap.h"
#include "core/features/merge_charts.h"

namespace strata {
namespace {

constexpr int kLetGoRounds = 4;  // of letting creases go, before what is left is freed on the spot
constexpr int kMostRounds = 7;   // in all: where freeing could not make hexes valid, all creases round them go
constexpr std::size_t kFew = 64; // bad hexes, that freeing the vertices round them costs less than any crease
constexpr Goals kArrived{.bad = 0, .poor = 0};        // what is inverted still
constexpr Goals kSettled{.bad = 0.03, .poor = 0.30};

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

}  // namespace

MergedGround::MergedGround(const Ground& of, const IdMap<ChartId, ChartId>& into)
    : features(merge_charts(of.features(), into)), ground(of.surface(), features) {}

FeatureFit fit_features(const HexMesh& smooth, const Ground& ground, Context& context) {
  const Features& features = ground.features();
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
    if (may_let_go && give_way(creases_in_the_way(mesh, features, let_go, rule, kSettled), let_go)) continue;

    IdMap<VertexId, Attachment> held = mesh.attachment;
    fit.result = make_valid(std::move(mesh), here, context);
    if (fit.result.bad > 0 && round < kMostRounds) {
      std::swap(fit.result.mesh.attachment, held);  // what the hexes were held by before they were freed
      if (give_way(creases_near(fit.result.mesh, bad_hexes(fit.result.mesh), features, let_go), let_go)) continue;
      std::swap(fit.result.mesh.attachment, held);
    }
    return fit;
  }
}

}  // namespace strata
