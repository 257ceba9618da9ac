#include "client/commands.h"

#include <google/protobuf/util/json_util.h>
#include <grpcpp/generic/generic_stub.h>
#include <grpcpp/grpcpp.h>

#include <algorithm>
#include <chrono>
#include <cstdio>
#include <filesystem>
#include <fstream>
#include <iostream>
#include <nlohmann/json.hpp>
#include <random>
#include <thread>

#include "client/connection.h"
#include "client/exit_code.h"
#include "client/interrupt.h"
#include "client/progress.h"
#include "client/report.h"
#include "client/spec_file.h"
#include "client/status.h"
#include "client/transfer.h"
#include "client/version.h"
#include "client/watch.h"

namespace strata::client {
namespace {

namespace fs = std::filesystem;

constexpr auto kCallLimit = std::chrono::seconds(30);
constexpr auto kCheckLimit = std::chrono::minutes(5);
constexpr auto kCancelLimit = std::chrono::seconds(5);

void set_deadline(grpc::ClientContext& context, std::chrono::seconds limit = kCallLimit) {
  context.set_deadline(std::chrono::system_clock::now() + limit);
}

// Calls a unary method, again while the server is away.
template <class Request, class Response, class Method>
Response call(const Method& method, const Request& request, const GlobalOptions& global, const std::string& doing,
              std::chrono::seconds limit = kCallLimit) {
  Backoff backoff(global.retries);
  for (;;) {
    grpc::ClientContext context;
    set_deadline(context, limit);
    CallGuard guard(context, limit);
    Response response;
    const grpc::Status status = method(&context, request, &response);
    if (status.ok()) return response;
    go_on();
    if (!transient(status) || !backoff.pause()) throw command_error(status, doing);
  }
}

using Labels = google::protobuf::Map<std::string, std::string>;

void add_labels(const std::vector<std::string>& words, Labels& labels) {
  for (const std::string& word : words) {
    const std::size_t equals = word.find('=');
    if (equals == 0 || equals == std::string::npos) throw CommandError(ExitCode::Usage, "a label is KEY=VALUE, not '" + word + "'");
    labels[word.substr(0, equals)] = word.substr(equals + 1);
  }
}

std::string random_id() {
  std::random_device device;
  char text[40];
  std::snprintf(text, sizeof text, "%08x%08x%08x%08x", device(), device(), device(), device());
  return text;
}

v1::OutputFormat format_of(const std::string& path) {
  std::string ending = fs::path(path).extension().string();
  std::transform(ending.begin(), ending.end(), ending.begin(), [](unsigned char c) { return static_cast<char>(std::tolower(c)); });
  if (ending == ".mesh") return v1::OUTPUT_FORMAT_MESH;
  if (ending == ".meshb") return v1::OUTPUT_FORMAT_MESHB;
  if (ending == ".vtu") return v1::OUTPUT_FORMAT_VTU;
  if (ending == ".vtk") return v1::OUTPUT_FORMAT_VTK;
  if (ending == ".sol") return v1::OUTPUT_FORMAT_LAYER_SOL;
  if (ending == ".solb") return v1::OUTPUT_FORMAT_LAYER_SOLB;
  throw CommandError(ExitCode::Usage, "the ending of '" + path + "' names no mesh format", "use .vtu, .vtk, .mesh or .meshb");
}

void need_readable(const std::string& path, const char* what) {
  std::error_code error;
  if (!fs::exists(path, error)) throw CommandError(ExitCode::Usage, "there is no file '" + path + "' (" + what + ")");
  if (std::ifstream in(path, std::ios::binary); !in || fs::is_directory(path, error))
    throw CommandError(ExitCode::Usage, "'" + path + "' (" + what + ") cannot be read");
}

void need_writable_folder(const std::string& path) {
  const fs::path folder = fs::absolute(path).parent_path();
  std::error_code error;
  if (!fs::is_directory(folder, error))
    throw CommandError(ExitCode::LocalIo, "there is no folder '" + folder.string() + "' to write '" + path + "' to");
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

v1::Job get_job(Connection& connection, const GlobalOptions& global, const std::string& id) {
  v1::GetJobRequest request;
  request.set_job_id(id);
  const auto method = [&](auto* context, const auto& r, auto* response) { return connection.jobs->GetJob(context, r, response); };
  return call<v1::GetJobRequest, v1::GetJobResponse>(method, request, global, "asking for job " + id).job();
}

void fetch(Connection& connection, const GlobalOptions& global, const v1::Job& job, v1::OutputFormat format, const std::string& path,
           ProgressView& view) {
  for (const v1::Artifact& artifact : job.artifacts()) {
    if (artifact.format() != format) continue;
    download(connection, artifact.blob(), path, global.retries,
             [&](std::int64_t done, std::int64_t total) { view.transfer("downloading " + path, done, total); });
    view.clear();
    return;
  }
  std::string there;
  for (const v1::Artifact& artifact : job.artifacts())
    there += " " + lower_name(v1::OutputFormat_Name(artifact.format()), "OUTPUT_FORMAT_");
  throw CommandError(ExitCode::NotFound, "job " + job.job_id() + " has no result in the format of '" + path + "'",
                     there.empty() ? "it has no results" : "it has:" + there);
}

void need_success(const v1::Job& job) {
  if (job.state() != v1::JOB_STATE_SUCCEEDED) throw command_error(job);
}

std::string as_json(const google::protobuf::Message& message) {
  std::string text;
  google::protobuf::util::JsonPrintOptions options;
  options.preserve_proto_field_names = true;
  (void)google::protobuf::util::MessageToJsonString(message, &text, options);
  return text;
}

void print_jobs_table(const std::vector<v1::Job>& jobs) {
  std::printf("%-26s  %-9s  %5s  %12s  %s\n", "JOB", "STATE", "DONE", "HEXES", "NAME");
  for (const v1::Job& job : jobs)
    std::printf("%-26s  %-9s  %3.0f %%  %12lld  %s\n", job.job_id().c_str(), state_name(job.state()).c_str(),
                100 * (job.state() == v1::JOB_STATE_SUCCEEDED ? 1.0 : job.progress().fraction()), static_cast<long long>(job.hexes()),
                printable(job.display_name()).c_str());
  std::fflush(stdout);
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

void cancel_job(Connection& connection, const GlobalOptions& global, const std::string& id) {
  v1::CancelJobRequest request;
  request.set_job_id(id);
  const auto method = [&](auto* context, const auto& r, auto* response) { return connection.jobs->CancelJob(context, r, response); };
  call<v1::CancelJobRequest, v1::CancelJobResponse>(method, request, global, "cancelling job " + id);
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

void watch_jobs(const GlobalOptions& global, const JobOptions& options) {
  Connection connection = connect(global, PrivateServerAllowed::No);
  for (const std::string& id : options.jobs) {
    const bool json = global.output == Output::Json;
    ProgressView view(json ? ProgressView::Style::Silent : ProgressView::style_for(global.quiet, global.no_progress));
    WatchOptions watching{global.retries, {}};
    if (json) watching.on_event = [](const v1::WatchJobResponse& event) { std::cout << as_json(event) << std::endl; };
    v1::Job job;
    try {
      job = watch(connection, id, watching, view);
    } catch (const CommandError& error) {
      view.clear();
      if (!stopped()) throw;
      throw CommandError(error.code(), std::string(error.what()) + "; job " + id + " goes on",
                         "come back with: strata watch " + id + " --server " + connection.address);
    }
    need_success(job);
    if (!json && !global.quiet) std::cerr << summary(job);
  }
}

void wait_for_jobs(const GlobalOptions& global, const JobOptions& options) {
  Connection connection = connect(global, PrivateServerAllowed::No);
  for (const std::string& id : options.jobs) {
    ProgressView view(ProgressView::Style::Silent);
    const v1::Job job = watch(connection, id, {global.retries, {}}, view);
    if (!options.any_end) need_success(job);
  }
}

void get(const GlobalOptions& global, const JobOptions& options) {
  const v1::OutputFormat format = format_of(options.format.empty() ? options.out : "x." + options.format);
  need_writable_folder(options.out);
  Connection connection = connect(global, PrivateServerAllowed::No);
  const v1::Job job = get_job(connection, global, options.jobs.front());
  if (job.state() == v1::JOB_STATE_QUEUED || job.state() == v1::JOB_STATE_RUNNING)
    throw CommandError(ExitCode::NotFound, "job " + job.job_id() + " has not ended (" + state_name(job.state()) + ")",
                       "strata wait " + job.job_id());
  need_success(job);
  ProgressView view(ProgressView::style_for(global.quiet, global.no_progress));
  fetch(connection, global, job, format, options.out, view);
  if (!options.report.empty()) write_report(job, options.report);
}

void list(const GlobalOptions& global, const JobOptions& options) {
  v1::ListJobsRequest request;
  for (const std::string& state : options.states) {
    std::string name = "JOB_STATE_" + state;
    std::transform(name.begin(), name.end(), name.begin(), [](unsigned char c) { return static_cast<char>(std::toupper(c)); });
    v1::JobState value;
    if (!v1::JobState_Parse(name, &value))
      throw CommandError(ExitCode::Usage, "there is no state '" + state + "'", "queued, running, succeeded, failed or cancelled");
    request.add_states(value);
  }
  add_labels(options.labels, *request.mutable_labels());
  Connection connection = connect(global, PrivateServerAllowed::No);
  std::vector<v1::Job> jobs;
  const auto method = [&](auto* context, const auto& r, auto* response) { return connection.jobs->ListJobs(context, r, response); };
  do {
    auto answer = call<v1::ListJobsRequest, v1::ListJobsResponse>(method, request, global, "listing jobs");
    for (auto& job : *answer.mutable_jobs()) jobs.push_back(std::move(job));
    request.set_page_token(answer.next_page_token());
  } while (!request.page_token().empty());
  if (global.output == Output::Table) return print_jobs_table(jobs);
  for (const v1::Job& job : jobs) std::cout << (global.output == Output::Json ? as_json(job) : job.job_id()) << '\n';
}

void show(const GlobalOptions& global, const JobOptions& options) {
  Connection connection = connect(global, PrivateServerAllowed::No);
  for (const std::string& id : options.jobs) {
    const v1::Job job = get_job(connection, global, id);
    if (global.output == Output::Json) {
      std::cout << as_json(job) << '\n';
      continue;
    }
    std::cout << "job        " << job.job_id() << "  " << printable(job.display_name()) << "\nstate      " << state_name(job.state())
              << '\n';
    if (job.state() == v1::JOB_STATE_RUNNING)
      std::printf("stage      %s, %.0f %%\n", stage_name(job.progress().stage()).c_str(), 100 * job.progress().fraction()),
          std::fflush(stdout);
    if (job.has_error())
      std::cout << "error      " << (job.error().has_diagnostic() ? describe(job.error().diagnostic()) : job.error().message()) << '\n';
    if (job.state() == v1::JOB_STATE_SUCCEEDED) std::cout << summary(job);
    for (const auto& a : job.adjustments()) std::cout << "note       " << describe(a) << '\n';
  }
}

void cancel(const GlobalOptions& global, const JobOptions& options) {
  Connection connection = connect(global, PrivateServerAllowed::No);
  for (const std::string& id : options.jobs) cancel_job(connection, global, id);
}

void remove(const GlobalOptions& global, const JobOptions& options) {
  Connection connection = connect(global, PrivateServerAllowed::No);
  for (const std::string& id : options.jobs) {
    v1::DeleteJobRequest request;
    request.set_job_id(id);
    request.set_cancel_if_running(options.force);
    const auto method = [&](auto* context, const auto& r, auto* response) { return connection.jobs->DeleteJob(context, r, response); };
    call<v1::DeleteJobRequest, v1::DeleteJobResponse>(method, request, global, "deleting job " + id);
  }
}

void server_status(const GlobalOptions& global) {
  Connection connection = connect(global, PrivateServerAllowed::No);
  const auto method = [&](auto* context, const auto& r, auto* response) {
    return connection.system->GetServerStatus(context, r, response);
  };
  const auto status = call<v1::GetServerStatusRequest, v1::GetServerStatusResponse>(method, {}, global, "asking the server");
  if (global.output == Output::Json) {
    std::cout << as_json(status) << '\n';
    return;
  }
  std::printf("server     %s%s\nrunning    %d\nqueued     %d\njobs       %lld\nmemory     %.0f MB\n", connection.address.c_str(),
              status.draining() ? " (draining)" : "", status.running_jobs(), status.queued_jobs(),
              static_cast<long long>(status.jobs_total()), 1e-6 * static_cast<double>(status.resident_memory_bytes()));
}

// Asks the standard health service, which answers without credentials; by hand, because its messages are this small.
void server_health(const GlobalOptions& global) {
  Connection connection = connect(global, PrivateServerAllowed::No);
  grpc::ClientContext context;
  set_deadline(context, kCancelLimit);
  CallGuard guard(context, kCancelLimit);
  grpc::CompletionQueue queue;
  const grpc::ByteBuffer question(nullptr, 0);
  grpc::ByteBuffer answer;
  grpc::Status status;
  const auto call = grpc::GenericStub(connection.channel).PrepareUnaryCall(&context, "/grpc.health.v1.Health/Check", question, &queue);
  call->StartCall();
  call->Finish(&answer, &status, nullptr);
  void* tag = nullptr;
  bool ok = false;
  queue.Next(&tag, &ok);
  if (!status.ok()) throw command_error(status, "asking for the health of the server");
  grpc::Slice bytes;
  const std::string serving = "\x08\x01";  // HealthCheckResponse{status: SERVING}
  const bool healthy = answer.DumpToSingleSlice(&bytes).ok() && std::string(bytes.begin(), bytes.end()) == serving;
  if (!healthy) throw CommandError(ExitCode::Unreachable, "the server at " + connection.address + " is not serving");
  std::cout << "serving" << std::endl;
}

void version(const GlobalOptions& global, bool of_server) {
  std::cout << "strata " << kVersion << std::endl;
  if (!of_server) return;
  Connection connection = connect(global, PrivateServerAllowed::Yes);
  const auto method = [&](auto* context, const auto& r, auto* response) {
    return connection.system->GetCapabilities(context, r, response);
  };
  std::cout << "stratad "
            << call<v1::GetCapabilitiesRequest, v1::GetCapabilitiesResponse>(method, {}, global, "asking the server").version() << '\n';
}

}  // namespace strata::client
