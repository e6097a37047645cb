// Profiles against what is known of them: intervals of linear models, a curve with its own formula, bounds,
// refits made without them; and whole fits that profile, go on after a kill and refuse what is not fitted.
#include "fitting/profile.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <unistd.h>

#include <cmath>
#include <filesystem>
#include <nlohmann/json.hpp>
#include <random>

#include "sim/core/error.h"
#include "sim/output/atomic_file.h"
#include "tests/fitting/hand_made_objective.h"
#include "tests/fitting/synthetic_tracks.h"

namespace rhytid::fitting {
namespace {

namespace fs = std::filesystem;
using test::HandMadeObjective;
using testing::Contains;
using testing::HasSubstr;

constexpr double kNormal = 1.959963984540054;

LocalFit local_fit(const std::string& optimiser = "ceres") {
  return [optimiser](Search& search) {
    const OptimiserOptions options{.max_evaluations = 60};
    return optimiser == "ceres" ? fit_with_ceres(search, options) : fit_with_nlopt(search, options);
  };
}

/// z = A t − b with correlated columns and noise that is no part of the model.
struct LinearModel {
  HandMadeObjective objective = test::parabola(3, 1);
  MatrixXd A;
  VectorXd best;
  double cost = 0;

  explicit LinearModel(double bound = 50) {
    std::mt19937 random(5);
    std::normal_distribution<double> normal;
    A = MatrixXd(30, 3);
    for (double& x : A.reshaped()) x = normal(random);
    A.col(1) += 2 * A.col(0);
    const VectorXd b = A * Vec3(0.3, -0.2, 0.1) + VectorXd::NullaryExpr(30, [&] { return normal(random); });
    for (FitVariable& v : objective.list) v.lower = -bound, v.upper = bound;
    objective.residuals = 30;
    objective.z = [this, b](const VectorXd& t) -> VectorXd { return A * t - b; };
    objective.dz = [this](const VectorXd&) { return A; };
    best = A.colPivHouseholderQr().solve(b);
    cost = 0.5 * (A * best - b).squaredNorm();
  }
  LinearModel(const LinearModel&) = delete;
  LinearModel& operator=(const LinearModel&) = delete;
};

class ProfileBy : public testing::TestWithParam<const char*> {};
INSTANTIATE_TEST_SUITE_P(Optimisers, ProfileBy, testing::Values("ceres", "nlopt"));

TEST_P(ProfileBy, OfALinearModelIsItsInterval) {
  for (const int degrees : {1000000, 8}) {
    LinearModel model;
    const double w = 1.4;
    const Identifiability found(model.A, model.objective.list, w, degrees);
    const double q = student_quantile_975(degrees);
    const MatrixXd covariance = (model.A.transpose() * model.A).inverse();
    for (int k = 0; k < 3; ++k) {
      const ProfileScale scale = profile_scale(found, k, w);
      EXPECT_NEAR(scale.widening, w, 1e-9);
      const double half = q * w * std::sqrt(covariance(k, k));
      const Profile profile =
          profile_of(model.objective, k, model.best, model.cost, scale, local_fit(GetParam()));
      ASSERT_TRUE(profile.low && profile.high);
      EXPECT_NEAR(*profile.low, model.best[k] - half, 1e-3 * half);
      EXPECT_NEAR(*profile.high, model.best[k] + half, 1e-3 * half);
      int runs = 0;
      for (const ProfiledPoint& point : profile.points) {
        runs += point.forward_runs;
        // Where the others end is known too.
        const VectorXd ridge =
            model.best + (point.t_k - model.best[k]) * covariance.col(k) / covariance(k, k);
        EXPECT_LT((point.t - ridge).norm(), 0.02 * half) << point.t_k;
      }
      EXPECT_EQ(runs, profile.forward_runs);
      EXPECT_GE(profile.points.size(), 9u);
    }
  }
}

/// F = ½ s² (e^t − 1)²: the interval is asymmetric, and below there is a floor of ½ s².
HandMadeObjective exponential(double s) {
  HandMadeObjective o;
  o.list = {test::plain_variable("rate", 0, -30, 4)};
  o.residuals = 1;
  o.z = [s](const VectorXd& t) -> VectorXd { return VectorXd::Constant(1, s * std::expm1(t[0])); };
  o.dz = [s](const VectorXd& t) -> MatrixXd { return MatrixXd::Constant(1, 1, s * std::exp(t[0])); };
  return o;
}

ProfileScale scale_of(double sigma, int parameters = 1) {
  ProfileScale scale;
  scale.sigma = sigma;
  scale.valley = VectorXd::Unit(parameters, 0);
  return scale;
}

TEST(Profile, FollowsACurveThatIsNoParabola) {
  const double s = 4;
  HandMadeObjective objective = exponential(s);
  const Profile profile = profile_of(objective, 0, VectorXd::Zero(1), 0, scale_of(1 / s), local_fit());
  ASSERT_TRUE(profile.low && profile.high);
  EXPECT_NEAR(*profile.high, std::log(1 + kNormal / s), 1e-3);
  EXPECT_NEAR(*profile.low, std::log(1 - kNormal / s), 1e-2);
  EXPECT_LT(profile.points.back().t_k, 3 / s) << "ends beyond the 99 % level";
  EXPECT_GT(profile.points.back().cost, 0.5 * 6.6349);
}

TEST(Profile, SaysWhichSideIsOpen) {
  const double s = 1.5;  // the floor is at 2.25, below 3.84
  HandMadeObjective objective = exponential(s);
  const Profile profile = profile_of(objective, 0, VectorXd::Zero(1), 0, scale_of(1 / s), local_fit());
  EXPECT_FALSE(profile.low);
  EXPECT_EQ(profile.points.front().t_k, -30) << "as far as the bound";
  EXPECT_THAT(profile.failure_below, testing::IsEmpty());
  ASSERT_TRUE(profile.high);
  EXPECT_NEAR(*profile.high, std::log(1 + kNormal / s), 1e-2);
  // With the parabola as flat as the model leaves it, steps come from the bounds.
  const Profile wide = profile_of(objective, 0, VectorXd::Zero(1), 0,
                                  scale_of(std::numeric_limits<double>::infinity()), local_fit());
  EXPECT_FALSE(wide.low);
  ASSERT_TRUE(wide.high);
  EXPECT_NEAR(*wide.high, std::log(1 + kNormal / s), 0.1);
}

TEST(Profile, EndsWhereNothingCanBeRun) {
  LinearModel model;
  const Identifiability found(model.A, model.objective.list, 1, 27);
  const ProfileScale scale = profile_scale(found, 0, 1);
  const double limit = model.best[0] + 1.2 * scale.sigma;
  model.objective.fails = [limit](const VectorXd& t) { return t[0] > limit; };
  const Profile profile = profile_of(model.objective, 0, model.best, model.cost, scale, local_fit());
  EXPECT_TRUE(profile.low);
  EXPECT_FALSE(profile.high);
  EXPECT_THAT(profile.failure_above, HasSubstr("no value there"));
  EXPECT_NEAR(profile.points.back().t_k, model.best[0] + scale.sigma, 1e-9);
}

TEST(Profile, StartsAtABound) {
  LinearModel model(0.02);  // the best values lie beyond
  VectorXd t = model.best.cwiseMax(-0.02).cwiseMin(0.02);
  Search search(model.objective, t);
  const OptimiserOutcome best = local_fit()(search);
  const Identifiability found(model.A, model.objective.list, 1, 27);
  const int k = 0;
  ASSERT_EQ(std::fabs(best.t[k]), 0.02);
  const Profile profile =
      profile_of(model.objective, k, best.t, best.cost, profile_scale(found, k, 1), local_fit());
  EXPECT_EQ((best.t[k] > 0 ? profile.points.back() : profile.points.front()).status, "optimum");
  for (const ProfiledPoint& point : profile.points) {
    EXPECT_LE(point.t.cwiseAbs().maxCoeff(), 0.02);
    EXPECT_GE(point.cost, best.cost * (1 - 1e-6));
  }
}

TEST(Profile, FindsThatTheAnswerIsNotTheOptimum) {
  LinearModel model;
  const Identifiability found(model.A, model.objective.list, 1, 27);
  VectorXd wrong = model.best;
  wrong[2] += 3 * found.noise_sigma(Vec3::UnitZ());
  const double cost = model.objective.evaluate(wrong).cost;
  const Profile profile =
      profile_of(model.objective, 0, wrong, cost, profile_scale(found, 0, 1), local_fit());
  double least = cost;
  for (const ProfiledPoint& point : profile.points) least = std::min(least, point.cost);
  EXPECT_LT(least, model.cost + 0.2);
  EXPECT_GT(cost, model.cost + 4);
}

TEST(LastCrossing, IsTheOutermostAndMonotoneBetweenPoints) {
  EXPECT_NEAR(*last_crossing({0, 1, 2, 3}, {0, 1, 2, 3}, 1.96), 1.96, 1e-12);
  // Down again after a first crossing: the last one counts.
  const double x = *last_crossing({0, 1, 2, 3, 4}, {0, 2.2, 1.5, 1.9, 3}, 2);
  EXPECT_GT(x, 3);
  EXPECT_LT(x, 4);
  EXPECT_FALSE(last_crossing({0, 1, 2}, {0, 1, 1.5}, 2));
  EXPECT_FALSE(last_crossing({0}, {3}, 2));
  // A kink must not make it overshoot.
  double before = 0;
  for (double level = 0.05; level < 3; level += 0.05) {
    const double at = *last_crossing({0, 1, 2, 3}, {0, 0.1, 2.9, 3}, level);
    EXPECT_GT(at, before);
    before = at;
  }
}

class ProfiledFit : public testing::Test {
 protected:
  void SetUp() override {
    folder_ = fs::temp_directory_path() / ("rhytid_profile_" + std::to_string(getpid()));
    fs::create_directories(folder_);
    const Scene scene = test::drag_scene(3);
    const Camera camera = test::make_camera();
    FitCase fit = test::three_parameters();
    fit.parameters = {test::fitted("/ligaments/sources/right/strength", 2),
                      test::fitted("/skin/layers/film/youngs_modulus", 0.8)};
    fit.profiles = {"/ligaments/sources/right/strength"};
    input_ = {scene, camera, test::make_tracks(scene, camera, 2, 0.02, 3), fit, {}};
  }
  void TearDown() override { fs::remove_all(folder_); }

  struct Outcome {
    FitResult result;
    std::string record;
    int fresh = 0, replayed = 0;
  };
  Outcome fit(const std::string& name, int stop_after = 0) {
    Outcome out;
    FitObserver observer;
    observer.run = [&out](const FitProgress& p) { ++(p.replayed ? out.replayed : out.fresh); };
    observer.should_stop = [&out, stop_after] { return stop_after > 0 && out.fresh >= stop_after; };
    input_.evaluations = (folder_ / name).string();
    out.result = run_fit(input_, observer);
    const std::string results = (folder_ / (name + "_results")).string();
    fs::create_directories(results);
    write_fit_result(out.result, results);
    auto json = nlohmann::ordered_json::parse(read_file(results + "/fit.json"));
    for (const char* key : {"seconds", "forward_seconds"}) json.erase(key);
    for (auto& step : json["history"]) step.erase("seconds");
    out.record = json.dump() + answer_text(out.result);
    return out;
  }

  fs::path folder_;
  FitInput input_;
};

TEST_F(ProfiledFit, AgreesWithDirectRefitsAndIsResumed) {
  const Outcome whole = fit("whole");
  ASSERT_TRUE(whole.result.converged) << whole.result.status;
  ASSERT_EQ(whole.result.profiles.size(), 1u);
  const ParameterProfile& profile = whole.result.profiles[0];
  ASSERT_TRUE(profile.bounded_above);
  EXPECT_EQ(profile.warning, "");
  EXPECT_EQ(whole.result.forward_runs, whole.fresh);
  EXPECT_GT(profile.forward_runs, 4);
  EXPECT_LT(profile.forward_runs, whole.fresh);
  EXPECT_THAT(answer_text(whole.result), HasSubstr("95 % by profile"));

  // The end of the interval, fitted again from elsewhere and to the end.
  FitProblem problem(input_.scene, input_.options, input_.camera, input_.tracks);
  const double level = 0.5 * std::pow(profile.widening * profile.quantile, 2);
  VectorXd t = problem.initial();
  t[0] = std::log(profile.high95);
  Search search(problem, t, {0});
  const OptimiserOutcome refit = fit_with_ceres(search, {.relative_decrease = 1e-9});
  EXPECT_NEAR(refit.cost - whole.result.final_cost, level, 0.02 * level);
  // The parabola would not do.
  EXPECT_GT(std::fabs(std::log(profile.high95 / profile.linear_high95)), 0.05);

  const Outcome stopped = fit("stopped", whole.fresh - 3), last = fit("stopped");
  EXPECT_TRUE(stopped.result.stopped);
  EXPECT_EQ(last.fresh, 3);
  EXPECT_EQ(last.record, whole.record);
}

TEST_F(ProfiledFit, RefusesWhatIsNotFitted) {
  input_.options.profiles = {"/ligaments/stiffness"};
  try {
    run_fit(input_);
    FAIL() << "accepted";
  } catch (const InputError& error) {
    EXPECT_THAT(error.what(), testing::AllOf(HasSubstr("/ligaments/stiffness"),
                                             HasSubstr("/skin/layers/film/youngs_modulus")));
  }
}

}  // namespace
}  // namespace rhytid::fitting
