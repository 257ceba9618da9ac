// The whole mesher in one process, without a socket: what profilers and whole-flow benchmarks run.
//
//     mesh_in_process SURFACE SPEC.json OUT [--without-layers] [--threads N] [--tell] [--worst N]
//
// Prints one line per stage (wall and CPU seconds, peak memory), then what came out. --tell: the quality after stages too, which the service
// tells whoever watches a job.
#include <algorithm>
#include <array>
#include <cstdio>
#include <cstdlib>
#include <fstream>
#include <iomanip>
#include <iostream>
#include <iterator>
#include <string>
#include <string_view>
#include <thread>
#include <vector>

#include "core/base/context.h"
#include "core/base/parallel.h"
#include "core/io/mesh_io.h"
#include "core/io/surface_io.h"
#include "core/mesher.h"
#include "server/convert.h"
#include "server/spec_json.h"

namespace {

std::string read_all(const std::string& path) {
  std::ifstream in(path, std::ios::binary);
  if (!in) {
    std::cerr << "cannot read " << path << "\n";
    std::exit(2);
  }
  return {std::istreambuf_iterator<char>(in), {}};
}

// The poorest hexes: where they lie and what holds their vertices.
void print_worst(const strata::HexMesh& mesh, std::size_t count) {
  using namespace strata;
  std::vector<std::pair<double, HexId>> order;
  for (HexId h : mesh.hexes.ids()) {
    std::array<Vec3, 8> p;
    for (std::size_t c = 0; c < 8; ++c) p[c] = mesh.position[mesh.hexes[h][c]];
    order.emplace_back(corner_scaled_jacobian(p), h);
  }
  std::sort(order.begin(), order.end());
  order.resize(std::min(order.size(), count));
  for (const auto& [jacobian, h] : order) {
    Vec3 centre = Vec3::Zero();
    for (VertexId v : mesh.hexes[h]) centre += mesh.position[v] / 8;
    std::printf("  %8.4f hex %d at (%.4g %.4g %.4g):", jacobian, h.value, centre.x(), centre.y(), centre.z());
    for (VertexId v : mesh.hexes[h]) {
      const Attachment a = mesh.attachment[v];
      constexpr const char* kNames = ".skcX";  // free, surface, curve, corner, fixed
      std::printf(" %c", kNames[static_cast<std::size_t>(a.hold)]);
      if (a.hold != Hold::Free) std::printf("%d", a.of);
    }
    std::printf("\n");
  }
}

}  // namespace

int main(int argc, char** argv) {
  using namespace strata;
  if (argc < 4) {
    std::cerr << "usage: mesh_in_process SURFACE SPEC.json OUT [--without-layers] [--threads N] [--tell] [--worst N]\n";
    return 2;
  }
  bool layers = true, tell = false;
  int threads = 0;
  std::size_t worst = 0;
  for (int i = 4; i < argc; ++i) {
    if (std::string_view(argv[i]) == "--without-layers") layers = false;
    if (std::string_view(argv[i]) == "--tell") tell = true;
    if (std::string_view(argv[i]) == "--threads" && i + 1 < argc) threads = std::atoi(argv[++i]);
    if (std::string_view(argv[i]) == "--worst" && i + 1 < argc) worst = std::strtoul(argv[++i], nullptr, 10);
  }
  try {
    Context context(nullptr, {}, [](const Diagnostic& d) { std::printf("  note: %s\n", d.message.c_str()); });
    MeshSpec spec = server::from_wire(server::parse_spec(read_all(argv[2])));
    if (!layers) spec.layers.clear();
    context.begin(Stage::Read);
    TriangleSoup soup = io::read_surface_file(argv[1]);
    Outcome outcome;
    Observer observer;
    if (tell)
      observer.on_quality = [](Stage stage, const Quality& q) {
        std::printf("after %s: SJ min %.4f mean %.4f\n", std::string(stage_name(stage)).c_str(), q.all.min, q.all.mean);
      };
    with_threads(threads > 0 ? threads : static_cast<int>(std::thread::hardware_concurrency()),
                 [&] { outcome = generate(std::move(soup), spec, context, observer); });
    double wall = 0, cpu = 0;
    for (const StageRecord& s : outcome.stages) {
      std::printf("%-18s %8.2f s wall %8.2f s cpu %7.0f MB\n", std::string(stage_name(s.stage)).c_str(), s.seconds, s.cpu_seconds,
                  static_cast<double>(s.peak_rss_bytes) / 1e6);
      wall += s.seconds, cpu += s.cpu_seconds;
    }
    const auto hexes = static_cast<double>(outcome.mesh.hexes.size());
    std::printf("%zu hexes, %.2f s wall, %.2f s cpu, %.0f hexes per core-second, SJ min %.4f mean %.4f, rung %s\n",
                outcome.mesh.hexes.size(), wall, cpu, hexes / cpu, outcome.quality.all.min, outcome.quality.all.mean,
                std::string(rung_name(outcome.rung)).c_str());
    print_worst(outcome.mesh, worst);
    std::ofstream patches(std::string(argv[3]) + ".patches.json");
    patches << "{\"patches\": {";
    for (PatchId p : outcome.patch_names.ids())
      patches << (p.value ? ", " : "") << std::quoted(outcome.patch_names[p]) << ": " << p.value + 1;
    patches << "}}\n";
    io::write_mesh_file(outcome.mesh, argv[3], {});
    return 0;
  } catch (const MeshError& error) {
    std::printf("failed: %s\n", error.what());
    return 1;
  }
}
