// Held parameters that are wrong: the predicted move of the answer against fits that hold other values, and
// intervals that have room for it.
#include "fitting/consider.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cstdio>

#include "tests/fitting/small_drag.h"

namespace rhytid::fitting {
namespace {

using testing::HasSubstr;

const char* const kFriction = "/colliders/finger/friction/coefficient";

/// The finger's friction held at `friction` where the tracks have 0.4.
FitInput make_input(double friction) {
  FitInput input = test::small_drag({std::string(kFriction) + "=" + std::to_string(friction)});
  input.options.consider.reset();
  return input;
}

TEST(Consider, FrictionThatIsNotFittedByDefault) {
  JointFitInput input{.clips = {{"", "", test::drag_scene(2), {}, {}, {}}}, .options = {}};
  std::vector<FitParameter> list = considered_parameters(input);
  ASSERT_EQ(list.size(), 1u);
  EXPECT_EQ(list[0].address, kFriction);
  EXPECT_EQ(*list[0].prior_sigma, kFrictionSigma);
  input.options.parameters = {test::fitted(kFriction)};
  EXPECT_TRUE(considered_parameters(input).empty()) << "it is fitted";
  input.options.consider = {{test::fitted(kFriction), test::fitted("/base/stiffness")}};
  list = considered_parameters(input);
  ASSERT_EQ(list.size(), 1u);
  EXPECT_EQ(list[0].address, "/base/stiffness");
  input.options.consider->back().prior_sigma = 0;
  EXPECT_TRUE(considered_parameters(input).empty()) << "it is exact";
  input.options.parameters.clear();
  input.options.consider.emplace();
  EXPECT_TRUE(considered_parameters(input).empty()) << "the case says so";
}

TEST(Consider, ShiftIsWhatAnotherHeldValueMakesOfTheAnswer) {
  FitInput input = make_input(0.4);
  input.options.consider.emplace();
  FitParameter friction = test::fitted(kFriction);
  friction.prior_sigma = 0.05;
  input.options.consider->push_back(friction);
  const FitResult at = run_fit(input);
  std::printf("%s", answer_text(at).c_str());
  ASSERT_TRUE(at.converged);
  ASSERT_EQ(at.systematic.size(), 2u);
  ASSERT_EQ(at.systematic[0].failure, "");
  EXPECT_THAT(at.systematic[0].change, HasSubstr("off by a factor 1.05"));
  ASSERT_EQ(at.systematic[0].left.size(), 1u);
  const VectorXd shift =
      Eigen::Map<const VectorXd>(at.systematic[0].shift.data(), 2) / at.systematic[0].left[0];
  VectorXd moved[2];
  for (const int side : {0, 1}) {
    FitInput other = make_input(0.4 * std::exp(side == 0 ? 0.05 : -0.05));
    other.options.consider.emplace();
    const FitResult found = run_fit(other);
    ASSERT_TRUE(found.converged);
    moved[side] = test::logarithms(found) - test::logarithms(at);
  }
  const VectorXd central = 0.5 * (moved[0] - moved[1]);
  std::printf("predicted %+.5f %+.5f, found %+.5f %+.5f\n", shift[0], shift[1], central[0], central[1]);
  EXPECT_LT((central - shift).norm(), 0.1 * central.norm());
  EXPECT_GT(central.norm(), 0.01);
}

// Friction held a sixth too low: without considering it the interval of the film misses the truth.
TEST(Consider, IntervalsHoldTheTruthWhereFrictionIsHeldWrong) {
  FitInput input = make_input(0.34);
  input.options.path_deviations = "ignore";
  FitParameter friction = test::fitted(kFriction);
  friction.prior_sigma = kFrictionSigma;
  input.options.consider = {{friction}};
  const FitResult with = run_fit(input);
  std::printf("%s", answer_text(with).c_str());
  input.options.consider.emplace();
  const FitResult without = run_fit(input);
  bool misses = false;
  for (std::size_t k = 0; k < 2; ++k) {
    const double truth = get_parameter(test::drag_scene(test::kDragFrames), with.parameters[k].address);
    EXPECT_EQ(with.parameters[k].value, without.parameters[k].value);
    EXPECT_TRUE(with.parameters[k].low95 <= truth && truth <= with.parameters[k].high95)
        << with.parameters[k].name;
    misses = misses || truth < without.parameters[k].low95 || truth > without.parameters[k].high95;
  }
  EXPECT_TRUE(misses);
  EXPECT_THAT(with.cannot_tell,
              testing::Contains(HasSubstr("hangs on a parameter that is held, finger friction")));
}

}  // namespace
}  // namespace rhytid::fitting
