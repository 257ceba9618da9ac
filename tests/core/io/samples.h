// One small closed surface, a tetrahedron of four triangles, in every format readers know.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "tests/core/io/reading.h"

namespace strata::test {

inline constexpr double kTetPoints[4][3] = {{0, 0, 0}, {1, 0, 0}, {0, 1, 0}, {0, 0, 1}};
inline constexpr int kTetFaces[4][3] = {{0, 2, 1}, {0, 1, 3}, {1, 2, 3}, {0, 3, 2}};

inline std::string facet(int face) {
  std::string text = "facet normal 0 0 0\n outer loop\n";
  for (const int v : kTetFaces[face]) {
    text += "  vertex";
    for (const double x : kTetPoints[v]) text += " " + std::to_string(x);
    text += "\n";
  }
  return text + " endloop\nendfacet\n";
}

inline std::string solid(const std::string& name, std::initializer_list<int> faces) {
  std::string text = "solid " + name + "\n";
  for (const int f : faces) text += facet(f);
  return text + "endsolid " + name + "\n";
}

inline std::string binary_stl(std::string header, std::uint32_t count = 4) {
  header.resize(80, ' ');
  append(header, count);
  for (const auto& face : kTetFaces) {
    for (int i = 0; i < 3; ++i) append(header, 0.0f);
    for (const int v : face)
      for (const double x : kTetPoints[v]) append(header, static_cast<float>(x));
    append(header, std::uint16_t{0});
  }
  return header;
}

inline const std::string kTetObj = "v 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 1\ng base\nf 1 3 2\ng walls\nf 1 2 4\nf 2 3 4\nf 1 4 3\n";
inline const std::string kTetOff = "OFF\n4 4 6\n0 0 0\n1 0 0\n0 1 0\n0 0 1\n3 0 2 1\n3 0 1 3\n3 1 2 3\n3 0 3 2\n";
inline const std::string kTetMedit =
    "MeshVersionFormatted 2\nDimension 3\nVertices\n4\n0 0 0 0\n1 0 0 0\n0 1 0 0\n0 0 1 0\n"
    "Triangles\n4\n1 3 2 5\n1 2 4 9\n2 3 4 9\n1 4 3 9\nEnd\n";

inline std::string ply_header(const std::string& format, const std::string& face_properties) {
  return "ply\nformat " + format +
         " 1.0\ncomment a tetrahedron\nelement vertex 4\nproperty double x\nproperty double y\n"
         "property double z\nelement face 4\n" +
         face_properties + "end_header\n";
}

inline std::string ascii_ply() {
  std::string text = ply_header("ascii", "property list uchar int vertex_indices\nproperty int patch\n");
  for (const auto& p : kTetPoints) text += std::to_string(p[0]) + " " + std::to_string(p[1]) + " " + std::to_string(p[2]) + "\n";
  for (const auto& f : kTetFaces)
    text += "3 " + std::to_string(f[0]) + " " + std::to_string(f[1]) + " " + std::to_string(f[2]) + (f[0] == 1 ? " 8\n" : " 7\n");
  return text;
}

// The machine is little-endian, as the writers assert.
inline std::string binary_ply(Bytes order) {
  std::string bytes = ply_header(order == Bytes::AsIs ? "binary_little_endian" : "binary_big_endian",
                                 "property short label\nproperty list ushort uint vertex_index\n");
  for (const auto& p : kTetPoints)
    for (const double x : p) append(bytes, x, order);
  for (const auto& f : kTetFaces) {
    append<std::int16_t>(bytes, f[0] == 1 ? 8 : 7, order);
    append<std::uint16_t>(bytes, 3, order);
    for (const int v : f) append<std::uint32_t>(bytes, static_cast<std::uint32_t>(v), order);
  }
  return bytes;
}

// Keyword blocks as GMF versions 1 to 4 have them.
inline std::string gmf(int version, Bytes order) {
  std::string bytes;
  const auto integer = [&](std::int64_t i) {
    if (version >= 4) append(bytes, i, order);
    else append(bytes, static_cast<std::int32_t>(i), order);
  };
  const auto real = [&](double x) {
    if (version >= 2) append(bytes, x, order);
    else append(bytes, static_cast<float>(x), order);
  };
  const std::size_t position_bytes = version >= 3 ? 8 : 4, integer_bytes = version >= 4 ? 8 : 4, real_bytes = version >= 2 ? 8 : 4;
  const auto head = [&](std::int32_t keyword, std::size_t data_bytes) {
    append(bytes, keyword, order);
    const std::size_t next = data_bytes == 0 ? 0 : bytes.size() + position_bytes + data_bytes;
    if (version >= 3) append(bytes, static_cast<std::int64_t>(next), order);
    else append(bytes, static_cast<std::int32_t>(next), order);
  };
  append<std::int32_t>(bytes, 1, order);
  append<std::int32_t>(bytes, version, order);
  head(3, 4);
  append<std::int32_t>(bytes, 3, order);
  head(4, integer_bytes + 4 * (3 * real_bytes + integer_bytes));
  integer(4);
  for (const auto& p : kTetPoints) {
    for (const double x : p) real(x);
    integer(0);
  }
  head(13, integer_bytes * 2);  // Corners: to be stepped over
  integer(1);
  integer(1);
  head(6, integer_bytes * (1 + 4 * 4));
  integer(4);
  for (const auto& f : kTetFaces) {
    for (const int v : f) integer(v + 1);
    integer(f[0] == 1 ? 9 : 5);
  }
  head(54, 0);
  return bytes;
}

struct Sample {
  std::string name;
  std::string bytes;
  io::SurfaceFormat format;
};

inline std::vector<Sample> samples() {
  using F = io::SurfaceFormat;
  std::vector<Sample> all{{"ASCII STL", solid("base", {0}) + solid("walls", {1, 2, 3}), F::Stl},
                          {"binary STL", binary_stl("made by hand"), F::Stl},
                          {"OBJ", kTetObj, F::Obj},
                          {"OFF", kTetOff, F::Off},
                          {"ASCII PLY", ascii_ply(), F::Ply},
                          {"little-endian PLY", binary_ply(Bytes::AsIs), F::Ply},
                          {"big-endian PLY", binary_ply(Bytes::Swapped), F::Ply},
                          {"Medit", kTetMedit, F::Medit}};
  for (int version = 1; version <= 4; ++version)
    for (const Bytes order : {Bytes::AsIs, Bytes::Swapped})
      all.push_back({"GMF version " + std::to_string(version) + (order == Bytes::AsIs ? "" : " swapped"), gmf(version, order), F::Medit});
  return all;
}

}  // namespace strata::test
