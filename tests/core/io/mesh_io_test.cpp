// What was written is taken apart again by small parsers of this file, one a format.
#include "core/io/mesh_io.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <zlib.h>

#include <cstring>
#include <filesystem>
#include <fstream>
#include <map>
#include <sstream>

#include "core/base/diagnostic.h"
#include "core/io/surface_io.h"
#include "tests/core/io/block_mesh.h"

namespace strata::test {
namespace {

using io::MeshFormat;

constexpr MeshFormat kFormats[] = {MeshFormat::MeditAscii, MeshFormat::MeditBinary, MeshFormat::Vtu, MeshFormat::Vtk};

std::string written(const HexMesh& mesh, MeshFormat format, io::WriteOptions options = {}) {
  std::string bytes;
  io::write_mesh(mesh, format, options, [&](std::span<const char> piece) { bytes.append(piece.data(), piece.size()); });
  return bytes;
}

std::string layers_written(const HexMesh& mesh, MeshFormat format) {
  std::string bytes;
  io::write_layer_solution(mesh, format, [&](std::span<const char> piece) { bytes.append(piece.data(), piece.size()); });
  return bytes;
}

// What every format holds, as plain lists: vertices from 0, hexes before quads.
struct Contents {
  std::vector<double> coordinates;
  std::vector<std::vector<std::int64_t>> cells;
  std::vector<std::int64_t> reference;
  std::vector<std::int64_t> layer;  // empty in Medit files
};

Contents contents_of(const HexMesh& mesh) {
  Contents c;
  for (const Vec3& p : mesh.position) c.coordinates.insert(c.coordinates.end(), {p.x(), p.y(), p.z()});
  const auto add = [&](const auto& vertices, std::int64_t reference, std::int64_t layer) {
    c.cells.emplace_back();
    for (const VertexId v : vertices) c.cells.back().push_back(v.value);
    c.reference.push_back(reference);
    c.layer.push_back(layer);
  };
  for (const HexId h : mesh.hexes.ids()) add(mesh.hexes[h], mesh.region[h].value + 1, mesh.layer[h]);
  for (const QuadId q : mesh.quads.ids()) add(mesh.quads[q], mesh.patch[q].value + 1, 0);
  return c;
}

void expect_same(const Contents& actual, const Contents& expected) {
  EXPECT_EQ(actual.coordinates, expected.coordinates);
  EXPECT_EQ(actual.cells, expected.cells);
  EXPECT_EQ(actual.reference, expected.reference);
  if (!actual.layer.empty()) {
    EXPECT_EQ(actual.layer, expected.layer);
  }
}

void put_hexes_first(Contents& c) {
  std::vector<std::size_t> order;
  for (const std::size_t size : {8u, 4u})
    for (std::size_t i = 0; i < c.cells.size(); ++i)
      if (c.cells[i].size() == size) order.push_back(i);
  Contents sorted = c;
  for (std::size_t i = 0; i < order.size(); ++i) {
    sorted.cells[i] = c.cells[order[i]];
    sorted.reference[i] = c.reference[order[i]];
  }
  c = sorted;
}

Contents parse_medit(const std::string& text) {
  std::istringstream in(text);
  Contents c;
  for (std::string word; in >> word;) {
    const std::size_t corners = word == "Hexahedra" ? 8 : word == "Quadrilaterals" ? 4 : 0;
    std::size_t count = 0;
    if (word == "Vertices") {
      in >> count;
      for (std::size_t i = 0; i < count; ++i) {
        std::string x, y, z, reference;
        in >> x >> y >> z >> reference;
        c.coordinates.insert(c.coordinates.end(), {std::stod(x), std::stod(y), std::stod(z)});
      }
    } else if (corners > 0) {
      in >> count;
      for (std::size_t i = 0; i < count; ++i) {
        c.cells.emplace_back(corners);
        for (std::int64_t& v : c.cells.back()) in >> v, --v;
        in >> c.reference.emplace_back();
      }
    }
  }
  put_hexes_first(c);
  return c;
}

template <class T>
T take(const std::string& bytes, std::size_t& at) {
  T value;
  if (at + sizeof(T) > bytes.size()) throw std::out_of_range("the file ends early");
  std::memcpy(&value, bytes.data() + at, sizeof(T));
  at += sizeof(T);
  return value;
}

Contents parse_gmf(const std::string& bytes) {
  Contents c;
  std::size_t at = 0;
  EXPECT_EQ(take<std::int32_t>(bytes, at), 1);
  EXPECT_EQ(take<std::int32_t>(bytes, at), 2);
  for (std::int32_t keyword = 0; keyword != 54;) {
    keyword = take<std::int32_t>(bytes, at);
    const auto next = take<std::int32_t>(bytes, at);
    if (keyword == 3) {
      EXPECT_EQ(take<std::int32_t>(bytes, at), 3);
    }
    if (keyword == 4)
      for (auto n = take<std::int32_t>(bytes, at); n > 0; --n) {
        for (int i = 0; i < 3; ++i) c.coordinates.push_back(take<double>(bytes, at));
        take<std::int32_t>(bytes, at);
      }
    if (keyword == 7 || keyword == 10)
      for (auto n = take<std::int32_t>(bytes, at); n > 0; --n) {
        c.cells.emplace_back(keyword == 7 ? 4 : 8);
        for (std::int64_t& v : c.cells.back()) v = take<std::int32_t>(bytes, at) - 1;
        c.reference.push_back(take<std::int32_t>(bytes, at));
      }
    EXPECT_EQ(static_cast<std::size_t>(next), keyword == 54 ? 0 : at);
  }
  EXPECT_EQ(at, bytes.size());
  put_hexes_first(c);
  return c;
}

// Unpacks the appended array of a name.
template <class T>
std::vector<T> vtu_array(const std::string& file, const std::string& name) {
  const std::size_t tag = file.find("Name=\"" + name + "\"");
  const std::size_t offset = std::stoul(file.substr(file.find("offset=\"", tag) + 8));
  std::size_t at = file.find('_', file.find("<AppendedData")) + 1 + offset;
  const auto blocks = take<std::uint64_t>(file, at), size = take<std::uint64_t>(file, at), last = take<std::uint64_t>(file, at);
  std::vector<std::uint64_t> packed(blocks);
  for (std::uint64_t& p : packed) p = take<std::uint64_t>(file, at);
  std::vector<T> values;
  for (std::size_t b = 0; b < blocks; ++b) {
    uLongf bytes = b + 1 == blocks && last != 0 ? last : size;
    const uLongf expected = bytes;
    std::vector<T> block(bytes / sizeof(T));
    EXPECT_EQ(uncompress(reinterpret_cast<Bytef*>(block.data()), &bytes, reinterpret_cast<const Bytef*>(file.data() + at), packed[b]),
              Z_OK);
    EXPECT_EQ(bytes, expected);
    values.insert(values.end(), block.begin(), block.end());
    at += packed[b];
  }
  return values;
}

Contents parse_vtu(const std::string& file) {
  Contents c;
  c.coordinates = vtu_array<double>(file, "Points");
  const auto connectivity = vtu_array<std::int32_t>(file, "connectivity");
  const auto types = vtu_array<std::uint8_t>(file, "types");
  std::size_t begin = 0;
  for (const std::int64_t end : vtu_array<std::int64_t>(file, "offsets")) {
    c.cells.emplace_back(connectivity.begin() + static_cast<std::ptrdiff_t>(begin), connectivity.begin() + end);
    EXPECT_EQ(types[c.cells.size() - 1], c.cells.back().size() == 8 ? 12 : 9);
    begin = static_cast<std::size_t>(end);
  }
  EXPECT_EQ(begin, connectivity.size());
  for (const std::int32_t r : vtu_array<std::int32_t>(file, "ref")) c.reference.push_back(r);
  for (const std::uint16_t l : vtu_array<std::uint16_t>(file, "layer")) c.layer.push_back(l);
  return c;
}

template <class T>
T take_big_endian(const std::string& bytes, std::size_t& at) {
  std::string raw = bytes.substr(at, sizeof(T));
  raw.assign(raw.rbegin(), raw.rend());
  at += sizeof(T);
  T value;
  std::memcpy(&value, raw.data(), sizeof(T));
  return value;
}

Contents parse_vtk(const std::string& file) {
  Contents c;
  const auto behind = [&](const std::string& line_start, int lines = 1) {
    std::size_t at = file.find("\n" + line_start) + 1;
    while (lines-- > 0) at = file.find('\n', at) + 1;
    return at;
  };
  const auto number = [&](const std::string& keyword) { return std::stoul(file.substr(file.find("\n" + keyword) + keyword.size() + 2)); };
  std::size_t at = behind("POINTS");
  for (std::size_t i = 0; i < 3 * number("POINTS"); ++i) c.coordinates.push_back(take_big_endian<double>(file, at));
  at = behind("CELLS");
  for (std::size_t i = 0; i < number("CELLS"); ++i) {
    c.cells.emplace_back(static_cast<std::size_t>(take_big_endian<std::int32_t>(file, at)));
    for (std::int64_t& v : c.cells.back()) v = take_big_endian<std::int32_t>(file, at);
  }
  at = behind("CELL_TYPES");
  for (const auto& cell : c.cells) EXPECT_EQ(take_big_endian<std::int32_t>(file, at), cell.size() == 8 ? 12 : 9);
  at = behind("SCALARS ref", 2);
  for (std::size_t i = 0; i < c.cells.size(); ++i) c.reference.push_back(take_big_endian<std::int32_t>(file, at));
  at = behind("SCALARS layer", 2);
  for (std::size_t i = 0; i < c.cells.size(); ++i) c.layer.push_back(take_big_endian<std::int32_t>(file, at));
  return c;
}

HexMesh odd_mesh() {
  HexMesh mesh = block_mesh(5, 4, 3);
  for (Vec3& p : mesh.position) p = Vec3(p.x() / 3, p.y() * 1e-20 + 0.1, -p.z() * 1e20);
  return mesh;
}

TEST(MeshWriters, EveryFormatHoldsTheMesh) {
  const HexMesh mesh = odd_mesh();
  const Contents expected = contents_of(mesh);
  expect_same(parse_medit(written(mesh, MeshFormat::MeditAscii)), expected);
  expect_same(parse_gmf(written(mesh, MeshFormat::MeditBinary)), expected);
  expect_same(parse_vtu(written(mesh, MeshFormat::Vtu)), expected);
  expect_same(parse_vtk(written(mesh, MeshFormat::Vtk)), expected);
}

TEST(MeshWriters, MeshesOfManyBlocksAreWhole) {
  const HexMesh mesh = block_mesh(40, 41, 39);
  const Contents expected = contents_of(mesh);
  const std::string vtu = written(mesh, MeshFormat::Vtu);
  EXPECT_GT(mesh.hexes.size() * 32, std::size_t{7} << 18);  // several compressed blocks
  expect_same(parse_vtu(vtu), expected);
  expect_same(parse_gmf(written(mesh, MeshFormat::MeditBinary)), expected);
  EXPECT_LT(vtu.size(), written(mesh, MeshFormat::Vtk).size() / 2);
}

TEST(MeshWriters, HandOverPiecesOfAboutAMebibyte) {
  const HexMesh mesh = block_mesh(40, 41, 39);
  for (const MeshFormat format : kFormats) {
    std::size_t largest = 0, pieces = 0, total = 0;
    io::write_mesh(mesh, format, {}, [&](std::span<const char> piece) {
      largest = std::max(largest, piece.size());
      total += piece.size();
      ++pieces;
    });
    EXPECT_LE(largest, std::size_t{1} << 20);
    EXPECT_EQ(pieces, (total + (1u << 20) - 1) >> 20);
  }
}

TEST(MeshWriters, WriteTheSameBytesEveryTime) {
  const HexMesh mesh = block_mesh(30, 30, 30);
  for (const MeshFormat format : kFormats) EXPECT_EQ(written(mesh, format), written(mesh, format));
}

TEST(MeshWriters, BoundaryQuadsReadBackAsASurface) {
  const HexMesh mesh = block_mesh(4, 4, 4);
  for (const MeshFormat format : {MeshFormat::MeditAscii, MeshFormat::MeditBinary}) {
    const std::string bytes = written(mesh, format);
    const TriangleSoup soup = io::read_surface(std::span<const char>(bytes), io::SurfaceFormat::Medit);
    EXPECT_EQ(soup.triangles.size(), 2 * mesh.quads.size());
    EXPECT_THAT(soup.patch_names, ::testing::UnorderedElementsAre("1", "2", "3", "4", "5", "6", "7"));
    EXPECT_EQ(soup.points, mesh.position.values());
  }
}

TEST(MeshWriters, LayersGoWithAMeditMesh) {
  const HexMesh mesh = block_mesh(2, 2, 3);
  std::istringstream text(layers_written(mesh, MeshFormat::MeditAscii));
  std::string word;
  while (text >> word && word != "SolAtHexahedra") {
  }
  std::size_t count = 0, fields = 0, kind = 0;
  text >> count >> fields >> kind;
  EXPECT_EQ(count, mesh.hexes.size());
  EXPECT_EQ(fields, 1u);
  EXPECT_EQ(kind, 1u);
  const std::string bytes = layers_written(mesh, MeshFormat::MeditBinary);
  std::size_t at = 8 + 12;  // head, dimension
  EXPECT_EQ(take<std::int32_t>(bytes, at), 68);
  EXPECT_EQ(static_cast<std::size_t>(take<std::int32_t>(bytes, at)), bytes.size() - 8);
  EXPECT_EQ(static_cast<std::size_t>(take<std::int32_t>(bytes, at)), mesh.hexes.size());
  at += 8;
  for (const HexId h : mesh.hexes.ids()) {
    int layer = -1;
    text >> layer;
    EXPECT_EQ(layer, mesh.layer[h]);
    EXPECT_EQ(take<double>(bytes, at), mesh.layer[h]);
  }
  EXPECT_THROW(layers_written(mesh, MeshFormat::Vtu), MeshError);
}

TEST(MeshWriters, AFileAppearsUnderItsNameOnlyWhenComplete) {
  const auto path = std::filesystem::temp_directory_path() / "strata_io_mesh_test.vtu";
  const HexMesh mesh = block_mesh(3, 3, 3);
  io::write_mesh_file(mesh, path.string());
  std::ifstream in(path, std::ios::binary);
  const std::string bytes((std::istreambuf_iterator<char>(in)), {});
  EXPECT_EQ(bytes, written(mesh, MeshFormat::Vtu));
  EXPECT_FALSE(std::filesystem::exists(path.string() + ".part"));
  std::filesystem::remove(path);
  EXPECT_THROW(io::write_mesh_file(mesh, "/no/such/directory/x.vtu"), std::system_error);
  EXPECT_THROW(io::write_mesh_file(mesh, "mesh.xyz"), MeshError);
}

TEST(MeshWriters, AMeshWithoutQuadsOrLabelsCanBeWritten) {
  HexMesh mesh = block_mesh(2, 2, 2);
  mesh.quads.clear();
  mesh.patch.clear();
  mesh.region.clear();
  mesh.layer.clear();
  EXPECT_EQ(parse_vtu(written(mesh, MeshFormat::Vtu)).reference, std::vector<std::int64_t>(8, 0));
  EXPECT_EQ(parse_gmf(written(mesh, MeshFormat::MeditBinary)).cells.size(), 8u);
}

}  // namespace
}  // namespace strata::test
