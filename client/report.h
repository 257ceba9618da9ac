// REPORT.json: what the mesh is, what it cost, and where it differs from the wish (docs/formats.md).
#pragma once

#include <string>

#include <nlohmann/json_fwd.hpp>

#include "strata/v1/job.pb.h"

namespace strata::client {

nlohmann::json report(const v1::Job& job);
nlohmann::json to_json(const v1::Diagnostic& diagnostic);
// Writes beside the path, then renames.
void write_report(const v1::Job& job, const std::string& path);
// Ten lines for people: counts, quality, layers by patch, time.
std::string summary(const v1::Job& job);

}  // namespace strata::client
