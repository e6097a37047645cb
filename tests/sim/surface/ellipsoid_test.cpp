// Distance to an ellipsoid and a capsule: against points built outward and inward from known feet, against
// spheres, difference quotients, and at all the places where the nearest point is not unique.
#include <gtest/gtest.h>

#include <Eigen/Geometry>
#include <cmath>
#include <limits>
#include <random>

#include "sim/core/error.h"
#include "sim/surface/shapes.h"

namespace rhytid {
namespace {

const Vec3 kAxes[] = {{8, 5, 3}, {3, 8, 5}, {1, 1, 4}, {4, 4, 1}, {2, 2, 2}, {100, 1, 0.2}};

/// A point of the surface, its normal and the largest depth along the normal for which it stays the nearest:
/// not below the smallest radius of curvature of the whole ellipsoid, m²/longest.
struct Foot {
  Vec3 y, n;
  double safe_depth;
};
Foot random_foot(const Vec3& e, std::mt19937& random) {
  std::normal_distribution<double> normal;
  const Vec3 direction = Vec3(normal(random), normal(random), normal(random)).normalized();
  Foot f;
  f.y = e.cwiseProduct(direction);
  f.n = direction.cwiseQuotient(e).normalized();
  f.safe_depth = e.minCoeff() * e.minCoeff() / e.maxCoeff();
  return f;
}

TEST(Ellipsoid, FindsTheFootItWasBuiltFrom) {
  std::mt19937 random(5);
  for (const Vec3& e : kAxes) {
    const Ellipsoid shape(e);
    for (int trial = 0; trial < 300; ++trial) {
      const Foot f = random_foot(e, random);
      for (const double g : {-0.95 * f.safe_depth, -1e-6, 0.0, 1e-9, 0.3, 20.0, 1e5}) {
        const GapJet jet = shape.evaluate(f.y + g * f.n);
        const double size = e.maxCoeff() + std::fabs(g);
        ASSERT_NEAR(jet.gap, g, 1e-14 * size) << e.transpose() << ", " << f.y.transpose();
        ASSERT_LT((jet.gradient - f.n).norm(), 1e-13 * e.maxCoeff() * e.maxCoeff() / e.minCoeff())
            << e.transpose();
        ASSERT_NEAR(jet.gradient.norm(), 1, 1e-15);
      }
    }
  }
}

/// Error of the Hessian against central differences of the gradient, at steps h and h/2.
template <class Shape>
void expect_second_order(const Shape& shape, const Vec3& x, double h) {
  const GapJet jet = shape.evaluate(x);
  double errors[2];
  for (int k = 0; k < 2; ++k, h /= 2) {
    Mat3 difference;
    for (int i = 0; i < 3; ++i)
      difference.col(i) =
          (shape.evaluate(x + h * Vec3::Unit(i)).gradient - shape.evaluate(x - h * Vec3::Unit(i)).gradient) /
          (2 * h);
    errors[k] = (difference - jet.hessian).norm() / jet.hessian.norm();
  }
  EXPECT_LT(errors[1], 1e-5) << x.transpose();
  if (errors[1] > 1e-9) {
    EXPECT_NEAR(std::log2(errors[0] / errors[1]), 2, 0.2) << x.transpose();
  }
  EXPECT_LT((jet.hessian * jet.gradient).norm(), 1e-13 * jet.hessian.norm());
  EXPECT_LT((jet.hessian - jet.hessian.transpose()).norm(), 1e-15 * jet.hessian.norm());
}

TEST(Ellipsoid, HessianIsTheDerivativeOfTheGradient) {
  std::mt19937 random(6);
  for (const Vec3& e : {kAxes[0], kAxes[1], kAxes[2], kAxes[3]}) {
    const Ellipsoid shape(e);
    for (int trial = 0; trial < 30; ++trial) {
      const Foot f = random_foot(e, random);
      for (const double g : {-0.5 * f.safe_depth, 0.0, 2.0})
        expect_second_order(shape, f.y + g * f.n, 1e-3 * f.safe_depth);
    }
  }
}

TEST(Ellipsoid, WithEqualAxesIsASphere) {
  std::mt19937 random(7);
  std::normal_distribution<double> normal;
  const Sphere sphere(2);
  const Ellipsoid shape(Vec3(2, 2, 2));
  for (int trial = 0; trial < 200; ++trial) {
    const Vec3 x = std::pow(10.0, trial % 9 - 6) * Vec3(normal(random), normal(random), normal(random));
    const GapJet a = sphere.evaluate(x), b = shape.evaluate(x);
    EXPECT_NEAR(a.gap, b.gap, 1e-15 * (2 + x.norm()));
    EXPECT_LT((a.gradient - b.gradient).norm(), 1e-15 * 2);
    if (x.norm() > 1e-3) {
      EXPECT_LT((a.hessian - b.hessian).norm(), 1e-12 * a.hessian.norm());
    }
  }
}

// On the axes, in the planes of symmetry and at the centre. Inside, up to the focal distance, the nearest
// point lies off the axis: for x on the long axis y₁ = x a²/(a² − c²), y₃ = c √(1 − y₁²/a²).
TEST(Ellipsoid, IsExactOnAxesAndInTheMiddle) {
  const Ellipsoid shape(Vec3(8, 5, 3));
  EXPECT_EQ(shape.evaluate(Vec3::Zero()).gap, -3);
  EXPECT_EQ(shape.evaluate(Vec3::Zero()).gradient, Vec3(0, 0, 1));
  EXPECT_NEAR(shape.evaluate(Vec3(0, 0, -1)).gap, -2, 1e-15);
  EXPECT_EQ(shape.evaluate(Vec3(0, 0, -1)).gradient, Vec3(0, 0, -1));
  EXPECT_NEAR(shape.evaluate(Vec3(9, 0, 0)).gap, 1, 1e-14);
  EXPECT_EQ(shape.evaluate(Vec3(9, 0, 0)).gradient, Vec3(1, 0, 0));
  EXPECT_NEAR(shape.evaluate(Vec3(0, -4.5, 0)).gap, -0.5, 1e-14);
  for (const double x : {0.1, 2.0, 6.5}) {
    const double y1 = x * 64 / (64 - 9), y3 = 3 * std::sqrt(1 - y1 * y1 / 64);
    const GapJet on = shape.evaluate(Vec3(x, 0, 0));
    EXPECT_NEAR(on.gap, -std::hypot(x - y1, y3), 1e-14) << x;
    EXPECT_NEAR(on.gradient.norm(), 1, 1e-15);
    EXPECT_GT(on.gradient[2], 0) << "the side with positive coordinates";
    // The same values come from just beside the plane, where the nearest point is unique.
    for (const double z : {1e-300, 1e-15, 1e-9}) {
      const GapJet above = shape.evaluate(Vec3(x, 0, z)), below = shape.evaluate(Vec3(x, 0, -z));
      EXPECT_NEAR(above.gap, on.gap, 2e-9);
      EXPECT_LT((above.gradient - on.gradient).norm(), 1e-8);
      EXPECT_EQ(below.gap, above.gap);
      EXPECT_EQ(below.gradient[2], -above.gradient[2]);
    }
  }
  // The end of the evolute, where the curvature of the distance would be infinite.
  EXPECT_TRUE(shape.evaluate(Vec3(8 - 9. / 8, 0, 0)).hessian.allFinite());
}

TEST(Ellipsoid, IsFiniteForAnyArgument) {
  for (const Vec3& e : kAxes)
    for (const double size : {0.0, 1e-300, 1e-30, 1e-8, 1.0, 1e12, 1e150})
      for (const Vec3& d :
           {Vec3(1, -2, 2), Vec3(0, 1, 0), Vec3(1, 0, 1e-17), Vec3(-1, 1e-300, 0), Vec3(0, 0, 1)}) {
        const GapJet jet = Ellipsoid(e).evaluate(size * d);
        EXPECT_TRUE(std::isfinite(jet.gap) && jet.gradient.allFinite() && jet.hessian.allFinite())
            << e.transpose() << ", " << size << " * " << d.transpose();
        EXPECT_NEAR(jet.gradient.norm(), 1, 1e-14);
        EXPECT_GE(jet.gap, -e.minCoeff() * (1 + 1e-15));
      }
}

TEST(Capsule, IsASphereRoundItsEndsAndACylinderBetween) {
  std::mt19937 random(8);
  std::normal_distribution<double> normal;
  const Vec3 axis = Vec3(1, -2, 0.5).normalized();
  const Capsule capsule(3, 4, 2.5 * axis);
  const Sphere sphere(3);
  for (int trial = 0; trial < 300; ++trial) {
    const Vec3 x = 6 * Vec3(normal(random), normal(random), normal(random));
    const GapJet jet = capsule.evaluate(x);
    const double along = axis.dot(x);
    if (std::fabs(along) > 4) {
      const GapJet ball = sphere.evaluate(x - capsule.end(along > 0));
      EXPECT_NEAR(jet.gap, ball.gap, 1e-14);
      EXPECT_LT((jet.hessian - ball.hessian).norm(), 1e-14);
    } else {
      EXPECT_NEAR(jet.gap, axis.cross(x).norm() - 3, 1e-14);
      EXPECT_NEAR(jet.gradient.dot(axis), 0, 1e-15);
      EXPECT_LT((jet.hessian * axis).norm(), 1e-15);
    }
    if (std::fabs(std::fabs(along) - 4) > 0.01) expect_second_order(capsule, x, 1e-3 * (jet.gap + 3));
  }
  EXPECT_EQ(capsule.gap_by_radius(), -1);
  EXPECT_EQ(Capsule(3, 0).evaluate(Vec3(1, 2, 7)).gap, sphere.evaluate(Vec3(1, 2, 7)).gap);
}

// Gap and gradient by the semi-axes, outside and inside, against central differences of the evaluation.
TEST(Ellipsoid, DerivativesByItsSemiAxes) {
  const Vec3 axes(7, 4, 5);
  const Ellipsoid built(Vec3(1, 2, 3));  // what it was built with does not matter
  for (const Vec3& x : {Vec3(6, 3, 4), Vec3(-2, 4.5, 1), Vec3(3, -1, -3.9), Vec3(0.5, 3.5, 0.2)}) {
    SizeDerivatives by_size;
    const GapJet jet = built.evaluate_sized(x, axes, by_size);
    EXPECT_EQ(jet.gap, Ellipsoid(axes).evaluate(x).gap);
    const double h = 1e-5;
    for (int k = 0; k < 3; ++k) {
      const GapJet more = Ellipsoid(axes + h * Vec3::Unit(k)).evaluate(x),
                   less = Ellipsoid(axes - h * Vec3::Unit(k)).evaluate(x);
      EXPECT_NEAR(by_size.gap[k], (more.gap - less.gap) / (2 * h), 1e-9);
      EXPECT_LT((by_size.gradient.col(k) - (more.gradient - less.gradient) / (2 * h)).norm(), 1e-8);
    }
    EXPECT_GT(by_size.gradient.norm(), 1e-3);
  }
  SizeDerivatives by_size;
  EXPECT_THROW((void)Sphere(2).evaluate_sized(Vec3(1, 2, 3), axes, by_size), ContractError);
}

TEST(Capsule, IsFiniteOnItsAxis) {
  const Capsule capsule(3, 4);
  for (const double z : {0.0, 4.0, -4.0, 1.7}) {
    const GapJet jet = capsule.evaluate(Vec3(0, 0, z));
    EXPECT_EQ(jet.gap, -3);
    EXPECT_EQ(jet.gradient, Vec3::Zero().eval());
    EXPECT_EQ(jet.hessian, Mat3::Zero().eval());
  }
  EXPECT_NEAR(capsule.evaluate(Vec3(0, 0, 5)).gap, -2, 1e-15);
}

TEST(Shapes, RefuseBadCapsulesAndEllipsoids) {
  const double nan = std::numeric_limits<double>::quiet_NaN();
  EXPECT_THROW(Capsule(0, 1), ContractError);
  EXPECT_THROW(Capsule(1, -1), ContractError);
  EXPECT_THROW(Capsule(1, nan), ContractError);
  EXPECT_THROW(Capsule(1, 1, Vec3::Zero()), ContractError);
  EXPECT_THROW(Ellipsoid(Vec3(1, 0, 1)), ContractError);
  EXPECT_THROW(Ellipsoid(Vec3(1, nan, 1)), ContractError);
  EXPECT_THROW(Ellipsoid(Vec3(1, 1, 2000)), ContractError);
}

}  // namespace
}  // namespace rhytid
