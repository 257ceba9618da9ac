// What the door promises whatever the shape: determinism, invariance, cancellation, progress, refusals.
#include <oneapi/tbb/global_control.h>

#include <atomic>
#include <chrono>
#include <random>

#include "tests/flow/flow.h"

namespace strata::testing {
namespace {

using namespace test;  // shapes

struct Job {
  TriangleSoup soup;
  MeshSpec spec;
};
// A curved wall, rims, and layers: every stage has work to do. Small.
Job cylinder_job() { return {cylinder(32, 1.5, 4), with_layers(sized(0.3), layers_of({"side"}, 2, 0.02))}; }
Job cube_job() { return {rotated(cube(3), Vec3(1, 2, 3), 0.5), with_layers(sized(0.2), layers_of({"z_min"}, 2, 0.02))}; }

TEST(Door, MakesTheSameBytesForAnyNumberOfThreads) {
  for (const Job& job : {cylinder_job(), cube_job()}) {
    std::vector<Outcome> outcomes;
    for (const std::size_t threads : {1, 2, 4}) {
      const tbb::global_control limit(tbb::global_control::max_allowed_parallelism, threads);
      outcomes.push_back(run(job.soup, job.spec));
    }
    EXPECT_TRUE(same_bytes(outcomes[0].mesh, outcomes[1].mesh)) << "2 threads";
    EXPECT_TRUE(same_bytes(outcomes[0].mesh, outcomes[2].mesh)) << "4 threads";
  }
}

// Rounding differs, so optimisation stops at points a little apart: the worst hex shows it, the mean hardly.
constexpr double kSameMin = 0.02, kSameMean = 1e-3;
void expect_equal_figures(const Outcome& a, const Outcome& b) {
  EXPECT_EQ(a.quality.all.count, b.quality.all.count);
  EXPECT_EQ(a.quality.quads, b.quality.quads);
  EXPECT_EQ(a.quality.layers.count, b.quality.layers.count);
  EXPECT_NEAR(a.quality.all.min, b.quality.all.min, kSameMin);
  EXPECT_NEAR(a.quality.all.mean, b.quality.all.mean, kSameMean);
  EXPECT_EQ(a.rung, b.rung);
}

MeshSpec scaled_lengths(MeshSpec spec, double factor) {
  *spec.sizing.max_size *= factor;
  for (LayerSpec& l : spec.layers) *l.first_height *= factor;
  return spec;
}

TEST(Door, GivesEqualFiguresWhenTrianglesAreShuffled) {
  const Job job = cube_job();
  expect_equal_figures(run(job.soup, job.spec), run(shuffled(job.soup, 5), job.spec));
}

TEST(Door, GivesEqualFiguresInEveryUnit) {
  const Job job = cube_job();
  const Outcome outcome = run(job.soup, job.spec);
  for (const double factor : {1e-3, 1e3}) {
    const Outcome other = run(scaled(job.soup, factor), scaled_lengths(job.spec, factor));
    expect_equal_figures(outcome, other);
    EXPECT_NEAR(meshed_volume(other) / std::pow(factor, 3), meshed_volume(outcome), 1e-3);
  }
}

TEST(Door, GivesEqualFiguresFarFromTheOrigin) {
  const Job job = cube_job();
  const double far = 1e4 * diagonal_of(job.soup);
  expect_equal_figures(run(job.soup, job.spec), run(shifted(job.soup, Vec3(far, -far, far)), job.spec));
}

TEST(Door, TellsProgressThatOnlyRises) {
  std::vector<Progress> told;
  Context context(nullptr, [&](const Progress& p) { told.push_back(p); });
  const Job job = cylinder_job();
  const Outcome outcome = generate(job.soup, job.spec, context);
  ASSERT_GT(told.size(), 10U);
  for (std::size_t i = 0; i < told.size(); ++i) {
    EXPECT_GE(told[i].stage_fraction, 0);
    EXPECT_LE(told[i].stage_fraction, 1);
    if (i == 0) continue;
    EXPECT_GE(told[i].stage, told[i - 1].stage) << "stages come in their order";
    const double least = told[i].stage == told[i - 1].stage ? told[i - 1].stage_fraction : 0;
    EXPECT_GE(told[i].stage_fraction, least) << stage_name(told[i].stage) << ", call " << i;
  }
  EXPECT_EQ(told.back().stage, Stage::MeasureQuality);
  for (std::size_t i = 1; i < outcome.stages.size(); ++i) EXPECT_GT(outcome.stages[i].stage, outcome.stages[i - 1].stage);
}

TEST(Door, CancelsAtEveryCallOfProgress) {
  const Job job = cylinder_job();
  int calls = 0;
  {
    Context context(nullptr, [&](const Progress&) { ++calls; });
    generate(job.soup, job.spec, context);
  }
  std::mt19937 random(41);
  for (int round = 0; round < 8; ++round) {
    const int at = std::uniform_int_distribution<int>(1, calls - 1)(random);
    std::atomic<bool> cancel = false;
    int call = 0;
    Context context(&cancel, [&](const Progress&) {
      if (++call == at) cancel = true;
    });
    try {
      generate(job.soup, job.spec, context);
      // Only the last stretch of the last stage may run to its end.
      EXPECT_GE(at, calls - 1) << "call " << at << " of " << calls;
    } catch (const MeshError& error) {
      EXPECT_EQ(error.failure(), Failure::Cancelled);
      EXPECT_EQ(error.diagnostic().reason, Reason::Cancelled);
    }
    EXPECT_LE(call, at + 1) << "cancelled at call " << at << " of " << calls;
  }
}

Reason refusal(TriangleSoup soup, const MeshSpec& spec, Failure failure = Failure::InvalidInput) {
  try {
    run(std::move(soup), spec);
  } catch (const MeshError& error) {
    EXPECT_EQ(error.failure(), failure) << error.what();
    EXPECT_FALSE(std::string(error.what()).empty());
    return error.diagnostic().reason;
  }
  ADD_FAILURE() << "not refused";
  return Reason::InvariantViolated;
}

TEST(Door, RefusesEmptySurfaces) {
  EXPECT_EQ(refusal({{}, {}, {}, {"surface"}}, sized(0.1)), Reason::SurfaceEmpty);
  EXPECT_EQ(refusal({{}, {}, {}, {}}, {}), Reason::SurfaceEmpty);
}

TEST(Door, RefusesCoordinatesThatAreNotFinite) {
  TriangleSoup soup = cube(2);
  soup.points[3].y() = std::nan("");
  EXPECT_EQ(refusal(soup, sized(0.2)), Reason::SurfaceNonFinite);
}

TEST(Door, RefusesUnknownPatches) {
  EXPECT_EQ(refusal(cube(2), with_layers(sized(0.2), layers_of({"wing"}, 2, 0.01))), Reason::PatchUnknown);
}

TEST(Door, RefusesImpossibleSizes) {
  EXPECT_EQ(refusal(cube(2), sized(0)), Reason::SpecInvalid);
  EXPECT_EQ(refusal(cube(2), sized(-1)), Reason::SpecInvalid);
  EXPECT_EQ(refusal(cube(2), sized(std::nan(""))), Reason::SpecInvalid);
}

TEST(Door, RefusesSeedsOutside) {
  MeshSpec spec = sized(0.2);
  spec.volume = {VolumeMode::Points, {Vec3(5, 5, 5)}};
  EXPECT_EQ(refusal(cube(2), spec), Reason::RegionNotFound);
}

TEST(Door, ChecksRequestsWithoutMeshing) {
  Context context;
  const CheckReport good = check_request(cube(2), sized(0.1), context);
  EXPECT_TRUE(good.findings.empty());
  EXPECT_EQ(good.patch_names.size(), 6U);
  EXPECT_EQ(good.estimate.triangles, 48);
  const auto meshed = static_cast<double>(run(cube(2), sized(0.1)).quality.all.count);
  EXPECT_GT(static_cast<double>(good.estimate.hexes), meshed / 4);
  EXPECT_LT(static_cast<double>(good.estimate.hexes), meshed * 4);
  Context other;
  const CheckReport bad = check_request(cube(2), with_layers(sized(0.1), layers_of({"wing"}, 2, 0.01)), other);
  ASSERT_EQ(bad.findings.size(), 1U);
  EXPECT_EQ(bad.findings[0].reason, Reason::PatchUnknown);
  EXPECT_EQ(bad.estimate.hexes, 0);
}

}  // namespace
}  // namespace strata::testing
