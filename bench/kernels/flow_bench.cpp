// The whole flow over a ladder of sizes, on one thread and on all cores: hexes per core-second, nanoseconds of CPU per hex of every stage, peak
// memory per hex.
//
//     strata_bench --benchmark_filter='Flow/rocket/.*'        a name is Flow/SHAPE/HEXES ASKED FOR/THREADS
//
// Three bodies: the rocket of the examples, a ball in a box (smooth), a bracket (mechanical part, meshed inside), all with six layers. The
// large steps take minutes and gigabytes.
#include <benchmark/benchmark.h>

#ifdef __GLIBC__
#include <malloc.h>
#endif

#include <algorithm>
#include <array>
#include <cmath>
#include <fstream>
#include <string>
#include <thread>
#include <utility>
#include <vector>

#include "bench/shapes/shapes.h"
#include "core/base/context.h"
#include "core/base/parallel.h"
#include "core/mesher.h"

namespace {

using strata::MeshSpec;
using strata::TriangleSoup;

constexpr int kLayers = 6;
constexpr double kFirstHeight = 1.0 / 13;  // of the surface size; six layers with growth 1.2 are then about three quarters of a cell
constexpr double kGrowth = 1.2;

struct Body {
  const char* name;
  strata::shapes::PatchedSurface (*make)(int);
  std::vector<std::string> walls;  // patches with the surface size and layers
  std::vector<strata::Vec3> inside;  // empty: all that is enclosed
  double max_size;
  double size_of_million;  // surface size at which about a million hexes come out
};

const std::vector<Body>& bodies() {
  static const std::vector<Body> all = {
      {"rocket", strata::shapes::rocket, {"nose", "body", "fins", "base", "nozzle_*"}, {strata::Vec3(-2, 1, 0.5)}, 0.7, 0.0215},
      {"ball", strata::shapes::sphere_in_box, {"sphere"}, {strata::Vec3(-2, 1, 0.5)}, 0.5, 0.0078},
      {"bracket", strata::shapes::bracket, {"*"}, {}, 0.25, 0.0195},
  };
  return all;
}

// Layers and the cells beside them follow the surface: the number of hexes goes with the inverse square of the size.
double surface_size(const Body& body, std::int64_t hexes) { return body.size_of_million * std::sqrt(1e6 / static_cast<double>(hexes)); }

// Facets about as long as the cells of 100 thousand hexes, and finer for more.
int fineness(std::int64_t hexes) { return std::clamp(static_cast<int>(std::lround(std::sqrt(static_cast<double>(hexes) / 1e5))), 1, 8); }

TriangleSoup soup_of(const strata::shapes::PatchedSurface& surface) {
  TriangleSoup soup;
  for (const auto& p : surface.points) soup.points.emplace_back(p[0], p[1], p[2]);
  soup.triangles.assign(surface.triangles.begin(), surface.triangles.end());
  soup.patch.assign(surface.patch_of.begin(), surface.patch_of.end());
  soup.patch_names = surface.patch_names;
  return soup;
}

MeshSpec spec_of(const Body& body, double size) {
  MeshSpec spec;
  if (!body.inside.empty()) spec.volume = {strata::VolumeMode::Points, body.inside};
  spec.sizing.max_size = body.max_size;
  spec.sizing.patches.push_back({body.walls, size});
  strata::LayerSpec layers;
  layers.patches = body.walls;
  layers.count = kLayers;
  layers.first_height = kFirstHeight * size;
  layers.growth = kGrowth;
  spec.layers.push_back(layers);
  return spec;
}

// What earlier runs left in the allocator goes back, and Linux forgets the highest memory so far; elsewhere the peak of the process stands
// for that of the run.
void forget_peak_memory() {
#ifdef __GLIBC__
  malloc_trim(0);
#endif
  std::ofstream("/proc/self/clear_refs") << "5\n";
}

void report(benchmark::State& state, const strata::Outcome& outcome) {
  const auto hexes = static_cast<double>(outcome.mesh.hexes.size());
  double cpu = 0;
  std::int64_t peak = 0;
  for (const auto& stage : outcome.stages) {
    cpu += stage.cpu_seconds;
    peak = std::max(peak, stage.peak_rss_bytes);
    state.counters["ns_" + std::string(stage_name(stage.stage))] += stage.cpu_seconds * 1e9 / hexes;
  }
  state.counters["hexes"] = hexes;
  state.counters["hexes_per_core_second"] = hexes / cpu;
  state.counters["bytes_per_hex"] = static_cast<double>(peak) / hexes;
  state.counters["min_scaled_jacobian"] = outcome.quality.all.min;
  state.SetLabel(std::string(rung_name(outcome.rung)));
}

void flow(benchmark::State& state, const Body& body, std::int64_t hexes, int threads) {
  const TriangleSoup soup = soup_of(body.make(fineness(hexes)));
  const MeshSpec spec = spec_of(body, surface_size(body, hexes));
  for ([[maybe_unused]] const auto& step : state) {
    forget_peak_memory();
    strata::Context context;
    strata::Outcome outcome;
    strata::with_threads(threads, [&] { outcome = strata::generate(soup, spec, context); });
    report(state, outcome);
  }
}

[[maybe_unused]] const bool registered = [] {
  const int cores = std::max(1, static_cast<int>(std::thread::hardware_concurrency()));
  for (const Body& body : bodies()) {
    for (const std::int64_t hexes : {100'000, 500'000, 2'000'000, 8'000'000}) {
      for (const int threads : {1, cores}) {
        const std::string name = std::string("Flow/") + body.name + "/" + std::to_string(hexes) + "/" + std::to_string(threads);
        benchmark::RegisterBenchmark(name.c_str(), [&body, hexes, threads](benchmark::State& state) { flow(state, body, hexes, threads); })
            ->Iterations(1)
            ->Unit(benchmark::kSecond)
            ->MeasureProcessCPUTime()
            ->UseRealTime();
        if (cores == 1) break;
      }
    }
  }
  return true;
}();

}  // namespace
