// What several commands ask about jobs.
#pragma once

#include <google/protobuf/map.h>
#include <google/protobuf/message.h>

#include <string>
#include <vector>

#include "client/connection.h"
#include "client/options.h"
#include "client/progress.h"

namespace strata::client {

using Labels = google::protobuf::Map<std::string, std::string>;

// From KEY=VALUE. Throws CommandError.
void add_labels(const std::vector<std::string>& words, Labels& labels);

v1::Job get_job(Connection& connection, const GlobalOptions& global, const std::string& id);
void cancel_job(Connection& connection, const GlobalOptions& global, const std::string& id);
// Throws CommandError with the error of the job, when there is one.
void need_success(const v1::Job& job);
// Downloads the result in that format. Throws CommandError NotFound when there is none.
void fetch(Connection& connection, const GlobalOptions& global, const v1::Job& job, v1::OutputFormat format, const std::string& path,
           ProgressView& view);

std::string as_json(const google::protobuf::Message& message);

}  // namespace strata::client
