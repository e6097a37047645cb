#include "sim/surface/shapes.h"

#include <gtest/gtest.h>

#include <limits>
#include <memory>
#include <random>

#include "hyper_dual.h"
#include "sim/core/error.h"

namespace rhytid {
namespace {

using testing::exact_jet;
using testing::ExactJet;
using testing::HyperDual;

Vec3 random_vector(std::mt19937& random, double size) {
  std::normal_distribution<double> normal;
  return size * Vec3(normal(random), normal(random), normal(random));
}

void expect_jet(const GapJet& jet, const ExactJet& exact, double tolerance) {
  EXPECT_TRUE(jet.supported);
  EXPECT_NEAR(jet.gap, exact.value, tolerance * (1 + std::abs(exact.value)));
  EXPECT_LT((jet.gradient - exact.gradient).norm(), tolerance);
  EXPECT_LT((jet.hessian - exact.hessian).norm(), tolerance * (1 + exact.hessian.norm()));
}

TEST(Sphere, JetIsThatOfTheDistanceOnBothSides) {
  std::mt19937 random(11);
  for (int trial = 0; trial < 200; ++trial) {
    const Vec3 x = random_vector(random, std::pow(10.0, trial % 5 - 2));
    const double radius = 0.5 + trial * 0.1;
    for (const Side side : {Side::outside, Side::inside}) {
      const double sign = side == Side::outside ? 1 : -1;
      const ExactJet exact = exact_jet(x, [&](const HyperDual(&v)[3]) {
        return HyperDual(sign) * (sqrt(v[0] * v[0] + v[1] * v[1] + v[2] * v[2]) - HyperDual(radius));
      });
      expect_jet(Sphere(radius, side).evaluate(x), exact, 1e-14);
    }
  }
}

TEST(Sphere, SignsAreThoseOfABallAndOfACavity) {
  const Sphere ball(2), cavity(2, Side::inside);
  EXPECT_DOUBLE_EQ(ball.evaluate(Vec3(0, 3, 0)).gap, 1);
  EXPECT_DOUBLE_EQ(ball.evaluate(Vec3(0, 1.5, 0)).gap, -0.5);
  EXPECT_DOUBLE_EQ(cavity.evaluate(Vec3(0, 1.5, 0)).gap, 0.5);
  EXPECT_EQ(ball.evaluate(Vec3(0, 3, 0)).gradient, Vec3(0, 1, 0));
  EXPECT_EQ(cavity.evaluate(Vec3(0, 1.5, 0)).gradient, Vec3(0, -1, 0));
}

TEST(Sphere, RadiusOffsetsTheGapAndLeavesDirectionAlone) {
  const Vec3 x(0.3, -1.2, 0.7);
  for (const Side side : {Side::outside, Side::inside}) {
    const Sphere small(1.5, side), large(1.75, side);
    const GapJet a = small.evaluate(x), b = large.evaluate(x);
    EXPECT_NEAR((b.gap - a.gap) / 0.25, small.gap_by_radius(), 1e-14);
    EXPECT_EQ(a.gradient, b.gradient);
    EXPECT_EQ(a.hessian, b.hessian);
  }
  EXPECT_EQ(Sphere(1).gap_by_radius(), -1);
}

TEST(Sphere, IsFiniteAtTheCentreAndForHugeAndTinyArguments) {
  const Sphere ball(8);
  const GapJet centre = ball.evaluate(Vec3::Zero());
  EXPECT_EQ(centre.gap, -8);
  EXPECT_EQ(centre.gradient, Vec3::Zero().eval());
  EXPECT_EQ(centre.hessian, Mat3::Zero().eval());
  for (const double size : {1e-300, 1e-14, 1e-6, 1e200}) {
    const GapJet jet = ball.evaluate(size * Vec3(1, -2, 2));
    EXPECT_TRUE(std::isfinite(jet.gap) && jet.gradient.allFinite() && jet.hessian.allFinite()) << size;
  }
  EXPECT_NEAR(ball.evaluate(1e200 * Vec3(1, -2, 2)).gap, 3e200, 1e186);
}

TEST(Plane, JetIsLinear) {
  std::mt19937 random(12);
  for (int trial = 0; trial < 50; ++trial) {
    const Vec3 normal = random_vector(random, std::pow(10.0, trial % 7 - 3)), x = random_vector(random, 10);
    const double length = normal.norm();
    const ExactJet exact = exact_jet(x, [&](const HyperDual(&v)[3]) {
      return (v[0] * HyperDual(normal[0]) + v[1] * HyperDual(normal[1]) + v[2] * HyperDual(normal[2])) /
             HyperDual(length);
    });
    const std::unique_ptr<ImplicitShape> plane = std::make_unique<Plane>(normal);
    expect_jet(plane->evaluate(x), exact, 1e-14);
    EXPECT_EQ(plane->gap_by_radius(), 0);
    EXPECT_NEAR(plane->evaluate(x).gradient.norm(), 1, 3e-16);
  }
}

TEST(Shapes, RefuseWhatIsNoShape) {
  const double nan = std::numeric_limits<double>::quiet_NaN();
  EXPECT_THROW(Sphere(0), ContractError);
  EXPECT_THROW(Sphere(-1), ContractError);
  EXPECT_THROW(Sphere{nan}, ContractError);
  EXPECT_THROW(Plane(Vec3::Zero()), ContractError);
  EXPECT_THROW(Plane(Vec3(0, nan, 1)), ContractError);
}

}  // namespace
}  // namespace rhytid
