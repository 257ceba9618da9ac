#include "server/mesh_job.h"

#include <sys/resource.h>

#include <chrono>
#include <new>
#include <utility>

#include "core/base/parallel.h"
#include "core/io/mesh_io.h"
#include "core/mesher.h"
#include "server/cell_cap.h"
#include "server/convert.h"
#include "server/job_error.h"
#include "server/progress_meter.h"
#include "server/refusal.h"

namespace strata::server {
namespace {

constexpr int kMaxAdjustments = 1000;  // in the record; far below the 4 MiB of a message

void store_bytes(BlobWriter& writer, std::span<const char> bytes) { writer.write({bytes.data(), bytes.size()}); }

void write_artifact(const HexMesh& mesh, v1::OutputFormat format, v1::Artifact& artifact, BlobWriter& writer) {
  const io::ByteSink sink = [&](std::span<const char> bytes) { store_bytes(writer, bytes); };
  switch (format) {
    case v1::OUTPUT_FORMAT_MESH: return io::write_mesh(mesh, io::MeshFormat::MeditAscii, {}, sink);
    case v1::OUTPUT_FORMAT_MESHB: return io::write_mesh(mesh, io::MeshFormat::MeditBinary, {}, sink);
    case v1::OUTPUT_FORMAT_VTU: return io::write_mesh(mesh, io::MeshFormat::Vtu, {}, sink);
    case v1::OUTPUT_FORMAT_VTK: return io::write_mesh(mesh, io::MeshFormat::Vtk, {}, sink);
    case v1::OUTPUT_FORMAT_LAYER_SOL: return io::write_layer_solution(mesh, io::MeshFormat::MeditAscii, sink);
    case v1::OUTPUT_FORMAT_LAYER_SOLB: return io::write_layer_solution(mesh, io::MeshFormat::MeditBinary, sink);
    default: *artifact.mutable_blocks() = blocks_of(mesh); return write_blocks(mesh, artifact.blocks(), sink);
  }
}

// Artifacts that are taken back unless all of them are there.
class ArtifactSet {
 public:
  ArtifactSet(BlobStore& blobs, std::string owner) : blobs_(blobs), owner_(std::move(owner)) {}
  ~ArtifactSet() {
    for (const v1::Artifact& artifact : artifacts_) blobs_.remove(artifact.blob().blob_id());
  }
  void add(const HexMesh& mesh, v1::OutputFormat format) {
    v1::Artifact artifact;
    artifact.set_format(format);
    const auto writer = blobs_.create(owner_);
    write_artifact(mesh, format, artifact, *writer);
    const BlobInfo blob = writer->publish();
    artifact.mutable_blob()->set_blob_id(blob.id);
    artifact.mutable_blob()->set_size_bytes(blob.size);
    artifact.mutable_blob()->set_sha256(blob.sha256);
    artifacts_.push_back(std::move(artifact));
  }
  void hand_over(v1::Job& job) {
    for (v1::Artifact& artifact : artifacts_) *job.add_artifacts() = std::move(artifact);
    artifacts_.clear();
  }

 private:
  BlobStore& blobs_;
  const std::string owner_;
  std::vector<v1::Artifact> artifacts_;
};

void record_outcome(const Outcome& outcome, v1::Job& job) {
  job.set_rung(to_wire(outcome.rung));
  for (const PatchId patch : outcome.patch_names.ids()) {
    v1::PatchReference& reference = *job.add_patches();
    reference.set_name(outcome.patch_names[patch]);
    reference.set_reference(patch.value + 1);
  }
  *job.mutable_quality() = to_wire(outcome.quality);
  job.set_hexes(outcome.quality.all.count);
  job.set_layer_hexes(outcome.quality.layers.count);
  job.set_adjustments_total(static_cast<std::int64_t>(outcome.adjustments.size()));
  for (const Diagnostic& adjustment : outcome.adjustments) {
    if (job.adjustments_size() == kMaxAdjustments) break;
    *job.add_adjustments() = to_wire(adjustment);
  }
}

void tell_quality(v1::Stage stage, const v1::Quality& quality, const EventSink& sink) {
  v1::WatchJobResponse event;
  event.mutable_quality()->set_stage(stage);
  *event.mutable_quality()->mutable_quality() = quality;
  sink(std::move(event));
}

Observer observer_of(const CellCap& cap, const MemoryGate& gate, const EventSink& sink) {
  Observer observer;
  observer.on_estimate = [&](const Estimate& grown) {
    const Estimate estimate = cap.of_what_was_asked(grown);
    v1::WatchJobResponse event;
    *event.mutable_estimate() = to_wire(estimate);
    sink(std::move(event));
    gate(estimate);
  };
  observer.on_quality = [&](Stage stage, const Quality& quality) { tell_quality(to_wire(stage), to_wire(quality), sink); };
  return observer;
}

void produce(const JobOrder& order, BlobStore& blobs, const MesherDoor& mesher, Context& context, CellCap& cap, const MemoryGate& gate,
             const EventSink& sink, v1::Job& job) {
  context.begin(Stage::Read);
  const v1::Surface& surface = order.request.surface();
  const auto blob = blobs.find(surface.blob_id());
  if (!blob) throw Refusal(Refused::NotFound, "BLOB_NOT_FOUND", "the surface of the job is no longer stored");
  TriangleSoup soup = read_wire_surface(surface, read_all(blobs, *blob));
  MeshSpec spec = from_wire(order.request.spec());
  cap.put_on(spec, order.memory_budget_bytes);
  const Outcome outcome = mesher.generate(std::move(soup), spec, context, observer_of(cap, gate, sink));
  record_outcome(outcome, job);
  tell_quality(v1::STAGE_MEASURE_QUALITY, job.quality(), sink);

  context.begin(Stage::Write);
  ArtifactSet artifacts(blobs, order.owner);
  for (int i = 0; i < order.request.outputs_size(); ++i) {
    context.progress(static_cast<double>(i) / order.request.outputs_size(), outcome.quality.all.count);
    artifacts.add(outcome.mesh, order.request.outputs(i));
  }
  context.end();
  context.checkpoint();
  artifacts.hand_over(job);
}

double seconds(const timeval& t) { return static_cast<double>(t.tv_sec) + 1e-6 * static_cast<double>(t.tv_usec); }

rusage process_usage() {
  rusage usage{};
  getrusage(RUSAGE_SELF, &usage);
  return usage;
}

void run_guarded(const JobOrder& order, BlobStore& blobs, const MesherDoor& mesher, Context& context, CellCap& cap, const MemoryGate& gate,
                 const EventSink& sink, v1::Job& job) {
  try {
    with_threads(order.threads, [&] { produce(order, blobs, mesher, context, cap, gate, sink, job); });
    job.set_state(v1::JOB_STATE_SUCCEEDED);
  } catch (const MeshError& error) {
    job = ended_badly(to_wire(error));  // nothing of a result stays
  } catch (const Refusal& refusal) {
    job = ended_badly(job_error(refusal.kind == Refused::ResourceExhausted ? 8 : 13, refusal.reason, refusal.what()));
  } catch (const std::bad_alloc&) {
    job = ended_badly(job_error(8, "MEMORY_BUDGET_EXCEEDED", "the job needs more memory than there is: ask for larger cells"));
  } catch (const std::exception& error) {
    job = ended_badly(job_error(13, "INTERNAL", std::string("unexpected failure: ") + error.what()));
  }
}

}  // namespace

v1::Job run_mesh_job(const JobOrder& order, BlobStore& blobs, const MesherDoor& mesher, const std::atomic<bool>& cancel,
                     const MemoryGate& gate, const EventSink& sink) {
  const auto started = std::chrono::steady_clock::now();
  const rusage before = process_usage();
  ProgressMeter meter(sink);
  Context* watched = nullptr;
  CellCap cap;
  Context context(
      &cancel, [&](const Progress& progress) { meter.report(progress, watched->stages()); },
      [&](const Diagnostic& adjustment) {
        if (cap.hear(adjustment)) return;
        v1::WatchJobResponse event;
        *event.mutable_adjustment() = to_wire(adjustment);
        sink(std::move(event));
      });
  watched = &context;

  v1::Job job;
  run_guarded(order, blobs, mesher, context, cap, gate, sink, job);
  if (job.has_error()) {
    job.mutable_error()->set_stage(meter.stage());
    context.end();
  }
  meter.report_ended(context.stages());
  for (const StageRecord& record : context.stages()) *job.add_stages() = to_wire(record);
  const rusage after = process_usage();
  v1::Usage& usage = *job.mutable_usage();
  usage.set_wall_seconds(std::chrono::duration<double>(std::chrono::steady_clock::now() - started).count());
  usage.set_cpu_seconds(seconds(after.ru_utime) + seconds(after.ru_stime) - seconds(before.ru_utime) - seconds(before.ru_stime));
  usage.set_peak_memory_bytes(static_cast<std::int64_t>(after.ru_maxrss) * 1024);  // Linux counts in KiB
  return job;
}

}  // namespace strata::server
