// Coarse to fine: stages hand on their answer, the fit ends where it ends without them, for fewer runs of its own.
#include "fitting/stages.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <unistd.h>

#include <cmath>
#include <cstdio>
#include <filesystem>

#include "sim/core/error.h"
#include "tests/fitting/synthetic_tracks.h"

namespace rhytid::fitting {
namespace {

namespace fs = std::filesystem;
using testing::HasSubstr;

constexpr int kFrames = 4;

JointFitInput make_input() {
  const Camera camera = test::make_camera();
  const Scene scene = test::drag_scene(kFrames, {"/skin/order=3"});
  FitCase fit = test::three_parameters();
  return {.clips = {{"", "", scene, {camera}, test::make_tracks(scene, camera, 4, 0.02, 5)}}, .options = fit};
}

/// A stage with coarser elements on all frames.
void add_stage(JointFitInput& input, int last_frame = 0) {
  StageCase coarse;
  coarse.settings = {{"/skin/order=2"}};
  coarse.last_frame = last_frame;
  input.options.stages.push_back(coarse);
  input.stages.push_back({test::drag_scene(kFrames, {"/skin/order=2"})});
}

TEST(Stages, TheFitEndsWhereItEndsWithoutThem) {
  JointFitInput input = make_input();
  const FitResult plain = run_fit(input);
  add_stage(input);
  const FitResult staged = run_fit(input);
  std::printf("%s%d runs without stages\n", answer_text(staged).c_str(), plain.forward_runs);
  ASSERT_TRUE(plain.converged && staged.converged);
  ASSERT_EQ(staged.stages.size(), 1u);
  EXPECT_EQ(staged.stages[0].change, "/skin/order=2");
  ASSERT_EQ(staged.stages[0].values.size(), 3u);
  EXPECT_LE(staged.forward_runs, plain.forward_runs + 1) << "the stages' own are counted apart";
  for (std::size_t k = 0; k < 3; ++k) {
    const FittedParameter &a = staged.parameters[k], &b = plain.parameters[k];
    EXPECT_LT(std::fabs(std::log(a.value / b.value)), 0.05 * b.sigma) << a.name;
    EXPECT_EQ(a.initial, b.initial) << "that of the case";
    EXPECT_DOUBLE_EQ(staged.history[0].values[k], staged.stages[0].values[k])
        << "it began where the stage ended";
  }
}

// The first two frames do not determine friction and strength: a stage of them ends at the bounds.
TEST(Stages, OneThatLeadsAstrayIsNotFollowed) {
  JointFitInput input = make_input();
  const FitResult plain = run_fit(input);
  add_stage(input, 2);
  const FitResult staged = run_fit(input);
  ASSERT_TRUE(staged.converged);
  EXPECT_THAT(staged.stages[0].change, HasSubstr("/skin/order=2, frames to 2"));
  EXPECT_THAT(staged.stages[0].status, HasSubstr("not followed, since"));
  EXPECT_LE(staged.forward_runs, plain.forward_runs + 1);
  for (std::size_t k = 0; k < 3; ++k)
    EXPECT_NEAR(std::log(staged.parameters[k].value / plain.parameters[k].value), 0,
                0.05 * plain.parameters[k].sigma);
}

// A coarse scene that tells another story: with a film ten times as thick the stage's answer costs more in the fit.
TEST(Stages, OneThatMakesTheStartWorseIsNotFollowed) {
  JointFitInput input = make_input();
  for (FitParameter& p : input.options.parameters) p.initial.reset();  // near the truth
  add_stage(input);
  input.stages[0] = {test::drag_scene(kFrames, {R"(/skin/layers/film/thickness="0.4 mm")"})};
  const FitResult staged = run_fit(input);
  EXPECT_THAT(staged.stages[0].status,
              testing::AnyOf(HasSubstr("begins at the initial values"), HasSubstr("not followed")));
  for (std::size_t k = 0; k < 3; ++k)
    EXPECT_NEAR(staged.history[0].values[k], staged.parameters[k].initial,
                1e-12 * staged.parameters[k].initial);
}

TEST(Stages, PriorsStayWhereTheCaseHasThem) {
  JointFitInput input = make_input();
  input.options.parameters[2].prior_sigma = 0.01;  // about 0.6, where the tracks have 0.4
  const FitResult plain = run_fit(input);
  add_stage(input);
  add_stage(input);
  const FitResult staged = run_fit(input);
  EXPECT_NEAR(std::log(staged.parameters[2].value / plain.parameters[2].value), 0, 1e-3);
  EXPECT_GT(plain.parameters[2].value, 0.41) << "the prior pulls";
}

TEST(Stages, AreResumedToTheSameBits) {
  JointFitInput input = make_input();
  add_stage(input);
  add_stage(input);
  input.evaluations = (fs::temp_directory_path() / ("rhytid_stages_" + std::to_string(getpid()))).string();
  fs::remove_all(input.evaluations);
  FitObserver observer;
  int runs = 0;
  observer.run = [&](const FitProgress&) { ++runs; };
  observer.should_stop = [&] { return runs >= 3; };
  EXPECT_TRUE(run_fit(input, observer).stopped);
  FitObserver counting;
  int replayed = 0;
  counting.run = [&](const FitProgress& run) { replayed += run.replayed ? 1 : 0; };
  const FitResult resumed = run_fit(input, counting);
  EXPECT_GE(replayed, 3) << "what was there was not run again";
  fs::remove_all(input.evaluations);
  const FitResult whole = run_fit(input);
  ASSERT_TRUE(resumed.converged && whole.converged);
  for (std::size_t k = 0; k < 3; ++k) EXPECT_EQ(resumed.parameters[k].value, whole.parameters[k].value);
  EXPECT_EQ(resumed.final_cost, whole.final_cost);
  fs::remove_all(input.evaluations);
}

TEST(Stages, AStageThatDoesNotGoWithTheTracksIsNamed) {
  JointFitInput input = make_input();
  add_stage(input);
  add_stage(input);
  input.stages[1] = {test::drag_scene(kFrames, {"/time/frame_rate=\"30 Hz\""})};
  try {
    run_fit(input);
    FAIL();
  } catch (const InputError& error) {
    EXPECT_THAT(error.what(), testing::AllOf(HasSubstr("stage 2"), HasSubstr("frame_rate")));
  }
}

}  // namespace
}  // namespace rhytid::fitting
