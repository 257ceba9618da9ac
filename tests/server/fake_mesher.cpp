#include "tests/server/fake_mesher.h"

#include <chrono>
#include <string>
#include <thread>
#include <utility>

#include "core/mesher.h"

namespace strata::server {
namespace {

using namespace std::chrono_literals;

HexMesh stack_of_cubes(int count) {
  HexMesh mesh;
  for (int level = 0; level <= count; ++level)
    for (const auto& [x, y] : {std::pair{0, 0}, {1, 0}, {1, 1}, {0, 1}}) mesh.position.push_back(Vec3(x, y, level));
  for (int i = 0; i < count; ++i) {
    HexVertices hex;
    for (int k = 0; k < 8; ++k) hex[static_cast<std::size_t>(k)] = VertexId(4 * i + k);
    mesh.hexes.push_back(hex);
    mesh.region.push_back(RegionId(0));
    mesh.layer.push_back(0);
  }
  mesh.quads.push_back({VertexId(0), VertexId(3), VertexId(2), VertexId(1)});
  mesh.patch.push_back(PatchId(0));
  return mesh;
}

}  // namespace

void FakeMesher::tell_estimate(const TriangleSoup& soup, const Observer& observer) const {
  if (!observer.on_estimate) return;
  Estimate estimate;
  estimate.triangles = static_cast<std::int64_t>(soup.triangles.size());
  estimate.memory_bytes = needed_memory;
  observer.on_estimate(estimate);
}

Outcome FakeMesher::generate(const TriangleSoup& soup, Context& context) {
  on_generate();
  context.begin(Stage::RefineOctree);
  while (held_) {
    context.progress(0.5, 1);
    std::this_thread::sleep_for(2ms);
  }
  context.begin(Stage::MeasureQuality);
  Diagnostic thinner;
  thinner.reason = Reason::LayersThinned;
  thinner.severity = Severity::Warning;
  thinner.message = "thinner";
  context.adjusted(thinner);
  Outcome outcome;
  outcome.mesh = stack_of_cubes(hexes);
  for (const std::string& name : soup.patch_names) outcome.patch_names.push_back(name);
  outcome.quality.all.count = hexes;
  outcome.rung = Rung::LayersThinned;
  outcome.adjustments = context.adjustments();
  return outcome;
}

MesherDoor FakeMesher::door() {
  return {[this](const TriangleSoup& soup, const MeshSpec&, Context& context, const Observer& observer) {
            before_estimate(context);
            tell_estimate(soup, observer);
            return generate(soup, context);
          },
          [](const TriangleSoup& soup, const MeshSpec&, Context&) {
            CheckReport report;
            report.patch_names = soup.patch_names;
            report.estimate.triangles = static_cast<std::int64_t>(soup.triangles.size());
            return report;
          },
          [](const MeshSpec& spec, const std::vector<std::string>&) {
            std::vector<Diagnostic> findings;
            if (!spec.sizing.max_size || *spec.sizing.max_size > 0) return findings;
            findings.emplace_back();
            findings.back().reason = Reason::SpecInvalid;
            findings.back().field = "sizing.max_size";
            findings.back().message = "sizing.max_size must be more than 0";
            return findings;
          }};
}

}  // namespace strata::server
