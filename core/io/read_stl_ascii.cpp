// ASCII STL, read in parallel: the text is cut at lines that begin with "facet" or "solid", each piece is parsed on its own, the pieces
// are joined in order. The result, and the refusal of a bad file, is that of reading from the top.
#include <algorithm>
#include <exception>
#include <optional>
#include <string_view>

#include "core/base/parallel.h"
#include "core/io/soup_builder.h"
#include "core/io/surface_readers.h"
#include "core/io/text_cursor.h"
#include "core/io/weld_exact.h"

namespace strata::io {
namespace {

constexpr std::size_t kPieceBytes = std::size_t{1} << 20;

struct SolidStart {
  std::size_t triangle = 0;  // of the piece, from which on the name holds
  std::string_view name;
};

struct Piece {
  std::size_t begin = 0;
  std::size_t end = 0;  // parsing stops at the first facet or solid that starts here or later
  std::vector<Vec3> corners;
  std::vector<SolidStart> solids;
  std::optional<bool> solid_open;  // at the end of the piece; empty: as it was at the start
  std::exception_ptr refusal;
};

// First line at or behind `from` that begins with "facet" or "solid"; the end of the text when there is none.
std::size_t next_cut(std::string_view text, std::size_t from) {
  for (TextCursor cursor(text, from); !cursor.done();) {
    cursor.skip_line();
    const std::size_t line = cursor.offset();
    cursor.skip_blanks();
    const std::string_view first = cursor.rest_of_word();
    if (is_keyword(first, "facet") || is_keyword(first, "solid")) return line;
  }
  return text.size();
}

std::vector<Piece> cut(std::string_view text) {
  std::vector<Piece> pieces;
  for (std::size_t begin = 0; begin < text.size();) {
    const std::size_t end = begin + kPieceBytes < text.size() ? next_cut(text, begin + kPieceBytes) : text.size();
    pieces.emplace_back();
    pieces.back().begin = begin;
    pieces.back().end = end;
    begin = end;
  }
  return pieces;
}

void expect(TextCursor& cursor, std::string_view keyword) {
  cursor.skip_space();
  TextCursor before = cursor;
  if (!is_keyword(cursor.rest_of_word(), keyword)) before.expected("'" + std::string(keyword) + "'");
}

// "normal x y z": recomputed later, so anything goes, but a missing one must not swallow "outer".
void skip_normal(TextCursor& cursor) {
  for (int i = 0; i < 4; ++i) {
    TextCursor before = cursor;
    if (is_keyword(cursor.word(), "outer")) {
      cursor = before;
      return;
    }
  }
}

void read_facet(TextCursor& cursor, std::vector<Vec3>& corners) {
  skip_normal(cursor);
  expect(cursor, "outer");
  expect(cursor, "loop");
  for (int i = 0; i < 3; ++i) {
    expect(cursor, "vertex");
    const double x = cursor.coordinate(), y = cursor.coordinate(), z = cursor.coordinate();
    corners.emplace_back(x, y, z);
  }
  expect(cursor, "endloop");
  expect(cursor, "endfacet");
}

void parse(std::string_view text, Piece& piece) {
  TextCursor cursor(text, piece.begin);
  for (cursor.skip_space(); cursor.offset() < piece.end; cursor.skip_space()) {
    TextCursor before = cursor;
    const std::string_view keyword = cursor.rest_of_word();
    if (is_keyword(keyword, "facet")) {
      read_facet(cursor, piece.corners);
    } else if (is_keyword(keyword, "solid")) {
      piece.solids.push_back({piece.corners.size() / 3, cursor.rest_of_line()});
      piece.solid_open = true;
    } else if (is_keyword(keyword, "endsolid")) {
      cursor.skip_line();
      piece.solid_open = false;
    } else {
      before.expected("'facet', 'solid' or 'endsolid'");
    }
  }
}

// A file that ends inside a solid was cut off, even when it was cut between two facets.
void require_closed(std::string_view text, const std::vector<Piece>& pieces) {
  bool open = false;
  for (const Piece& piece : pieces) open = piece.solid_open.value_or(open);
  if (open) TextCursor(text, text.size()).expected("'endsolid'");
}

// The same name is the same patch. Solids without a name are told apart by their number, unless no solid has a name: such a
// surface is one patch.
void name_patches(const std::vector<Piece>& pieces, TriangleSoup& soup) {
  SoupBuilder names;
  bool any_name = false;
  for (const Piece& piece : pieces)
    for (const SolidStart& solid : piece.solids) any_name = any_name || !solid.name.empty();
  std::int32_t patch = -1;
  int solid_number = 0;
  std::size_t base = 0;
  soup.patch.reserve(soup.triangles.size());
  for (const Piece& piece : pieces) {
    for (const SolidStart& solid : piece.solids) {
      soup.patch.resize(base + solid.triangle, patch);
      patch = names.patch(!any_name            ? std::string(kUnnamedPatch)
                          : solid.name.empty() ? "solid_" + std::to_string(solid_number)
                                               : std::string(solid.name));
      ++solid_number;
    }
    base += piece.corners.size() / 3;
    soup.patch.resize(base, patch);
  }
  soup.patch_names = names.names();
}

std::vector<Vec3> join(std::vector<Piece>& pieces) {
  std::size_t count = 0;
  for (const Piece& piece : pieces) count += piece.corners.size();
  std::vector<Vec3> corners;
  corners.reserve(count);
  for (const Piece& piece : pieces) corners.insert(corners.end(), piece.corners.begin(), piece.corners.end());
  return corners;
}

}  // namespace

TriangleSoup read_stl_ascii(std::span<const char> bytes) {
  const std::string_view text = as_text(bytes);
  std::vector<Piece> pieces = cut(text);
  parallel_for(
      pieces.size(),
      [&](std::size_t i) {
        try {
          parse(text, pieces[i]);
        } catch (const MeshError&) {
          pieces[i].refusal = std::current_exception();  // the first bad place of the file is to be named, not the first found
        }
      },
      1);
  for (const Piece& piece : pieces)
    if (piece.refusal) std::rethrow_exception(piece.refusal);
  require_closed(text, pieces);
  TriangleSoup soup;
  weld_exact(join(pieces), soup);
  name_patches(pieces, soup);
  finish_soup(soup);
  return soup;
}

}  // namespace strata::io
