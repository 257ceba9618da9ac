#include "tests/support/shapes.h"

#include <algorithm>
#include <cmath>
#include <map>
#include <numbers>
#include <random>

namespace strata::test {
namespace {

using Triangle = std::array<std::int32_t, 3>;

std::int32_t patch_named(TriangleSoup& soup, const std::string& name) {
  const auto at = std::find(soup.patch_names.begin(), soup.patch_names.end(), name);
  if (at != soup.patch_names.end()) return static_cast<std::int32_t>(at - soup.patch_names.begin());
  soup.patch_names.push_back(name);
  return static_cast<std::int32_t>(soup.patch_names.size() - 1);
}

std::int32_t add_point(TriangleSoup& soup, const Vec3& p) {
  soup.points.push_back(p);
  return static_cast<std::int32_t>(soup.points.size() - 1);
}

void add_triangle(TriangleSoup& soup, std::int32_t a, std::int32_t b, std::int32_t c, std::int32_t patch) {
  soup.triangles.push_back({a, b, c});
  soup.patch.push_back(patch);
}

// Joins points that lie within 1e-12: makers draw faces one by one.
TriangleSoup stitched(TriangleSoup soup) {
  const auto key = [](const Vec3& p) {
    const auto snap = [](double v) { return std::llround(v * 1e10); };
    return std::array<long long, 3>{snap(p.x()), snap(p.y()), snap(p.z())};
  };
  std::map<std::array<long long, 3>, std::int32_t> seen;
  std::vector<Vec3> points;
  std::vector<std::int32_t> to(soup.points.size());
  for (std::size_t i = 0; i < soup.points.size(); ++i) {
    const auto [at, fresh] = seen.try_emplace(key(soup.points[i]), static_cast<std::int32_t>(points.size()));
    if (fresh) points.push_back(soup.points[i]);
    to[i] = at->second;
  }
  soup.points = std::move(points);
  TriangleSoup kept{soup.points, {}, {}, soup.patch_names};
  for (std::size_t t = 0; t < soup.triangles.size(); ++t) {
    const auto [a, b, c] = soup.triangles[t];
    if (to[a] == to[b] || to[b] == to[c] || to[c] == to[a]) continue;
    add_triangle(kept, to[a], to[b], to[c], soup.patch[t]);
  }
  return kept;
}

// The parallelogram origin + i u/nu + j v/nv; normal along u x v.
void add_grid(TriangleSoup& soup, const Vec3& origin, const Vec3& u, const Vec3& v, int nu, int nv, const std::string& name) {
  const std::int32_t patch = patch_named(soup, name);
  const auto first = static_cast<std::int32_t>(soup.points.size());
  for (int j = 0; j <= nv; ++j)
    for (int i = 0; i <= nu; ++i) soup.points.push_back(origin + u * (double(i) / nu) + v * (double(j) / nv));
  const auto at = [&](int i, int j) { return first + j * (nu + 1) + i; };
  for (int j = 0; j < nv; ++j)
    for (int i = 0; i < nu; ++i) {
      add_triangle(soup, at(i, j), at(i + 1, j), at(i + 1, j + 1), patch);
      add_triangle(soup, at(i, j), at(i + 1, j + 1), at(i, j + 1), patch);
    }
}

Vec3 on_circle(int i, int n, double radius, double z) {
  const double a = 2 * std::numbers::pi * i / n;
  return {radius * std::cos(a), radius * std::sin(a), z};
}

// The strip between two circles around z, normal outwards (radially, or towards +z for a shrinking radius).
void add_band(TriangleSoup& soup, int segments, int rings, double r0, double z0, double r1, double z1, const std::string& name) {
  const std::int32_t patch = patch_named(soup, name);
  const auto first = static_cast<std::int32_t>(soup.points.size());
  for (int j = 0; j <= rings; ++j)
    for (int i = 0; i < segments; ++i) {
      const double s = double(j) / rings;
      soup.points.push_back(on_circle(i, segments, r0 + s * (r1 - r0), z0 + s * (z1 - z0)));
    }
  const auto at = [&](int i, int j) { return first + j * segments + i % segments; };
  for (int j = 0; j < rings; ++j)
    for (int i = 0; i < segments; ++i) {
      add_triangle(soup, at(i, j), at(i + 1, j), at(i + 1, j + 1), patch);
      add_triangle(soup, at(i, j), at(i + 1, j + 1), at(i, j + 1), patch);
    }
}

}  // namespace

TriangleSoup box(const Vec3& min, const Vec3& max, int n) {
  const Vec3 d = max - min;
  const Vec3 x(d.x(), 0, 0), y(0, d.y(), 0), z(0, 0, d.z());
  TriangleSoup soup;
  add_grid(soup, min, z, y, n, n, "x_min");
  add_grid(soup, min + x, y, z, n, n, "x_max");
  add_grid(soup, min, x, z, n, n, "y_min");
  add_grid(soup, min + y, z, x, n, n, "y_max");
  add_grid(soup, min, y, x, n, n, "z_min");
  add_grid(soup, min + z, x, y, n, n, "z_max");
  return stitched(std::move(soup));
}

TriangleSoup cube(int n) { return box(Vec3::Zero(), Vec3::Ones(), n); }

TriangleSoup sphere(int subdivisions) {
  const double g = std::numbers::phi;
  TriangleSoup soup;
  soup.patch_names = {"sphere"};
  for (const Vec3& p : {Vec3(-1, g, 0), Vec3(1, g, 0), Vec3(-1, -g, 0), Vec3(1, -g, 0), Vec3(0, -1, g), Vec3(0, 1, g), Vec3(0, -1, -g),
                        Vec3(0, 1, -g), Vec3(g, 0, -1), Vec3(g, 0, 1), Vec3(-g, 0, -1), Vec3(-g, 0, 1)})
    soup.points.push_back(p.normalized());
  std::vector<Triangle> faces = {{0, 11, 5},  {0, 5, 1},  {0, 1, 7},  {0, 7, 10}, {0, 10, 11}, {1, 5, 9}, {5, 11, 4},
                                 {11, 10, 2}, {10, 7, 6}, {7, 1, 8},  {3, 9, 4},  {3, 4, 2},   {3, 2, 6}, {3, 6, 8},
                                 {3, 8, 9},   {4, 9, 5},  {2, 4, 11}, {6, 2, 10}, {8, 6, 7},   {9, 8, 1}};
  for (int s = 0; s < subdivisions; ++s) {
    std::map<std::pair<std::int32_t, std::int32_t>, std::int32_t> middles;
    const auto middle = [&](std::int32_t a, std::int32_t b) {
      const auto [at, fresh] = middles.try_emplace(std::minmax(a, b), static_cast<std::int32_t>(soup.points.size()));
      if (fresh) soup.points.push_back((soup.points[a] + soup.points[b]).normalized());
      return at->second;
    };
    std::vector<Triangle> finer;
    for (const auto& [a, b, c] : faces) {
      const std::int32_t ab = middle(a, b), bc = middle(b, c), ca = middle(c, a);
      finer.insert(finer.end(), {{a, ab, ca}, {b, bc, ab}, {c, ca, bc}, {ab, bc, ca}});
    }
    faces = std::move(finer);
  }
  soup.triangles = std::move(faces);
  soup.patch.assign(soup.triangles.size(), 0);
  return soup;
}

TriangleSoup cylinder(int segments, double height, int rings) {
  TriangleSoup soup;
  add_band(soup, segments, rings, 1, 0, 1, height, "side");
  add_band(soup, segments, 2, 0, 0, 1, 0, "cap_bottom");
  add_band(soup, segments, 2, 1, height, 0, height, "cap_top");
  return stitched(std::move(soup));
}

TriangleSoup cone(int segments, double height, int rings) {
  TriangleSoup soup;
  add_band(soup, segments, rings, 1, 0, 0, height, "side");
  add_band(soup, segments, 2, 0, 0, 1, 0, "base");
  return stitched(std::move(soup));
}

TriangleSoup l_block(int n) {
  const Vec3 x(1, 0, 0), y(0, 1, 0), z(0, 0, 1), o = Vec3::Zero();
  TriangleSoup soup;
  add_grid(soup, o, z, 2 * y, n, 2 * n, "x_min");
  add_grid(soup, 2 * x, y, z, n, n, "x_max");
  add_grid(soup, o, 2 * x, z, 2 * n, n, "y_min");
  add_grid(soup, 2 * y, z, x, n, n, "y_max");
  add_grid(soup, x + y, y, z, n, n, "notch_x");
  add_grid(soup, x + y, z, x, n, n, "notch_y");
  for (const Vec3& corner : {o, x, y}) {
    add_grid(soup, corner, y, x, n, n, "z_min");
    add_grid(soup, corner + z, x, y, n, n, "z_max");
  }
  return stitched(std::move(soup));
}

TriangleSoup torus(double ring, double tube, int around, int across) {
  TriangleSoup soup;
  soup.patch_names = {"torus"};
  for (int i = 0; i < around; ++i)
    for (int j = 0; j < across; ++j) {
      const double b = 2 * std::numbers::pi * j / across;
      soup.points.push_back(on_circle(i, around, ring + tube * std::cos(b), tube * std::sin(b)));
    }
  const auto at = [&](int i, int j) { return (i % around) * across + j % across; };
  for (int i = 0; i < around; ++i)
    for (int j = 0; j < across; ++j) {
      add_triangle(soup, at(i, j), at(i + 1, j), at(i + 1, j + 1), 0);
      add_triangle(soup, at(i, j), at(i + 1, j + 1), at(i, j + 1), 0);
    }
  return soup;
}

TriangleSoup two_patches(int n) {
  TriangleSoup soup = cube(n);
  const std::int32_t top = patch_named(soup, "z_max");
  soup.patch_names[static_cast<std::size_t>(top)] = "z_max_left";
  const std::int32_t right = patch_named(soup, "z_max_right");
  for (std::size_t t = 0; t < soup.triangles.size(); ++t) {
    if (soup.patch[t] != top) continue;
    const auto& [a, b, c] = soup.triangles[t];
    if ((soup.points[a] + soup.points[b] + soup.points[c]).x() / 3 > 0.5) soup.patch[t] = right;
  }
  return soup;
}

TriangleSoup chamfered_cylinder(double chamfer, int segments) {
  TriangleSoup soup;
  const std::int32_t patch = patch_named(soup, "surface");
  const std::vector<std::array<double, 2>> profile{{1, -1}, {1, 1 - chamfer}, {1 - chamfer, 1}};  // radius, height
  const std::int32_t bottom = add_point(soup, Vec3(0, 0, -1)), top = add_point(soup, Vec3(0, 0, 1));
  std::vector<std::vector<std::int32_t>> ring(profile.size());
  for (std::size_t k = 0; k < profile.size(); ++k)
    for (int i = 0; i < segments; ++i) {
      const double angle = 2 * std::numbers::pi * i / segments;
      ring[k].push_back(add_point(soup, Vec3(profile[k][0] * std::cos(angle), profile[k][0] * std::sin(angle), profile[k][1])));
    }
  for (std::size_t i = 0; i < ring[0].size(); ++i) {
    const std::size_t j = (i + 1) % ring[0].size();
    add_triangle(soup, bottom, ring.front()[j], ring.front()[i], patch);
    for (std::size_t k = 0; k + 1 < ring.size(); ++k) {
      add_triangle(soup, ring[k][i], ring[k][j], ring[k + 1][j], patch);
      add_triangle(soup, ring[k][i], ring[k + 1][j], ring[k + 1][i], patch);
    }
    add_triangle(soup, top, ring.back()[i], ring.back()[j], patch);
  }
  return soup;
}

TriangleSoup stepped_cube(double step) {
  TriangleSoup soup;
  const std::int32_t patch = patch_named(soup, "surface");
  const std::vector<std::array<double, 2>> outline{{0, 0}, {1, 0}, {1, 1}, {0.5, 1}, {0.5, 1 + step}, {0, 1 + step}};  // x, z
  std::vector<std::int32_t> near, far;
  for (const auto& [x, z] : outline) {
    near.push_back(add_point(soup, Vec3(x, 0, z)));
    far.push_back(add_point(soup, Vec3(x, 1, z)));
  }
  for (std::size_t i = 0; i < outline.size(); ++i) {
    const std::size_t j = (i + 1) % outline.size();
    add_triangle(soup, near[i], far[j], near[j], patch);
    add_triangle(soup, near[i], far[i], far[j], patch);
    if (i == 0 || j == 0) continue;
    add_triangle(soup, near[0], near[i], near[j], patch);
    add_triangle(soup, far[0], far[j], far[i], patch);
  }
  return soup;
}

TriangleSoup sharp_wedge(double angle, int n) {
  const Vec3 o = Vec3::Zero(), x(1, 0, 0), y(0, 1, 0), leg(std::cos(angle), 0, std::sin(angle));
  TriangleSoup soup;
  add_grid(soup, o, y, x, n, n, "lower");
  add_grid(soup, o, leg, y, n, n, "upper");
  add_grid(soup, x, y, leg - x, n, n, "back");
  for (const bool far : {false, true}) {
    const std::int32_t patch = patch_named(soup, far ? "y_max" : "y_min");
    const auto at = [&](int i, int j) { return Vec3((far ? y : o) + x * (double(i) / n) + leg * (double(j) / n)); };
    const auto add = [&](const Vec3& a, const Vec3& b, const Vec3& c) {
      const std::int32_t ia = add_point(soup, a), ib = add_point(soup, b), ic = add_point(soup, c);
      if (far) add_triangle(soup, ia, ic, ib, patch);
      else add_triangle(soup, ia, ib, ic, patch);
    };
    for (int j = 0; j < n; ++j)
      for (int i = 0; i + j < n; ++i) {
        add(at(i, j), at(i + 1, j), at(i, j + 1));
        if (i + j + 1 < n) add(at(i + 1, j), at(i + 1, j + 1), at(i, j + 1));
      }
  }
  return stitched(std::move(soup));
}

TriangleSoup sphere_in_box(int subdivisions, int n) {
  return joined(box(Vec3::Constant(-2), Vec3::Constant(2), n), scaled(sphere(subdivisions), 0.5));
}

TriangleSoup touching_cubes(int n) {
  TriangleSoup left = cube(n), right = shifted(cube(n), Vec3(1, 0, 0));
  left.patch_names = {"left"};
  right.patch_names = {"right"};
  left.patch.assign(left.triangles.size(), 0);
  right.patch.assign(right.triangles.size(), 0);
  return joined(std::move(left), right);
}

TriangleSoup scaled(TriangleSoup soup, double factor) {
  for (Vec3& p : soup.points) p *= factor;
  return soup;
}

TriangleSoup shifted(TriangleSoup soup, const Vec3& by) {
  for (Vec3& p : soup.points) p += by;
  return soup;
}

TriangleSoup rotated(TriangleSoup soup, const Vec3& axis, double angle) {
  const Mat3 turn = Eigen::AngleAxisd(angle, axis.normalized()).toRotationMatrix();
  for (Vec3& p : soup.points) p = turn * p;
  return soup;
}

TriangleSoup shuffled(TriangleSoup soup, std::uint32_t seed) {
  std::mt19937 random(seed);
  for (std::size_t i = soup.triangles.size(); i > 1; --i) {
    const std::size_t j = random() % i;
    std::swap(soup.triangles[i - 1], soup.triangles[j]);
    std::swap(soup.patch[i - 1], soup.patch[j]);
  }
  for (Triangle& t : soup.triangles) std::rotate(t.begin(), t.begin() + random() % 3, t.end());
  return soup;
}

TriangleSoup jittered(TriangleSoup soup, double amount, std::uint32_t seed) {
  std::mt19937 random(seed);
  std::uniform_real_distribution<double> by(-amount, amount);
  for (Vec3& p : soup.points) {
    const double x = by(random), y = by(random), z = by(random);
    p += Vec3(x, y, z);
  }
  return soup;
}

TriangleSoup exploded(const TriangleSoup& soup) {
  TriangleSoup out{{}, {}, soup.patch, soup.patch_names};
  for (const Triangle& t : soup.triangles) {
    const auto first = static_cast<std::int32_t>(out.points.size());
    for (const std::int32_t p : t) out.points.push_back(soup.points[p]);
    out.triangles.push_back({first, first + 1, first + 2});
  }
  return out;
}

TriangleSoup flipped(TriangleSoup soup) {
  for (Triangle& t : soup.triangles) std::swap(t[1], t[2]);
  return soup;
}

TriangleSoup joined(TriangleSoup a, const TriangleSoup& b) {
  const auto offset = static_cast<std::int32_t>(a.points.size());
  a.points.insert(a.points.end(), b.points.begin(), b.points.end());
  for (std::size_t t = 0; t < b.triangles.size(); ++t) {
    const auto& [i, j, k] = b.triangles[t];
    add_triangle(a, i + offset, j + offset, k + offset, patch_named(a, b.patch_names[static_cast<std::size_t>(b.patch[t])]));
  }
  return a;
}

}  // namespace strata::test
