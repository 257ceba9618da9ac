#include "core/io/medit_soup.h"

#include <limits>
#include <string>

namespace strata::io {
namespace {

std::string face_name(int corners, std::size_t number) { return (corners == 4 ? "quadrilateral " : "triangle ") + std::to_string(number); }

}  // namespace

void MeditSoup::add_face(const std::array<std::int64_t, 4>& vertices, int corners, std::int64_t reference, Place place) {
  Face face{{}, corners, 0};
  for (int i = 0; i < corners; ++i) {
    const std::int64_t v = vertices[static_cast<std::size_t>(i)];
    if (v < 1 || v > std::numeric_limits<std::int32_t>::max())
      refuse_index(place, corners == 4 ? "a quadrilateral" : "a triangle", v, soup_.point_count());
    face.vertices[static_cast<std::size_t>(i)] = static_cast<std::int32_t>(v);
  }
  if (patch_ < 0 || reference != last_reference_) patch_ = soup_.patch(std::to_string(reference));
  last_reference_ = reference;
  face.patch = patch_;
  faces_.push_back(face);
}

TriangleSoup MeditSoup::finish() {
  std::array<std::size_t, 5> number{};  // of the face among those with as many corners, from 1
  for (Face& face : faces_) {
    const auto corners = static_cast<std::size_t>(face.corners);
    ++number[corners];
    for (std::size_t i = 0; i < corners; ++i) {
      const auto v = static_cast<std::size_t>(face.vertices[i]);
      if (v > soup_.point_count()) refuse_index({}, face_name(face.corners, number[corners]), face.vertices[i], soup_.point_count());
      --face.vertices[i];
    }
    soup_.add_polygon(std::span(face.vertices).first(corners), face.patch);
  }
  return soup_.finish();
}

}  // namespace strata::io
