// Proto messages stop here: wire <-> core. No policy, no defaults but the documented ones. Core's types are named only: who uses one includes it.
#pragma once

#include <cstdint>
#include <functional>
#include <span>

#include "strata/v1/job.pb.h"

namespace strata {
class MeshError;
enum class Rung;
enum class Stage;
struct Diagnostic;
struct Estimate;
struct HexMesh;
struct MeshSpec;
struct Quality;
struct StageRecord;
struct TriangleSoup;
}  // namespace strata

namespace strata::server {

// Specification. from_wire throws MeshError(InvalidInput, SpecInvalid) for what the message can say and core cannot (a missing point, an
// unspecified enum where one is required). Angles change unit.
MeshSpec from_wire(const v1::MeshSpec& spec);
v1::MeshSpec to_wire(const MeshSpec& spec);

v1::Diagnostic to_wire(const Diagnostic& diagnostic);
v1::Stage to_wire(Stage stage);
v1::Rung to_wire(Rung rung);
v1::StageRecord to_wire(const StageRecord& record);
v1::Quality to_wire(const Quality& quality);
v1::Estimate to_wire(const Estimate& estimate);
// Codes as in JobError.code.
v1::JobError to_wire(const MeshError& error);

// The surface behind `bytes`, in any format of the wire. Throws MeshError(InvalidInput).
TriangleSoup read_wire_surface(const v1::Surface& surface, std::span<const char> bytes);
// Is the format known (by enum or file name) and complete? Throws MeshError(InvalidInput, FormatUnknown) if not.
void check_wire_surface(const v1::Surface& surface);

// The typed arrays of a mesh: first where each block lies, then the bytes, all of them, in order.
v1::MeshBlocks blocks_of(const HexMesh& mesh);
void write_blocks(const HexMesh& mesh, const v1::MeshBlocks& blocks, const std::function<void(std::span<const char>)>& sink);

}  // namespace strata::server
