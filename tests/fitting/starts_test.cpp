// Fits from several starts: the points, the logic on landscapes whose valleys are known, and whole fits that
// find what one start misses, go on after a kill, and say where the footage does not decide.
#include "fitting/starts.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <filesystem>
#include <nlohmann/json.hpp>

#include "sim/core/error.h"
#include "sim/output/atomic_file.h"
#include "tests/fitting/hand_made_objective.h"
#include "tests/fitting/synthetic_tracks.h"

namespace rhytid::fitting {
namespace {

namespace fs = std::filesystem;
using test::HandMadeObjective;
using testing::ElementsAre;
using testing::HasSubstr;

LocalFit local_fit(const std::string& optimiser) {
  return [optimiser](Search& search) {
    const OptimiserOptions options{.max_evaluations = 60};
    return optimiser == "ceres" ? fit_with_ceres(search, options) : fit_with_nlopt(search, options);
  };
}

TEST(StartPoints, FillTheBoxEvenlyAndKeepTheirPrefix) {
  HandMadeObjective objective = test::two_valleys(0.3);
  const StartOptions options{.starts = 64, .spread = 0.5, .seed = 3};
  const std::vector<VectorXd> points = start_points(objective, options);
  ASSERT_EQ(points.size(), 64u);
  EXPECT_EQ(points[0], objective.initial());
  // Range −2..3, from 0.9: a quarter of the range times the spread on either side; the second one is a
  // logarithm near its bound.
  const double reach = 0.5 * 0.25 * 5;
  std::array<int, 8> strata{};
  for (std::size_t i = 1; i < points.size(); ++i) {
    EXPECT_LE(std::fabs(points[i][0] - 0.9), reach);
    EXPECT_GE(points[i][1], objective.lower()[1]);
    EXPECT_LE(points[i][1], objective.initial()[1] + 0.5);
    ++strata[static_cast<std::size_t>((points[i][0] - 0.9 + reach) / (2 * reach) * 8)];
  }
  for (const int n : strata) EXPECT_NEAR(n, 63. / 8, 1.5) << "evenly, unlike independent draws";

  const std::vector<VectorXd> fewer = start_points(objective, {.starts = 5, .spread = 0.5, .seed = 3});
  for (std::size_t i = 0; i < fewer.size(); ++i) EXPECT_EQ(fewer[i], points[i]);
  EXPECT_NE(start_points(objective, {.starts = 5, .spread = 0.5, .seed = 4})[1], points[1]);
  EXPECT_THROW(start_points(objective, {.starts = 0}), ContractError);
}

TEST(StartPoints, OffsetsOfAPathStayWithinTheirPrior) {
  HandMadeObjective objective = test::two_valleys(0.3);
  objective.list[0].moves = {{"/colliders/finger/path/0/position/0", 0.1}};
  objective.list[0].prior_sigma = 0.2;
  double most = 0;
  for (const VectorXd& t : start_points(objective, {.starts = 32, .spread = 1}))
    most = std::max(most, std::fabs(t[0] - objective.initial()[0]));
  EXPECT_LE(most, 0.2 + 1e-12);
  EXPECT_GT(most, 0.1);
}

TEST(StartPoints, ManyParametersAreNotTiedToEachOther) {
  // Plain Halton points in bases 41 and 43 lie on a line for the first forty; permuted digits must not.
  HandMadeObjective objective = test::parabola(14, 1);
  const std::vector<VectorXd> points = start_points(objective, {.starts = 33, .seed = 1});
  for (int a = 0; a < 14; ++a)
    for (int b = 0; b < a; ++b) {
      double xy = 0, xx = 0, yy = 0;
      for (std::size_t i = 1; i < points.size(); ++i) {
        const double x = points[i][a], y = points[i][b];
        xy += x * y, xx += x * x, yy += y * y;
      }
      EXPECT_LT(std::fabs(xy) / std::sqrt(xx * yy), 0.75) << a << " and " << b;
    }
}

class BothOptimisers : public testing::TestWithParam<const char*> {};
INSTANTIATE_TEST_SUITE_P(Starts, BothOptimisers, testing::Values("ceres", "nlopt"));

TEST_P(BothOptimisers, FindTheLowerOfTwoValleys) {
  HandMadeObjective objective = test::two_valleys(0.3);
  Search alone(objective);
  const OptimiserOutcome single = local_fit(GetParam())(alone);
  EXPECT_NEAR(single.t[0], 1, 0.1) << "the valley that it began in";

  const StartsOutcome found = search_from_starts(
      objective, objective, {.starts = 8, .local_fits = 3, .spread = 2, .seed = 1}, local_fit(GetParam()));
  EXPECT_NEAR(found.best().t[0], -1, 0.1);
  EXPECT_LT(found.best().cost, single.cost);
  EXPECT_NE(found.winner, 0);
  EXPECT_EQ(found.starts.size(), 8u);
  EXPECT_TRUE(found.starts[0].was_searched) << "the case's own is always among them";
  EXPECT_NEAR(found.starts[0].outcome.cost, single.cost, 1e-9 * single.cost);
  int searched = 0;
  double worst = 0;
  for (const SearchedStart& start : found.starts) {
    EXPECT_TRUE(std::isfinite(start.screened_cost));
    if (!start.was_searched) continue;
    ++searched;
    EXPECT_GT(start.forward_runs, 0);
    EXPECT_LE(start.outcome.history.back().evaluations, start.forward_runs) << "from its own beginning";
    if (&start != &found.starts[0]) worst = std::max(worst, start.screened_cost);
  }
  EXPECT_EQ(searched, 3);
  for (const SearchedStart& start : found.starts)
    EXPECT_TRUE(start.was_searched || start.screened_cost >= worst) << "the cheapest others";

  const StartsOutcome again = search_from_starts(
      objective, objective, {.starts = 8, .local_fits = 3, .spread = 2, .seed = 1}, local_fit(GetParam()));
  EXPECT_EQ(again.best().t, found.best().t);
  EXPECT_EQ(again.winner, found.winner);
}

TEST_P(BothOptimisers, FailedStartsAreLeftOut) {
  HandMadeObjective objective = test::two_valleys(0.3);
  objective.fails = [](const VectorXd& t) { return t[0] > 0.5; };  // the case's own start among them
  const StartsOutcome found = search_from_starts(
      objective, objective, {.starts = 8, .local_fits = 2, .spread = 2, .seed = 1}, local_fit(GetParam()));
  EXPECT_THAT(found.starts[0].failure, HasSubstr("no value there"));
  EXPECT_TRUE(std::isnan(found.starts[0].screened_cost));
  EXPECT_EQ(found.starts[0].outcome.status, OptimiserOutcome::Status::failed);
  EXPECT_NE(found.winner, 0);
  EXPECT_NEAR(found.best().t[0], -1, 0.1);

  objective.fails = [](const VectorXd&) { return true; };
  const StartsOutcome none =
      search_from_starts(objective, objective, {.starts = 4, .seed = 1}, local_fit(GetParam()));
  EXPECT_EQ(none.winner, 0);
  EXPECT_EQ(none.best().status, OptimiserOutcome::Status::failed);
}

TEST(Starts, OneStartIsThePlainSearch) {
  HandMadeObjective objective = test::two_valleys(0.3);
  const StartsOutcome found = search_from_starts(objective, objective, {}, local_fit("ceres"));
  ASSERT_EQ(found.starts.size(), 1u);
  const int runs = objective.forward_runs();
  Search search(objective);
  const OptimiserOutcome plain = local_fit("ceres")(search);
  EXPECT_EQ(found.best().t, plain.t);
  EXPECT_EQ(found.best().history.size(), plain.history.size());
  EXPECT_EQ(objective.forward_runs() - runs, runs) << "nothing was screened";
}

TEST(Starts, AStopWhileScreeningIsAStop) {
  HandMadeObjective objective = test::two_valleys(0.3);
  objective.stops_after = 3;
  const StartsOutcome found = search_from_starts(objective, objective, {.starts = 8}, local_fit("ceres"));
  EXPECT_EQ(found.best().status, OptimiserOutcome::Status::stopped);
}

FitInput two_ligaments(double right, double left) {
  // Where the searches from these starts end is this rule's: the default one has a way back.
  const Scene scene = test::drag_scene(4, {"/skin/quadrature/rule=full"});
  const Camera camera = test::make_camera();
  FitCase fit = test::three_parameters();
  fit.parameters = {test::fitted("/ligaments/sources/right/strength", right),
                    test::fitted("/ligaments/sources/left/strength", left)};
  fit.local_fits = 2;
  return {scene, camera, test::make_tracks(scene, camera, 2, 0.02, 3), fit, {}};
}

// From far too strong a ligament Levenberg-Marquardt jumps to where there is none, and no gradient leads back.
TEST(Starts, RecoverWhereOneStartEndsAtABound) {
  FitInput input = two_ligaments(60, 0.5);
  FitProblem problem(input.scene, input.options, input.camera, input.tracks);
  const double cost_of_truth = problem.evaluate(Eigen::Vector2d(std::log(3.), std::log(0.5))).cost;
  input.options.starts = 6;
  input.options.start_spread = 4;
  const FitResult result = run_fit(input);
  ASSERT_EQ(result.starts.size(), 6u);
  const FittedStart& own = result.starts[0];
  EXPECT_EQ(own.status, "converged");
  EXPECT_GT(own.final_cost, cost_of_truth + 5) << "one start converges elsewhere";
  EXPECT_LT(own.values[0], 0.002) << "at the lower bound";
  EXPECT_TRUE(result.converged) << result.status;
  EXPECT_LT(result.final_cost, cost_of_truth);
  EXPECT_LT(std::fabs(std::log(result.parameters[0].value / 3)), 4 * result.parameters[0].sigma);
  int searched = 0;
  for (const FittedStart& start : result.starts) {
    if (start.optimum == 0) continue;
    ++searched;
    EXPECT_EQ(start.costs.size(), start.evaluations.size());
    EXPECT_EQ(start.optimum, &start == &own ? 2 : 1);
  }
  EXPECT_EQ(searched, 2);
  EXPECT_THAT(result.notes, testing::Contains(HasSubstr("From the start of the case alone")));
  EXPECT_THAT(result.cannot_tell, testing::Not(testing::Contains(HasSubstr("Another optimum"))));
  EXPECT_THAT(answer_text(result), HasSubstr("Starts: 6; searches from 2 in "));
}

// Without the left ligament the tracks are followed as well as with it, to within their noise.
TEST(Starts, AnOptimumThatCostsHardlyMoreIsSaid) {
  FitInput input = two_ligaments(3, 0.002);
  input.options.optimiser = "nlopt";
  input.options.starts = 3;
  input.options.start_spread = 8;
  const FitResult result = run_fit(input);
  EXPECT_LT(result.starts[0].final_cost - result.final_cost, 2);
  EXPECT_EQ(result.starts[0].optimum, 2);
  EXPECT_LT(result.starts[0].values[1], 0.003);
  EXPECT_GT(result.parameters[1].value, 1);
  EXPECT_THAT(result.cannot_tell,
              testing::Contains(testing::AllOf(HasSubstr("Another optimum (start 0) costs only 1."),
                                               HasSubstr("left strength 0.00"), HasSubstr("1/mm"))));
}

class ResumedStarts : public testing::Test {
 protected:
  void SetUp() override {
    folder_ = fs::temp_directory_path() / ("rhytid_starts_" + std::to_string(getpid()));
    fs::create_directories(folder_);
    const Camera camera = test::make_camera();
    for (const char* name : {"one", "two"}) {
      const Scene scene = test::drag_scene(
          2, {std::string("/colliders/finger/friction/coefficient=") + (*name == 'o' ? "0.4" : "0.3")});
      input_.clips.push_back({name, {}, scene, {camera}, test::make_tracks(scene, camera, 2, 0.02, 3)});
    }
    input_.options = test::three_parameters();
    input_.options.parameters = {test::fitted("/skin/layers/film/youngs_modulus", 0.5),
                                 test::fitted("/ligaments/stiffness", 0.001)};
    input_.options.starts = 4;
    input_.options.local_fits = 2;
    input_.options.max_evaluations = 3;
    input_.options.screen_frames = 1;
  }
  void TearDown() override { fs::remove_all(folder_); }

  struct Outcome {
    FitResult result;
    std::string record;  ///< without wall clock times
    std::vector<int> counts;
    int fresh = 0, replayed = 0;
  };
  Outcome fit(const std::string& name, int stop_after = 0) {
    Outcome out;
    FitObserver observer;
    observer.run = [&out](const FitProgress& p) {
      ++(p.replayed ? out.replayed : out.fresh);
      out.counts.push_back(p.forward_runs);
    };
    observer.should_stop = [&out, stop_after] { return stop_after > 0 && out.fresh >= stop_after; };
    input_.evaluations = (folder_ / name).string();
    out.result = run_fit(input_, observer);
    const std::string results = (folder_ / (name + "_results")).string();
    fs::create_directories(results);
    write_fit_result(out.result, results);
    auto json = nlohmann::ordered_json::parse(read_file(results + "/fit.json"));
    for (const char* key : {"seconds", "forward_seconds"}) json.erase(key);
    for (auto& step : json["history"]) step.erase("seconds");
    out.record = json.dump() + read_file(results + "/residuals.csv");
    return out;
  }

  fs::path folder_;
  JointFitInput input_;
};

TEST_F(ResumedStarts, EndAtTheSameBits) {
  for (const std::size_t clips : {2u, 1u}) {
    input_.clips.resize(clips);
    const std::string whole_name = "whole" + std::to_string(clips), name = "stopped" + std::to_string(clips);
    const Outcome whole = fit(whole_name);
    EXPECT_FALSE(whole.result.stopped);
    ASSERT_EQ(whole.result.starts.size(), 4u);
    EXPECT_EQ(whole.replayed, 0);
    EXPECT_EQ(whole.result.forward_runs, whole.fresh);
    for (std::size_t i = 0; i < whole.counts.size(); ++i)
      EXPECT_EQ(whole.counts[i], static_cast<int>(i) + 1) << "counted through";
    EXPECT_TRUE(fs::exists(folder_ / whole_name / "screen" / (clips > 1 ? "two" : "") / "identity.json"));

    const Outcome screening = fit(name, 2), searching = fit(name, 4), last = fit(name);
    EXPECT_TRUE(screening.result.stopped);
    EXPECT_TRUE(searching.result.stopped);
    EXPECT_EQ(searching.replayed, 2);
    EXPECT_EQ(last.replayed, 6);
    EXPECT_EQ(last.fresh, whole.fresh - 6);
    EXPECT_EQ(last.record, whole.record);
    const Outcome again = fit(name);
    EXPECT_EQ(again.fresh, 0);
    EXPECT_EQ(again.record, whole.record);
  }
  // More starts keep what is known of those before.
  input_.options.starts = 5;
  const Outcome more = fit("stopped1");
  EXPECT_GE(more.replayed, 4 + 3) << "screening, and the search from the case's own";
  EXPECT_LE(more.fresh, 1 + 3);
}

}  // namespace
}  // namespace rhytid::fitting
