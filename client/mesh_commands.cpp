// mesh, submit, check: from a surface on this side.
#include <chrono>
#include <cstdio>
#include <filesystem>
#include <iostream>
#include <nlohmann/json.hpp>
#include <random>
#include <vector>

#include "client/call.h"
#include "client/commands.h"
#include "client/connection.h"
#include "client/job_calls.h"
#include "client/local_files.h"
#include "client/report.h"
#include "client/spec_file.h"
#include "client/transfer.h"
#include "client/watch.h"

namespace strata::client {
namespace {

namespace fs = std::filesystem;

constexpr auto kCheckLimit = std::chrono::minutes(5);
constexpr auto kCancelLimit = std::chrono::seconds(5);

std::string random_id() {
  std::random_device device;
  char text[40];
  std::snprintf(text, sizeof text, "%08x%08x%08x%08x", device(), device(), device(), device());
  return text;
}

v1::Surface upload_surface(Connection& connection, const std::string& path, const GlobalOptions& global, ProgressView& view) {
  v1::Surface surface;
  surface.set_file_name(fs::path(path).filename().string());
  surface.set_blob_id(upload(connection, path, global.retries,
                             [&](std::int64_t done, std::int64_t total) { view.transfer("uploading " + path, done, total); }));
  return surface;
}

v1::Job create(Connection& connection, const GlobalOptions& global, const MeshOptions& options,
               const std::vector<v1::OutputFormat>& outputs, ProgressView& view) {
  v1::CreateJobRequest request;
  request.set_request_id(options.request_id.empty() ? random_id() : options.request_id);
  if (!options.spec.empty()) request.set_spec_json(spec_json_of(options.spec));
  add_labels(options.labels, *request.mutable_labels());
  request.set_priority(options.priority);
  request.set_result_ttl_seconds(options.keep_seconds);
  *request.mutable_surface() = upload_surface(connection, options.surface, global, view);
  for (v1::OutputFormat format : outputs) request.add_outputs(format);
  request.set_max_threads(global.threads);
  request.set_display_name(options.name.empty() ? fs::path(options.surface).filename().string() : options.name);
  const auto method = [&](auto* context, const auto& r, auto* response) { return connection.jobs->CreateJob(context, r, response); };
  return call<v1::CreateJobRequest, v1::CreateJobResponse>(method, request, global, "creating the job").job();
}

// Of a command that is being interrupted: once, and not for long.
void cancel_on_the_way_out(Connection& connection, const std::string& id) {
  grpc::ClientContext context;
  set_deadline(context, kCancelLimit);
  v1::CancelJobRequest request;
  request.set_job_id(id);
  v1::CancelJobResponse ignored;
  (void)connection.jobs->CancelJob(&context, request, &ignored);
}

// What becomes of the job when `mesh` ends early.
CommandError ended_early(Connection& connection, const MeshOptions& options, const std::string& job_id, const CommandError& why) {
  const std::string what = why.what();
  if (job_id.empty()) return why;
  if (connection.own) return {why.code(), what + "; the job was cancelled"};
  if (options.cancel_on_exit) {
    cancel_on_the_way_out(connection, job_id);
    return {why.code(), what + "; job " + job_id + " was cancelled"};
  }
  return {why.code(), what + "; job " + job_id + " stays with the server",
          "come back with: strata watch " + job_id + " --server " + connection.address + "\n  then:           strata get " + job_id +
              " -o " + options.out + " --server " + connection.address};
}

}  // namespace

void mesh(const GlobalOptions& global, const MeshOptions& options) {
  // What is wrong locally is said before anything is sent.
  std::vector<v1::OutputFormat> outputs{format_of(options.out)};
  if (!options.layers_out.empty()) outputs.push_back(format_of(options.layers_out));
  need_readable(options.surface, "the surface");
  if (!options.spec.empty()) need_readable(options.spec, "the specification");
  for (const std::string& path : {options.out, options.report, options.layers_out})
    if (!path.empty()) need_writable_folder(path);

  ProgressView view(ProgressView::style_for(global.quiet, global.no_progress));
  Connection connection = connect(global, PrivateServerAllowed::Yes);
  std::string id;
  v1::Job job;
  try {
    id = create(connection, global, options, outputs, view).job_id();
    job = watch(connection, id, {global.retries, {}}, view);
    need_success(job);
    fetch(connection, global, job, outputs[0], options.out, view);
    if (!options.layers_out.empty()) fetch(connection, global, job, outputs[1], options.layers_out, view);
  } catch (const CommandError& error) {
    view.clear();
    if (connection.own)  // nobody can come back for the rest
      for (const std::string& path : {options.out, options.layers_out}) discard_partial(path);
    if (!stopped()) throw;
    throw ended_early(connection, options, id, error);
  }
  if (!options.report.empty()) write_report(job, options.report);
  if (global.output == Output::Json) std::cout << safe_dump(report(job)) << '\n';
  else if (!global.quiet) std::cerr << summary(job) << "wrote      " << options.out << '\n';
}

void submit(const GlobalOptions& global, const MeshOptions& options) {
  std::vector<v1::OutputFormat> outputs;
  for (const std::string& format : options.formats) outputs.push_back(format_of("x." + format));
  if (outputs.empty()) outputs = {v1::OUTPUT_FORMAT_VTU, v1::OUTPUT_FORMAT_MESHB};
  need_readable(options.surface, "the surface");
  if (!options.spec.empty()) need_readable(options.spec, "the specification");
  ProgressView view(ProgressView::style_for(global.quiet, global.no_progress));
  Connection connection = connect(global, PrivateServerAllowed::No);
  const v1::Job job = create(connection, global, options, outputs, view);
  view.clear();
  if (global.output == Output::Json) std::cout << as_json(job) << '\n';
  else std::cout << job.job_id() << '\n';
}

void check(const GlobalOptions& global, const MeshOptions& options) {
  need_readable(options.surface, "the surface");
  if (!options.spec.empty()) need_readable(options.spec, "the specification");
  ProgressView view(ProgressView::style_for(global.quiet, global.no_progress));
  Connection connection = connect(global, PrivateServerAllowed::Yes);
  v1::ValidateJobRequest request;
  if (!options.spec.empty()) request.set_spec_json(spec_json_of(options.spec));
  *request.mutable_surface() = upload_surface(connection, options.surface, global, view);
  view.clear();
  const auto method = [&](auto* context, const auto& r, auto* response) { return connection.jobs->ValidateJob(context, r, response); };
  const auto answer =
      call<v1::ValidateJobRequest, v1::ValidateJobResponse>(method, request, global, "checking " + options.surface, kCheckLimit);
  if (global.output == Output::Json) {
    std::cout << as_json(answer) << '\n';
  } else {
    for (const auto& finding : answer.findings())
      std::cout << lower_name(v1::Severity_Name(finding.severity()), "SEVERITY_") << ": " << describe(finding) << '\n';
    std::cout << "patches   ";
    for (const auto& p : answer.patches()) std::cout << ' ' << printable(p.name());
    std::cout << std::endl;
    const v1::Estimate& e = answer.estimate();
    if (answer.acceptable())
      std::printf("triangles  %lld\nhexes      about %lld\nmemory     about %.0f MB\ntime       about %.1f CPU s\n",
                  static_cast<long long>(e.triangles()), static_cast<long long>(e.hexes()), 1e-6 * static_cast<double>(e.memory_bytes()),
                  e.cpu_seconds());
  }
  std::cout.flush();
  if (!answer.acceptable()) throw CommandError(ExitCode::InputRejected, "the server would refuse this", "mend what is listed above");
}

}  // namespace strata::client
