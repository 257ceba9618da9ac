// The doors of core that the service uses, as values, so that tests can put another mesher behind the service.
#pragma once

#include <functional>

#include "core/mesher.h"

namespace strata::server {

struct MesherDoor {
  std::function<Outcome(TriangleSoup, const MeshSpec&, Context&, const Observer&)> generate;
  std::function<CheckReport(TriangleSoup, const MeshSpec&, Context&)> check_request;
  std::function<std::vector<Diagnostic>(const MeshSpec&, const std::vector<std::string>& patch_names)> check_spec;
};

// The mesher itself.
MesherDoor mesher_door();

}  // namespace strata::server
