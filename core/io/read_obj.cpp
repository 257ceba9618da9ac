// Wavefront OBJ: vertices and polygons; patches from g, else o, else usemtl. Everything else is skipped.
#include <charconv>
#include <string>
#include <vector>

#include "core/io/soup_builder.h"
#include "core/io/surface_readers.h"
#include "core/io/text_cursor.h"

namespace strata::io {
namespace {

class ObjReader {
 public:
  explicit ObjReader(std::span<const char> bytes) : cursor_(as_text(bytes)) {}

  TriangleSoup read() {
    for (cursor_.skip_space(); !cursor_.done(); cursor_.skip_space()) read_statement();
    return soup_.finish();
  }

 private:
  void read_statement() {
    const std::string_view keyword = cursor_.rest_of_word();
    if (keyword == "v") read_vertex();
    else if (keyword == "f") read_face();
    else if (keyword == "g") rename(group_);
    else if (keyword == "o") rename(object_);
    else if (keyword == "usemtl") rename(material_);
    else skip_statement();
  }

  // x y z, perhaps a weight or a colour after them.
  void read_vertex() {
    Vec3 p;
    for (int i = 0; i < 3; ++i) {
      skip_blanks();
      p[i] = cursor_.coordinate_here("a coordinate");
    }
    soup_.add_point(p);
    skip_statement();
  }

  void read_face() {
    const TextCursor statement = cursor_;
    corners_.clear();
    for (skip_blanks(); !cursor_.at_line_end(); skip_blanks()) corners_.push_back(read_corner());
    if (corners_.size() < 3)
      refuse(Reason::FileMalformed, statement.place(), "expected a face of at least 3 corners, found " + std::to_string(corners_.size()),
             {{"corners", static_cast<double>(corners_.size())}});
    if (patch_ < 0) patch_ = soup_.patch(patch_name());
    soup_.add_polygon(corners_, patch_);
  }

  // "7", "7/1", "7//3", "7/1/3", "-2": counted from 1, or backwards from the last vertex so far.
  std::int32_t read_corner() {
    TextCursor start = cursor_;
    const std::string_view word = cursor_.rest_of_word();
    const std::string_view vertex = word.substr(0, word.find('/'));
    std::int64_t index = 0;
    const auto [after, error] = std::from_chars(vertex.data(), vertex.data() + vertex.size(), index);
    if (error != std::errc() || after != vertex.data() + vertex.size()) start.expected("a vertex index");
    const auto count = static_cast<std::int64_t>(soup_.point_count());
    if (index == 0 || index > count || index < -count) refuse_index(start.place(), "a face", index, soup_.point_count());
    return static_cast<std::int32_t>(index > 0 ? index - 1 : count + index);
  }

  void rename(std::string& name) {
    name.clear();
    for (skip_blanks(); !cursor_.at_line_end(); skip_blanks()) {
      if (!name.empty()) name += ' ';
      name += cursor_.rest_of_word();
    }
    patch_ = -1;
  }

  [[nodiscard]] std::string_view patch_name() const {
    for (const std::string* name : {&group_, &object_, &material_})
      if (!name->empty()) return *name;
    return kUnnamedPatch;
  }

  // A backslash at the end of a line continues the statement.
  void skip_blanks() {
    for (cursor_.skip_blanks(); !cursor_.at_line_end(); cursor_.skip_blanks()) {
      TextCursor ahead = cursor_;
      if (ahead.rest_of_word() != "\\") return;
      ahead.skip_blanks();
      if (!ahead.at_line_end()) return;
      ahead.skip_line();
      cursor_ = ahead;
    }
  }
  void skip_statement() {
    for (std::string_view line = cursor_.rest_of_line(); line.ends_with('\\') && !cursor_.done();) line = cursor_.rest_of_line();
  }

  TextCursor cursor_;
  SoupBuilder soup_;
  std::string group_, object_, material_;
  std::int32_t patch_ = -1;  // of the names above; -1: to be looked up
  std::vector<std::int32_t> corners_;
};

}  // namespace

TriangleSoup read_obj(std::span<const char> bytes) { return ObjReader(bytes).read(); }

}  // namespace strata::io
