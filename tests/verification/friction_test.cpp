// Friction of whole bodies: creep and sliding threshold on an incline, the plateau of a block dragged through
// a spring, and how far the lag of the normal force is off.
#include <gtest/gtest.h>

#include <cmath>
#include <cstdio>

#include "loaded_problem.h"
#include "sim/element/quadrature.h"
#include "sim/scene/load.h"
#include "sim/terms/geometry.h"
#include "tests/support/small_scenes.h"

namespace rhytid::test {
namespace {

constexpr double kFriction = 0.4, kPressure = 0.02, kSlipSpeed = 2;  // MPa, mm/s

/// A slab under a rigid plane (its outer face touches the plane).
Scene slab_under_plane(const std::string& mollifier, std::vector<PathKnot> path) {
  Scene scene = slab_scene(4, 2, 1, 1, 2, 2);
  ColliderScene plane;
  plane.name = "plane";
  plane.shape = ShapeKind::plane;
  plane.normal = -Vec3::UnitZ();
  plane.stiffness = 1;
  plane.onset = 1e-3;
  plane.friction = FrictionScene{kFriction, kSlipSpeed, mollifier};
  plane.path = std::move(path);
  scene.colliders = {plane};
  return scene;
}

/// Load of a uniform traction on the outer face.
VectorXd face_load(const SkinMesh& mesh, const Vec3& traction) {
  const TermGroup g = surface_group(mesh, SkinSide::outer, triangle_rule(10));
  VectorXd load = VectorXd::Zero(3 * mesh.num_nodes());
  for (int e = 0; e < g.num_elements; ++e)
    for (int q = 0; q < g.num_points; ++q)
      for (int i = 0; i < g.num_nodes; ++i)
        load.segment<3>(3 * g.nodes[static_cast<std::size_t>(e * g.num_nodes + i)]) +=
            traction * g.weight[static_cast<std::size_t>(e * g.num_points + q)] *
            g.node_by_row[static_cast<std::size_t>(q * g.num_nodes + i)];
  return load;
}

/// Mean speed over ε_v of a slab that presses with kPressure and is pulled along by ratio μ kPressure; a
/// negative value when no equilibrium is found.
double creep(const std::string& mollifier, double ratio) {
  const SceneModel m(slab_under_plane(mollifier, {{0, Vec3(0, 0, -1e-3)}}));
  const Model& model = m.model();
  const VectorXd native = m.native();
  State state = model.rest_state();
  const double dt = 1. / 24;
  double moved = 0;
  VectorXd last = VectorXd::Zero(state.u.size());
  for (int i = 0; i < 4; ++i) {
    const StepInfo info{i, i * dt, (i + 1) * dt};
    StepProblem step(model, native, info, state);
    // The first step only presses: there is no friction yet to hold against a pull.
    const double pull = i == 0 ? 0 : ratio * kFriction * kPressure;
    // A slab without friction is free to slide: its mean is held until there is.
    std::vector<int> held;
    if (i == 0)
      for (int n = 0; n < model.num_nodes(); ++n) held.insert(held.end(), {3 * n, 3 * n + 1});
    LoadedProblem problem(step, held, face_load(model.mesh, Vec3(pull, 0, kPressure)));
    // Moved on, as steps start: without slip the quintic mollifier has no stiffness, and a first step from there is as
    // long as rounding makes it.
    VectorXd q = i > 1 ? VectorXd(state.u + last) : state.u;
    if (!problem.solve(q, 1e-11).converged()) return -1;
    last = q - state.u;
    double mean = 0;
    for (int n = 0; n < model.num_nodes(); ++n) mean += (q[3 * n] - state.u[3 * n]) / model.num_nodes();
    moved = mean;
    state = step.advance(q);
  }
  return moved / (kSlipSpeed * dt);
}

// Quintic: 6t⁵ − 15t⁴ + 10t³ = ratio (B14 gives 0.1, 0.5, 0.9); quadratic: t (2 − t) = ratio.
TEST(Friction, BlockOnAnInclineCreepsBelowTheThresholdAndSlidesBeyond) {
  for (const double ratio : {0.1, 0.5, 0.9, 0.99}) {
    const double quadratic = 1 - std::sqrt(1 - ratio);
    double lo = 0, hi = 1;
    for (int i = 0; i < 60; ++i) {
      const double t = 0.5 * (lo + hi);
      (t * t * t * (10 - 15 * t + 6 * t * t) < ratio ? lo : hi) = t;
    }
    EXPECT_NEAR(creep("quintic", ratio), lo, 1e-6) << ratio;
    EXPECT_NEAR(creep("quadratic", ratio), quadratic, 1e-6) << ratio;
  }
  for (const char* mollifier : {"quintic", "quadratic"}) EXPECT_LT(creep(mollifier, 1.01), 0) << mollifier;
}

// The slab is the spring: its inner face is held, the plane presses the outer one and moves along x. The
// force rises with the shear until it is μ N, and stays.
TEST(Friction, SpringBlockSticksThenSlidesAtMuN) {
  Scene scene =
      slab_under_plane("quintic", {{0, Vec3(0, 0, 0)}, {0.25, Vec3(0, 0, -0.1)}, {2.25, Vec3(1.2, 0, -0.1)}});
  scene.colliders[0].friction->slip_speed = 0.02;  // against 0.6 mm/s of the plane
  scene.skin.layers[0].relaxing_fraction = 0;      // N stays what the press made it
  scene.skin.rule = RuleKind::full;                // with the default rule N lags by 5.5e-3
  const SceneModel m(scene);
  const Model& model = m.model();
  const VectorXd native = m.native();
  State state = model.rest_state();
  const SkinMesh& mesh = model.mesh;
  std::vector<int> held;
  for (int c = 0; c < mesh.num_columns; ++c)
    for (int a = 0; a < 3; ++a) held.push_back(3 * mesh.node(c, 0) + a);
  const double dt = 1. / 24;
  std::vector<double> ratio, slip;
  for (int i = 0; i < 54; ++i) {
    const StepInfo info{i, i * dt, (i + 1) * dt};
    StepProblem step(model, native, info, state);
    LoadedProblem problem(step, held, VectorXd::Zero(3 * model.num_nodes()));
    VectorXd q = state.u;
    ASSERT_TRUE(problem.solve(q, 1e-11).converged()) << i;
    Vec3 friction = Vec3::Zero(), contact = Vec3::Zero();
    int sliding = 0, pressed = 0;
    for (std::size_t k = 0; k < model.terms.size(); ++k) {
      const Term& term = model.terms[k];
      if (term.groups().front().material >= 0) continue;
      VectorXd g = VectorXd::Zero(q.size());
      (void)term.energy(info, step.data(k), q, &g, nullptr);
      Vec3& sum = term.name() == "contact plane" ? contact : friction;
      sum = Eigen::Map<const MatrixX3>(g.data(), model.num_nodes(), 3).colwise().sum().transpose();
      if (term.name() != "friction plane") continue;
      for (const signed char r : term.regimes(info, step.data(k), q)) sliding += r == 2, pressed += r > 0;
    }
    ratio.push_back(-friction[0] / contact[2]);
    slip.push_back(pressed > 0 ? static_cast<double>(sliding) / pressed : 0);
    state = step.advance(q);
  }
  std::printf("spring block: T/(μN) at steps 8, 10, 14, 53: %.4f %.4f %.4f %.8f\n", ratio[8] / kFriction,
              ratio[10] / kFriction, ratio[14] / kFriction, ratio[53] / kFriction);
  EXPECT_NEAR(ratio[53], kFriction, 1e-4 * kFriction);
  EXPECT_EQ(slip[53], 1);
  EXPECT_LT(slip[7], 0.5);
  EXPECT_LT(ratio[8], 0.9 * kFriction);
  for (int i = 7; i < 53; ++i) {
    EXPECT_LE(ratio[i], kFriction * (1 + 5e-3)) << i;  // the lag of N
    EXPECT_GE(ratio[i + 1], ratio[i] - 5e-3 * kFriction) << i;
  }
}

/// Displacement at the end of the drag scene; largest change of a last pass, mm.
struct DragEnd {
  VectorXd u;
  double pass_change = 0;
};

DragEnd drag_end(int substeps, int passes, const std::vector<std::string>& more = {}) {
  std::vector<std::string> settings = {
      "/skin/surface/grid/cells=[4,3]", "/skin/layers/soft/order=1", "/colliders/finger/path/1/time=0.0625",
      "/time/substeps=" + std::to_string(substeps), "/time/lag_passes=" + std::to_string(passes)};
  settings.insert(settings.end(), more.begin(), more.end());
  const SceneModel m(parse_scene_text(drag_scene(2, 8), "drag.json", settings));
  const Trajectory run = simulate(m.model(), m.native(), m.run_options());
  EXPECT_TRUE(run.complete) << run.failure;
  DragEnd end{run.at_frame(8).u};
  for (const StepRecord& step : run.steps) end.pass_change = std::max(end.pass_change, step.pass_change);
  return end;
}

TEST(Friction, PassesConvergeToTheImplicitLaw) {
  double to_implicit[2][3];
  std::printf("lag: largest displacement error against converged passes, mm\n");
  for (int level = 0; level < 2; ++level) {
    const DragEnd converged = drag_end(1 << level, 12);
    const VectorXd& implicit = converged.u;
    const double size = implicit.lpNorm<Eigen::Infinity>();
    for (int k = 0; k < 3; ++k) {
      const int passes = k == 0 ? 1 : k == 1 ? 2 : 4;
      const DragEnd end = drag_end(1 << level, passes);
      to_implicit[level][k] = (end.u - implicit).lpNorm<Eigen::Infinity>() / size;
      // A run says how far its passes are from their limit.
      if (passes == 1) {
        EXPECT_EQ(end.pass_change, 0);
      } else {
        EXPECT_GT(end.pass_change, 0.3 * to_implicit[level][k] * size);
        EXPECT_GT(end.pass_change, 10 * converged.pass_change);
      }
    }
    std::printf("  %d substeps: %.2e (previous) %.2e (2 passes) %.2e (4 passes) of the largest, %.3f mm\n",
                1 << level, to_implicit[level][0], to_implicit[level][1], to_implicit[level][2], size);
    EXPECT_LT(to_implicit[level][1], 0.5 * to_implicit[level][0]);
    EXPECT_LT(to_implicit[level][2], 0.5 * to_implicit[level][1]);
  }
  EXPECT_LT(to_implicit[1][0], 0.8 * to_implicit[0][0]) << "the lag is of first order in dt";
  EXPECT_LT(to_implicit[1][1], 0.6 * to_implicit[0][1]);
}

/// Errors of the last frame against steps so fine that the lag no longer matters, of the largest displacement: one
/// pass, two, one with an extrapolated lag.
struct LagErrors {
  double previous, two_passes, extrapolated;
};

std::vector<LagErrors> errors_in_time(const std::vector<int>& substeps, std::vector<std::string> settings) {
  const auto end = [&](int steps, int passes, const char* lag) {
    std::vector<std::string> all = settings;
    all.emplace_back(std::string("/time/lag=") + lag);
    return drag_end(steps, passes, all).u;
  };
  const VectorXd fine = end(64, 1, "extrapolated");
  const double size = fine.lpNorm<Eigen::Infinity>();
  const auto error = [&](const VectorXd& u) { return (u - fine).lpNorm<Eigen::Infinity>() / size; };
  EXPECT_LT(error(end(64, 2, "previous")), 3e-4) << "both lags have one limit";
  std::vector<LagErrors> errors;
  for (const int n : substeps) {
    errors.push_back(
        {error(end(n, 1, "previous")), error(end(n, 2, "previous")), error(end(n, 1, "extrapolated"))});
    std::printf("  %d substeps: %.2e (previous) %.2e (2 passes) %.2e (extrapolated) of %.3f mm\n", n,
                errors.back().previous, errors.back().two_passes, errors.back().extrapolated, size);
  }
  return errors;
}

// A free patch that a finger on a smooth path takes along.
TEST(Friction, ExtrapolatedLagBringsSmallerErrorsInTime) {
  const auto errors = errors_in_time({2, 4, 8}, {"/skin/rim=free", "/colliders/finger/interpolation=spline"});
  for (const LagErrors& e : errors) {
    EXPECT_LT(e.extrapolated, 0.4 * e.previous);
    EXPECT_LT(e.extrapolated, e.two_passes) << "at half the solves";
  }
  EXPECT_LT(errors[2].extrapolated, 0.3 * errors[0].extrapolated);
}

// A finger that presses, then slides off at once: the pressure that was about to grow does not. Coarse steps are no
// better then, fine ones are.
TEST(Friction, ExtrapolatedLagOvershootsWhereAPathHasAKink) {
  const auto errors = errors_in_time({2, 16}, {});
  EXPECT_GT(errors[0].extrapolated, 0.8 * errors[0].previous);
  EXPECT_LT(errors[1].extrapolated, 0.5 * errors[1].previous);
}

}  // namespace
}  // namespace rhytid::test
