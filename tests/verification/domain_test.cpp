// Where the energy ends (T7): K/2 (J − 1)² is finite at J = 0 and beyond, and the stretches of C
// do not know the sign of J. A state with an inverted point must be infinite, never be accepted, and the line
// search must know how far it is.
#include <gtest/gtest.h>

#include <Eigen/LU>
#include <cmath>
#include <cstdio>
#include <limits>
#include <random>

#include "loaded_problem.h"
#include "sim/core/error.h"
#include "sim/scene/load.h"
#include "tests/support/small_scenes.h"

namespace rhytid::test {
namespace {

/// A free slab and its problem.
struct Slab {
  SceneModel model;
  VectorXd native;
  State rest;
  StepProblem step;
  Slab()
      : model(slab_scene(2, 2, 0.7, 2, 2, 2)),
        native(model.native()),
        rest(model.model().rest_state()),
        step(model.model(), native, {0, 0, 1. / 24}, rest) {}
  VectorXd affine(const Mat3& f) const {
    VectorXd q(3 * model.model().num_nodes());
    for (int i = 0; i < model.model().num_nodes(); ++i)
      q.segment<3>(3 * i) = (f - Mat3::Identity()) * model.model().mesh.rest.row(i).transpose();
    return q;
  }
};

TEST(Domain, InvertedStatesAreInfiniteWhateverTheirStretches) {
  Slab s;
  const double infinite = std::numeric_limits<double>::infinity();
  VectorXd gradient(3 * s.model.model().num_nodes());
  for (const Vec3& stretch :
       {Vec3(1, 1, -0.2), Vec3(-1, 1, 1), Vec3(1, 1, 0), Vec3(-1, -1, -1), Vec3(2, 0.5, -1)})
    EXPECT_EQ(s.step.energy(s.affine(Mat3(stretch.asDiagonal())), &gradient), infinite)
        << stretch.transpose();
  // Two reflections are a turn, and allowed.
  EXPECT_LT(s.step.energy(s.affine(Mat3(Vec3(-1, -1, 1).asDiagonal())), &gradient), 1e-12);
  // Numbers beyond exp and beyond double: infinite or a number, never a NaN.
  for (const double size : {1e3, 1e6, 1e30, 1e100, 1e160, 1e200, 1e308})
    for (const Vec3& stretch : {Vec3(size, 1, 1), Vec3(size, 1 / size, 1), Vec3(size, size, size),
                                Vec3(1 / size, 1 / size, 1 / size)}) {
      const double energy = s.step.energy(s.affine(Mat3(stretch.asDiagonal())), nullptr);
      EXPECT_FALSE(std::isnan(energy)) << stretch.transpose();
      EXPECT_GE(energy, 0);
    }
  VectorXd q = s.affine(Mat3::Identity());
  q[7] = std::nan("");
  EXPECT_FALSE(std::isfinite(s.step.energy(q, nullptr)));
}

TEST(Domain, TheFeasibleStepIsTheFirstRootOfTheDeterminant) {
  Slab s;
  double worst = 0;
  std::mt19937 random(7);
  std::uniform_real_distribution<double> uniform(-1, 1);
  int finite = 0;
  for (int trial = 0; trial < 200; ++trial) {
    const Mat3 f = Mat3::Identity() + 0.2 * Mat3::NullaryExpr([&] { return uniform(random); }),
               d = 3 * Mat3::NullaryExpr([&] { return uniform(random); });
    const double found = s.step.largest_feasible_step(s.affine(f), s.affine(d + Mat3::Identity()));
    // First sign change of det(F + s D) in 0..1, by steps and bisection.
    double root = std::numeric_limits<double>::infinity();
    for (int k = 0; k < 4000 && std::isinf(root); ++k) {
      double low = k / 4000.0, high = (k + 1) / 4000.0;
      if ((f + high * d).determinant() > 0) continue;
      for (int it = 0; it < 60; ++it)
        ((f + 0.5 * (low + high) * d).determinant() > 0 ? low : high) = 0.5 * (low + high);
      root = high;
    }
    if (std::isinf(root)) {
      EXPECT_GE(found, 1) << trial;
      continue;
    }
    ++finite;
    worst = std::max(worst, std::fabs(found / root - 1));
  }
  std::printf("feasible step: %d roots, worst relative error %.1e\n", finite, worst);
  EXPECT_GT(finite, 50);
  EXPECT_LT(worst, 1e-9);
}

/// Random states from tame to absurd: finite exactly where no point is inverted (or the exponential
/// overflows).
TEST(Domain, FiniteExactlyWhereNoPointIsInverted) {
  Slab s;
  std::mt19937 random(8);
  std::uniform_real_distribution<double> uniform(-1, 1);
  int inside = 0, outside = 0;
  VectorXd gradient(3 * s.model.model().num_nodes());
  for (int trial = 0; trial < 600; ++trial) {
    const double size = std::pow(10.0, -3 + 5.0 * (trial % 60) / 60);
    const VectorXd q = VectorXd::NullaryExpr(gradient.size(), [&] { return size * uniform(random); });
    const double energy = s.step.energy(q, &gradient);
    EXPECT_FALSE(std::isnan(energy));
    if (s.model.model().terms[0].smallest_jacobian(q) > 0) {
      ++inside;
      EXPECT_TRUE(std::isfinite(energy)) << size;
      EXPECT_TRUE(gradient.allFinite());
    } else {
      ++outside;
      EXPECT_TRUE(std::isinf(energy)) << size;
    }
  }
  std::printf("random states: %d inside the domain, %d outside\n", inside, outside);
  EXPECT_GT(inside, 100);
  EXPECT_GT(outside, 100);
}

TEST(Domain, NoInvertedStateIsEverAccepted) {
  // 0.9 mm into 1.65 mm of skin in one step, without halving; every minimiser.
  for (const char* minimiser : {"newton", "newton_projected", "lbfgs", "lbfgs_literal"}) {
    const SceneModel m(parse_scene_text(
        drag_scene(2, 1), "press.json",
        {"/skin/surface/grid/cells=[4,3]", "/skin/layers/soft/order=1", "/time/max_bisections=0",
         R"(/colliders/finger/path=[{"time": 0, "position": [-2, 0, 5.02]}, {"time": 0.0416, "position": [-2, 0, 4.1]}])",
         std::string("/solver/minimiser=") + minimiser}));
    RunObserver observer;
    int iterations = 0;
    double smallest = 1e300;
    observer.iteration = [&](int, double, int, double energy, double residual) {
      ++iterations;
      EXPECT_TRUE(std::isfinite(energy) && std::isfinite(residual));
      return true;
    };
    observer.step = [&](const StepEvent& event) {
      for (const Term& term : event.problem.model().terms)
        smallest = std::min(smallest, term.smallest_jacobian(event.state.u));
    };
    const Trajectory run = simulate(m.model(), m.native(), m.run_options(), observer);
    std::printf("press in one step, %-16s: %s, %d iterations, min J %.3f\n", minimiser,
                run.complete ? "converged" : run.failure.c_str(), iterations, smallest);
    EXPECT_TRUE(run.complete) << run.failure;
    EXPECT_GT(smallest, 0);
  }
  // A start outside the domain is refused, not repaired.
  Slab s;
  VectorXd q = s.affine(Mat3(Vec3(1, 1, -0.2).asDiagonal()));
  const VectorXd start = q;
  LoadedProblem problem(s.step, {}, VectorXd::Zero(q.size()));
  EXPECT_EQ(problem.solve(q).status, MinimiserStatus::not_finite);
  EXPECT_EQ(q, start);
  EXPECT_THROW((void)s.step.residual(q), ContractError);
}

}  // namespace
}  // namespace rhytid::test
