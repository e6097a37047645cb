// Weights of frames and clips: what they do to cost, covariance and answer.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>

#include "tests/fitting/synthetic_tracks.h"

namespace rhytid::fitting {
namespace {

using testing::Contains;
using testing::HasSubstr;

constexpr int kFrames = 4;

FitCase film_alone() {
  FitCase fit = test::three_parameters();
  fit.parameters = {test::fitted("/skin/layers/film/youngs_modulus", 0.8)};
  fit.robust_scale = 0;
  return fit;
}

TrackSet tracks_of(int frames) {
  return test::make_tracks(test::drag_scene(frames), test::make_camera(), 2, 0.02, 3);
}

TEST(FrameWeights, TheLastRuleThatHoldsAFrameCounts) {
  const std::vector<FrameWeight> rules = {{1, 0, 0.5, 0}, {3, 4, 0.25, 0}, {6, 0, 1, 2}};
  EXPECT_EQ(frame_weight({}, 7), 1);
  EXPECT_EQ(frame_weight(rules, 2), 0.5);
  EXPECT_EQ(frame_weight(rules, 3), 0.25);
  EXPECT_EQ(frame_weight(rules, 5), 0.5);
  EXPECT_EQ(frame_weight(rules, 6), 1);
  EXPECT_DOUBLE_EQ(frame_weight(rules, 10), 0.25) << "half of it every two frames";
}

TEST(FrameWeights, FramesOfWeightZeroAreNotThere) {
  FitCase weighted = film_alone(), shorter = film_alone();
  weighted.frame_weights = {{3, 0, 0, 0}};
  shorter.last_frame = 2;
  const Camera camera = test::make_camera();
  const TrackSet tracks = tracks_of(kFrames);
  FitProblem with(test::drag_scene(kFrames), weighted, camera, tracks),
      without(test::drag_scene(kFrames), shorter, camera, tracks);
  EXPECT_EQ(with.num_observations(), without.num_observations());
  EXPECT_NEAR(with.evaluate(with.initial()).cost, without.evaluate(without.initial()).cost, 1e-9);
}

// A weight that halves every frame is denormal after a thousand: the covariance it divides would be infinite.
TEST(FrameWeights, WhatWeighsNextToNothingIsNotThere) {
  FitCase fit = film_alone();
  fit.frame_weights = {{2, 0, 1, 0.001}};
  EXPECT_EQ(frame_weight(fit.frame_weights, 3), 0);
  const Camera camera = test::make_camera();
  const TrackSet tracks = tracks_of(kFrames);
  FitProblem problem(test::drag_scene(kFrames), fit, camera, tracks);
  EXPECT_FALSE(problem.evaluate(problem.initial()).failed);
  fit.frame_weights = {{1, 0, 1e-10, 0}};
  EXPECT_THAT([&] { FitProblem(test::drag_scene(kFrames), fit, camera, tracks); },
              testing::ThrowsMessage<InputError>(HasSubstr("/fit/frame_weights")));
}

// Information is what the weight says: of the frames' own noise, with that of frame 0 as it was, or of everything.
TEST(FrameWeights, DivideVariances) {
  const Camera camera = test::make_camera();
  const TrackSet tracks = tracks_of(2);
  const auto information = [&](const FitCase& fit, const TrackSet& of) {
    FitProblem problem(test::drag_scene(2), fit, camera, of);
    return problem.linearised(problem.initial())->jacobian.squaredNorm();
  };
  FitCase clip = film_alone(), frames = film_alone();
  clip.clip_weight = 0.25;
  frames.frame_weights = {{2, 2, 0.25, 0}};
  const double plain = information(film_alone(), tracks);
  EXPECT_NEAR(information(clip, tracks) / plain, 0.25, 1e-9);
  TrackSet noisier = tracks;
  for (Track& track : noisier.tracks)
    for (Observation& o : track.observations) o.covariance *= o.frame == 2 ? 4 : 1;
  EXPECT_NEAR(information(frames, tracks) / information(film_alone(), noisier), 1, 1e-9);
  EXPECT_LT(information(frames, tracks), 0.9 * plain);
}

TEST(FrameWeights, ClipsCountByTheirs) {
  const Camera camera = test::make_camera();
  const TrackSet tracks = tracks_of(2);
  const FitCase fit = film_alone();
  const auto cost = [&](double left, double right) {
    std::vector<FitClip> clips(2);
    for (FitClip& clip : clips)
      clip.scene = test::drag_scene(2), clip.cameras = {camera}, clip.tracks = tracks;
    clips[0].name = "left", clips[0].weight = left;
    clips[1].name = "right", clips[1].weight = right;
    JointProblem problem(clips, fit);
    return problem.evaluate(problem.initial()).cost;
  };
  const double one = cost(1, 1) / 2;
  EXPECT_GT(one, 1);
  EXPECT_NEAR(cost(1, 0.25), 1.25 * one, 1e-9 * one);
}

// Weights say how much counts, not how large the noise is: chi-square per degree stays where it was.
TEST(FrameWeights, DoNotDiluteChiSquare) {
  const TrackSet tracks = tracks_of(2);
  FitCase fit = film_alone();
  fit.parameters = {test::fitted("/skin/layers/film/youngs_modulus")};  // where the truth has it
  const auto chi = [&](double right) {
    std::vector<FitClip> clips(2);
    for (FitClip& clip : clips)
      clip.scene = test::drag_scene(2), clip.cameras = {test::make_camera()}, clip.tracks = tracks;
    clips[0].name = "left", clips[1].name = "right", clips[1].weight = right;
    JointProblem problem(clips, fit);
    EXPECT_NEAR(problem.clip(1).sum_of_weights(), right * problem.clip(1).num_observations(), 1e-9);
    return 2 * problem.evaluate(problem.initial()).cost / problem.degrees_of_freedom();
  };
  EXPECT_NEAR(chi(0.1) / chi(1), 1, 0.05);
}

// A clip that states half its deviations stands out by its own chi-square, whatever it weighs.
TEST(FrameWeights, EachClipHasItsOwnChiSquare) {
  const auto fit_with = [&](double weight) {
    std::vector<FitClip> clips(2);
    for (FitClip& clip : clips) clip.scene = test::drag_scene(2), clip.cameras = {test::make_camera()};
    clips[0].name = "as stated", clips[0].tracks = tracks_of(2);
    clips[1].name = "twice that",
    clips[1].tracks = test::make_tracks(clips[1].scene, clips[1].cameras[0], 2, 0.02, 4);
    for (Track& track : clips[1].tracks.tracks)
      for (Observation& o : track.observations) o.covariance /= 4;
    clips[1].weight = weight;
    return run_fit(JointFitInput{.clips = clips, .options = film_alone()});
  };
  for (const double weight : {1.0, 0.2}) {
    const FitResult result = fit_with(weight);
    ASSERT_TRUE(result.converged) << result.status;
    std::printf("weight %g: %.3f and %.3f\n", weight, result.clips[0].reduced_chi_square,
                result.clips[1].reduced_chi_square);
    EXPECT_NEAR(result.clips[0].reduced_chi_square, 1, 0.25);
    EXPECT_NEAR(result.clips[1].reduced_chi_square, 4, 1);
    EXPECT_NEAR(result.clips[1].degrees_of_freedom / (2 * weight * result.clips[1].num_observations), 1,
                0.02);
  }
}

// Late frames in which points slip: where they weigh little the answer is that of the early ones, with wider intervals.
TEST(FrameWeights, EarlyFramesDecideWhenLateOnesAreWrong) {
  const Camera camera = test::make_camera();
  TrackSet tracks = tracks_of(kFrames);
  for (Track& track : tracks.tracks)
    for (Observation& o : track.observations)
      if (o.frame >= 3) o.pixel.x() += 0.3;
  FitCase fit = film_alone();
  const FitResult all = run_fit({test::drag_scene(kFrames), camera, tracks, fit, {}});
  fit.frame_weights = {{3, 0, 0.001, 0}};
  const FitResult early = run_fit({test::drag_scene(kFrames), camera, tracks, fit, {}});
  std::printf("film: %.4f, early frames weighted %.4f ± %.4f\n", all.parameters[0].value,
              early.parameters[0].value, early.parameters[0].sigma);
  EXPECT_GT(std::fabs(std::log(all.parameters[0].value)), 3 * std::fabs(std::log(early.parameters[0].value)));
  EXPECT_LT(std::fabs(std::log(early.parameters[0].value)), 3 * early.parameters[0].sigma);
  EXPECT_THAT(early.notes, Contains(HasSubstr("frames 3 on weigh 0.001")));
}

}  // namespace
}  // namespace rhytid::fitting
