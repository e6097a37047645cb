// The lag that friction extrapolates: exact for what changes evenly, of second order for what does not, whatever the
// lengths of the steps; what it is in a first step, at the onset of contact, and where there is no normal.
#include "sim/terms/extrapolated_friction_law.h"

#include <gtest/gtest.h>

#include <cmath>

#include "law_cases.h"
#include "sim/core/types.h"
#include "sim/surface/shapes.h"
#include "sim/terms/kernel_table.h"

namespace rhytid::test {
namespace {

constexpr double kStiffness = 0.7;

using Law = ExtrapolatedFrictionLaw;

/// κ, no inflation, μ, a body at c that stood there before, upright.
VectorXd parameters(const Vec3& c) {
  VectorXd theta(17);
  theta << kStiffness, 0, 0.4, c, c, 1, 0, 0, 0, 1, 0, 0, 0;
  return theta;
}

struct Point {
  VectorXd history = VectorXd::Zero(Law::ns);
  double time = 0;
};

const double kRest[4] = {0, 0, 0, 0};

/// What friction takes at the next step, dt long: pressure and normal.
Eigen::Vector4d lag_ahead(const Law& law, const Point& p, double dt) {
  VectorXd prepared(Law::np), u = Vec3::Zero();
  const VectorXd theta = parameters(Vec3::Zero());
  law.prepare<double>(u.data(), p.history.data(), theta.data(), kRest, dt, prepared.data());
  return prepared.head<4>();
}

/// A step of length dt that ends with the point at x and the body at c.
void take_step(const Law& law, const Vec3& x, const Vec3& c, double dt, Point& p) {
  VectorXd prepared(Law::np), history(Law::ns);
  const VectorXd theta = parameters(c);
  const Vec3 unused = Vec3::Zero();
  law.prepare<double>(unused.data(), p.history.data(), theta.data(), kRest, dt, prepared.data());
  law.update<double>(x.data(), prepared.data(), theta.data(), kRest, dt, history.data());
  p.history = history;
  p.time += dt;
}

/// The lag of FrictionLaw there: pressure and normal at the place itself.
Eigen::Vector4d lag_at(const Law& law, const Vec3& x, const Vec3& c) {
  Eigen::Vector4d lag;
  const VectorXd theta = parameters(c);
  static_cast<const FrictionLaw&>(law).update<double>(x.data(), nullptr, theta.data(), kRest, 1, lag.data());
  return lag;
}

// f_n = p_n + dt ṗ: with the penalty κ d², pressure rises evenly with depth, so that it is exact, for halved steps and
// for a whole one behind a halved one.
TEST(ExtrapolatedLag, PressureThatRisesEvenlyIsExactForAnyStepLengths) {
  const Plane plane(Vec3::UnitZ());
  const Law law{{&plane, 0, 1, Mollifier::quintic}};
  const auto depth = [](double t) { return Vec3(0.3 * t, 0, -0.2 - 0.5 * t); };
  for (const double ratio : {1e-3, 0.5, 1., 2., 7.}) {
    Point p;
    for (const double dt : {0.04, 0.1}) take_step(law, depth(p.time + dt), Vec3::Zero(), dt, p);
    const double next = 0.1 * ratio;
    const Eigen::Vector4d lag = lag_ahead(law, p, next),
                          truth = lag_at(law, depth(p.time + next), Vec3::Zero()),
                          before = lag_at(law, depth(p.time), Vec3::Zero());
    EXPECT_NEAR(lag[0], truth[0], 1e-14) << ratio;
    EXPECT_GT(truth[0] - before[0], 0.05 * ratio);
    EXPECT_EQ((lag - truth).tail<3>().norm(), 0);
  }
}

// f_n = p_n² / (p_n − dt ṗ) where it falls: 1/p goes on, positive however fast it falls, joined C¹ to the line.
TEST(ExtrapolatedLag, PressureThatFallsStaysPositiveAndAgreesToSecondOrder) {
  const Law law{};
  const auto ahead = [&](double rate, double dt) {
    Point p;
    p.history << 0.3, 0, 0, 1, rate, 0, 0, 0;
    return lag_ahead(law, p, dt)[0];
  };
  EXPECT_DOUBLE_EQ(ahead(-6, 0.05), 0.15);  // as much again would be 0
  EXPECT_DOUBLE_EQ(ahead(-6, 0.15), 0.075);
  for (const double dt : {0.01, 0.02}) {
    const double error = ahead(-2, dt) - (0.3 - 2 * dt), half = ahead(-2, dt / 2) - (0.3 - dt);
    EXPECT_GT(error, 0);
    EXPECT_NEAR(error / half, 4, 0.3);
  }
  double least = 1;
  for (const double rate : {-1e2, -1e6, -1e12}) {
    EXPECT_GT(ahead(rate, 0.04), 0);
    EXPECT_LT(ahead(rate, 0.04), least);
    least = ahead(rate, 0.04);
  }
  // Value and slope by p and by its change are those of p + change on both sides of no change.
  for (const double change : {-1e-300, 0., 1e-300}) {
    using D = Dual<2>;
    const D p = Law::pressure_ahead(D::variable(0.3, 0), D::variable(change, 1));
    EXPECT_DOUBLE_EQ(p.v, 0.3);
    EXPECT_DOUBLE_EQ(p.d[0], 1);
    EXPECT_DOUBLE_EQ(p.d[1], 1);
  }
  EXPECT_EQ(Law::pressure_ahead(0., -0.1), 0) << "no friction behind the contact";
}

/// Error of the lag at the end of the next step, and that of the lag at its start, along a smooth way around a ball.
struct Errors {
  double pressure, normal, previous_pressure, previous_normal;
};
Errors errors(double dt, double last) {
  const Sphere ball(5);
  const Law law{{&ball, 0, 1, Mollifier::quintic}};
  const auto place = [](double t) {
    const double angle = 0.4 + 0.8 * t + 0.3 * t * t;
    return Vec3((4.6 + 0.2 * std::sin(2 * t)) * Vec3(std::sin(angle), 0.1 * t, -std::cos(angle)));
  };
  // Two steps that end at t = 0.5, then the one looked at.
  Point p;
  p.time = 0.5 - 2 * last;
  for (int k = 0; k < 2; ++k) take_step(law, place(p.time + last), Vec3::Zero(), last, p);
  const Eigen::Vector4d lag = lag_ahead(law, p, dt), truth = lag_at(law, place(p.time + dt), Vec3::Zero()),
                        before = lag_at(law, place(p.time), Vec3::Zero());
  EXPECT_NEAR(lag.tail<3>().norm(), 1, 1e-15);
  return {std::fabs(lag[0] - truth[0]), (lag - truth).tail<3>().norm(), std::fabs(before[0] - truth[0]),
          (before - truth).tail<3>().norm()};
}

TEST(ExtrapolatedLag, IsOfSecondOrderOnASmoothWay) {
  for (const double ratio : {0.5, 1., 2.}) {
    const Errors coarse = errors(0.02, 0.02 / ratio), fine = errors(0.01, 0.01 / ratio);
    std::printf("dt ratio %.1f: pressure %.1e (previous %.1e) MPa, normal %.1e (previous %.1e)\n", ratio,
                fine.pressure, fine.previous_pressure, fine.normal, fine.previous_normal);
    EXPECT_NEAR(std::log2(coarse.pressure / fine.pressure), 2, 0.1);
    EXPECT_NEAR(std::log2(coarse.normal / fine.normal), 2, 0.1);
    EXPECT_NEAR(std::log2(coarse.previous_pressure / fine.previous_pressure), 1, 0.1);
    EXPECT_NEAR(std::log2(coarse.previous_normal / fine.previous_normal), 1, 0.1);
    EXPECT_LT(fine.pressure, 0.1 * fine.previous_pressure);
    EXPECT_LT(fine.normal, 0.1 * fine.previous_normal);
  }
}

// Frame 0 is no equilibrium of a body that lies on the skin there already.
TEST(ExtrapolatedLag, OfTheFirstStepIsThatOfThePreviousOne) {
  const Sphere ball(5);
  const Law law{{&ball, 0.01, 1, Mollifier::quintic}};
  const Vec3 x(1, 0.5, -4.6);
  Point p;
  EXPECT_EQ(lag_ahead(law, p, 0.04)[0], 0) << "no friction in the first step";
  take_step(law, x, Vec3::Zero(), 0.04, p);
  EXPECT_EQ(p.history.tail<4>().norm(), 0);
  EXPECT_LT((lag_ahead(law, p, 0.04) - lag_at(law, x, Vec3::Zero())).norm(), 1e-15);
  EXPECT_GT(p.history[0], 0.1);
}

// A settling step takes 1e9 s: what it changed is not carried on.
TEST(ExtrapolatedLag, BehindASettlingStepIsThatOfThePreviousOne) {
  const Sphere ball(5);
  const Law law{{&ball, 0.01, 1, Mollifier::quintic}};
  Point p;
  for (const double depth : {0.1, 0.4}) take_step(law, Vec3(0, 0, depth - 5), Vec3::Zero(), 1e9, p);
  EXPECT_LT((lag_ahead(law, p, 0.04) - lag_at(law, Vec3(0, 0, -4.6), Vec3::Zero())).norm(), 1e-9);
}

// A point that was about to touch and one that just did have the same lag a step later: no jump at the onset.
TEST(ExtrapolatedLag, IsContinuousWhereAPointBeginsToTouch) {
  const Sphere ball(5);
  for (const double onset : {0., 0.01}) {
    const Law law{{&ball, onset, 1, Mollifier::quintic}};
    const auto lag = [&](double depth_before) {
      Point p;
      take_step(law, Vec3(3, 0, -5), Vec3::Zero(), 0.02, p);  // apart
      take_step(law, (5 - depth_before) * Vec3(0.3, 0.1, -1).normalized(), Vec3::Zero(), 0.02, p);
      take_step(law, 4.8 * Vec3(0.2, 0.1, -1).normalized(), Vec3::Zero(), 0.02, p);
      return lag_ahead(law, p, 0.02);
    };
    EXPECT_LT((lag(1e-13) - lag(-1e-13)).norm(), 1e-11) << onset;
    // Pressure and normal go on from no pressure, and from the normal that was there.
    const Eigen::Vector4d now = lag_at(law, 4.8 * Vec3(0.2, 0.1, -1).normalized(), Vec3::Zero());
    EXPECT_NEAR(lag(-1e-13)[0], 2 * now[0], 1e-14);
    EXPECT_GT((lag(-1e-13) - now).tail<3>().norm(), 0.05);
  }
}

TEST(ExtrapolatedLag, IsTheNextOneWhereTheShapeHasNoNormal) {
  const Sphere ball(5);
  const Law law{{&ball, 0, 1, Mollifier::quintic}};
  Point p;
  take_step(law, Vec3::Zero(), Vec3::Zero(), 0.04, p);  // its centre
  EXPECT_EQ(p.history.norm(), 0);
  const Eigen::Vector4d none = lag_ahead(law, p, 0.04);
  EXPECT_TRUE(none.allFinite());
  EXPECT_EQ(none[0], 0);
  const Vec3 x(0, 1, -4.5);
  take_step(law, x, Vec3::Zero(), 0.04, p);
  EXPECT_LT((lag_ahead(law, p, 0.04) - lag_at(law, x, Vec3::Zero())).norm(), 1e-15);
}

// Apart from where pressure and normal come from it is FrictionLaw, to the bit.
TEST(ExtrapolatedLag, ForcesAndWorkAreThoseOfTheLagItself) {
  const auto choices = shapes();
  for (const auto& c : extrapolated_friction_cases(choices))
    for (const LawState& s : c.states) {
      SCOPED_TRACE(c.name);
      const FrictionLaw& plain = c.law;
      double prepared[Law::np], same[FrictionLaw::np], lag[4], traction[3], wanted[3];
      c.law.prepare<double>(s.e_old.data(), s.history.data(), s.theta.data(), s.rest.data(), s.dt, prepared);
      for (int i = 0; i < 4; ++i) lag[i] = prepared[i];
      plain.prepare<double>(s.e_old.data(), lag, s.theta.data(), s.rest.data(), s.dt, same);
      EXPECT_EQ(c.law.stress<double>(s.e.data(), prepared, s.theta.data(), s.rest.data(), s.dt, traction),
                plain.stress<double>(s.e.data(), same, s.theta.data(), s.rest.data(), s.dt, wanted));
      EXPECT_EQ(Vec3(traction), Vec3(wanted));
      EXPECT_EQ(
          c.law.dissipated(nullptr, nullptr, s.e.data(), prepared, nullptr, s.theta.data(), s.rest.data(),
                           s.dt),
          plain.dissipated(nullptr, nullptr, s.e.data(), same, nullptr, s.theta.data(), s.rest.data(), s.dt));
      EXPECT_NE(prepared[0], s.history[0]) << "nothing was extrapolated";
    }
}

TEST(ExtrapolatedLag, HasKernelsOfItsOwn) {
  EXPECT_EQ(friction_kernels().ns, 4);
  EXPECT_EQ(friction_kernels().np, 7);
  EXPECT_TRUE(friction_kernels().history_is_lag);
  for (const KernelTable* kernels :
       {&extrapolated_friction_kernels(), &extrapolated_ellipsoid_friction_kernels()}) {
    EXPECT_EQ(kernels->ns, 8);
    EXPECT_EQ(kernels->np, 11);
    EXPECT_FALSE(kernels->history_is_lag) << "its rates are none: no pass may replace them";
  }
}

}  // namespace
}  // namespace rhytid::test
