// What the two Medit readers share: faces may come before the vertices they name, so indices are checked last.
#pragma once

#include <array>
#include <cstdint>
#include <vector>

#include "core/io/read_error.h"
#include "core/io/soup_builder.h"

namespace strata::io {

class MeditSoup {
 public:
  void add_vertex(const Vec3& p) { soup_.add_point(p); }
  [[nodiscard]] std::size_t vertex_count() const { return soup_.point_count(); }

  // Vertices are counted from 1; a triangle's fourth is 0. The place serves the message about an index no file can mean.
  void add_face(const std::array<std::int64_t, 4>& vertices, int corners, std::int64_t reference, Place place);

  // Patches are named by their reference: "1", "2". Quadrilaterals become two triangles.
  TriangleSoup finish();

 private:
  struct Face {
    std::array<std::int32_t, 4> vertices;
    std::int32_t corners;
    std::int32_t patch;
  };

  SoupBuilder soup_;
  std::vector<Face> faces_;
  std::int32_t patch_ = -1;
  std::int64_t last_reference_ = 0;
};

}  // namespace strata::io
