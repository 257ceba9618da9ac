#include "core/io/soup_builder.h"

#include "core/io/read_error.h"

namespace strata::io {

std::int32_t SoupBuilder::patch(std::string_view name) {
  const auto known = patch_of_.find(name);
  if (known != patch_of_.end()) return known->second;
  const auto index = static_cast<std::int32_t>(soup_.patch_names.size());
  soup_.patch_names.emplace_back(name);
  patch_of_.emplace(name, index);
  return index;
}

void SoupBuilder::add_polygon(std::span<const std::int32_t> corners, std::int32_t patch) {
  for (std::size_t i = 2; i < corners.size(); ++i) {
    soup_.triangles.push_back({corners[0], corners[i - 1], corners[i]});
    soup_.patch.push_back(patch);
  }
}

TriangleSoup SoupBuilder::finish() {
  require_indexable(soup_.points.size(), "points");
  require_indexable(soup_.triangles.size(), "triangles");
  finish_soup(soup_);
  return std::move(soup_);
}

void finish_soup(TriangleSoup& soup) {
  if (soup.triangles.empty()) refuse(Reason::SurfaceEmpty, {}, "the file holds no triangle");
  std::vector<std::int32_t> renumbered(soup.patch_names.size(), -1);
  for (const std::int32_t p : soup.patch) renumbered[static_cast<std::size_t>(p)] = 0;
  std::vector<std::string> used;
  for (std::size_t p = 0; p < renumbered.size(); ++p) {
    if (renumbered[p] < 0) continue;
    renumbered[p] = static_cast<std::int32_t>(used.size());
    used.push_back(std::move(soup.patch_names[p]));
  }
  soup.patch_names = std::move(used);
  for (std::int32_t& p : soup.patch) p = renumbered[static_cast<std::size_t>(p)];
}

}  // namespace strata::io
