// One function a command. Results go to standard output, everything for people to standard error.
#pragma once

#include "client/options.h"

namespace strata::client {

void mesh(const GlobalOptions& global, const MeshOptions& options);
void submit(const GlobalOptions& global, const MeshOptions& options);
void check(const GlobalOptions& global, const MeshOptions& options);
void watch_jobs(const GlobalOptions& global, const JobOptions& options);
void wait_for_jobs(const GlobalOptions& global, const JobOptions& options);
void get(const GlobalOptions& global, const JobOptions& options);
void list(const GlobalOptions& global, const JobOptions& options);
void show(const GlobalOptions& global, const JobOptions& options);
void cancel(const GlobalOptions& global, const JobOptions& options);
void remove(const GlobalOptions& global, const JobOptions& options);
void server_status(const GlobalOptions& global);
void server_health(const GlobalOptions& global);
void version(const GlobalOptions& global, bool of_server);

}  // namespace strata::client
