#include "core/optimise/star.h"

#include <gtest/gtest.h>

#include <Eigen/Cholesky>

#include <random>

namespace strata {
namespace {

const std::array<Vec3, 8> kCube{Vec3(0, 0, 0), Vec3(1, 0, 0), Vec3(1, 1, 0), Vec3(0, 1, 0),
                                Vec3(0, 0, 1), Vec3(1, 0, 1), Vec3(1, 1, 1), Vec3(0, 1, 1)};

std::array<Vec3, 7> seen_from(const std::array<Vec3, 8>& hex, std::size_t corner) {
  std::array<Vec3, 7> p;
  p[0] = hex[corner];
  for (std::size_t k = 0; k < 6; ++k) p[k + 1] = hex[static_cast<std::size_t>(kStarPatterns[corner].vertex[k])];
  return p;
}

void add(Star& star, const std::array<Vec3, 7>& p, const Vec3& w, bool sound) {
  std::array<const Vec3*, 7> at;
  for (std::size_t i = 0; i < 7; ++i) at[i] = &p[i];
  star.add_hex(at, {w[0], w[1], w[2]}, sound);
}

// Eight jittered cubes round the origin.
Star random_star(std::mt19937& random, double jitter, const Vec3& w, bool sound) {
  std::uniform_real_distribution<double> noise(-jitter, jitter);
  std::array<std::array<std::array<Vec3, 3>, 3>, 3> p;
  for (int x = 0; x < 3; ++x)
    for (int y = 0; y < 3; ++y)
      for (int z = 0; z < 3; ++z) p[x][y][z] = Vec3(x - 1, y - 1, z - 1) + Vec3(noise(random), noise(random), noise(random));
  Star star;
  for (int o = 0; o < 8; ++o) {
    const int ox = o & 1, oy = (o >> 1) & 1, oz = o >> 2;
    std::array<Vec3, 8> hex;
    std::size_t own = 0;
    for (std::size_t c = 0; c < 8; ++c) {
      const int x = ox + static_cast<int>(kCube[c].x()), y = oy + static_cast<int>(kCube[c].y()), z = oz + static_cast<int>(kCube[c].z());
      hex[c] = p[x][y][z];
      if (x == 1 && y == 1 && z == 1) own = c;
    }
    const StarPattern& pattern = kStarPatterns[own];
    add(star, seen_from(hex, own), Vec3(w[pattern.axis[0]], w[pattern.axis[1]], w[pattern.axis[2]]), sound);
  }
  star.complete();
  return star;
}

TEST(StarPatterns, SeeAnIdealHexFromEveryCorner) {
  for (std::size_t corner = 0; corner < 8; ++corner) {
    Star star;
    add(star, seen_from(kCube, corner), Vec3(1, 1, 1), true);
    star.complete();
    for (int c = 0; c < 4; ++c) EXPECT_DOUBLE_EQ(star.determinant(0, c, Vec3::Zero()), 1);
    EXPECT_NEAR(star.value(Vec3::Zero(), 0, 3).energy, 4, 1e-12);
    EXPECT_NEAR(star.scaled_jacobian(Vec3::Zero()), 1, 1e-14);
  }
}

TEST(StarPatterns, AxesFollowTheHexNotTheCorner) {
  std::array<Vec3, 8> slab = kCube;
  for (Vec3& p : slab) p = p.cwiseProduct(Vec3(1, 2, 5));
  for (std::size_t corner = 0; corner < 8; ++corner) {
    Star star;
    const Vec3 w(1, 0.5, 0.2);
    const auto& axis = kStarPatterns[corner].axis;
    add(star, seen_from(slab, corner), Vec3(w[axis[0]], w[axis[1]], w[axis[2]]), true);
    star.complete();
    EXPECT_NEAR(star.value(Vec3::Zero(), 0, 1).energy, 4, 1e-12) << "a box with its own proportions as target is ideal";
  }
}

TEST(Star, GradientAndHessianAgreeWithFiniteDifferences) {
  std::mt19937 random(3);
  for (int round = 0; round < 20; ++round)
    for (const int exponent : {1, 2, 5}) {
      const Star star = random_star(random, 0.15, Vec3(1, 0.7, 1.8), true);
      const Vec3 at(0.03, -0.02, 0.01);
      Vec3 gradient;
      Mat3 hessian;
      star.derivatives(at, 0, exponent, gradient, hessian);
      const double h = 1e-5;
      for (int i = 0; i < 3; ++i) {
        const Vec3 step = h * Vec3::Unit(i);
        const double slope = (star.value(at + step, 0, exponent).energy - star.value(at - step, 0, exponent).energy) / (2 * h);
        EXPECT_NEAR(slope, gradient[i], 1e-6 * (1 + gradient.norm()));
        Vec3 plus, minus;
        Mat3 unused;
        star.derivatives(at + step, 0, exponent, plus, unused);
        star.derivatives(at - step, 0, exponent, minus, unused);
        EXPECT_LT(((plus - minus) / (2 * h) - hessian.col(i)).norm(), 1e-5 * (1 + hessian.norm()));
      }
    }
}

TEST(Star, RegularisedGradientAgreesWithFiniteDifferencesThroughInversion) {
  std::mt19937 random(4);
  for (int round = 0; round < 50; ++round) {
    const Star star = random_star(random, 0.6, Vec3(1, 1, 1), false);
    Vec3 gradient;
    Mat3 hessian;
    const double eps = 0.3, h = 1e-6;
    star.derivatives(Vec3::Zero(), eps, 1, gradient, hessian);
    for (int i = 0; i < 3; ++i) {
      const double slope = (star.value(h * Vec3::Unit(i), eps, 1).energy - star.value(-h * Vec3::Unit(i), eps, 1).energy) / (2 * h);
      EXPECT_NEAR(slope, gradient[i], 1e-5 * (1 + gradient.norm()));
    }
    EXPECT_EQ(hessian.llt().info(), Eigen::Success) << "the Hessian must be positive definite, inverted or not";
  }
}

TEST(Star, AngleGradientAgreesWithFiniteDifferences) {
  std::mt19937 random(6);
  for (int round = 0; round < 20; ++round) {
    const Star star = random_star(random, 0.15, Vec3(1, 0.7, 1.8), true);
    const Star::AngleEnergy energy{.exponent = 3, .shape_exponent = 4, .shape_share = 0.5};
    Vec3 gradient;
    Mat3 hessian;
    star.angle_derivatives(Vec3::Zero(), energy, gradient, hessian);
    const double h = 1e-6;
    for (int i = 0; i < 3; ++i) {
      const double slope = (star.angle_energy(h * Vec3::Unit(i), energy) - star.angle_energy(-h * Vec3::Unit(i), energy)) / (2 * h);
      EXPECT_NEAR(slope, gradient[i], 1e-5 * (1 + gradient.norm()));
    }
    EXPECT_EQ(hessian.llt().info(), Eigen::Success);
  }
}

TEST(Star, ScaledJacobianIsAtLeastTheInverseOfU) {
  std::mt19937 random(8);
  for (int round = 0; round < 100; ++round) {
    const Star star = random_star(random, 0.2, Vec3(1, 1, 1), true);
    const Star::Value value = star.value(Vec3::Zero(), 0, 1);
    if (value.sound) {
      EXPECT_GE(star.scaled_jacobian(Vec3::Zero()), 1 / value.worst - 1e-12);
    }
  }
}

}  // namespace
}  // namespace strata
