// A specification given as any text or as any message either is refused, naming what is wrong, or survives the way to core and back.
#include <cstddef>
#include <cstdint>
#include <cstdlib>
#include <string_view>

#include "core/base/diagnostic.h"
#include "core/spec/mesh_spec.h"
#include "server/convert.h"
#include "server/spec_json.h"

namespace {

void require(bool holds) {
  if (!holds) std::abort();
}

void through_core(const strata::v1::MeshSpec& wire) {
  const strata::MeshSpec spec = strata::server::from_wire(wire);
  for (const strata::Diagnostic& finding : strata::check(spec, {"wall", "inlet"})) require(!finding.message.empty());
  const strata::v1::MeshSpec again = strata::server::to_wire(spec);
  static_cast<void>(strata::server::from_wire(again));
}

template <class Body>
void refused_or_fine(const Body& body) {
  try {
    body();
  } catch (const strata::MeshError& error) {
    require(error.failure() == strata::Failure::InvalidInput);
    require(!error.diagnostic().message.empty());
  }
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  const std::string_view text(reinterpret_cast<const char*>(data), size);
  refused_or_fine([&] { through_core(strata::server::parse_spec(text)); });
  strata::v1::MeshSpec message;
  if (message.ParseFromArray(data, static_cast<int>(size))) refused_or_fine([&] { through_core(message); });
  return 0;
}
