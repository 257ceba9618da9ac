// Diagnostics, statistics, surfaces and meshes: wire <-> core.
#include "server/convert.h"

#include <bit>
#include <cmath>
#include <cstring>
#include <optional>
#include <set>
#include <string>
#include <utility>
#include <vector>

#include "core/io/surface_io.h"
#include "core/mesher.h"

namespace strata::server {
namespace {

static_assert(std::endian::native == std::endian::little, "blocks are little-endian: arrays are written as they lie");

constexpr std::int64_t kBlockAlignment = 64;  // so that a mapped file can be read in place with any vector width

[[noreturn]] void refuse(Reason reason, const std::string& field, const std::string& message) {
  Diagnostic diagnostic;
  diagnostic.reason = reason;
  diagnostic.field = field;
  diagnostic.message = message;
  throw MeshError(Failure::InvalidInput, std::move(diagnostic));
}

v1::Severity to_wire(Severity severity) {
  switch (severity) {
    case Severity::Info: return v1::SEVERITY_INFO;
    case Severity::Warning: return v1::SEVERITY_WARNING;
    case Severity::Error: return v1::SEVERITY_ERROR;
  }
  return v1::SEVERITY_UNSPECIFIED;
}

void fill(const Vec3& from, v1::Vector3& to) {
  to.set_x(from.x());
  to.set_y(from.y());
  to.set_z(from.z());
}

void fill(const JacobianStatistics& from, v1::JacobianStatistics& to) {
  to.set_count(from.count);
  to.set_min(from.min);
  to.set_mean(from.mean);
  to.set_not_positive(from.not_positive);
  to.mutable_histogram()->Assign(from.histogram.begin(), from.histogram.end());
}

void fill(const PatchStatistics& from, v1::PatchStatistics& to) {
  to.set_name(from.name);
  to.set_reference(from.reference);
  to.set_quads(from.quads);
  to.set_area(from.area);
  fill(from.jacobian, *to.mutable_jacobian());
  to.set_layers_wished(from.layers_wished);
  to.set_layers(from.layers);
  to.set_first_height_wished(from.first_height_wished);
  to.set_first_height_mean(from.first_height_mean);
  to.set_thickness_fraction_mean(from.thickness_fraction_mean);
  to.set_thickness_fraction_min(from.thickness_fraction_min);
  to.set_coverage(from.coverage);
}

std::optional<io::SurfaceFormat> file_format_of(const v1::Surface& surface) {
  switch (surface.format()) {
    case v1::SURFACE_FORMAT_UNSPECIFIED: return io::surface_format(surface.file_name());
    case v1::SURFACE_FORMAT_STL: return io::SurfaceFormat::Stl;
    case v1::SURFACE_FORMAT_OBJ: return io::SurfaceFormat::Obj;
    case v1::SURFACE_FORMAT_OFF: return io::SurfaceFormat::Off;
    case v1::SURFACE_FORMAT_PLY: return io::SurfaceFormat::Ply;
    case v1::SURFACE_FORMAT_MEDIT: return io::SurfaceFormat::Medit;
    default: return {};
  }
}

constexpr std::int64_t kMaxArrayEntries = std::int64_t{1} << 30;  // keeps the size arithmetic and 32-bit ids far from overflow
constexpr std::int64_t kPointBytes = 24;
constexpr std::int64_t kTriangleBytes = 12;
constexpr std::int64_t kPatchBytes = 4;

void check_arrays(const v1::SurfaceArrays& arrays) {
  if (arrays.point_count() < 0 || arrays.point_count() > kMaxArrayEntries)
    refuse(Reason::FileMalformed, "surface.arrays.point_count", "surface.arrays.point_count is out of range");
  if (arrays.triangle_count() < 0 || arrays.triangle_count() > kMaxArrayEntries)
    refuse(Reason::FileMalformed, "surface.arrays.triangle_count", "surface.arrays.triangle_count is out of range");
  std::set<std::string> seen;
  for (int i = 0; i < arrays.patch_names_size(); ++i)
    if (arrays.patch_names(i).empty() || !seen.insert(arrays.patch_names(i)).second)
      refuse(Reason::FileMalformed, "surface.arrays.patch_names[" + std::to_string(i) + "]",
             "patch names must be unique and not empty: \"" + arrays.patch_names(i) + "\"");
}

// Moves the first `count` values out of the bytes.
template <class T>
void take(std::span<const char>& bytes, std::vector<T>& into, std::size_t count) {
  into.resize(count);
  if (count > 0) std::memcpy(static_cast<void*>(into.data()), bytes.data(), count * sizeof(T));
  bytes = bytes.subspan(count * sizeof(T));
}

TriangleSoup read_arrays(const v1::SurfaceArrays& arrays, std::span<const char> bytes) {
  check_arrays(arrays);
  const bool has_patches = arrays.patch_names_size() > 0;
  const std::int64_t per_triangle = kTriangleBytes + (has_patches ? kPatchBytes : 0);
  const std::int64_t wanted = arrays.point_count() * kPointBytes + arrays.triangle_count() * per_triangle;
  if (wanted != static_cast<std::int64_t>(bytes.size()))
    refuse(Reason::FileMalformed, "surface.arrays",
           "the arrays need " + std::to_string(wanted) + " bytes, " + std::to_string(bytes.size()) + " came");
  TriangleSoup soup;
  static_assert(sizeof(Vec3) == kPointBytes);
  take(bytes, soup.points, static_cast<std::size_t>(arrays.point_count()));
  take(bytes, soup.triangles, static_cast<std::size_t>(arrays.triangle_count()));
  if (has_patches) {
    take(bytes, soup.patch, soup.triangles.size());
    soup.patch_names.assign(arrays.patch_names().begin(), arrays.patch_names().end());
  } else {
    soup.patch.assign(soup.triangles.size(), 0);
    soup.patch_names = {"surface"};
  }
  return soup;
}

// What readers of files guarantee, for arrays too.
void check_soup(const TriangleSoup& soup) {
  if (soup.triangles.empty()) refuse(Reason::SurfaceEmpty, "surface", "the surface has no triangles");
  for (std::size_t i = 0; i < soup.points.size(); ++i)
    if (!soup.points[i].allFinite())
      refuse(Reason::SurfaceNonFinite, "surface", "point " + std::to_string(i) + " has a coordinate that is not finite");
  const auto points = static_cast<std::int64_t>(soup.points.size());
  const auto patches = static_cast<std::int64_t>(soup.patch_names.size());
  for (std::size_t t = 0; t < soup.triangles.size(); ++t) {
    for (const std::int32_t p : soup.triangles[t])
      if (p < 0 || p >= points)
        refuse(Reason::SurfaceIndexOutOfRange, "surface",
               "triangle " + std::to_string(t) + " names a point that is not there (0 to " + std::to_string(points - 1) + ")");
    if (soup.patch[t] < 0 || soup.patch[t] >= patches)
      refuse(Reason::SurfaceIndexOutOfRange, "surface",
             "triangle " + std::to_string(t) + " names patch " + std::to_string(soup.patch[t]) + " of " + std::to_string(patches));
  }
}

// A job's record tells of every patch, and clients take messages of 4 MiB.
void check_patch_names(const std::vector<std::string>& names) {
  constexpr std::size_t kMost = std::size_t{3} << 20, kFigures = 160;  // bytes of the record; of them those of a patch besides its name
  std::size_t bytes = 0;
  for (const std::string& name : names) bytes += 2 * name.size() + kFigures;  // its reference, and its quality
  if (bytes <= kMost) return;
  Diagnostic diagnostic;
  diagnostic.reason = Reason::FileTooLarge;
  diagnostic.severity = Severity::Error;
  diagnostic.field = "surface";
  diagnostic.message = std::to_string(names.size()) + " patches with such names would need " + std::to_string(bytes >> 10) +
                       " KiB in the record of the job, more than the " + std::to_string(kMost >> 10) +
                       " there are: join patches, or give them shorter names";
  diagnostic.values = {{"patches", static_cast<double>(names.size())}};
  throw MeshError(Failure::InvalidInput, std::move(diagnostic));
}

void add_block(v1::MeshBlocks& blocks, v1::Block::Role role, v1::Block::ScalarType type, int components, std::size_t count,
               std::int64_t scalar_bytes) {
  std::int64_t end = 0;
  if (blocks.blocks_size() > 0) end = blocks.blocks().rbegin()->offset() + blocks.blocks().rbegin()->size_bytes();
  v1::Block& block = *blocks.add_blocks();
  block.set_role(role);
  block.set_scalar_type(type);
  block.set_components(components);
  block.set_count(static_cast<std::int64_t>(count));
  block.set_offset((end + kBlockAlignment - 1) / kBlockAlignment * kBlockAlignment);
  block.set_size_bytes(static_cast<std::int64_t>(count) * components * scalar_bytes);
}

template <class Container>
std::span<const char> bytes_of(const Container& values) {
  return {reinterpret_cast<const char*>(values.data()), values.size() * sizeof(*values.data())};
}

// References in files count from 1.
template <class Ids>
std::vector<std::int32_t> references(const Ids& ids) {
  std::vector<std::int32_t> result;
  result.reserve(ids.size());
  for (const auto id : ids) result.push_back(id.value + 1);
  return result;
}

}  // namespace

v1::Stage to_wire(Stage stage) { return static_cast<v1::Stage>(static_cast<int>(stage) + v1::STAGE_READ); }
static_assert(static_cast<int>(Stage::Write) + v1::STAGE_READ == v1::STAGE_WRITE);
static_assert(static_cast<int>(Stage::Carve) + v1::STAGE_READ == v1::STAGE_CARVE);

v1::Rung to_wire(Rung rung) { return static_cast<v1::Rung>(static_cast<int>(rung) + v1::RUNG_FULL); }
static_assert(static_cast<int>(Rung::CarvedDual) + v1::RUNG_FULL == v1::RUNG_CARVED_DUAL);

v1::Diagnostic to_wire(const Diagnostic& diagnostic) {
  v1::Diagnostic wire;
  wire.set_reason(std::string(reason_name(diagnostic.reason)));
  wire.set_severity(to_wire(diagnostic.severity));
  wire.set_message(diagnostic.message);
  wire.set_patch(diagnostic.patch);
  wire.set_field(diagnostic.field);
  wire.mutable_triangles()->Assign(diagnostic.triangles.begin(), diagnostic.triangles.end());
  wire.set_count(diagnostic.count);
  if (!diagnostic.box.empty()) {
    fill(diagnostic.box.min, *wire.mutable_box()->mutable_min());
    fill(diagnostic.box.max, *wire.mutable_box()->mutable_max());
  }
  for (const auto& [name, value] : diagnostic.values) (*wire.mutable_values())[name] = value;
  return wire;
}

v1::StageRecord to_wire(const StageRecord& record) {
  v1::StageRecord wire;
  wire.set_stage(to_wire(record.stage));
  wire.set_seconds(record.seconds);
  wire.set_cpu_seconds(record.cpu_seconds);
  wire.set_peak_memory_bytes(record.peak_rss_bytes);
  return wire;
}

v1::Quality to_wire(const Quality& quality) {
  v1::Quality wire;
  fill(quality.all, *wire.mutable_all());
  fill(quality.layers, *wire.mutable_layers());
  fill(quality.rest, *wire.mutable_rest());
  for (const RegionStatistics& region : quality.regions) {
    v1::RegionStatistics& out = *wire.add_regions();
    out.set_reference(region.reference);
    out.set_hexes(region.hexes);
    out.set_volume(region.volume);
    fill(region.jacobian, *out.mutable_jacobian());
  }
  for (const PatchStatistics& patch : quality.patches) fill(patch, *wire.add_patches());
  wire.set_vertices(quality.vertices);
  wire.set_quads(quality.quads);
  return wire;
}

v1::Estimate to_wire(const Estimate& estimate) {
  v1::Estimate wire;
  wire.set_triangles(estimate.triangles);
  wire.set_octree_cells(estimate.octree_cells);
  wire.set_hexes(estimate.hexes);
  wire.set_memory_bytes(estimate.memory_bytes);
  wire.set_cpu_seconds(estimate.cpu_seconds);
  return wire;
}

v1::JobError to_wire(const MeshError& error) {
  const auto code_of = [](Failure failure) {  // google.rpc.Code
    switch (failure) {
      case Failure::InvalidInput: return 3;
      case Failure::LimitExceeded: return 8;
      case Failure::Cancelled: return 1;
      case Failure::Internal: return 13;
    }
    return 13;
  };
  v1::JobError wire;
  wire.set_code(code_of(error.failure()));
  *wire.mutable_diagnostic() = to_wire(error.diagnostic());
  wire.set_reason(wire.diagnostic().reason());
  wire.set_message(error.what());
  return wire;
}

void check_wire_surface(const v1::Surface& surface) {
  if (surface.format() == v1::SURFACE_FORMAT_ARRAYS) return check_arrays(surface.arrays());
  if (file_format_of(surface)) return;
  refuse(Reason::FormatUnknown, "surface.format",
         "the format of the surface is unknown: give it, or a file_name ending in .stl, .obj, .off, .ply, .mesh or .meshb");
}

TriangleSoup read_wire_surface(const v1::Surface& surface, std::span<const char> bytes) {
  check_wire_surface(surface);
  const bool arrays = surface.format() == v1::SURFACE_FORMAT_ARRAYS;
  TriangleSoup soup = arrays ? read_arrays(surface.arrays(), bytes) : io::read_surface(bytes, *file_format_of(surface));
  if (arrays) check_soup(soup);
  check_patch_names(soup.patch_names);
  return soup;
}

v1::MeshBlocks blocks_of(const HexMesh& mesh) {
  v1::MeshBlocks blocks;
  blocks.set_vertex_count(static_cast<std::int64_t>(mesh.position.size()));
  blocks.set_hex_count(static_cast<std::int64_t>(mesh.hexes.size()));
  blocks.set_quad_count(static_cast<std::int64_t>(mesh.quads.size()));
  using B = v1::Block;
  add_block(blocks, B::ROLE_VERTEX_POSITION, B::SCALAR_TYPE_FLOAT64, 3, mesh.position.size(), 8);
  add_block(blocks, B::ROLE_HEX, B::SCALAR_TYPE_UINT32, 8, mesh.hexes.size(), 4);
  add_block(blocks, B::ROLE_BOUNDARY_QUAD, B::SCALAR_TYPE_UINT32, 4, mesh.quads.size(), 4);
  add_block(blocks, B::ROLE_QUAD_PATCH, B::SCALAR_TYPE_INT32, 1, mesh.quads.size(), 4);
  add_block(blocks, B::ROLE_HEX_REGION, B::SCALAR_TYPE_INT32, 1, mesh.hexes.size(), 4);
  add_block(blocks, B::ROLE_HEX_LAYER, B::SCALAR_TYPE_UINT16, 1, mesh.hexes.size(), 2);
  return blocks;
}

void write_blocks(const HexMesh& mesh, const v1::MeshBlocks& blocks, const std::function<void(std::span<const char>)>& sink) {
  static_assert(sizeof(Vec3) == 24 && sizeof(HexVertices) == 32 && sizeof(QuadVertices) == 16);
  static constexpr char kZeros[kBlockAlignment] = {};
  std::int64_t at = 0;
  const auto put = [&](const v1::Block& block, std::span<const char> bytes) {
    sink({kZeros, static_cast<std::size_t>(block.offset() - at)});
    sink(bytes);
    at = block.offset() + block.size_bytes();
  };
  put(blocks.blocks(0), bytes_of(mesh.position));
  put(blocks.blocks(1), bytes_of(mesh.hexes));
  put(blocks.blocks(2), bytes_of(mesh.quads));
  put(blocks.blocks(3), bytes_of(references(mesh.patch)));
  put(blocks.blocks(4), bytes_of(references(mesh.region)));
  put(blocks.blocks(5), bytes_of(mesh.layer));
}

}  // namespace strata::server
