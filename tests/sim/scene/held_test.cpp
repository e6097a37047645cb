// Held parts: moved exactly along their path, at the price of the work their rim does; imperfection of the
// rest shape.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>

#include "sim/core/error.h"
#include "sim/scene/load.h"
#include "sim/scene/scene_model.h"
#include "sim/time/energy_account.h"

namespace rhytid {
namespace {

using testing::HasSubstr;

/// A bar 20 × 4 × 1 mm along x, held at its left end and moved at its right one.
std::string bar(const std::string& left_path, const std::string& right_path) {
  return R"({
    "name": "bar",
    "skin": {"surface": {"grid": {"size": [20, 4], "cells": [6, 2]}}, "order": 2, "rim": "free",
      "layers": [{"name": "rubber", "thickness": 1, "order": 2, "youngs_modulus": "1 MPa", "poissons_ratio": 0.3,
                  "relaxing_fraction": 0}],
      "held": [{"name": "left", "box": {"low": [-10, -2, 0], "high": [-10, 2, 0]})" +
         left_path + R"(},
               {"name": "right", "box": {"low": [10, -2, 0], "high": [10, 2, 0]})" +
         right_path + R"(}]},
    "time": {"frame_rate": 10, "frames": 4}
  })";
}

Scene scene(const std::string& text, const std::vector<std::string>& changes = {}) {
  return parse_scene_text(text, "bar.json", changes);
}

std::string error_of(const std::string& text, const std::vector<std::string>& changes) {
  try {
    SceneModel built(scene(text, changes));
  } catch (const InputError& error) {
    return error.what();
  }
  return "";
}

const std::string kShift = R"(, "path": [{"time": 0, "displacement": [0, 0, 0]},
                                        {"time": 0.4, "displacement": [1, -2, 0.5]}])";

TEST(Held, AShiftOfBothEndsMovesTheWholeBarWithoutAnIteration) {
  const SceneModel built(scene(bar(kShift, kShift)));
  const Trajectory run = simulate(built.model(), built.model().native, built.run_options());
  ASSERT_TRUE(run.complete) << run.failure;
  for (int frame = 1; frame <= 4; ++frame) {
    const VectorXd& u = run.at_frame(frame).u;
    for (int node = 0; node < built.model().num_nodes(); ++node)
      EXPECT_LT((u.segment<3>(3 * node) - 0.25 * frame * Vec3(1, -2, 0.5)).norm(), 1e-9);
  }
  // The linear response is the answer already.
  for (const StepRecord& step : run.steps) EXPECT_LE(step.report.iterations, 1);
}

TEST(Held, APulledBarStoresTheWorkOfItsRim) {
  const std::string pull = R"(, "path": [{"time": 0, "displacement": [0, 0, 0]},
                                         {"time": 0.4, "displacement": [0.2, 0, 0]}])";
  const SceneModel built(scene(bar("", pull)));
  RunOptions options = built.run_options();
  options.account_energies = true;
  // What is left of the forces is imbalance.
  options.minimiser.absolute_tolerance = options.minimiser.relative_tolerance = 1e-13;
  const Trajectory run = simulate(built.model(), built.model().native, options);
  ASSERT_TRUE(run.complete) << run.failure;
  // 1 % of stretch: ½ E ε² V, a little more since the ends cannot narrow.
  const double small_strain = 0.5 * 1 * 1e-4 * 80, stored = run.steps.back().energies.stored;
  EXPECT_GT(stored, 0.99 * small_strain);
  EXPECT_LT(stored, 1.06 * small_strain);
  // The force grows in proportion and R · Δu takes its end value: the rim's work less its numerical part is
  // stored.
  double balance = 0;
  for (const StepRecord& step : run.steps) {
    EXPECT_NEAR(step.energies.imbalance, 0, 1e-12);
    balance += step.energies.rim_work - step.energies.numerical;
  }
  EXPECT_NEAR(balance, stored, 1e-9);
  const VectorXd& u = run.at_frame(4).u;
  for (const MovedNodes& part : built.model().constraints.moved)
    for (const int node : part.nodes) EXPECT_EQ((u.segment<3>(3 * node) - Vec3(0.2, 0, 0)).norm(), 0);
}

TEST(Held, AViscousRunContinuedFromAFrameHasTheSameBits) {
  const Scene relaxing = scene(bar("", kShift), {"/skin/layers/rubber/relaxing_fraction=0.5"});
  const SceneModel built(relaxing);
  RunOptions options = built.run_options();
  const Trajectory whole = simulate(built.model(), built.model().native, options);
  ASSERT_TRUE(whole.complete) << whole.failure;
  options.frames_done = 2;
  const State middle = whole.at_frame(2);
  const Trajectory rest = simulate(built.model(), built.model().native, options, {}, &middle);
  EXPECT_EQ(rest.steps.back().state.u, whole.steps.back().state.u);
}

// A part that is away from its rest position at time 0 is there in frame 0, and the skin at rest with it: the
// steps after it find nothing to do and nothing to dissipate.
TEST(Held, DisplacedFromTheStartTheSkinSettlesFirst) {
  const std::string stretched = R"(, "path": [{"time": 0, "displacement": [2, 0, 0.5]}])";
  const SceneModel built(
      scene(bar("", stretched), {"/skin/layers/rubber/relaxing_fraction=0.8", "/time/frames=3"}));
  RunOptions options = built.run_options();
  EXPECT_TRUE(options.settle);
  options.account_energies = true;
  const Trajectory run = simulate(built.model(), built.model().native, options);
  ASSERT_TRUE(run.complete) << run.failure;
  ASSERT_EQ(run.steps.front().frame, 0);
  const VectorXd& u = run.at_frame(0).u;
  for (const MovedNodes& part : built.model().constraints.moved)
    for (const int node : part.nodes) EXPECT_EQ(u.segment<3>(3 * node), Vec3(2, 0, 0.5));
  const double stored = run.steps.front().energies.stored;
  // The relaxed bar: a fifth of ½ E ε² V in shear, all of it in volume.
  EXPECT_GT(stored, 0.1 * 0.5 * 1 * 1e-2 * 80);
  for (std::size_t i = 1; i < run.steps.size(); ++i) {
    EXPECT_LT((run.steps[i].state.u - u).cwiseAbs().maxCoeff(), 1e-9);
    EXPECT_NEAR(run.steps[i].energies.stored, stored, 1e-9 * stored);
    EXPECT_NEAR(run.steps[i].energies.numerical, 0, 1e-9 * stored);
    EXPECT_NEAR(run.steps[i].energies.dissipated, 0, 1e-9 * stored);
  }
  EXPECT_FALSE(SceneModel(scene(bar("", kShift))).run_options().settle);
}

TEST(Held, ErrorsNameThePart) {
  EXPECT_THAT(
      error_of(bar("", kShift), {"/skin/held/right/box/low=[10,-2,5]", "/skin/held/right/box/high=[10,2,6]"}),
      HasSubstr("/skin/held/right/box: got a box without nodes"));
  EXPECT_THAT(error_of(bar("", kShift), {"/skin/held/right/box/low=[-20,-2,0]"}),
              HasSubstr("got nodes that another held part has"));
  EXPECT_THAT(error_of(bar("", kShift), {"/skin/held/right/box/low=[11,-2,0]"}),
              HasSubstr("expected low below high in every coordinate"));
  EXPECT_THAT(error_of(bar("", kShift), {"/skin/held/right/path/1/time=0"}),
              HasSubstr("/skin/held/right/path/1/time: got 0"));
}

// An imperfection moves nodes off the plane of a flat box by up to twice the distance to the next column: the
// same columns are held as without it.
TEST(Held, AnImperfectionNeitherAddsNorLosesColumns) {
  const auto blocks = [](const std::string& imperfection) {
    const SceneModel built(scene(
        bar("", ""), {"/skin/surface/grid/cells=[40,8]", "/skin/surface/imperfection=" + imperfection}));
    return built.model().constraints.block;
  };
  EXPECT_EQ(blocks(R"({"amplitude": 0.1})"), blocks("null"));
  EXPECT_EQ(blocks(R"({"amplitude": 0.5})"), blocks("null"));
}

TEST(Held, WithNothingFreeThereIsNoSkinToSolveFor) {
  const std::string expected = "got no node that is free to move";
  EXPECT_THAT(error_of(bar("", ""), {"/skin/held/right/box/low=[-9,-2,0]", "/skin/surface/grid/cells=[1,1]",
                                     "/skin/order=1"}),
              HasSubstr("bar.json: /skin/held: " + expected));
  EXPECT_THAT(error_of(bar("", ""), {"/skin/held=null", "/skin/rim=clamped", "/skin/surface/grid/cells=[1,1]",
                                     "/skin/order=1"}),
              HasSubstr("bar.json: /skin/rim: " + expected));
}

TEST(Held, IsWrittenAndReadBack) {
  const Scene once =
      scene(bar("", kShift), {R"(/skin/surface/imperfection={"amplitude": "1 um", "seed": 3})"});
  const Scene twice = parse_scene(scene_to_json(once), "again.json");
  ASSERT_EQ(twice.skin.held.size(), 2u);
  EXPECT_EQ(twice.skin.held[1].path[1].displacement, Vec3(1, -2, 0.5));
  EXPECT_EQ(twice.skin.surface.imperfection_amplitude, 1e-3);
  EXPECT_EQ(scene_to_json(twice), scene_to_json(once));
}

TEST(Imperfection, MovesColumnsAlongTheirNormalsAndLeavesTheRestStateFreeOfForces) {
  const Scene smooth = scene(bar("", ""));
  const auto rough = [](int seed) {
    return SceneModel(scene(bar("", ""), {R"(/skin/surface/imperfection={"amplitude": "0.05 mm", "seed": )" +
                                          std::to_string(seed) + "}"}));
  };
  const SceneModel flat(smooth), first(rough(1)), again(rough(1)), other(rough(2));
  const MatrixX3 moved = first.model().mesh.rest - flat.model().mesh.rest;
  EXPECT_EQ(moved.leftCols(2).cwiseAbs().maxCoeff(), 0);
  EXPECT_LE(moved.col(2).cwiseAbs().maxCoeff(), 0.05 + 1e-12);
  EXPECT_GT(moved.col(2).cwiseAbs().maxCoeff(), 0.04);
  EXPECT_EQ(first.model().mesh.rest, again.model().mesh.rest);
  EXPECT_NE(first.model().mesh.rest, other.model().mesh.rest);
  const State rest = first.model().rest_state();
  StepProblem problem(first.model(), first.model().native, {0, 0, 0.1}, rest);
  EXPECT_EQ(problem.residual(rest.u).norm(), 0);
}

}  // namespace
}  // namespace rhytid
