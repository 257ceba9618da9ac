// VTK XML .vtu, appended raw data, zlib. The header in front names where each array starts, so every block is compressed twice: once to
// learn its size, once to write it. That costs a second of time for a million hexes and saves holding the compressed file in memory.
// An array is { number of blocks, bytes of a block, bytes of the last one if shorter, compressed size of each block }, all 64 bits, and
// then the blocks.
#include <zlib.h>

#include <bit>
#include <functional>
#include <stdexcept>
#include <string>
#include <vector>

#include "core/io/mesh_writers.h"
#include "core/io/vtk_cells.h"

namespace strata::io {
namespace {

static_assert(std::endian::native == std::endian::little, "the file declares LittleEndian and arrays are written as they lie");
static_assert(sizeof(Vec3) == 3 * sizeof(double) && sizeof(VertexId) == sizeof(std::int32_t));

constexpr std::size_t kBlockBytes = std::size_t{1} << 18;  // a multiple of every value's size but a point's, which is cut into doubles
constexpr std::size_t kBatch = 16;                         // blocks in memory at a time

struct Array {
  std::string tag;          // attributes of its DataArray element
  std::size_t value_bytes;
  std::size_t values;
  std::function<void(std::size_t begin, std::size_t end, std::string& out)> append_values;
  std::vector<std::uint64_t> compressed{};  // size of each block

  [[nodiscard]] std::size_t bytes() const { return value_bytes * values; }
  [[nodiscard]] std::size_t blocks() const { return (bytes() + kBlockBytes - 1) / kBlockBytes; }
  [[nodiscard]] std::uint64_t bytes_in_file() const {
    std::uint64_t sum = sizeof(std::uint64_t) * (3 + compressed.size());
    for (const std::uint64_t size : compressed) sum += size;
    return sum;
  }
};

template <class T>
void append_run(std::string& out, const T* values, std::size_t begin, std::size_t end) {
  if (begin < end) out.append(reinterpret_cast<const char*>(values + begin), (end - begin) * sizeof(T));
}

// The vertices of the hexes, then those of the quads.
void append_connectivity(const HexMesh& mesh, std::size_t begin, std::size_t end, std::string& out) {
  const std::size_t of_hexes = 8 * mesh.hexes.size();
  const auto* hexes = reinterpret_cast<const VertexId*>(mesh.hexes.data());
  const auto* quads = reinterpret_cast<const VertexId*>(mesh.quads.data());
  append_run(out, hexes, begin, std::min(end, of_hexes));
  if (end > of_hexes) append_run(out, quads, std::max(begin, of_hexes) - of_hexes, end - of_hexes);
}

template <class T, class ValueOf>
auto appender(const ValueOf& value_of) {
  return [value_of](std::size_t begin, std::size_t end, std::string& out) {
    for (std::size_t i = begin; i < end; ++i) append(out, static_cast<T>(value_of(i)));
  };
}

enum ArrayIndex { kPoints, kConnectivity, kOffsets, kTypes, kRef, kLayer };

std::vector<Array> arrays_of(const HexMesh& mesh) {
  const std::size_t hexes = mesh.hexes.size(), cells = hexes + mesh.quads.size();
  std::vector<Array> arrays;
  arrays.push_back({"type=\"Float64\" Name=\"Points\" NumberOfComponents=\"3\"", sizeof(double), 3 * mesh.position.size(),
                    [&mesh](std::size_t begin, std::size_t end, std::string& out) {
                      append_run(out, reinterpret_cast<const double*>(mesh.position.data()), begin, end);
                    }});
  arrays.push_back({"type=\"Int32\" Name=\"connectivity\"", sizeof(std::int32_t), 8 * hexes + 4 * mesh.quads.size(),
                    [&mesh](std::size_t begin, std::size_t end, std::string& out) { append_connectivity(mesh, begin, end, out); }});
  arrays.push_back({"type=\"Int64\" Name=\"offsets\"", sizeof(std::int64_t), cells,
                    appender<std::int64_t>([hexes](std::size_t c) { return c < hexes ? 8 * (c + 1) : 8 * hexes + 4 * (c + 1 - hexes); })});
  arrays.push_back({"type=\"UInt8\" Name=\"types\"", sizeof(std::uint8_t), cells,
                    appender<std::uint8_t>([&mesh](std::size_t c) { return vtk_type(mesh, c); })});
  arrays.push_back({"type=\"Int32\" Name=\"ref\"", sizeof(std::int32_t), cells,
                    appender<std::int32_t>([&mesh](std::size_t c) { return vtk_reference(mesh, c); })});
  arrays.push_back({"type=\"UInt16\" Name=\"layer\"", sizeof(std::uint16_t), cells,
                    appender<std::uint16_t>([&mesh](std::size_t c) { return vtk_layer(mesh, c); })});
  return arrays;
}

std::string compress_block(const Array& array, std::size_t block, int level) {
  const std::size_t per_block = kBlockBytes / array.value_bytes;
  std::string plain;
  plain.reserve(kBlockBytes);
  array.append_values(block * per_block, std::min(array.values, (block + 1) * per_block), plain);
  std::string packed(compressBound(plain.size()), '\0');
  uLongf size = packed.size();
  const int status =
      compress2(reinterpret_cast<Bytef*>(packed.data()), &size, reinterpret_cast<const Bytef*>(plain.data()), plain.size(), level);
  if (status != Z_OK) throw std::runtime_error("zlib cannot compress a block: status " + std::to_string(status));
  packed.resize(size);
  return packed;
}

// take(block, packed) for every block in order; the blocks of a batch are compressed in parallel.
template <class Take>
void for_each_block(const Array& array, int level, const Take& take) {
  std::vector<std::string> packed(kBatch);
  for (std::size_t first = 0; first < array.blocks(); first += kBatch) {
    const std::size_t here = std::min(kBatch, array.blocks() - first);
    parallel_for(here, [&](std::size_t b) { packed[b] = compress_block(array, first + b, level); }, 1);
    for (std::size_t b = 0; b < here; ++b) take(packed[b]);
  }
}

void write_header(const HexMesh& mesh, const std::vector<Array>& arrays, ByteStream& out) {
  std::uint64_t offset = 0;
  std::vector<std::string> tags;
  for (const Array& array : arrays) {
    tags.push_back("        <DataArray " + array.tag + " format=\"appended\" offset=\"" + std::to_string(offset) + "\"/>\n");
    offset += array.bytes_in_file();
  }
  out.write(
      "<?xml version=\"1.0\"?>\n<VTKFile type=\"UnstructuredGrid\" version=\"1.0\" byte_order=\"LittleEndian\" "
      "header_type=\"UInt64\" compressor=\"vtkZLibDataCompressor\">\n  <UnstructuredGrid>\n");
  out.write("    <Piece NumberOfPoints=\"" + std::to_string(mesh.position.size()) + "\" NumberOfCells=\"" +
            std::to_string(mesh.hexes.size() + mesh.quads.size()) + "\">\n");
  out.write("      <Points>\n" + tags[kPoints] + "      </Points>\n");
  out.write("      <Cells>\n" + tags[kConnectivity] + tags[kOffsets] + tags[kTypes] + "      </Cells>\n");
  out.write("      <CellData Scalars=\"ref\">\n" + tags[kRef] + tags[kLayer] + "      </CellData>\n");
  out.write("    </Piece>\n  </UnstructuredGrid>\n  <AppendedData encoding=\"raw\">\n_");
}

void write_array(const Array& array, int level, ByteStream& out) {
  std::string head;
  append<std::uint64_t>(head, array.blocks());
  append<std::uint64_t>(head, kBlockBytes);
  append<std::uint64_t>(head, array.bytes() % kBlockBytes);
  for (const std::uint64_t size : array.compressed) append(head, size);
  out.write(head);
  for_each_block(array, level, [&](const std::string& packed) { out.write(packed); });
}

}  // namespace

void write_vtu(const HexMesh& mesh, const WriteOptions& options, ByteStream& out) {
  std::vector<Array> arrays = arrays_of(mesh);
  for (Array& array : arrays)
    for_each_block(array, options.compression_level, [&](const std::string& packed) { array.compressed.push_back(packed.size()); });
  write_header(mesh, arrays, out);
  for (const Array& array : arrays) write_array(array, options.compression_level, out);
  out.write("\n  </AppendedData>\n</VTKFile>\n");
}

}  // namespace strata::io
