// Medit .mesh: keywords followed by numbers. Vertices, Triangles and Quadrilaterals are read, all other keywords stepped over.
#include <array>
#include <string_view>

#include "core/io/medit_soup.h"
#include "core/io/surface_readers.h"
#include "core/io/text_cursor.h"

namespace strata::io {
namespace {

constexpr std::size_t kBytesPerNumber = 2;  // a digit and a space

bool is_letter(char c) { return (c >= 'a' && c <= 'z') || (c >= 'A' && c <= 'Z'); }

class MeditReader {
 public:
  explicit MeditReader(std::span<const char> bytes) : text_(as_text(bytes)), cursor_(text_) {}

  TriangleSoup read() {
    read_version();
    while (read_section()) {
    }
    return soup_.finish();
  }

 private:
  void read_version() {
    cursor_.skip_space_and_comments();
    TextCursor start = cursor_;
    if (cursor_.rest_of_word() != "MeshVersionFormatted") start.expected("'MeshVersionFormatted'");
    integer("a version");
  }

  // False at the end.
  bool read_section() {
    cursor_.skip_space_and_comments();
    if (cursor_.done()) return false;
    TextCursor start = cursor_;
    const std::string_view keyword = cursor_.rest_of_word();
    if (!is_letter(keyword[0])) start.expected("a keyword");
    if (keyword == "End") return false;
    if (keyword == "Dimension") read_dimension();
    else if (keyword == "Vertices") read_vertices();
    else if (keyword == "Triangles") read_faces(3, "triangles");
    else if (keyword == "Quadrilaterals") read_faces(4, "quadrilaterals");
    else skip_numbers();
    return true;
  }

  void read_dimension() {
    cursor_.skip_space_and_comments();
    TextCursor start = cursor_;
    if (integer("a dimension") != 3) start.expected("dimension 3");
  }

  std::uint64_t read_count(std::size_t numbers_each, std::string_view what) {
    cursor_.skip_space_and_comments();
    const Place place = cursor_.place();
    const std::uint64_t count = cursor_.count_here("a number of " + std::string(what));
    require_room(count, cursor_.bytes_left() + 1, numbers_each * kBytesPerNumber, what, place);
    return count;
  }

  void read_vertices() {
    for (std::uint64_t n = read_count(4, "vertices"); n > 0; --n) {
      const double x = coordinate(), y = coordinate(), z = coordinate();
      integer("a reference");
      soup_.add_vertex({x, y, z});
    }
  }

  void read_faces(int corners, std::string_view what) {
    for (std::uint64_t n = read_count(static_cast<std::size_t>(corners) + 1, what); n > 0; --n) {
      cursor_.skip_space_and_comments();
      const TextCursor start = cursor_;
      std::array<std::int64_t, 4> vertices{};
      for (int i = 0; i < corners; ++i) {
        const std::int64_t v = integer("a vertex index");
        // Vertices come first in all but odd files, and then the line can be named.
        if (v < 1 || (soup_.vertex_count() > 0 && v > static_cast<std::int64_t>(soup_.vertex_count())))
          refuse_index(start.place(), corners == 4 ? "a quadrilateral" : "a triangle", v, soup_.vertex_count());
        vertices[static_cast<std::size_t>(i)] = v;
      }
      soup_.add_face(vertices, corners, integer("a reference"), {});
    }
  }

  void skip_numbers() {
    for (cursor_.skip_space_and_comments(); !cursor_.done() && !is_letter(text_[cursor_.offset()]); cursor_.skip_space_and_comments())
      cursor_.rest_of_word();
  }

  double coordinate() {
    cursor_.skip_space_and_comments();
    return cursor_.coordinate_here("a coordinate");
  }
  std::int64_t integer(std::string_view what) {
    cursor_.skip_space_and_comments();
    return cursor_.integer_here(what);
  }

  std::string_view text_;
  TextCursor cursor_;
  MeditSoup soup_;
};

}  // namespace

TriangleSoup read_medit_ascii(std::span<const char> bytes) { return MeditReader(bytes).read(); }

}  // namespace strata::io
