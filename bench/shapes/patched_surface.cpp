#include "bench/shapes/patched_surface.h"

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <cstdio>
#include <map>
#include <memory>
#include <stdexcept>
#include <utility>

namespace strata::shapes {

namespace {

Point minus(const Point& a, const Point& b) { return {a[0] - b[0], a[1] - b[1], a[2] - b[2]}; }
double dot(const Point& a, const Point& b) { return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]; }
Point cross(const Point& a, const Point& b) { return {a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]}; }

Point unit_normal(const PatchedSurface& surface, const std::array<int, 3>& triangle) {
  const auto& points = surface.points;
  const auto normal = cross(minus(points[triangle[1]], points[triangle[0]]), minus(points[triangle[2]], points[triangle[0]]));
  const double length = std::sqrt(dot(normal, normal));
  return {normal[0] / length, normal[1] / length, normal[2] / length};
}

struct CloseFile {
  void operator()(std::FILE* file) const { std::fclose(file); }
};
using File = std::unique_ptr<std::FILE, CloseFile>;

void write_stl_ascii(const PatchedSurface& surface, std::FILE* file) {
  for (int patch = 0; patch < static_cast<int>(surface.patch_names.size()); ++patch) {
    std::fprintf(file, "solid %s\n", surface.patch_names[patch].c_str());
    for (std::size_t t = 0; t < surface.triangles.size(); ++t) {
      if (surface.patch_of[t] != patch) continue;
      const auto normal = unit_normal(surface, surface.triangles[t]);
      std::fprintf(file, "facet normal %.6g %.6g %.6g\nouter loop\n", normal[0], normal[1], normal[2]);
      for (const int p : surface.triangles[t]) {
        const auto& point = surface.points[p];
        std::fprintf(file, "vertex %.12g %.12g %.12g\n", point[0], point[1], point[2]);
      }
      std::fprintf(file, "endloop\nendfacet\n");
    }
    std::fprintf(file, "endsolid %s\n", surface.patch_names[patch].c_str());
  }
}

void write_stl_binary(const PatchedSurface& surface, std::FILE* file) {
  std::array<char, 80> header{};
  std::snprintf(header.data(), header.size(), "binary STL by strata_shapes");
  std::fwrite(header.data(), 1, header.size(), file);
  const auto count = static_cast<std::uint32_t>(surface.triangles.size());
  std::fwrite(&count, sizeof count, 1, file);
  for (const auto& triangle : surface.triangles) {
    std::array<float, 12> values{};
    const auto normal = unit_normal(surface, triangle);
    for (int i = 0; i < 3; ++i) values[i] = static_cast<float>(normal[i]);
    for (int corner = 0; corner < 3; ++corner) {
      for (int i = 0; i < 3; ++i) values[3 + 3 * corner + i] = static_cast<float>(surface.points[triangle[corner]][i]);
    }
    const std::uint16_t attribute = 0;
    std::fwrite(values.data(), sizeof(float), values.size(), file);
    std::fwrite(&attribute, sizeof attribute, 1, file);
  }
}

void write_obj(const PatchedSurface& surface, std::FILE* file) {
  for (const auto& point : surface.points) std::fprintf(file, "v %.15g %.15g %.15g\n", point[0], point[1], point[2]);
  for (int patch = 0; patch < static_cast<int>(surface.patch_names.size()); ++patch) {
    std::fprintf(file, "g %s\n", surface.patch_names[patch].c_str());
    for (std::size_t t = 0; t < surface.triangles.size(); ++t) {
      if (surface.patch_of[t] != patch) continue;
      const auto& triangle = surface.triangles[t];
      std::fprintf(file, "f %d %d %d\n", triangle[0] + 1, triangle[1] + 1, triangle[2] + 1);
    }
  }
}

}  // namespace

int PatchedSurface::add_point(const Point& point) {
  points.push_back(point);
  return static_cast<int>(points.size()) - 1;
}

int PatchedSurface::patch(const std::string& name) {
  const auto found = std::find(patch_names.begin(), patch_names.end(), name);
  if (found != patch_names.end()) return static_cast<int>(found - patch_names.begin());
  patch_names.push_back(name);
  return static_cast<int>(patch_names.size()) - 1;
}

void PatchedSurface::add_triangle(int a, int b, int c, int patch) {
  if (a == b || b == c || c == a) return;
  triangles.push_back({a, b, c});
  patch_of.push_back(patch);
}

void PatchedSurface::add_quad(int a, int b, int c, int d, int patch) {
  const auto ac = minus(points[c], points[a]);
  const auto bd = minus(points[d], points[b]);
  // A hair of preference for one diagonal keeps flat grids regular in spite of rounding.
  if (dot(ac, ac) <= dot(bd, bd) * (1 + 1e-9)) {
    add_triangle(a, b, c, patch);
    add_triangle(a, c, d, patch);
  } else {
    add_triangle(a, b, d, patch);
    add_triangle(b, c, d, patch);
  }
}

void turn_inside_out(PatchedSurface& surface) {
  for (auto& triangle : surface.triangles) std::swap(triangle[1], triangle[2]);
}

PatchedSurface compact(const PatchedSurface& surface) {
  std::vector<int> new_index(surface.points.size(), -1);
  PatchedSurface result;
  result.patch_of = surface.patch_of;
  result.patch_names = surface.patch_names;
  for (auto triangle : surface.triangles) {
    for (int& p : triangle) {
      if (new_index[p] < 0) new_index[p] = result.add_point(surface.points[p]);
      p = new_index[p];
    }
    result.triangles.push_back(triangle);
  }
  return result;
}

EdgeFaults edge_faults(const PatchedSurface& surface) {
  std::map<std::pair<int, int>, std::pair<int, int>> uses;  // by (low, high): how often upwards, how often downwards
  for (const auto& triangle : surface.triangles) {
    for (int i = 0; i < 3; ++i) {
      const int from = triangle[i], to = triangle[(i + 1) % 3];
      auto& use = uses[std::minmax(from, to)];
      (from < to ? use.first : use.second) += 1;
    }
  }
  EdgeFaults faults;
  for (const auto& [edge, use] : uses) {
    const int total = use.first + use.second;
    faults.open += total == 1 ? 1 : 0;
    faults.crowded += total > 2 ? 1 : 0;
    faults.misoriented += total == 2 && use.first != 1 ? 1 : 0;
  }
  return faults;
}

double enclosed_volume(const PatchedSurface& surface) {
  double six_volumes = 0;
  for (const auto& t : surface.triangles) {
    six_volumes += dot(surface.points[t[0]], cross(surface.points[t[1]], surface.points[t[2]]));
  }
  return six_volumes / 6;
}

void write(const PatchedSurface& surface, const std::string& path, FileKind kind) {
  const File file(std::fopen(path.c_str(), "wb"));
  if (!file) throw std::runtime_error("cannot write " + path);
  switch (kind) {
    case FileKind::StlAscii: write_stl_ascii(surface, file.get()); break;
    case FileKind::StlBinary: write_stl_binary(surface, file.get()); break;
    case FileKind::Obj: write_obj(surface, file.get()); break;
  }
  if (std::fflush(file.get()) != 0 || std::ferror(file.get()) != 0) throw std::runtime_error("cannot write all of " + path);
}

}  // namespace strata::shapes
