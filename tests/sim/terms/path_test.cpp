// Interpolation of a collider's motion between knots, and the slip of skin under a body that turns.
#include "sim/terms/path.h"

#include <gtest/gtest.h>

#include <Eigen/Geometry>
#include <cmath>

#include "sim/core/error.h"
#include "sim/surface/shapes.h"
#include "sim/terms/contact_law.h"

namespace rhytid {
namespace {

double value(const KnotPath& path, const VectorXd& knots, double t) {
  double sum = 0;
  for (const KnotWeight& w : path.weights(t)) sum += w.weight * knots[w.knot];
  return sum;
}

const std::vector<double> kTimes{0, 0.3, 0.7, 0.8, 1.5, 2};

TEST(KnotPath, MeetsItsKnotsAndStaysOutside) {
  const VectorXd knots = (VectorXd(6) << 1, -2, 0.5, 3, 3, 7).finished();
  for (const PathKind kind : {PathKind::linear, PathKind::spline, PathKind::clamped_spline}) {
    const KnotPath path(kTimes, kind);
    for (int k = 0; k < 6; ++k)
      EXPECT_NEAR(value(path, knots, kTimes[static_cast<std::size_t>(k)]), knots[k], 1e-14);
    EXPECT_EQ(value(path, knots, -1), 1);
    EXPECT_EQ(value(path, knots, 5), 7);
    EXPECT_NEAR(value(path, VectorXd::Ones(6), 0.44), 1, 1e-14);
  }
  EXPECT_NEAR(value(KnotPath(kTimes), knots, 0.15), -0.5, 1e-15);
}

// A cubic at rest at both ends is its own clamped spline; a straight line is its own natural spline.
TEST(KnotPath, SplinesReproduceWhatTheyCan) {
  VectorXd cubic(6), line(6);
  const auto f = [](double t) { return t * t * (3 - t); };  // f' = 0 at 0 and 2
  for (int k = 0; k < 6; ++k) {
    cubic[k] = f(kTimes[static_cast<std::size_t>(k)]);
    line[k] = 3 - 2 * kTimes[static_cast<std::size_t>(k)];
  }
  for (double t = 0; t <= 2; t += 0.0173) {
    EXPECT_NEAR(value(KnotPath(kTimes, PathKind::clamped_spline), cubic, t), f(t), 2e-14);
    EXPECT_NEAR(value(KnotPath(kTimes, PathKind::spline), line, t), 3 - 2 * t, 2e-14);
  }
}

// Against central differences where paths are smooth; one-sided at kinks; nothing outside.
TEST(KnotPath, RatesAreTheDerivatives) {
  const VectorXd knots = (VectorXd(6) << 1, -2, 0.5, 3, 3, 7).finished();
  const auto rate = [&](const KnotPath& path, double t, KnotPath::Side side = KnotPath::Side::mean) {
    double sum = 0;
    for (const KnotWeight& w : path.rates(t, side)) sum += w.weight * knots[w.knot];
    return sum;
  };
  const std::vector<KnotPath> paths = {KnotPath(kTimes), KnotPath(kTimes, PathKind::spline),
                                       KnotPath(kTimes, PathKind::clamped_spline),
                                       KnotPath(kTimes, std::vector<double>{0.5, 1e-5, 1.2, 0, 0.9})};
  const double h = 1e-5;
  for (std::size_t k = 0; k < paths.size(); ++k) {
    const KnotPath& path = paths[k];
    for (const double t : {0.1, 0.44, 0.77, 1.2, 1.9}) {
      const double central = (value(path, knots, t + h) - value(path, knots, t - h)) / (2 * h);
      EXPECT_NEAR(rate(path, t), central, 1e-6) << k << " at " << t;
    }
    EXPECT_TRUE(path.rates(-0.1).empty());
    EXPECT_TRUE(path.rates(2.1).empty());
    for (const double knot : kTimes) {
      const double before = rate(path, knot, KnotPath::Side::before),
                   after = rate(path, knot, KnotPath::Side::after);
      EXPECT_NEAR(before, rate(path, knot - 1e-8), 1e-4);
      EXPECT_NEAR(after, rate(path, knot + 1e-8), 1e-4);
      EXPECT_NEAR(rate(path, knot), 0.5 * (before + after), 1e-12);
      const bool is_inside = knot > 0 && knot < 2, is_spline = k == 1 || k == 2;
      if (k == 2 || (is_spline && is_inside)) {
        EXPECT_NEAR(before, after, 1e-9) << knot;
      }
    }
  }
  EXPECT_EQ(rate(paths[0], 0.3, KnotPath::Side::before), -10);
  EXPECT_EQ(rate(paths[0], 0, KnotPath::Side::before), 0);
}

TEST(KnotPath, SplinesAreTwiceDifferentiable) {
  const VectorXd knots = (VectorXd(6) << 1, -2, 0.5, 3, 3, 7).finished();
  const double h = 1e-4;
  for (const PathKind kind : {PathKind::spline, PathKind::clamped_spline}) {
    const KnotPath path(kTimes, kind);
    const auto second = [&](double t) {
      return (value(path, knots, t + h) - 2 * value(path, knots, t) + value(path, knots, t - h)) / (h * h);
    };
    for (int k = 1; k < 5; ++k) {
      const double t = kTimes[static_cast<std::size_t>(k)];
      EXPECT_NEAR(second(t - 2 * h), second(t + 2 * h), 1) << "of about 100, at knot " << k;
    }
    EXPECT_GT(std::fabs(second(0.5)), 50);
    if (kind == PathKind::spline) {
      EXPECT_NEAR(second(2 * h), 0, 1);
      EXPECT_NEAR(second(2 - 2 * h), 0, 1);
    } else {
      EXPECT_NEAR((value(path, knots, h) - knots[0]) / h, 0, 0.1);
    }
  }
}

TEST(KnotPath, SlerpTurnsAtConstantSpeed) {
  const double angle = 2.5;  // of the rotation; half of it between the quaternions
  const KnotPath path({0, 1}, std::vector{angle / 2});
  for (double t = 0; t <= 1; t += 0.05) {
    Eigen::Vector2d q = Eigen::Vector2d::Zero();  // w and the component along the axis
    for (const KnotWeight& w : path.weights(t))
      q += w.weight *
           (w.knot == 0 ? Eigen::Vector2d(1, 0) : Eigen::Vector2d(std::cos(angle / 2), std::sin(angle / 2)));
    EXPECT_NEAR(q.norm(), 1, 1e-14);
    EXPECT_NEAR(2 * std::atan2(q[1], q[0]), angle * t, 1e-14);
  }
}

TEST(KnotPath, RefusesBadKnots) {
  EXPECT_THROW(KnotPath({}), ContractError);
  EXPECT_THROW(KnotPath({0, 1, 1}), ContractError);
  EXPECT_THROW(KnotPath({0, 1}, std::vector{2.0}), ContractError);
  EXPECT_THROW(KnotPath({0, 1}, std::vector<double>{}), ContractError);
}

/// θ of friction for a body that goes from (c_old, q_old) to (c, q).
std::array<double, 17> friction_theta(const Vec3& c, const Vec3& c_old, const Eigen::Quaterniond& q,
                                      const Eigen::Quaterniond& q_old) {
  return {1,     0,     0.5,   c[0],  c[1],      c[2],      c_old[0],  c_old[1], c_old[2],
          q.w(), q.x(), q.y(), q.z(), q_old.w(), q_old.x(), q_old.y(), q_old.z()};
}

// Skin that moves with the body, however far that goes and turns, does not slip.
TEST(Friction, SkinCarriedByTheBodyDoesNotSlip) {
  const Vec3 c_old(1, -2, 3), c(4, 2, -1), x_rest(0.2, 0.1, 5);
  const Eigen::Quaterniond q_old(Eigen::AngleAxisd(0.4, Vec3(1, 2, 0).normalized())),
      q = Eigen::Quaterniond(Eigen::AngleAxisd(2.1, Vec3(0.3, -1, 0.5).normalized())) * q_old;
  const auto theta = friction_theta(c, c_old, q, q_old);
  const Vec3 u_old(0.3, -0.2, 0.1), u = c + q * (q_old.inverse() * (x_rest + u_old - c_old)) - x_rest;
  const double prepared[7] = {1, 0, 0.6, 0.8, u_old[0], u_old[1], u_old[2]};
  const double rest[4] = {x_rest[0], x_rest[1], x_rest[2], 0};
  double slip[3];
  EXPECT_LT(FrictionLaw::slip_of<double>(u.data(), prepared, theta.data(), rest, slip), 1e-28);
}

// A ball that spins in place drags the skin under it: speed ω R, along the motion of the ball's surface.
TEST(Friction, ASpinningBallDragsTheSkin) {
  const double radius = 5, angle = 1e-3, dt = 0.1, pressure = 0.2;
  const Sphere ball(radius);
  const FrictionLaw law{&ball, 0, 1e-4, Mollifier::quintic};
  const auto theta = friction_theta(Vec3(0, 0, radius), Vec3(0, 0, radius),
                                    Eigen::Quaterniond(Eigen::AngleAxisd(angle, Vec3::UnitY())),
                                    Eigen::Quaterniond::Identity());
  const double u[3] = {}, rest[4] = {}, prepared[7] = {pressure, 0, 0, -1, 0, 0, 0};
  double slip[3], traction[3];
  EXPECT_NEAR(std::sqrt(FrictionLaw::slip_of<double>(u, prepared, theta.data(), rest, slip)),
              radius * std::sin(angle), 1e-15);
  (void)law.stress<double>(u, prepared, theta.data(), rest, dt, traction);
  // The ball's lowest point goes to −x; the skin, dragged along, pulls back on nothing: ∂Ψ/∂u = −force = +x.
  EXPECT_NEAR(traction[0], 0.5 * pressure, 1e-15);
  EXPECT_NEAR(traction[1], 0, 1e-15);
  EXPECT_NEAR(traction[2], 0, 1e-15);
}

}  // namespace
}  // namespace rhytid
