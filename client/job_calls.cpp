#include "client/job_calls.h"

#include <google/protobuf/util/json_util.h>

#include "client/call.h"
#include "client/report.h"
#include "client/transfer.h"

namespace strata::client {

void add_labels(const std::vector<std::string>& words, Labels& labels) {
  for (const std::string& word : words) {
    const std::size_t equals = word.find('=');
    if (equals == 0 || equals == std::string::npos) throw CommandError(ExitCode::Usage, "a label is KEY=VALUE, not '" + word + "'");
    labels[word.substr(0, equals)] = word.substr(equals + 1);
  }
}

v1::Job get_job(Connection& connection, const GlobalOptions& global, const std::string& id) {
  v1::GetJobRequest request;
  request.set_job_id(id);
  const auto method = [&](auto* context, const auto& r, auto* response) { return connection.jobs->GetJob(context, r, response); };
  return call<v1::GetJobRequest, v1::GetJobResponse>(method, request, global, "asking for job " + id).job();
}

void cancel_job(Connection& connection, const GlobalOptions& global, const std::string& id) {
  v1::CancelJobRequest request;
  request.set_job_id(id);
  const auto method = [&](auto* context, const auto& r, auto* response) { return connection.jobs->CancelJob(context, r, response); };
  call<v1::CancelJobRequest, v1::CancelJobResponse>(method, request, global, "cancelling job " + id);
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

}  // namespace strata::client
