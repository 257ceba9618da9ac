#include <array>
#include <cstdint>
#include <cstring>
#include <string>

#include "core/io/byte_cursor.h"
#include "core/io/gmf.h"
#include "core/io/medit_soup.h"
#include "core/io/surface_readers.h"

namespace strata::io {
namespace {

constexpr std::int32_t kByteOrderMark = 1;
constexpr std::int32_t kSwappedMark = 1 << 24;

std::int32_t first_word(std::span<const char> bytes) {
  std::int32_t word = 0;
  if (bytes.size() >= sizeof(word)) std::memcpy(&word, bytes.data(), sizeof(word));
  return word;
}

class GmfReader {
 public:
  explicit GmfReader(std::span<const char> bytes)
      : size_(bytes.size()),
        cursor_(bytes, sizeof(std::int32_t), first_word(bytes) == kSwappedMark ? ByteOrder::Swapped : ByteOrder::Native) {}

  TriangleSoup read() {
    const Place place = cursor_.place();
    version_ = cursor_.next<std::int32_t>("a version");
    if (version_ < 1 || version_ > 4)
      refuse(Reason::FileMalformed, place, "expected GMF version 1, 2, 3 or 4, found " + std::to_string(version_), {{"version", version_}});
    while (read_block()) {
    }
    return soup_.finish();
  }

 private:
  // False at the end. Positions only grow, so this ends whatever the file says.
  bool read_block() {
    const Place place = cursor_.place();
    const auto keyword = static_cast<GmfKeyword>(cursor_.next<std::int32_t>("a keyword"));
    const std::int64_t next = version_ >= 3 ? cursor_.next<std::int64_t>("a position") : cursor_.next<std::int32_t>("a position");
    if (keyword == GmfKeyword::End) return false;
    if (next != 0 && (next < static_cast<std::int64_t>(cursor_.offset()) || next > static_cast<std::int64_t>(size_)))
      refuse(Reason::FileMalformed, place,
             "keyword " + std::to_string(static_cast<std::int32_t>(keyword)) + " points to byte " + std::to_string(next) +
                 ", outside the " + std::to_string(size_) + " bytes that may follow",
             {{"position", static_cast<double>(next)}, {"size", static_cast<double>(size_)}});
    if (keyword == GmfKeyword::Dimension) read_dimension();
    if (keyword == GmfKeyword::Vertices) read_vertices();
    if (keyword == GmfKeyword::Triangles) read_faces(3, "triangles");
    if (keyword == GmfKeyword::Quadrilaterals) read_faces(4, "quadrilaterals");
    if (next == 0) return false;
    cursor_.seek(static_cast<std::size_t>(next));
    return true;
  }

  void read_dimension() {
    const Place place = cursor_.place();
    const auto dimension = cursor_.next<std::int32_t>("a dimension");
    if (dimension != 3)
      refuse(Reason::FileMalformed, place, "expected dimension 3, found " + std::to_string(dimension), {{"dimension", dimension}});
  }

  void read_vertices() {
    const std::size_t real_bytes = version_ >= 2 ? 8 : 4;
    for (std::uint64_t n = read_count(3 * real_bytes + integer_bytes(), "vertices"); n > 0; --n) {
      const Place place = cursor_.place();
      Vec3 p;
      for (int i = 0; i < 3; ++i) p[i] = real();
      integer("a reference");
      if (!p.allFinite())
        refuse(Reason::SurfaceNonFinite, place, "vertex " + std::to_string(soup_.vertex_count() + 1) + " is not finite",
               {{"vertex", static_cast<double>(soup_.vertex_count() + 1)}});
      soup_.add_vertex(p);
    }
  }

  void read_faces(int corners, const char* what) {
    for (std::uint64_t n = read_count((static_cast<std::size_t>(corners) + 1) * integer_bytes(), what); n > 0; --n) {
      const Place place = cursor_.place();
      std::array<std::int64_t, 4> vertices{};
      for (int i = 0; i < corners; ++i) vertices[static_cast<std::size_t>(i)] = integer("a vertex index");
      soup_.add_face(vertices, corners, integer("a reference"), place);
    }
  }

  std::uint64_t read_count(std::size_t bytes_each, const char* what) {
    const Place place = cursor_.place();
    const std::int64_t count = integer("a count");
    if (count < 0)
      refuse(Reason::FileMalformed, place, "expected a number of " + std::string(what) + ", found " + std::to_string(count),
             {{"count", static_cast<double>(count)}});
    require_room(static_cast<std::uint64_t>(count), cursor_.bytes_left(), bytes_each, what, place);
    return static_cast<std::uint64_t>(count);
  }

  [[nodiscard]] std::size_t integer_bytes() const { return version_ >= 4 ? 8 : 4; }
  std::int64_t integer(const char* what) { return version_ >= 4 ? cursor_.next<std::int64_t>(what) : cursor_.next<std::int32_t>(what); }
  double real() { return version_ >= 2 ? cursor_.next<double>("a coordinate") : cursor_.next<float>("a coordinate"); }

  std::size_t size_;
  ByteCursor cursor_;
  std::int32_t version_ = 0;
  MeditSoup soup_;
};

}  // namespace

bool looks_like_gmf(std::span<const char> bytes) {
  const std::int32_t word = first_word(bytes);
  return word == kByteOrderMark || word == kSwappedMark;
}

TriangleSoup read_gmf(std::span<const char> bytes) { return GmfReader(bytes).read(); }

}  // namespace strata::io
