// The doors into core as values, so that tests can put another mesher behind the service. Names its types only: most of the server passes the
// doors on and need not know what goes through them.
#pragma once

#include <functional>
#include <string>
#include <vector>

namespace strata {
class Context;
struct CheckReport;
struct Diagnostic;
struct MeshSpec;
struct Observer;
struct Outcome;
struct TriangleSoup;
}  // namespace strata

namespace strata::server {

struct MesherDoor {
  std::function<Outcome(TriangleSoup, const MeshSpec&, Context&, const Observer&)> generate;
  std::function<CheckReport(TriangleSoup, const MeshSpec&, Context&)> check_request;
  std::function<std::vector<Diagnostic>(const MeshSpec&, const std::vector<std::string>& patch_names)> check_spec;
};

// The mesher itself.
MesherDoor mesher_door();

}  // namespace strata::server
