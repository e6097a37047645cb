// Whole runs: the same bits with any number of threads, bisection in a hard step, one answer from three
// minimisers, and features that are not in the scene do no work.
#include "sim/time/simulate.h"

#include <gtest/gtest.h>

#include <cstring>

#include "sim/core/error.h"
#include "sim/core/parallel.h"
#include "sim/scene/load.h"
#include "sim/scene/scene_model.h"
#include "sim/terms/kernel_table.h"
#include "tests/support/small_scenes.h"

namespace rhytid {
namespace {

Trajectory run_scene(const SceneModel& m, const RunOptions& options) {
  return simulate(m.model(), m.native(), options);
}

Scene small_drag(int order, int frames) {
  Scene s = parse_scene_text(test::drag_scene(order, frames), "drag.json");
  s.skin.surface.grid_cells = {4, 3};
  return s;
}

bool same_bits(const VectorXd& a, const VectorXd& b) {
  return a.size() == b.size() &&
         std::memcmp(a.data(), b.data(), sizeof(double) * static_cast<std::size_t>(a.size())) == 0;
}

TEST(Simulate, SameBitsWithOneAndTwoThreads) {
  const SceneModel m(small_drag(2, 5));
  const int before = num_threads();
  set_num_threads(1);
  const Trajectory one = run_scene(m, m.run_options());
  set_num_threads(2);
  const Trajectory two = run_scene(m, m.run_options());
  set_num_threads(5);
  const Trajectory five = run_scene(m, m.run_options());
  set_num_threads(before);
  ASSERT_TRUE(one.complete) << one.failure;
  for (const Trajectory* other : {&two, &five}) {
    ASSERT_EQ(one.steps.size(), other->steps.size());
    for (std::size_t i = 0; i < one.steps.size(); ++i) {
      EXPECT_TRUE(same_bits(one.steps[i].state.u, other->steps[i].state.u)) << "step " << i;
      EXPECT_TRUE(same_bits(one.steps[i].state.history, other->steps[i].state.history)) << "step " << i;
    }
  }
  EXPECT_GT(one.at_frame(5).u.lpNorm<Eigen::Infinity>(), 0.1) << "nothing moved";
}

TEST(Simulate, HardStepIsBisectedAndEndsInTheSameFrames) {
  Scene s = small_drag(2, 2);
  s.colliders[0].path[1].time = 1. / 24;  // the whole press in one frame
  s.colliders[0].path[1].position[2] = 4.2;
  const SceneModel m(s);
  RunOptions options = m.run_options();
  const Trajectory easy = run_scene(m, options);
  ASSERT_TRUE(easy.complete) << easy.failure;
  int most = 0;
  for (const StepRecord& r : easy.steps) most = std::max(most, r.report.iterations);
  options.minimiser.max_iterations = most - 1;  // the hardest step now fails at its full length
  options.max_bisections = 6;
  const Trajectory hard = run_scene(m, options);
  ASSERT_TRUE(hard.complete) << hard.failure;
  EXPECT_GT(hard.steps.size(), easy.steps.size());
  ASSERT_EQ(hard.frames(), 2);
  bool bisected = false;
  double t = 0;
  for (std::size_t i = 0; i < hard.steps.size(); ++i) {
    const StepRecord& r = hard.steps[i];
    bisected = bisected || r.bisections > 0;
    EXPECT_EQ(r.step.index, static_cast<int>(i));
    EXPECT_EQ(r.step.t_old, t) << "steps must join";
    EXPECT_GT(r.step.t, t);
    EXPECT_NEAR(r.step.dt() * 24, std::ldexp(1.0, -r.bisections), 1e-12);
    t = r.step.t;
  }
  EXPECT_TRUE(bisected);
  for (int frame = 0; frame <= 2; ++frame) EXPECT_EQ(hard.at_frame(frame).time, easy.at_frame(frame).time);
  // Not allowed to bisect, and too few iterations for softened contacts to help: a clear failure that keeps
  // what was reached.
  options.max_bisections = 0;
  options.minimiser.max_iterations = 1;
  const Trajectory failed = run_scene(m, options);
  EXPECT_FALSE(failed.complete);
  EXPECT_NE(failed.failure.find("frame"), std::string::npos) << failed.failure;
  EXPECT_LT(failed.frames(), 2);
  EXPECT_EQ(static_cast<int>(failed.frame_end.back()), static_cast<int>(failed.steps.size()));
}

/// Pressure and normal of friction, and their rates, of a state: [points][8].
Eigen::Map<const Eigen::Matrix<double, Eigen::Dynamic, 8, Eigen::RowMajor>> extrapolated_lag(
    const Model& model, const State& state) {
  std::size_t k = 0;
  while (model.terms[k].name() != "friction finger") ++k;
  EXPECT_EQ(&model.terms[k].kernels(), &extrapolated_friction_kernels());
  return {state.history.data() + model.history_offset(k), model.terms[k].num_points(), 8};
}

// The rates that a step leaves are those over its own length, halved or not, so that the next one needs no ratio.
TEST(Simulate, ExtrapolatedLagKnowsTheLengthsOfHalvedSteps) {
  Scene s = small_drag(2, 4);
  s.time.lag = FrictionLag::extrapolated;
  s.colliders[0].path = {{0, Vec3(-2, 0, 5.02)},
                         {2. / 24, Vec3(-2, 0, 4.9)},
                         {3. / 24, Vec3(-2, 0, 4.2)},
                         {4. / 24, Vec3(-1.6, 0, 4.2)}};
  const SceneModel m(s);
  RunOptions options = m.run_options();
  const Trajectory easy = run_scene(m, options);
  ASSERT_TRUE(easy.complete) << easy.failure;
  int most = 0;
  for (const StepRecord& r : easy.steps) most = std::max(most, r.report.iterations);
  options.minimiser.max_iterations = most - 1;  // the press of frame 3 now fails at its full length
  options.max_bisections = 6;
  const Trajectory run = run_scene(m, options);
  ASSERT_TRUE(run.complete) << run.failure;
  ASSERT_GT(run.steps.size(), 4u);
  double shortest = 1, longest = 0, largest_rate = 0;
  for (int i = 1; i < static_cast<int>(run.steps.size()); ++i) {
    const auto old = extrapolated_lag(m.model(), run.before(i)),
               now = extrapolated_lag(m.model(), run.before(i + 1));
    const double dt = run.steps[static_cast<std::size_t>(i)].step.dt(),
                 ratio = dt / run.steps[static_cast<std::size_t>(i) - 1].step.dt();
    shortest = std::min(shortest, ratio), longest = std::max(longest, ratio);
    EXPECT_LE((now.leftCols<4>() - old.leftCols<4>() - dt * now.rightCols<4>()).cwiseAbs().maxCoeff(), 1e-14)
        << i;
    largest_rate = std::max(largest_rate, now.rightCols<4>().cwiseAbs().maxCoeff());
  }
  EXPECT_LT(shortest, 0.51);
  EXPECT_NEAR(longest, 2, 1e-12);
  EXPECT_GT(largest_rate, 0.1);
  EXPECT_EQ(extrapolated_lag(m.model(), run.before(1)).rightCols<4>().norm(), 0)
      << "nothing before the first step";
  // The same way in other steps.
  EXPECT_LT((run.at_frame(4).u - easy.at_frame(4).u).lpNorm<Eigen::Infinity>(),
            0.2 * easy.at_frame(4).u.lpNorm<Eigen::Infinity>());
}

TEST(Simulate, ExtrapolatedLagGoesOnFromAKeptStateWithTheSameBits) {
  Scene s = small_drag(2, 6);
  s.time.lag = FrictionLag::extrapolated;
  const SceneModel m(s);
  RunOptions options = m.run_options();
  const Trajectory whole = run_scene(m, options);
  ASSERT_TRUE(whole.complete) << whole.failure;
  for (const int done : {1, 4}) {
    options.frames_done = done;
    const Trajectory rest = simulate(m.model(), m.native(), options, {}, &whole.at_frame(done));
    ASSERT_TRUE(rest.complete) << rest.failure;
    EXPECT_TRUE(same_bits(rest.steps.back().state.u, whole.steps.back().state.u)) << done;
    EXPECT_TRUE(same_bits(rest.steps.back().state.history, whole.steps.back().state.history)) << done;
  }
  // What it extrapolates matters: without the rates it ends elsewhere.
  State without = whole.at_frame(4);
  const auto points = extrapolated_lag(m.model(), without).rows();
  std::size_t k = 0;
  while (m.model().terms[k].name() != "friction finger") ++k;
  for (Eigen::Index q = 0; q < points; ++q)
    without.history.segment<4>(static_cast<Eigen::Index>(m.model().history_offset(k)) + 8 * q + 4).setZero();
  options.frames_done = 4;
  const Trajectory other = simulate(m.model(), m.native(), options, {}, &without);
  EXPECT_GT((other.steps.back().state.u - whole.steps.back().state.u).lpNorm<Eigen::Infinity>(), 1e-4);
}

// The second pass begins with the factor of the first, which is that of its own step also where a run goes on.
TEST(Simulate, TwoPassesGoOnFromAKeptStateWithTheSameBits) {
  Scene s = small_drag(2, 5);
  s.time.lag_passes = 2;
  const SceneModel m(s);
  for (const FactorPrecision precision : {FactorPrecision::full, FactorPrecision::mixed}) {
    SCOPED_TRACE(name(precision));
    RunOptions options = m.run_options();
    options.minimiser.precision = precision;
    const Trajectory whole = run_scene(m, options);
    ASSERT_TRUE(whole.complete) << whole.failure;
    int by_kept_factors = 0;
    for (const StepRecord& r : whole.steps) by_kept_factors += r.report.lbfgs_iterations;
    ASSERT_GT(by_kept_factors, 0);
    for (const int done : {1, 2, 4}) {
      options.frames_done = done;
      const Trajectory rest = simulate(m.model(), m.native(), options, {}, &whole.at_frame(done));
      ASSERT_TRUE(rest.complete) << rest.failure;
      EXPECT_TRUE(same_bits(rest.steps.back().state.u, whole.steps.back().state.u)) << done;
      EXPECT_TRUE(same_bits(rest.steps.back().state.history, whole.steps.back().state.history)) << done;
      EXPECT_EQ(rest.steps.back().report.iterations, whole.steps.back().report.iterations) << done;
    }
  }
}

// A scene that does not ask for it has the history, the kernels and so the bits of one that never heard of it.
TEST(Simulate, ScenesWithoutExtrapolatedLagDoNotPayForIt) {
  const Scene plain = small_drag(2, 4);
  EXPECT_EQ(plain.time.lag, FrictionLag::previous);
  Scene other = plain;
  other.time.lag = FrictionLag::extrapolated;
  const SceneModel m(plain), extrapolated(other);
  std::size_t points = 0;
  for (const Term& term : m.model().terms) {
    if (term.name() != "friction finger") continue;
    EXPECT_EQ(&term.kernels(), &friction_kernels());
    points = static_cast<std::size_t>(term.num_points());
    EXPECT_EQ(term.history_size(), 4 * points);
  }
  ASSERT_GT(points, 0u);
  EXPECT_EQ(extrapolated.model().history_size(), m.model().history_size() + 4 * points);
  // There is nothing to extrapolate in the first two steps: they are the same.
  const Trajectory a = run_scene(m, m.run_options()), b = run_scene(extrapolated, extrapolated.run_options());
  ASSERT_TRUE(a.complete && b.complete);
  for (const int step : {0, 1}) EXPECT_TRUE(same_bits(a.steps[step].state.u, b.steps[step].state.u)) << step;
  EXPECT_FALSE(same_bits(a.steps[2].state.u, b.steps[2].state.u));
  EXPECT_GT((a.at_frame(4).u - b.at_frame(4).u).lpNorm<Eigen::Infinity>(), 1e-4);
}

/// The first half of a frame is accepted, the second fails at full depth: what the run then says.
TEST(Simulate, AFrameThatFailsHalfwayKeepsTheFramesBeforeIt) {
  Scene s = small_drag(1, 3);
  // Pressed in frame 1, held for half of frame 2, then 1.2 mm deeper at once.
  s.colliders[0].path = {{0, Vec3(-2, 0, 5.02)},
                         {1. / 24, Vec3(-2, 0, 4.9)},
                         {1.5 / 24, Vec3(-2, 0, 4.9)},
                         {1.5 / 24 + 1e-6, Vec3(-2, 0, 3.7)}};
  const SceneModel m(s);
  RunOptions options = m.run_options();
  options.frames = 1;
  options.minimiser.keep_factor = false;  // Newton's iterations are few and much alike
  const Trajectory first = run_scene(m, options);
  ASSERT_TRUE(first.complete) << first.failure;
  // As many iterations as the first frame takes: too few for the second half of the next, softened or not.
  options.frames = 3;
  options.minimiser.max_iterations = first.steps[0].report.iterations;
  options.max_bisections = 1;
  std::vector<double> seen;
  int frames_seen = 0;
  RunObserver observer;
  observer.step = [&](const StepEvent& e) {
    seen.push_back(e.state.time);
    frames_seen += e.frame_done;
  };
  const Trajectory run = simulate(m.model(), m.native(), options, observer);
  EXPECT_FALSE(run.complete);
  for (const char* part : {"frame 2", "t = 0.08", "max_iterations", "1 bisections", "residual", "wanted"})
    EXPECT_NE(run.failure.find(part), std::string::npos) << part << " in: " << run.failure;
  EXPECT_EQ(run.frames(), 1);
  ASSERT_EQ(run.frame_end, (std::vector<int>{0, 1}));
  ASSERT_EQ(run.steps.size(), 2u) << "the first half is kept, beyond the last frame";
  // The frames are untouched by what came after them; the half step stands behind them, on the true grid of times.
  EXPECT_TRUE(same_bits(run.at_frame(1).u, first.at_frame(1).u));
  EXPECT_TRUE(same_bits(run.at_frame(1).history, first.at_frame(1).history));
  EXPECT_EQ(run.at_frame(1).time, 1. / 24);
  EXPECT_EQ(run.steps[1].frame, 2);
  EXPECT_EQ(run.steps[1].bisections, 1);
  EXPECT_EQ(run.steps[1].step.t_old, 1. / 24);
  EXPECT_DOUBLE_EQ(run.steps[1].state.time, 1.5 / 24);
  EXPECT_TRUE(run.steps[1].state.u.allFinite());
  // An observer (who writes frames and tables) has seen two steps and one frame.
  EXPECT_EQ(seen, (std::vector<double>{1. / 24, run.steps[1].state.time}));
  EXPECT_EQ(frames_seen, 1);
  // From the last frame it goes on as a whole run would.
  options.minimiser.max_iterations = 200;
  options.max_bisections = 4;
  const Trajectory whole = run_scene(m, options);
  ASSERT_TRUE(whole.complete) << whole.failure;
  options.frames_done = 1;
  const Trajectory rest = simulate(m.model(), m.native(), options, {}, &run.at_frame(1));
  ASSERT_TRUE(rest.complete) << rest.failure;
  EXPECT_TRUE(same_bits(rest.at_frame(2).u, whole.at_frame(3).u));
}

TEST(Simulate, SubstepsEndInTheSameFrameTimesAndConverge) {
  Scene s = small_drag(1, 4);
  s.skin.surface.grid_cells = {3, 2};
  double moved[3];
  for (int k = 0; k < 3; ++k) {
    s.time.substeps = 1 << k;
    const SceneModel m(s);
    const Trajectory run = run_scene(m, m.run_options());
    ASSERT_TRUE(run.complete) << run.failure;
    EXPECT_EQ(run.frames(), 4);
    EXPECT_EQ(static_cast<int>(run.steps.size()), 4 << k);
    EXPECT_EQ(run.at_frame(4).time, 4. / 24);
    moved[k] = run.at_frame(4).u.norm();
  }
  EXPECT_LT(std::fabs(moved[2] - moved[1]), std::fabs(moved[1] - moved[0]));
}

TEST(Simulate, ThreeMinimisersReachTheSameStates) {
  const SceneModel m(small_drag(2, 5));
  RunOptions options = m.run_options();
  options.minimiser.relative_tolerance = 1e-10;
  const Trajectory newton = run_scene(m, options);
  ASSERT_TRUE(newton.complete) << newton.failure;
  for (Minimiser method : {Minimiser::newton_projected, Minimiser::lbfgs}) {
    options.minimiser.method = method;
    options.minimiser.max_iterations = 1000;
    const Trajectory other = run_scene(m, options);
    ASSERT_TRUE(other.complete) << name(method) << ": " << other.failure;
    double worst = 0, energy = 0;
    for (int frame = 1; frame <= newton.frames(); ++frame) {
      worst = std::max(worst, (newton.at_frame(frame).u - other.at_frame(frame).u).lpNorm<Eigen::Infinity>());
      const double a = newton.steps[static_cast<std::size_t>(newton.frame_end[frame] - 1)].report.energy,
                   b = other.steps[static_cast<std::size_t>(other.frame_end[frame] - 1)].report.energy;
      energy = std::max(energy, std::fabs(a - b) / a);
    }
    std::printf("%s against newton: %.1e mm, energy %.1e\n", name(method), worst, energy);
    EXPECT_LE(worst, 1e-6) << name(method);
    EXPECT_LE(energy, 1e-10) << name(method);
  }
}

TEST(Simulate, LiteralLbfgsReachesTheSameStatesToItsOwnTolerance) {
  const SceneModel m(small_drag(2, 3));
  const RunOptions options = m.run_options();
  const Trajectory newton = run_scene(m, options);
  RunOptions published = options;
  published.minimiser = published_minimiser();
  published.minimiser.max_iterations = 1000;
  const Trajectory literal = run_scene(m, published);
  ASSERT_TRUE(newton.complete && literal.complete) << literal.failure;
  double worst = 0;
  for (int frame = 1; frame <= newton.frames(); ++frame)
    worst = std::max(worst, (newton.at_frame(frame).u - literal.at_frame(frame).u).lpNorm<Eigen::Infinity>());
  std::printf("published minimiser against newton: %.1e mm\n", worst);
  EXPECT_LE(worst, 1e-5);
  EXPECT_GT(worst, 1e-9) << "is it Newton after all?";
  for (const StepRecord& step : literal.steps) {
    EXPECT_LE(step.report.residual, 1e-6);
    EXPECT_EQ(step.report.iterations, step.report.lbfgs_iterations);
  }
}

TEST(Simulate, WhatIsNotInTheSceneDoesNoWork) {
  Scene s = small_drag(1, 1);
  s.ligaments.reset();
  s.base.reset();
  s.colliders[0].friction.reset();
  for (LayerScene& l : s.skin.layers) l.relaxing_fraction = 0;
  const SceneModel m(s);
  ASSERT_EQ(m.model().terms.size(), 2u);  // elastic skin and the finger
  EXPECT_EQ(m.model().history_size(), 0u);
  const Trajectory run = run_scene(m, m.run_options());
  ASSERT_TRUE(run.complete) << run.failure;
  for (const Term& t : m.model().terms) {
    EXPECT_EQ(t.counters().update, 0);
    EXPECT_GT(t.counters().gradient, 0);
  }
}

TEST(Simulate, ContinuesFromAStateAsIfItHadNotStopped) {
  const SceneModel m(small_drag(1, 4));
  RunOptions options = m.run_options();
  const Trajectory whole = run_scene(m, options);
  ASSERT_TRUE(whole.complete);
  options.frames = 2;
  const Trajectory first = run_scene(m, options);
  const Trajectory second = simulate(m.model(), m.native(), options, {}, &first.at_frame(2));
  ASSERT_TRUE(second.complete);
  EXPECT_NEAR(second.at_frame(2).time, whole.at_frame(4).time, 1e-15);
  EXPECT_LE((second.at_frame(2).u - whole.at_frame(4).u).lpNorm<Eigen::Infinity>(), 1e-7);
}

/// What the reports of a run say of its work is what its skin was asked for: guesses, halved steps and
/// softened contacts included.
void expect_all_work_counted(const SceneModel& m, const Trajectory& run) {
  const Term& skin = m.model().terms.front();
  ASSERT_EQ(skin.name(), "skin");
  long evaluations = 0, factorisations = 0;
  for (const StepRecord& r : run.steps) {
    evaluations += r.report.evaluations;
    factorisations += r.report.factorisations;
  }
  EXPECT_EQ(evaluations, skin.counters().energy + skin.counters().gradient);
  EXPECT_GE(factorisations, skin.counters().hessian);
}

TEST(Simulate, ReportsCountAllWork) {
  const std::string held = R"(/skin/held=[{"name": "side", "box": {"low": [-8, -6, 0], "high": [-8, 6, 0]},
      "path": [{"time": 0, "displacement": [0, 0, 0]}, {"time": 0.1, "displacement": [0.5, 0.2, 0]}]}])";
  const SceneModel moved(parse_scene_text(test::drag_scene(2, 3), "moved.json", {held}));
  const Trajectory pulled = run_scene(moved, moved.run_options());
  ASSERT_TRUE(pulled.complete) << pulled.failure;
  expect_all_work_counted(moved, pulled);

  Scene s = small_drag(2, 2);
  s.colliders[0].path[1].time = 1. / 24;  // the whole press in one frame
  s.colliders[0].path[1].position[2] = 4.2;
  const SceneModel easy(s), hard(s), soft(s);
  RunOptions options = easy.run_options();
  options.minimiser.keep_factor = false;  // the press takes by far the most iterations of Newton's
  const Trajectory direct = run_scene(easy, options);
  ASSERT_TRUE(direct.complete) << direct.failure;
  expect_all_work_counted(easy, direct);
  int most = 0;
  for (const StepRecord& r : direct.steps) most = std::max(most, r.report.iterations);
  options.minimiser.max_iterations = most - 1;
  options.max_bisections = 6;
  const Trajectory bisected = run_scene(hard, options);
  ASSERT_TRUE(bisected.complete) << bisected.failure;
  EXPECT_GT(bisected.steps.front().bisections, 0);
  expect_all_work_counted(hard, bisected);
  options.max_bisections = 0;
  const Trajectory softened = run_scene(soft, options);
  ASSERT_TRUE(softened.complete) << softened.failure;
  EXPECT_TRUE(softened.steps.front().softened);
  expect_all_work_counted(soft, softened);
}

/// The densest rule that a scene may ask for fits into an element kernel.
TEST(Simulate, DensestQuadratureOfASceneRuns) {
  Scene s = parse_scene_text(test::drag_scene(1, 1), "drag.json",
                             {"/skin/quadrature/triangle_degree=12", "/skin/quadrature/thickness_points=6",
                              "/skin/quadrature/contact_degree=12"});
  s.skin.surface.grid_cells = {2, 2};
  const SceneModel m(s);
  const Trajectory run = run_scene(m, m.run_options());
  EXPECT_TRUE(run.complete) << run.failure;
  EXPECT_THROW(parse_scene_text(test::drag_scene(1, 1), "drag.json", {"/skin/quadrature/thickness_points=7"}),
               InputError);
}

TEST(Simulate, ObserverSeesEveryStepAndCanStop) {
  const SceneModel m(small_drag(1, 3));
  int steps = 0, frames = 0;
  RunObserver observer;
  observer.step = [&](const StepEvent& e) {
    ++steps;
    frames += e.frame_done;
    EXPECT_EQ(e.state.time, e.record.step.t);
    EXPECT_EQ(e.problem.old().time, e.record.step.t_old);
  };
  const Trajectory run = simulate(m.model(), m.native(), m.run_options(), observer);
  EXPECT_EQ(steps, static_cast<int>(run.steps.size()));
  EXPECT_EQ(frames, 3);
  observer.step = nullptr;
  observer.iteration = [](int frame, double, int, double, double) { return frame < 2; };
  const Trajectory stopped = simulate(m.model(), m.native(), m.run_options(), observer);
  EXPECT_FALSE(stopped.complete);
  EXPECT_EQ(stopped.frames(), 1);
  RunOptions bad;
  bad.frame_rate = 0;
  EXPECT_THROW((void)simulate(m.model(), m.native(), bad), ContractError);
}

}  // namespace
}  // namespace rhytid
