#include "server/check_run.h"

#include <new>
#include <utility>

#include "core/base/parallel.h"
#include "core/mesher.h"
#include "server/cell_cap.h"
#include "server/convert.h"
#include "server/job_error.h"
#include "server/refusal.h"

namespace strata::server {
namespace {

// Ends a run as soon as it knows.
struct CostKnown {
  Estimate cost;
};

// What the run itself will reserve: the same door up to the octree.
Estimate cost_of(TriangleSoup soup, MeshSpec spec, std::int64_t budget, const MesherDoor& mesher, const std::atomic<bool>& cancelled) {
  CellCap cap;
  cap.put_on(spec, budget);
  Context context(&cancelled, {}, [&](const Diagnostic& adjustment) { cap.hear(adjustment); });
  Estimate grown;
  Observer observer;
  observer.on_estimate = [](const Estimate& estimate) { throw CostKnown{estimate}; };
  try {
    mesher.generate(std::move(soup), spec, context, observer);
  } catch (const CostKnown& known) {
    grown = known.cost;
  }
  return cap.of_what_was_asked(grown);
}

void fill(const CheckReport& report, v1::ValidateJobResponse& response) {
  bool acceptable = true;
  for (const Diagnostic& finding : report.findings) {
    acceptable = acceptable && finding.severity != Severity::Error;
    *response.add_findings() = to_wire(finding);
  }
  response.set_acceptable(acceptable);
  for (const std::string& name : report.patch_names) {
    v1::PatchReference& patch = *response.add_patches();
    patch.set_name(name);
    patch.set_reference(response.patches_size());
  }
  if (acceptable) *response.mutable_estimate() = to_wire(report.estimate);
}

void look(const CheckOrder& order, const std::vector<char>& bytes, std::int64_t budget, const MesherDoor& mesher,
          const std::atomic<bool>& cancelled, v1::ValidateJobResponse& response) {
  const MeshSpec spec = from_wire(order.spec);
  TriangleSoup soup = read_wire_surface(order.surface, bytes);
  TriangleSoup again = order.depth == CheckDepth::All ? soup : TriangleSoup();
  const Estimate cost = cost_of(std::move(soup), spec, budget, mesher, cancelled);
  refuse_what_never_fits(cost.memory_bytes, budget);
  if (order.depth == CheckDepth::Cost) {
    response.set_acceptable(true);
    *response.mutable_estimate() = to_wire(cost);
    return;
  }
  Context context(&cancelled, {});
  fill(mesher.check_request(std::move(again), spec, context), response);
}

}  // namespace

Checked run_check(const CheckOrder& order, const std::function<std::vector<char>()>& bytes, std::int64_t memory_budget_bytes,
                  const MesherDoor& mesher, const std::atomic<bool>& cancelled) {
  Checked checked;
  try {
    with_threads(order.threads, [&] { look(order, bytes(), memory_budget_bytes, mesher, cancelled, checked.report); });
  } catch (const MeshError& error) {
    // What is wrong with the surface or the specification is the answer; the rest means that there is none.
    if (error.failure() == Failure::InvalidInput) *checked.report.add_findings() = to_wire(error.diagnostic());
    else checked.error = to_wire(error);
  } catch (const Refusal& refusal) {
    checked.error = job_error(13, refusal.reason, refusal.what());
  } catch (const std::bad_alloc&) {
    checked.error = job_error(8, "MEMORY_BUDGET_EXCEEDED", "the surface needs more memory than there is");
  } catch (const std::exception& error) {
    checked.error = job_error(13, "INTERNAL", std::string("unexpected failure: ") + error.what());
  }
  return checked;
}

}  // namespace strata::server
