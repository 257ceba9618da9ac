// The other side of a process runner: runs one job in a process of its own, told what to do over stdin, telling over stdout.
#pragma once

#include "server/mesher_door.h"

namespace strata::server {

// First argument of a worker's command line; the second is the process it belongs to.
inline constexpr const char* kWorkerFlag = "--worker";
inline constexpr int kOutOfMemoryExit = 71;  // the exit status that says so

// Is this process meant as a worker?
bool is_worker(int argc, const char* const* argv);
// Call before threads are started. Returns the exit status.
int worker_main(const MesherDoor& mesher, const char* const* argv);

}  // namespace strata::server
