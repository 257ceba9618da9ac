#include "core/ladder.h"

#include <array>
#include <cstdint>
#include <new>
#include <string>
#include <utility>
#include <vector>

#include "core/base/context.h"
#include "core/base/parallel.h"
#include "core/fit/part_contacts.h"
#include "core/optimise/optimise.h"
#include "core/quality/contacts.h"
#include "core/quality/quality.h"

namespace strata {
namespace {

constexpr double kFlat = 0.02;  // scaled Jacobian of hexes that the wrap leaves too flat
constexpr int kSweeps = 30;     // to free them

Diagnostic unforeseen(const char* what) {
  Diagnostic diagnostic;
  diagnostic.reason = Reason::InvariantViolated;
  diagnostic.message = what;
  return diagnostic;
}

Diagnostic describe(const HexMesh& mesh, const std::vector<Contact>& contacts) {
  Diagnostic diagnostic;
  diagnostic.reason = Reason::InvariantViolated;
  diagnostic.count = static_cast<std::int64_t>(contacts.size());
  diagnostic.message = "the skin touches itself at " + std::to_string(contacts.size()) + " places, the first at vertex " +
                       std::to_string(contacts.front().vertex.value);
  for (const Contact& c : contacts) diagnostic.box.add(mesh.position[c.vertex]);
  return diagnostic;
}

}  // namespace

std::optional<Diagnostic> failure_of(const std::function<void()>& part) {
  try {
    part();
    return {};
  } catch (const MeshError& error) {
    if (error.failure() != Failure::Internal) throw;
    return error.diagnostic();
  } catch (const std::bad_alloc&) {
    throw;
  } catch (const std::exception& error) {
    return unforeseen(error.what());
  }
}

void report_fall(const Diagnostic& failure, Reason reason, const std::string& what, Context& context) {
  Diagnostic diagnostic = failure;
  diagnostic.reason = reason;
  diagnostic.severity = Severity::Warning;
  diagnostic.message = what + " (" + failure.message + ")";
  context.adjusted(std::move(diagnostic));
}

void require(const HexMesh& mesh, const Promises& promises) {
  if (auto broken = check_mesh(mesh, promises)) throw MeshError(Failure::Internal, std::move(*broken));
}

void require_in_input(const HexMesh& mesh, const Frame& frame) {
  HexMesh written = mesh;
  for (Vec3& p : written.position) p = frame.to_input(p);
  require(written);
}

void require_no_contacts(const HexMesh& mesh) {
  if (const auto contacts = find_contacts(mesh); !contacts.empty()) throw MeshError(Failure::Internal, describe(mesh, contacts));
}

HexMesh label_by_nearest(HexMesh mesh, const Ground& ground) {
  mesh.patch.resize(mesh.quads.size());
  mesh.chart.resize(mesh.quads.size());
  parallel_for(
      mesh.quads.size(),
      [&](std::size_t i) {
        const QuadId q(i);
        Vec3 centre = Vec3::Zero();
        for (VertexId v : mesh.quads[q]) centre += 0.25 * mesh.position[v];
        const TriangleId near = ground.closest(centre).triangle;
        mesh.patch[q] = ground.surface().patch[near];
        mesh.chart[q] = ground.features().chart[near];
      },
      128);
  return mesh;
}

HexMesh make_staircase(HexMesh wrapped, const Ground& ground, Context& context) {
  wrapped = label_by_nearest(std::move(wrapped), ground);
  IdMap<VertexId, std::uint8_t> movable(wrapped.position.size(), std::uint8_t{0});
  bool any = false;
  for (HexId h : wrapped.hexes.ids()) {
    if (corner_scaled_jacobian(corners_of(wrapped, h)) > kFlat) continue;
    any = true;
    for (VertexId v : wrapped.hexes[h]) movable[v] = 1;
  }
  if (!any) return wrapped;
  OptimiseRequest request;
  request.ground = &ground;
  request.movable = &movable;
  OptimiseOptions options;
  options.sweeps = kSweeps;
  return optimise(std::move(wrapped), request, options, context).mesh;
}

void report_folded(const HexMesh& mesh, Context& context) {
  const std::vector<HexId> folded = folded_hexes(mesh);
  if (folded.empty()) return;
  Diagnostic diagnostic;
  diagnostic.reason = Reason::QualityBelowGoal;
  diagnostic.severity = Severity::Warning;
  diagnostic.count = static_cast<std::int64_t>(folded.size());
  diagnostic.values = {{"hexes", static_cast<double>(folded.size())}};
  for (HexId h : folded)
    for (VertexId v : mesh.hexes[h]) diagnostic.box.add(mesh.position[v]);
  diagnostic.message = std::to_string(folded.size()) +
                       " hexes are positive at their corners and centre but not everywhere inside; smaller cells there would help";
  context.adjusted(std::move(diagnostic));
}

OffItself take_off_itself(HexMesh mesh, Context& context) {
  PartedContacts parted = part_contacts(std::move(mesh));
  if (parted.left > 0) require_no_contacts(parted.mesh);
  if (parted.moved > 0) {
    Diagnostic diagnostic;
    diagnostic.reason = Reason::SurfaceFitRelaxed;
    diagnostic.severity = Severity::Warning;
    diagnostic.count = parted.moved;
    diagnostic.values = {{"vertices", static_cast<double>(parted.moved)}};
    diagnostic.message = std::to_string(parted.moved) + " boundary vertices were drawn in, because the skin touched itself there";
    context.adjusted(std::move(diagnostic));
  }
  return {std::move(parted.mesh), parted.moved > 0};
}

}  // namespace strata
