// What is wrong with files on this side is said before anything is sent. All throw CommandError.
#pragma once

#include <string>

#include "strata/v1/job.pb.h"

namespace strata::client {

// By the ending.
v1::OutputFormat format_of(const std::string& path);
// `what` it is, for the message.
void need_readable(const std::string& path, const char* what);
void need_writable_folder(const std::string& path);

}  // namespace strata::client
