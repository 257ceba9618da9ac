// Collects triangles and named patches while a file is read.
#pragma once

#include <cstdint>
#include <map>
#include <span>
#include <string>
#include <string_view>

#include "core/surface/triangle_soup.h"

namespace strata::io {

inline constexpr std::string_view kUnnamedPatch = "surface";  // the one patch of a surface without names

class SoupBuilder {
 public:
  void add_point(const Vec3& p) { soup_.points.push_back(p); }
  [[nodiscard]] std::size_t point_count() const { return soup_.points.size(); }
  [[nodiscard]] std::size_t triangle_count() const { return soup_.triangles.size(); }
  void reserve_points(std::size_t count) { soup_.points.reserve(count); }

  // The index of the patch of that name; the same name is the same patch.
  std::int32_t patch(std::string_view name);
  // A fan around the first corner. Fewer than three corners bound no area and add nothing.
  void add_polygon(std::span<const std::int32_t> corners, std::int32_t patch);

  [[nodiscard]] const std::vector<std::string>& names() const { return soup_.patch_names; }

  // Drops names that no triangle uses. Throws SurfaceEmpty when there is no triangle.
  TriangleSoup finish();

 private:
  TriangleSoup soup_;
  std::map<std::string, std::int32_t, std::less<>> patch_of_;
};

// Throws SurfaceEmpty when there is no triangle; drops patch names no triangle uses, keeping the order of the others.
void finish_soup(TriangleSoup& soup);

}  // namespace strata::io
