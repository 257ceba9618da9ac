// Alignment of axes r0 r1 r2 with normals n of areas A: sum of A (n.r)^4 over normals and axes, by the total area. It is 1 where all normals lie
// along axes, 3/5 on a sphere, 1/3 at worst: the energy of octahedral frames (Ray, Sokolov, Levy 2016, "Practical 3D frame field generation",
// section 2). It depends on the surface by 15 moments only. A sum of even powers is convex, so that steps to the rotation nearest to its
// gradient never lower it.
#include "core/surface/axes.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>
#include <utility>
#include <vector>

#include <Eigen/SVD>

#include "core/base/parallel.h"

namespace strata {
namespace {

constexpr int kStarts = 512;  // rotations that the search starts from
constexpr int kClimbed = 8;  // the best of them climb to a maximum
constexpr int kSteps = 60;
constexpr double kGain = 0.05;  // of alignment, that is worth a turn
constexpr double kFlush = 0.25;  // of the area, lying exactly along axes, that is worth one too
constexpr double kFlushLost = 0.1;  // of it, that none is worth
constexpr double kFlushCosine = 0.99999;  // of 0.26 degrees: steps of one cell lie more than 200 cells apart
constexpr double kPlane = 0.02;  // of the area, that makes a direction one to snap to
constexpr double kPlaneCosine = 0.99985;  // of 1 degree
constexpr double kSmallestTurn = 1e-9;  // of entries of the rotation

struct Power {
  std::array<int, 3> of;  // exponents of x, y, z
  double times;  // multinomial coefficient
};
constexpr std::array<Power, 15> kPowers{{{{4, 0, 0}, 1},
                                         {{0, 4, 0}, 1},
                                         {{0, 0, 4}, 1},
                                         {{3, 1, 0}, 4},
                                         {{3, 0, 1}, 4},
                                         {{1, 3, 0}, 4},
                                         {{0, 3, 1}, 4},
                                         {{1, 0, 3}, 4},
                                         {{0, 1, 3}, 4},
                                         {{2, 2, 0}, 6},
                                         {{2, 0, 2}, 6},
                                         {{0, 2, 2}, 6},
                                         {{2, 1, 1}, 12},
                                         {{1, 2, 1}, 12},
                                         {{1, 1, 2}, 12}}};
using Moments = Eigen::Array<double, 15, 1>;  // as kPowers

double power(double x, int n) {
  double result = 1;
  for (int i = 0; i < n; ++i) result *= x;
  return result;
}

// Sum of A (n.r)^4.
double along(const Moments& moments, const Vec3& r) {
  double sum = 0;
  for (std::size_t k = 0; k < kPowers.size(); ++k) {
    const auto& [of, times] = kPowers[k];
    sum += times * moments[static_cast<Eigen::Index>(k)] * power(r.x(), of[0]) * power(r.y(), of[1]) * power(r.z(), of[2]);
  }
  return sum;
}

Vec3 gradient(const Moments& moments, const Vec3& r) {
  Vec3 sum = Vec3::Zero();
  for (std::size_t k = 0; k < kPowers.size(); ++k)
    for (int i = 0; i < 3; ++i) {
      std::array<int, 3> of = kPowers[k].of;
      const int n = of[static_cast<std::size_t>(i)]--;
      if (n > 0)
        sum[i] +=
            n * kPowers[k].times * moments[static_cast<Eigen::Index>(k)] * power(r.x(), of[0]) * power(r.y(), of[1]) * power(r.z(), of[2]);
    }
  return sum;
}

double alignment(const Moments& moments, const Mat3& axes) {
  return along(moments, axes.row(0)) + along(moments, axes.row(1)) + along(moments, axes.row(2));
}

// The n-th of evenly spread rotations (Shoemake's uniform quaternions, with powers of the root of x^4 = x + 1 for random numbers).
Mat3 start(int n) {
  constexpr double kRoot = 0.8191725133961645;
  const auto part = [&](double by) { return std::fmod(0.5 + n * by, 1.0); };
  const double u = part(kRoot), v = 2 * std::numbers::pi * part(kRoot * kRoot), w = 2 * std::numbers::pi * part(kRoot * kRoot * kRoot);
  const double a = std::sqrt(1 - u), b = std::sqrt(u);
  return Eigen::Quaterniond(b * std::cos(w), a * std::sin(v), a * std::cos(v), b * std::sin(w)).toRotationMatrix();
}

Mat3 climb(const Moments& moments, Mat3 axes) {
  for (int step = 0; step < kSteps; ++step) {
    Mat3 rise;
    for (int i = 0; i < 3; ++i) rise.row(i) = gradient(moments, axes.row(i)).transpose();
    const Eigen::JacobiSVD<Mat3> svd(rise, Eigen::ComputeFullU | Eigen::ComputeFullV);
    axes = svd.matrixU() * svd.matrixV().transpose();
  }
  return axes;
}

Mat3 climb_from_everywhere(const Moments& moments) {
  std::vector<std::pair<double, int>> starts;
  for (int n = 0; n < kStarts; ++n) starts.emplace_back(-alignment(moments, start(n)), n);
  std::partial_sort(starts.begin(), starts.begin() + kClimbed, starts.end());
  Mat3 best = Mat3::Identity();
  double most = alignment(moments, best);
  for (int i = 0; i < kClimbed; ++i) {
    const Mat3 axes = climb(moments, start(starts[static_cast<std::size_t>(i)].second));
    if (const double reached = alignment(moments, axes); reached > most) most = reached, best = axes;
  }
  return best;
}

class Normals {
 public:
  explicit Normals(const Surface& surface) : surface_(surface), area_(surface.triangles.size()) {
    parallel_for(area_.size(), [&](std::size_t i) {
      const auto [a, b, c] = surface.corners(TriangleId(i));
      area_[i] = 0.5 * (b - a).cross(c - a).norm();
    });
    whole_ = sum([](const Vec3&) { return 1.0; }, 0.0);
  }
  // Sum of area times f(normal), by the whole area.
  template <class F, class T>
  [[nodiscard]] T mean(const F& f, T zero) const {
    return T(sum(f, zero) / whole_);
  }
  [[nodiscard]] Moments moments() const {
    return mean(
        [](const Vec3& n) {
          Moments powers;
          for (std::size_t k = 0; k < kPowers.size(); ++k) {
            const std::array<int, 3>& of = kPowers[k].of;
            powers[static_cast<Eigen::Index>(k)] = power(n.x(), of[0]) * power(n.y(), of[1]) * power(n.z(), of[2]);
          }
          return powers;
        },
        Moments(Moments::Zero()));
  }
  // Share of the area that lies across one of the axes.
  [[nodiscard]] double flush(const Mat3& axes) const {
    return mean([&](const Vec3& n) { return (axes * n).cwiseAbs().maxCoeff() > kFlushCosine ? 1.0 : 0.0; }, 0.0);
  }
  // Where normals near d crowd most: the mean over ever narrower cones. With the share of the area there.
  [[nodiscard]] std::pair<Vec3, double> crowd_near(Vec3 d) const {
    for (int narrow = 8; narrow <= 32768; narrow *= 4) {
      const Vec3 mean_normal = mean(
          [&](const Vec3& n) {
            const double c = n.dot(d);
            double weight = c * c;
            for (int exponent = 2; exponent < narrow; exponent *= 2) weight *= weight;
            return Vec3((c < 0 ? -weight : weight) * n);
          },
          Vec3(Vec3::Zero()));
      if (!(mean_normal.norm() > 0)) break;
      d = mean_normal.normalized();
    }
    return {d, mean([&](const Vec3& n) { return std::abs(n.dot(d)) > kPlaneCosine ? 1.0 : 0.0; }, 0.0)};
  }

 private:
  template <class F, class T>
  [[nodiscard]] T sum(const F& f, T zero) const {
    return parallel_reduce(
        area_.size(), zero, [&](std::size_t i) { return T(area_[i] * f(surface_.normal[TriangleId(i)])); },
        [](const T& a, const T& b) { return T(a + b); });
  }
  const Surface& surface_;
  std::vector<double> area_;
  double whole_ = 0;
};

// The greatest planes beside the axes become exact: the greatest whole, the next as far as right angles allow.
Mat3 snapped(const Mat3& axes, const Normals& normals) {
  struct Plane {
    int axis;
    Vec3 normal;
    double share;
  };
  std::array<Plane, 3> planes;
  for (int i = 0; i < 3; ++i) {
    const auto [normal, share] = normals.crowd_near(axes.row(i));
    planes[static_cast<std::size_t>(i)] = share >= kPlane ? Plane{i, normal, share} : Plane{i, axes.row(i), 0};
  }
  std::sort(planes.begin(), planes.end(),
            [](const Plane& a, const Plane& b) { return a.share != b.share ? a.share > b.share : a.axis < b.axis; });
  const Vec3 first = planes[0].normal, second = (planes[1].normal - planes[1].normal.dot(first) * first).normalized();
  Mat3 result;
  result.row(planes[0].axis) = first.transpose();
  result.row(planes[1].axis) = second.transpose();
  const int i = planes[2].axis;
  result.row(i) = result.row((i + 1) % 3).cross(result.row((i + 2) % 3));
  return result;
}

// Of the rotations that differ by turns of the cube only, the one nearest to the identity.
Mat3 smallest_turn(const Mat3& axes) {
  std::array<int, 3> order{0, 1, 2}, best_order = order;
  double most = -1;
  do {
    double trace = 0;
    for (int i = 0; i < 3; ++i) trace += std::abs(axes(order[static_cast<std::size_t>(i)], i));
    if (trace > most) most = trace, best_order = order;
  } while (std::next_permutation(order.begin(), order.end()));
  Mat3 result;
  for (int i = 0; i < 3; ++i) {
    const Vec3 row = axes.row(best_order[static_cast<std::size_t>(i)]);
    result.row(i) = (row[i] < 0 ? Vec3(-row) : row).transpose();
  }
  if (result.determinant() < 0) {
    int least = 0;
    for (int i = 1; i < 3; ++i)
      if (result(i, i) < result(least, least)) least = i;
    result.row(least) *= -1;
  }
  return result;
}

}  // namespace

Mat3 best_axes(const Surface& surface) {
  const Normals normals(surface);
  const Moments moments = normals.moments();
  Mat3 identity = Mat3::Identity();
  Mat3 turned = smallest_turn(snapped(climb_from_everywhere(moments), normals));
  if ((turned - identity).cwiseAbs().maxCoeff() < kSmallestTurn) return identity;
  const double gain = alignment(moments, turned) - alignment(moments, identity);
  const double flush = normals.flush(turned) - normals.flush(identity);
  const bool pays = (gain >= kGain && flush >= -kFlushLost) || flush >= kFlush;
  return pays ? turned : identity;
}

Surface turned(Surface surface, const Mat3& axes) {
  if (axes == Mat3::Identity()) return surface;
  parallel_for(surface.points.size(), [&](std::size_t i) { surface.points[PointId(i)] = axes * surface.points[PointId(i)]; });
  parallel_for(surface.normal.size(), [&](std::size_t i) { surface.normal[TriangleId(i)] = axes * surface.normal[TriangleId(i)]; });
  surface.box = Box();
  for (const Vec3& p : surface.points) surface.box.add(p);
  surface.frame.turn = surface.frame.turn ? Mat3(axes * *surface.frame.turn) : axes;
  return surface;
}

}  // namespace strata
