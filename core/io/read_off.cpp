// Object File Format: counts, one vertex a line, one polygon a line. Normals, texture coordinates and colours behind the
// position or the indices are skipped.
#include <string>
#include <vector>

#include "core/io/soup_builder.h"
#include "core/io/surface_readers.h"
#include "core/io/text_cursor.h"

namespace strata::io {
namespace {

constexpr std::size_t kLeastVertexBytes = 5;  // "0 0 0", the last one without a line break
constexpr std::size_t kLeastFaceBytes = 1;    // "0"

// The keyword OFF may be preceded by ST (texture), C (colour), N (normal); all of those follow the position. It may be absent.
void read_header(TextCursor& cursor) {
  cursor.skip_space_and_comments();
  TextCursor start = cursor;
  const std::string_view keyword = cursor.rest_of_word();
  if (!keyword.empty() && keyword[0] >= '0' && keyword[0] <= '9') {
    cursor = start;
    return;
  }
  for (const std::string_view known : {"OFF", "COFF", "NOFF", "CNOFF", "STOFF", "STCOFF", "STNOFF", "STCNOFF"})
    if (keyword == known) {
      cursor.skip_space_and_comments();
      start = cursor;
      if (cursor.rest_of_word() == "BINARY") start.expected("an ASCII OFF file");
      cursor = start;
      return;
    }
  start.expected("'OFF'");
}

std::uint64_t read_count(TextCursor& cursor, std::string_view what) {
  cursor.skip_space_and_comments();
  return cursor.count_here(what);
}

void read_vertices(TextCursor& cursor, std::uint64_t count, SoupBuilder& soup) {
  soup.reserve_points(count);
  for (std::uint64_t v = 0; v < count; ++v) {
    cursor.skip_space_and_comments();
    const double x = cursor.coordinate(), y = cursor.coordinate(), z = cursor.coordinate();
    cursor.skip_line();
    soup.add_point({x, y, z});
  }
}

void read_faces(TextCursor& cursor, std::uint64_t count, SoupBuilder& soup) {
  const std::int32_t patch = soup.patch(kUnnamedPatch);
  std::vector<std::int32_t> corners;
  for (std::uint64_t f = 0; f < count; ++f) {
    cursor.skip_space_and_comments();
    const std::uint64_t size = cursor.count_here("the number of corners of a face");
    if (!has_room(size, cursor.bytes_left(), 2)) require_room(size, cursor.bytes_left(), 2, "corners of a face", cursor.place());
    corners.clear();
    for (std::uint64_t i = 0; i < size; ++i) {
      const std::int64_t index = cursor.integer("a vertex index");
      if (index < 0 || index >= static_cast<std::int64_t>(soup.point_count()))
        refuse_index(cursor.place(), "face " + std::to_string(f) + " (counted from 0)", index, soup.point_count());
      corners.push_back(static_cast<std::int32_t>(index));
    }
    cursor.skip_line();
    soup.add_polygon(corners, patch);
  }
}

}  // namespace

TriangleSoup read_off(std::span<const char> bytes) {
  TextCursor cursor(as_text(bytes));
  read_header(cursor);
  const std::uint64_t vertices = read_count(cursor, "the number of vertices");
  const std::uint64_t faces = read_count(cursor, "the number of faces");
  const Place counts = cursor.place();
  cursor.skip_line();  // the number of edges, if given, is nobody's concern
  require_room(vertices, cursor.bytes_left(), kLeastVertexBytes, "vertices", counts);
  require_room(faces, cursor.bytes_left(), kLeastFaceBytes, "faces", counts);
  require_indexable(vertices, "points");
  SoupBuilder soup;
  read_vertices(cursor, vertices, soup);
  read_faces(cursor, faces, soup);
  return soup.finish();
}

}  // namespace strata::io
