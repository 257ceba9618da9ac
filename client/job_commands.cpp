// watch, wait, get, list, show, cancel, delete: jobs that the server has.
#include <algorithm>
#include <cctype>
#include <cstdio>
#include <iostream>
#include <vector>

#include "client/call.h"
#include "client/commands.h"
#include "client/connection.h"
#include "client/job_calls.h"
#include "client/local_files.h"
#include "client/report.h"
#include "client/watch.h"

namespace strata::client {
namespace {

void print_jobs_table(const std::vector<v1::Job>& jobs) {
  std::printf("%-26s  %-9s  %5s  %12s  %s\n", "JOB", "STATE", "DONE", "HEXES", "NAME");
  for (const v1::Job& job : jobs)
    std::printf("%-26s  %-9s  %3.0f %%  %12lld  %s\n", job.job_id().c_str(), state_name(job.state()).c_str(),
                100 * (job.state() == v1::JOB_STATE_SUCCEEDED ? 1.0 : job.progress().fraction()), static_cast<long long>(job.hexes()),
                printable(job.display_name()).c_str());
  std::fflush(stdout);
}

}  // namespace

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

}  // namespace strata::client
