// Stanford PLY: a text header that declares elements and their properties, then the elements as text or binary in either byte order.
// Wanted: vertex x y z, face vertex_indices (or vertex_index), face patch, ref or label. The rest is stepped over.
#include <bit>
#include <cmath>
#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "core/io/byte_cursor.h"
#include "core/io/soup_builder.h"
#include "core/io/surface_readers.h"
#include "core/io/text_cursor.h"

namespace strata::io {
namespace {

enum class Scalar { Int8, Uint8, Int16, Uint16, Int32, Uint32, Float32, Float64 };
enum class Encoding { Ascii, Little, Big };
enum class Role { Ignored, X, Y, Z, Corners, Reference };

struct Property {
  Scalar type = Scalar::Float32;
  std::optional<Scalar> count_type;  // set for lists
  Role role = Role::Ignored;
};
struct Element {
  enum class Kind { Vertex, Face, Other } kind = Kind::Other;
  std::string name;
  std::uint64_t count = 0;
  std::vector<Property> properties;
  Place place;
};
struct Header {
  Encoding encoding = Encoding::Ascii;
  std::vector<Element> elements;
  std::size_t size = 0;  // bytes up to the data
};

struct ScalarName {
  std::string_view name;
  Scalar type;
};
constexpr ScalarName kScalarNames[] = {
    {"char", Scalar::Int8},     {"int8", Scalar::Int8},       {"uchar", Scalar::Uint8},    {"uint8", Scalar::Uint8},
    {"short", Scalar::Int16},   {"int16", Scalar::Int16},     {"ushort", Scalar::Uint16},  {"uint16", Scalar::Uint16},
    {"int", Scalar::Int32},     {"int32", Scalar::Int32},     {"uint", Scalar::Uint32},    {"uint32", Scalar::Uint32},
    {"float", Scalar::Float32}, {"float32", Scalar::Float32}, {"double", Scalar::Float64}, {"float64", Scalar::Float64},
};

std::size_t size_of(Scalar type) {
  switch (type) {
    case Scalar::Int8:
    case Scalar::Uint8: return 1;
    case Scalar::Int16:
    case Scalar::Uint16: return 2;
    case Scalar::Int32:
    case Scalar::Uint32:
    case Scalar::Float32: return 4;
    case Scalar::Float64: return 8;
  }
  return 1;
}

Role role_of(Element::Kind kind, std::string_view name, bool list) {
  if (kind == Element::Kind::Vertex && !list && name.size() == 1 && name[0] >= 'x' && name[0] <= 'z')
    return name[0] == 'x' ? Role::X : name[0] == 'y' ? Role::Y : Role::Z;
  if (kind != Element::Kind::Face) return Role::Ignored;
  if (list) return name == "vertex_indices" || name == "vertex_index" ? Role::Corners : Role::Ignored;
  return name == "patch" || name == "ref" || name == "label" ? Role::Reference : Role::Ignored;
}

// ------------------------------------------------------------------------------------------------------------ header

class HeaderReader {
 public:
  explicit HeaderReader(std::string_view text) : cursor_(text) {}

  Header read() {
    if (cursor_.word() != "ply") TextCursor(cursor_).expected("'ply' at the start");
    cursor_.skip_line();
    while (read_line()) {
    }
    header_.size = cursor_.offset();
    return std::move(header_);
  }

 private:
  // False behind end_header.
  bool read_line() {
    cursor_.skip_space();
    TextCursor start = cursor_;
    const std::string_view keyword = cursor_.rest_of_word();
    if (keyword == "end_header") {
      end_of_header();
      return false;
    }
    if (keyword == "format") read_format();
    else if (keyword == "element") read_element(start.place());
    else if (keyword == "property") read_property();
    else if (keyword != "comment" && keyword != "obj_info") start.expected("a header line or 'end_header'");
    cursor_.skip_line();
    return true;
  }
  // Exactly one line break: the data may begin with bytes that look like whitespace.
  void end_of_header() {
    if (!format_given_) cursor_.expected("a 'format' line before");
    cursor_.skip_line();
  }
  void read_format() {
    TextCursor start = cursor_;
    const std::string_view name = cursor_.word();
    if (name == "ascii") header_.encoding = Encoding::Ascii;
    else if (name == "binary_little_endian") header_.encoding = Encoding::Little;
    else if (name == "binary_big_endian") header_.encoding = Encoding::Big;
    else (start.skip_space(), start.expected("'ascii', 'binary_little_endian' or 'binary_big_endian'"));
    format_given_ = true;
  }
  void read_element(Place place) {
    Element element;
    element.name = cursor_.word();
    element.kind = element.name == "vertex" ? Element::Kind::Vertex : element.name == "face" ? Element::Kind::Face : Element::Kind::Other;
    element.count = cursor_.count("the number of elements");
    element.place = place;
    header_.elements.push_back(std::move(element));
  }
  void read_property() {
    if (header_.elements.empty()) cursor_.expected("an 'element' line before");
    Element& element = header_.elements.back();
    Property property;
    TextCursor start = cursor_;
    if (cursor_.word() == "list") property.count_type = read_type();
    else cursor_ = start;
    property.type = read_type();
    property.role = role_of(element.kind, cursor_.word(), property.count_type.has_value());
    element.properties.push_back(property);
  }
  Scalar read_type() {
    cursor_.skip_blanks();
    TextCursor start = cursor_;
    const std::string_view name = cursor_.rest_of_word();
    for (const ScalarName& known : kScalarNames)
      if (name == known.name) return known.type;
    start.expected("a property type such as 'float' or 'uchar'");
  }

  TextCursor cursor_;
  Header header_;
  bool format_given_ = false;
};

// ------------------------------------------------------------------------------------------------------------ values

class AsciiValues {
 public:
  AsciiValues(std::span<const char> bytes, std::size_t at) : cursor_(as_text(bytes), at) {}
  double next(Scalar) { return cursor_.coordinate("a number"); }
  // Steps over a number nobody wants, even NaN.
  void skip(Scalar) {
    if (cursor_.word().empty()) cursor_.expected("a number");
  }
  [[nodiscard]] std::size_t bytes_left() const { return cursor_.bytes_left(); }
  [[nodiscard]] Place place() const { return cursor_.place(); }
  static std::size_t least_bytes(Scalar) { return 1; }  // a digit

 private:
  TextCursor cursor_;
};

class BinaryValues {
 public:
  BinaryValues(std::span<const char> bytes, std::size_t at, ByteOrder order) : cursor_(bytes, at, order) {}
  double next(Scalar type) {
    switch (type) {
      case Scalar::Int8: return cursor_.next<std::int8_t>("a number");
      case Scalar::Uint8: return cursor_.next<std::uint8_t>("a number");
      case Scalar::Int16: return cursor_.next<std::int16_t>("a number");
      case Scalar::Uint16: return cursor_.next<std::uint16_t>("a number");
      case Scalar::Int32: return cursor_.next<std::int32_t>("a number");
      case Scalar::Uint32: return cursor_.next<std::uint32_t>("a number");
      case Scalar::Float32: return cursor_.next<float>("a number");
      case Scalar::Float64: return cursor_.next<double>("a number");
    }
    return 0;
  }
  void skip(Scalar type) { next(type); }
  [[nodiscard]] std::size_t bytes_left() const { return cursor_.bytes_left(); }
  [[nodiscard]] Place place() const { return cursor_.place(); }
  static std::size_t least_bytes(Scalar type) { return size_of(type); }

 private:
  ByteCursor cursor_;
};

// -------------------------------------------------------------------------------------------------------------- body

// Reference 0 is a face without a patch.
std::string patch_name(double reference) {
  constexpr double kExact = 9007199254740992.0;  // 2^53: beyond it a double names no integer
  if (!(std::abs(reference) >= 1 && std::abs(reference) <= kExact)) return std::string(kUnnamedPatch);
  return std::to_string(static_cast<std::int64_t>(reference));
}

template <class Values>
class BodyReader {
 public:
  BodyReader(const Header& header, Values values) : header_(header), values_(values) {
    for (const Element& element : header_.elements)
      if (element.kind == Element::Kind::Vertex) vertex_count_ += element.count;
  }

  TriangleSoup read() {
    for (const Element& element : header_.elements) {
      if (element.properties.empty()) continue;
      std::size_t least = 0;
      for (const Property& property : element.properties) least += Values::least_bytes(property.count_type.value_or(property.type));
      require_room(element.count, values_.bytes_left(), least, element.name + " elements", element.place);
      require_indexable(element.count, element.name + " elements");
      if (element.kind == Element::Kind::Vertex) soup_.reserve_points(soup_.point_count() + element.count);
      for (std::uint64_t i = 0; i < element.count; ++i) read_record(element, i);
    }
    return soup_.finish();
  }

 private:
  void read_record(const Element& element, std::uint64_t number) {
    const Place place = element.kind == Element::Kind::Vertex && !kIsAscii ? values_.place() : Place{};
    Vec3 p = Vec3::Zero();
    double reference = 0;
    corners_.clear();
    for (const Property& property : element.properties) {
      if (property.count_type) {
        read_list(property, element, number);
        continue;
      }
      if (property.role == Role::Ignored) {
        values_.skip(property.type);
        continue;
      }
      const double value = values_.next(property.type);
      switch (property.role) {
        case Role::X: p.x() = value; break;
        case Role::Y: p.y() = value; break;
        case Role::Z: p.z() = value; break;
        case Role::Reference: reference = value; break;
        case Role::Corners:
        case Role::Ignored: break;
      }
    }
    if (element.kind == Element::Kind::Vertex) add_vertex(p, number, place);
    if (element.kind == Element::Kind::Face) soup_.add_polygon(corners_, patch_of(reference));
  }

  void read_list(const Property& property, const Element& element, std::uint64_t number) {
    const double count = values_.next(*property.count_type);
    if (!(count >= 0) || count != std::floor(count) || count > static_cast<double>(values_.bytes_left()))
      refuse(Reason::FileMalformed, values_.place(),
             "expected the length of a list of " + element.name + " " + std::to_string(number) + ", found " + std::to_string(count));
    const auto size = static_cast<std::uint64_t>(count);
    const std::size_t least = Values::least_bytes(property.type);
    if (!has_room(size, values_.bytes_left(), least)) require_room(size, values_.bytes_left(), least, "entries of a list", values_.place());
    for (std::uint64_t i = 0; i < size; ++i) {
      if (property.role != Role::Corners) {
        values_.skip(property.type);
        continue;
      }
      const double value = values_.next(property.type);
      if (!(value >= 0 && value < static_cast<double>(vertex_count_)))
        refuse_index(values_.place(), "face " + std::to_string(number) + " (counted from 0)",
                     std::abs(value) < 9e15 ? static_cast<std::int64_t>(value) : -1, vertex_count_);
      corners_.push_back(static_cast<std::int32_t>(value));
    }
  }

  void add_vertex(const Vec3& p, std::uint64_t number, Place place) {
    if (!p.allFinite())
      refuse(Reason::SurfaceNonFinite, place, "vertex " + std::to_string(number) + " (counted from 0) is not finite",
             {{"vertex", static_cast<double>(number)}});
    soup_.add_point(p);
  }

  std::int32_t patch_of(double reference) {
    if (patch_ < 0 || reference != last_reference_) {
      patch_ = soup_.patch(patch_name(reference));
      last_reference_ = reference;
    }
    return patch_;
  }

  static constexpr bool kIsAscii = std::is_same_v<Values, AsciiValues>;

  const Header& header_;
  Values values_;
  SoupBuilder soup_;
  std::uint64_t vertex_count_ = 0;
  std::vector<std::int32_t> corners_;
  std::int32_t patch_ = -1;
  double last_reference_ = 0;
};

}  // namespace

TriangleSoup read_ply(std::span<const char> bytes) {
  const Header header = HeaderReader(as_text(bytes)).read();
  if (header.encoding == Encoding::Ascii) return BodyReader(header, AsciiValues(bytes, header.size)).read();
  const bool native = (header.encoding == Encoding::Little) == (std::endian::native == std::endian::little);
  return BodyReader(header, BinaryValues(bytes, header.size, native ? ByteOrder::Native : ByteOrder::Swapped)).read();
}

}  // namespace strata::io
