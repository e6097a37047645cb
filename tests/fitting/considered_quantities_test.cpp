// Thicknesses and paths that are wrong: what they would move against fits of other scenes, intervals that have room for it,
// what is said of residuals, and logs.
#include "fitting/considered_quantities.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <Eigen/Cholesky>
#include <cstdio>
#include <filesystem>

#include "fitting/consider.h"
#include "fitting/error_posterior.h"
#include "fitting/path_deviations.h"
#include "tests/fitting/small_drag.h"
#include "tests/support/temporary_folder.h"

namespace rhytid::fitting {
namespace {

using testing::Contains;
using testing::HasSubstr;

constexpr int kFrames = test::kDragFrames;
const char* const kSoft = "/skin/layers/soft/thickness";

/// Settings that move the finger's path by so much along x, mm.
std::vector<std::string> finger_off_by(double x) {
  std::vector<std::string> settings;
  const Scene truth = test::drag_scene(kFrames);
  for (std::size_t k = 0; k < truth.colliders[0].path.size(); ++k)
    settings.push_back("/colliders/finger/path/" + std::to_string(k) +
                       "/position/0=" + std::to_string(truth.colliders[0].path[k].position[0] + x));
  return settings;
}

TEST(ConsideredQuantities, ThicknessesByDefault) {
  JointFitInput input{.clips = {{"a", "", test::drag_scene(2), {}, {}, {}}}, .options = {}};
  input.clips.push_back(input.clips[0]);
  input.clips[1].name = "b";
  const std::vector<ConsideredQuantity> list = considered_quantities(input);
  ASSERT_EQ(list.size(), 2u) << "one skin";
  EXPECT_EQ(list[0].address, kSoft);
  EXPECT_EQ(list[0].sigma, kThicknessSigma);
  EXPECT_TRUE(list[0].is_relative);
  EXPECT_EQ(list[1].address, "/skin/layers/film/thickness");
  input.options.consider.emplace();
  EXPECT_TRUE(considered_quantities(input).empty()) << "the case says that all is exact";
  input.options.consider_quantities = {{.address = kSoft, .sigma = 0.2}, {.address = "/base/onset"}};
  ASSERT_EQ(considered_quantities(input).size(), 1u) << "a deviation of 0 is none";
  EXPECT_EQ(considered_quantities(input)[0].sigma, 0.2);
}

TEST(ConsideredQuantities, MoveTheSceneByTheirDeviation) {
  const Scene scene = test::drag_scene(2);
  EXPECT_NEAR(
      moved_scene(scene, {.address = kSoft, .sigma = 0.1, .is_relative = true}).skin.layers[0].thickness,
      1.65, 1e-12);
  EXPECT_NEAR(moved_scene(scene, {.address = kSoft, .sigma = 0.1}).skin.layers[0].thickness, 1.6, 1e-12);
}

TEST(ConsideredQuantities, ShiftIsWhatAFitOfTheOtherSceneFinds) {
  FitInput input = test::small_drag();
  input.options.consider_quantities = {{.address = kSoft, .sigma = 0.05, .is_relative = true}};
  const FitResult at = run_fit(input);
  std::printf("%s", answer_text(at).c_str());
  ASSERT_TRUE(at.converged);
  ASSERT_EQ(at.systematic.size(), 2u);
  ASSERT_EQ(at.systematic[0].failure, "");
  EXPECT_EQ(at.systematic[0].name, "held soft thickness");
  EXPECT_THAT(at.systematic[0].change, HasSubstr("off by 5 %"));
  EXPECT_THAT(at.systematic[0].change, HasSubstr("of which the residuals leave"));
  EXPECT_EQ(at.systematic[1].name, kTogether);
  ASSERT_EQ(at.systematic[0].left.size(), 1u);
  EXPECT_GT(at.systematic[0].left[0], 0.01);
  EXPECT_LT(at.systematic[0].left[0], 1) << "it is as thick as it should be";
  EXPECT_GT(at.systematic[0].rms_px, 0);
  EXPECT_THAT(at.misfit, testing::IsEmpty()) << "the model has no error";
  const VectorXd shift =
      Eigen::Map<const VectorXd>(at.systematic[0].shift.data(), 2) / at.systematic[0].left[0];
  FitInput other = test::small_drag({std::string(kSoft) + "=1.575"});
  const FitResult found = run_fit(other);
  ASSERT_TRUE(found.converged);
  const VectorXd moved = test::logarithms(found) - test::logarithms(at);
  std::printf("predicted %+.5f %+.5f, found %+.5f %+.5f\n", shift[0], shift[1], moved[0], moved[1]);
  EXPECT_LT((moved - shift).norm(), 0.15 * moved.norm());
  EXPECT_GT(moved.norm(), 0.01);
}

// The soft layer held a tenth too thick: the intervals of before miss the truth, those of the default hold it.
TEST(ConsideredQuantities, IntervalsHoldTheTruthWhereAThicknessIsWrong) {
  FitInput input = test::small_drag({std::string(kSoft) + "=1.65"});
  const FitResult without = run_fit(input);
  input.options.consider.reset();
  const FitResult with = run_fit(input);
  std::printf("%s", answer_text(with).c_str());
  EXPECT_LT(test::intervals_that_hold(without), 2);
  EXPECT_EQ(test::intervals_that_hold(with), 2);
  for (std::size_t k = 0; k < 2; ++k) EXPECT_EQ(with.parameters[k].value, without.parameters[k].value);
}

// The finger off by more than the default: intervals have room for it, and the residuals tell where it is. One that is
// where it should be costs little.
TEST(ConsideredQuantities, AFingerThatIsOffIsInTheIntervalsAndTold) {
  FitInput input = test::small_drag(finger_off_by(-0.4));
  const FitResult without = run_fit(input);
  EXPECT_THAT(without.misfit, Contains(HasSubstr("the model misses something")));
  input.options.consider.reset();
  const FitResult with = run_fit(input);
  std::printf("%s", answer_text(with).c_str());
  EXPECT_EQ(test::intervals_that_hold(with), 2);
  ASSERT_GE(with.misfit.size(), 1u);
  EXPECT_THAT(with.misfit[0], testing::ContainsRegex("finger path x by \\+0\\.[34]"));
  for (const SystematicShift& shift : with.systematic)
    if (shift.name == "held finger path offset") {
      ASSERT_EQ(shift.signature.size(), 3u);
      for (const ResidualAxis& axis : shift.signature) {
        const double expected = axis.name == "finger path x" ? 0.4 : 0;
        EXPECT_NEAR(axis.estimate * axis.amount, expected, 0.08) << axis.name;
      }
    }
}

// The same rule for guesses and statements: whoever says it, what the residuals leave of it counts, and who knows better
// has intervals that are no wider.
TEST(ConsideredQuantities, WhatIsKnownBetterWidensLess) {
  for (const bool is_off : {false, true}) {
    const FitInput input = test::small_drag(is_off ? finger_off_by(-0.2) : std::vector<std::string>());
    JointFitInput joint{.clips = {{"", "", input.scene, {input.camera}, input.tracks}},
                        .options = input.options};
    const auto shifts_of = [&joint](double sigma) {  // sigma: 0: guessed
      JointFitInput given = joint;
      given.options.consider.reset();
      if (sigma > 0) {
        given.options.consider.emplace();
        given.options.consider_paths = {{.address = "/colliders/finger/path", .sigma = sigma}};
      }
      given = with_path_errors(given);
      given.options.consider.emplace();  // the path alone
      JointProblem problem(given.clips, given.options);
      VectorXd t = problem.initial();
      t << std::log(3), 0;  // the truth's
      const auto at = problem.linearised(t);
      const MatrixXd normal = at->jacobian.transpose() * at->jacobian;
      const MatrixXd basis = normal.llt().matrixU().solve(MatrixXd::Identity(2, 2));
      std::vector<SystematicShift> found = considered_shifts(given, problem, t, *at, basis, {});
      EXPECT_EQ(found.size(), 1u);
      const SystematicShift before = found[0];
      weigh_by_residuals(*at, basis, problem.degrees_of_freedom(), 0, found);
      EXPECT_EQ(found.size(), 2u);
      return std::vector<SystematicShift>{before, found[0], found[1]};
    };
    const std::vector<SystematicShift> guessed = shifts_of(0);
    for (std::size_t k = 0; k < 2; ++k) {
      double narrower = 0;
      for (const double sigma : {0.01, 0.05, 0.1, kPathSigma, 0.5}) {
        const std::vector<SystematicShift> stated = shifts_of(sigma);
        std::printf("%s, to %.2f mm: %.4f in full, %.4f left\n", is_off ? "off" : "right", sigma,
                    stated[0].shift[k], stated[2].shift[k]);
        EXPECT_GE(stated[2].shift[k], narrower);
        narrower = stated[2].shift[k];
        if (sigma <= kPathSigma) {
          EXPECT_LE(stated[2].shift[k], guessed[2].shift[k] * (1 + 1e-9));
        }
        if (sigma == kPathSigma) {
          EXPECT_NEAR(stated[2].shift[k], guessed[2].shift[k], 1e-9);
        }
        EXPECT_NEAR(stated[1].shift[k], stated[2].shift[k], 1e-9) << "nothing else is there";
      }
      if (!is_off) {
        EXPECT_LT(guessed[2].shift[k], 0.3 * guessed[0].shift[k]) << "tracks tell 0.25 mm";
      }
      EXPECT_GT(guessed[2].shift[k], 0);
    }
    EXPECT_THAT(guessed[1].change, HasSubstr("of which the residuals leave"));
  }
}

TEST(ConsideredQuantities, WhatCannotRunIsToldAndTakesNothingAlong) {
  FitInput input = test::small_drag();
  input.options.consider_quantities = {{.address = kSoft, .sigma = 0.05, .is_relative = true},
                                       {.address = "/skin/layers/soft/poissons_ratio", .sigma = 1}};
  const FitResult found = run_fit(input);
  ASSERT_EQ(found.systematic.size(), 3u);
  EXPECT_EQ(found.systematic[0].failure, "");
  EXPECT_NE(found.systematic[1].failure, "");
  EXPECT_THAT(answer_text(found), HasSubstr("Not checked: soft poissons_ratio off by 1"));
}

TEST(ConsideredQuantities, RunsAreKeptAndAStopIsAStop) {
  const rhytid::test::TemporaryFolder folder;
  FitInput input = test::small_drag();
  input.options.consider.reset();
  input.options.parameters.pop_back();
  input.evaluations = folder / "log";
  int polls = 0;
  bool is_moving = false;
  FitObserver observer;
  observer.note = [&](const std::string& text) { is_moving = is_moving || text.starts_with("held values"); };
  observer.should_stop = [&] { return is_moving && ++polls > 3; };
  const FitResult stopped = run_fit(input, observer);
  EXPECT_TRUE(stopped.stopped);
  EXPECT_FALSE(stopped.converged);

  const FitResult first = run_fit(input), again = run_fit(input);
  ASSERT_EQ(first.systematic.size(), 5u);  // the path, friction, two thicknesses, all together
  for (const char* name : {"moved_skin_layers_soft_thickness", "moved_skin_layers_film_thickness"})
    EXPECT_TRUE(std::filesystem::exists(std::filesystem::path(input.evaluations) / name / "identity.json"));
  for (std::size_t r = 0; r < first.systematic.size(); ++r) {
    EXPECT_EQ(first.systematic[r].failure, "");
    EXPECT_EQ(first.systematic[r].shift, again.systematic[r].shift) << "to the last bit";
    for (std::size_t a = 0; a < first.systematic[r].signature.size(); ++a)
      EXPECT_EQ(first.systematic[r].signature[a].estimate, again.systematic[r].signature[a].estimate);
  }
  EXPECT_EQ(first.parameters[0].low95, again.parameters[0].low95);
}

}  // namespace
}  // namespace rhytid::fitting
