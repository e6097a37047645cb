// Several clips and cameras fitted together: derivatives, what two swipes tell beyond each, resuming, the
// record, messages. Truth and fit are discretised differently.
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <unistd.h>

#include <cmath>
#include <cstdio>
#include <filesystem>

#include "fitting/fit.h"
#include "sim/core/error.h"
#include "tests/fitting/synthetic_tracks.h"

namespace rhytid::fitting {
namespace {

namespace fs = std::filesystem;
using testing::HasSubstr;

constexpr int kFrames = 3;
constexpr double kSigma = 0.25;  // px

/// The finger presses and drags to the right, or starts on the right and drags up and back.
std::vector<std::string> swipe(bool is_second) {
  if (!is_second) return {};
  return {
      R"(/colliders/finger/path=[{"time": 0, "position": [2, -1, 5.02]},
                                 {"time": 0.125, "position": [2, -1, 4.4]}, {"time": 1, "position": [-4, 7, 4.4]}])"};
}

Camera second_camera() {
  Camera camera = test::make_camera();
  camera.name = "right";
  const Vec3 centre(28, 8, 50), forward = (Vec3(0, 0, 1) - centre).normalized();
  const Vec3 right = forward.cross(Vec3::UnitZ()).normalized(), down = forward.cross(right);
  camera.rotation << right.transpose(), down.transpose(), forward.transpose();
  camera.translation = -camera.rotation * centre;
  return camera;
}

/// Tracks of a truth with another order through the thickness and smaller steps than the fit has.
TrackSet tracks_of(bool is_second, const Camera& camera, unsigned seed) {
  std::vector<std::string> settings = swipe(is_second);
  for (const char* setting : {"/skin/layers/soft/order=3", "/time/substeps=2"})
    settings.emplace_back(setting);
  return test::make_tracks(test::drag_scene(kFrames, settings), camera, 3, kSigma, seed);
}

FitClip make_clip(bool is_second) {
  const Camera camera = test::make_camera();
  return {is_second ? "up" : "right",
          is_second ? "up.csv" : "right.csv",
          test::drag_scene(kFrames, swipe(is_second)),
          {camera},
          tracks_of(is_second, camera, is_second ? 2 : 1)};
}

FitCase two_shared() {
  FitCase fit;
  fit.discretisation_check = false;
  fit.consider.emplace();
  fit.min_sigma = 0.005;
  fit.parameters = {test::fitted("/skin/layers/film/youngs_modulus", 0.5),
                    test::fitted("/ligaments/stiffness", 0.001)};
  return fit;
}

FitParameter of_clip(FitParameter parameter, const std::string& clip) {
  parameter.clip = clip;
  return parameter;
}

FitInput alone(const FitClip& clip, const FitCase& fit) {
  return {clip.scene, clip.cameras[0], clip.tracks, fit, {}};
}

TEST(JointProblem, JacobianAndGradientMatchDifferences) {
  FitCase fit = two_shared();
  const char* friction = "/colliders/finger/friction/coefficient";
  fit.parameters[1] = test::fitted("/ligaments/sources/right/strength", 1.5);
  fit.parameters[1].prior_sigma = 0.2;
  fit.parameters.push_back(of_clip(test::fitted(friction, 0.6), "up"));
  fit.parameters.push_back(of_clip(test::fitted("/time/offset", 0.002), "right"));
  JointProblem problem({make_clip(false), make_clip(true)}, fit);
  ASSERT_EQ(problem.num_parameters(), 4);
  EXPECT_EQ(problem.variables()[2].address, std::string("/clips/up") + friction);
  EXPECT_THAT(problem.variables()[3].name, HasSubstr("(right)"));
  const VectorXd t = problem.initial() + Eigen::Vector4d(0.03, 0.05, -0.04, 0.001);
  const ObjectiveEvaluation at = problem.evaluate(t);
  ASSERT_FALSE(at.failed) << at.failure;
  EXPECT_NEAR(at.cost, 0.5 * at.residuals.squaredNorm(), 1e-12 * at.cost);
  EXPECT_EQ(at.residuals.size(), problem.clip(0).num_residuals() + problem.clip(1).num_residuals());
  const auto jacobian = problem.jacobian(t);
  const auto gradient = problem.gradient(t);
  ASSERT_TRUE(jacobian && gradient);
  EXPECT_EQ(problem.forward_runs(), 1) << "value and derivatives share the runs";
  EXPECT_LT((jacobian->transpose() * at.residuals - *gradient).norm(), 1e-8 * gradient->norm());
  const Eigen::Index first = problem.clip(0).num_residuals();
  EXPECT_EQ(jacobian->col(2).head(first).norm(), 0) << "the other clip's friction";
  EXPECT_GT(jacobian->col(2).tail(jacobian->rows() - first).norm(), 0);
  EXPECT_EQ(jacobian->col(3).tail(jacobian->rows() - first).norm(), 0);
  // The prior counts once, in the only row that is a multiple of its parameter alone.
  EXPECT_EQ(problem.degrees_of_freedom(), 2 * problem.num_observations() - 4 + 1);
  for (const Eigen::Vector4d& direction :
       {Eigen::Vector4d(1, -0.5, 0.7, 0.02), Eigen::Vector4d(-0.2, 0.4, 0.3, -0.03)}) {
    const double h = 1e-4;
    const ObjectiveEvaluation plus = problem.evaluate(t + h * direction),
                              minus = problem.evaluate(t - h * direction);
    const VectorXd difference = (plus.residuals - minus.residuals) / (2 * h);
    EXPECT_LT((*jacobian * direction - difference).norm(), 1e-4 * difference.norm());
    EXPECT_NEAR((plus.cost - minus.cost) / (2 * h), gradient->dot(direction), 1e-5 * gradient->norm());
  }
}

TEST(Joint, TwoSwipesTellMoreThanEachAndTheOptimisersAgree) {
  FitCase fit = two_shared();
  JointFitInput input{.clips = {make_clip(false), make_clip(true)}, .options = fit};
  for (const ParameterSpec& spec : all_parameters(input.clips[0].scene))
    input.truth[spec.address] = spec.value;
  const FitResult joint = run_fit(input);
  std::printf("%s", answer_text(joint).c_str());
  ASSERT_TRUE(joint.converged) << joint.status;
  for (const FittedParameter& p : joint.parameters) {
    EXPECT_LT(p.low95, *p.truth) << p.name;
    EXPECT_GT(p.high95, *p.truth) << p.name;
  }
  for (const FitClip& clip : input.clips) {
    const FitResult one = run_fit(alone(clip, fit));
    ASSERT_TRUE(one.converged) << one.status;
    std::printf("%s alone\n%s", clip.name.c_str(), answer_text(one).c_str());
    for (int k = 0; k < 2; ++k) {
      EXPECT_LT(joint.parameters[k].sigma, one.parameters[k].sigma) << clip.name << k;
      EXPECT_LT(joint.parameters[k].high95 / joint.parameters[k].low95,
                one.parameters[k].high95 / one.parameters[k].low95);
    }
  }
  ASSERT_EQ(joint.clips.size(), 2u);
  double dof = 0, cost = 0;
  for (const FittedClip& clip : joint.clips) {
    dof += clip.degrees_of_freedom;
    cost += clip.cost;
    EXPECT_GT(clip.num_tracks, 20);
    EXPECT_GT(clip.reduced_chi_square, 0.3);
  }
  EXPECT_NEAR(dof, 2 * joint.num_observations - 2, 1e-6);
  EXPECT_NEAR(cost, joint.final_cost, 1e-9 * cost);
  EXPECT_THAT(answer_text(joint), HasSubstr("clip "));

  input.options.optimiser = "nlopt";
  input.options.max_evaluations = 60;
  const FitResult nlopt = run_fit(input);
  EXPECT_TRUE(nlopt.converged) << nlopt.status;
  EXPECT_NEAR(nlopt.final_cost, joint.final_cost, 1e-3);
  for (int k = 0; k < 2; ++k)
    EXPECT_LT(std::fabs(std::log(nlopt.parameters[k].value / joint.parameters[k].value)),
              0.05 * joint.parameters[k].sigma);
}

TEST(Joint, TwoCamerasShareTheRunsAndTellMore) {
  FitClip clip = make_clip(false);
  const FitResult one = run_fit(alone(clip, two_shared()));
  clip.cameras.push_back(second_camera());
  for (Track& track : tracks_of(false, second_camera(), 5).tracks) clip.tracks.tracks.push_back(track);
  JointFitInput input{.clips = {clip}, .options = two_shared()};
  const FitResult both = run_fit(input);
  std::printf("%s", answer_text(both).c_str());
  ASSERT_TRUE(both.converged) << both.status;
  ASSERT_EQ(both.clips.size(), 1u);
  ASSERT_EQ(both.clips[0].views.size(), 2u);
  EXPECT_EQ(both.clips[0].views[1].camera, "right");
  EXPECT_GT(both.clips[0].views[1].num_tracks, 15);
  EXPECT_EQ(both.clips[0].views[0].num_observations, one.num_observations);
  EXPECT_EQ(both.num_observations, one.num_observations + both.clips[0].views[1].num_observations);
  for (int k = 0; k < 2; ++k) EXPECT_LT(both.parameters[k].sigma, one.parameters[k].sigma);

  JointProblem problem(input.clips, input.options);
  const VectorXd t = problem.initial();
  const ObjectiveEvaluation at = problem.evaluate(t);
  const auto jacobian = problem.jacobian(t);
  ASSERT_TRUE(jacobian);
  EXPECT_EQ(problem.clip(0).counters().forward_runs, 1);
  EXPECT_EQ(problem.clip(0).counters().tangent_sweeps, 1);
  EXPECT_LT((jacobian->transpose() * at.residuals - *problem.gradient(t)).norm(),
            1e-8 * (jacobian->transpose() * at.residuals).norm());
  const Eigen::Vector2d direction(0.7, -1);
  const double h = 1e-4;
  const VectorXd plus = problem.evaluate(t + h * direction).residuals,
                 minus = problem.evaluate(t - h * direction).residuals;
  EXPECT_LT((*jacobian * direction - (plus - minus) / (2 * h)).norm(),
            1e-4 * (plus - minus).norm() / (2 * h));
}

TEST(Joint, OneNamedClipGivesTheBitsOfAPlainFit) {
  const FitClip clip = make_clip(false);
  FitCase fit = two_shared();
  fit.max_evaluations = 3;
  const FitResult plain = run_fit(alone(clip, fit));
  const FitResult named = run_fit(JointFitInput{.clips = {clip}, .options = fit});
  EXPECT_EQ(named.final_cost, plain.final_cost);
  EXPECT_EQ(named.forward_runs, plain.forward_runs);
  EXPECT_TRUE(named.clips.empty());
  for (int k = 0; k < 2; ++k) {
    EXPECT_EQ(named.parameters[k].value, plain.parameters[k].value);
    EXPECT_EQ(named.parameters[k].high95, plain.parameters[k].high95);
  }
}

TEST(Joint, RecordIsReadBackAndEveryClipResumesByItself) {
  const fs::path folder = fs::temp_directory_path() / ("rhytid_joint_" + std::to_string(getpid()));
  fs::create_directories(folder);
  JointFitInput input{.clips = {make_clip(false), make_clip(true)}, .options = two_shared()};
  input.options.max_evaluations = 2;
  input.evaluations = (folder / "evaluations").string();
  int fresh = 0, replayed = 0;
  FitObserver observer;
  observer.run = [&](const FitProgress& p) { ++(p.replayed ? replayed : fresh); };
  const FitResult first = run_fit(input, observer);
  EXPECT_EQ(fresh, 2);
  write_fit_result(first, folder.string());
  const FitResult back = read_fit_result(folder.string());
  ASSERT_EQ(back.clips.size(), 2u);
  EXPECT_EQ(back.clips[1].name, "up");
  EXPECT_EQ(back.clips[1].reduced_chi_square, first.clips[1].reduced_chi_square);
  ASSERT_EQ(back.residuals.size(), first.residuals.size());
  EXPECT_EQ(back.residuals.back().clip, 1);
  EXPECT_TRUE(fs::exists(folder / "up" / "fitted_scene.json"));

  fresh = 0;
  const FitResult again = run_fit(input, observer);
  EXPECT_EQ(fresh, 0);
  EXPECT_EQ(replayed, 2);
  EXPECT_EQ(again.final_cost, first.final_cost);
  EXPECT_EQ(again.parameters[0].high95, first.parameters[0].high95);

  // Other tracks in one clip: only its log is set aside.
  input.clips[1].tracks.tracks[0].observations[2].pixel.x() += 1e-9;
  std::vector<std::string> notes;
  observer.note = [&](const std::string& text) { notes.push_back(text); };
  run_fit(input, observer);
  ASSERT_EQ(notes.size(), 2u);
  EXPECT_THAT(notes[0], HasSubstr("resumed: 2 runs"));
  EXPECT_THAT(notes[1], testing::AllOf(HasSubstr("(other tracks)"), testing::EndsWith("up.old")));
  fs::remove_all(folder);
}

TEST(Joint, MistakesNameTheClip) {
  const std::vector<FitClip> good = {make_clip(false), make_clip(true)};
  const auto message = [&](const std::function<void(std::vector<FitClip>&, FitCase&)>& spoil) -> std::string {
    std::vector<FitClip> clips = good;
    FitCase fit = two_shared();
    spoil(clips, fit);
    try {
      const JointProblem problem(clips, fit);
    } catch (const InputError& error) {
      return error.what();
    }
    return "accepted";
  };
  EXPECT_THAT(message([](auto& clips, FitCase&) { clips[1].tracks.tracks.clear(); }),
              testing::AllOf(HasSubstr("clip 'up' (up.csv)"), HasSubstr("usable observations")));
  EXPECT_THAT(message([](auto& clips, FitCase&) { clips[1].name = "right"; }), HasSubstr("'right'"));
  EXPECT_THAT(message([](auto&, FitCase& fit) { fit.parameters[0].clip = "left"; }),
              HasSubstr("/clips/left/skin/layers/film/youngs_modulus"));
  EXPECT_THAT(message([](auto& clips, FitCase&) { clips[1].scene.skin.layers[0].youngs_modulus *= 2; }),
              testing::AllOf(HasSubstr("clip 'up'"), HasSubstr("the scale of all clips")));
  EXPECT_THAT(message([](auto& clips, FitCase&) { clips[0].cameras.push_back(clips[0].cameras[0]); }),
              HasSubstr("a name of its own"));
  EXPECT_THAT(message([](auto& clips, FitCase&) { clips[0].cameras.push_back(second_camera()); }),
              testing::AllOf(HasSubstr("clip 'right'"), HasSubstr("camera 'right'"),
                             HasSubstr("no usable observation")));
  std::vector<FitClip> stiffer = good;
  stiffer[1].scene.skin.layers[1].poissons_ratio = 0.3;
  const JointProblem odd(stiffer, two_shared());
  ASSERT_EQ(odd.differences().size(), 1u);
  EXPECT_THAT(odd.differences()[0], HasSubstr("/skin/layers/film/poissons_ratio"));
}

}  // namespace
}  // namespace rhytid::fitting
