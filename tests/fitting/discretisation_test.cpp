// What a finer discretisation would do to an answer: predicted from one run each, against fits of the finer
// scenes to the same tracks.
#include "fitting/discretisation.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <unistd.h>

#include <cmath>
#include <cstdio>
#include <filesystem>

#include "sim/scene/skin_rule.h"
#include "tests/fitting/synthetic_tracks.h"

namespace rhytid::fitting {
namespace {

namespace fs = std::filesystem;
using testing::HasSubstr;

constexpr int kFrames = 4;

/// Film and friction of a drag whose tracks come from the scene that `truth` settings make of it.
FitInput make_input(const std::vector<std::string>& settings, const std::vector<std::string>& truth) {
  std::vector<std::string> all = settings;
  all.insert(all.end(), truth.begin(), truth.end());
  const Camera camera = test::make_camera();
  FitCase fit;
  fit.min_sigma = 0.005;
  fit.consider.emplace();  // elements and steps alone
  fit.parameters = {test::fitted("/skin/layers/film/youngs_modulus", 0.9),
                    test::fitted("/colliders/finger/friction/coefficient", 0.75)};
  return {test::drag_scene(kFrames, settings),
          camera,
          test::make_tracks(test::drag_scene(kFrames, all), camera, 3, 0.02, 7),
          fit,
          {}};
}

VectorXd transformed(const FitResult& result) {
  VectorXd t(result.parameters.size());
  for (Eigen::Index k = 0; k < t.size(); ++k) t[k] = std::log(result.parameters[k].value);
  return t;
}

TEST(FinerScenes, ChangeOneThingEach) {
  const Scene scene = test::drag_scene(2, {"/skin/order=3", "/time/substeps=3"});
  const std::vector<FinerScene> finer = finer_scenes(scene);
  ASSERT_EQ(finer.size(), 3u);
  EXPECT_EQ(finer[0].name, "thickness");
  for (std::size_t i = 0; i < scene.skin.layers.size(); ++i)
    EXPECT_EQ(finer[0].scene.skin.layers[i].order, scene.skin.layers[i].order + 1);
  EXPECT_EQ(finer[0].scene.skin.order, 3);
  EXPECT_EQ(finer[1].scene.skin.order, 4);
  EXPECT_EQ(finer[1].scene.time.substeps, 3);
  EXPECT_EQ(finer[2].scene.time.substeps, 6);
  EXPECT_EQ(finer[2].scene.skin.order, 3);
  EXPECT_THAT(finer[1].change, HasSubstr("order 4"));

  const Scene published =
      test::drag_scene(2, {"/skin/order=4", R"(/skin/scheme="composite")", "/skin/composite_order=2",
                           R"(/skin/quadrature/rule="sheet")"});
  const std::vector<FinerScene> of_published = finer_scenes(published);
  EXPECT_EQ(of_published[0].scene.skin.scheme, ThicknessScheme::stacked);
  EXPECT_EQ(of_published[0].scene.skin.rule, RuleKind::product);
  EXPECT_EQ(of_published[1].scene.skin.order, 3) << "there is no higher one";
  for (const FinerScene& one : of_published) EXPECT_NO_THROW(SceneModel{one.scene}) << one.change;
}

// A rule of more points than the default stays one, or the shift would be that of the rule.
TEST(FinerScenes, KeepTheRule) {
  const Scene full = test::drag_scene(2, {"/skin/order=3", "/skin/quadrature/rule=full"});
  for (const FinerScene& one : finer_scenes(full))
    EXPECT_EQ(one.scene.skin.rule, RuleKind::full) << one.change;
  const Scene given = test::drag_scene(
      2, {"/skin/order=3", "/skin/quadrature/triangle_degree=8", "/skin/quadrature/thickness_points=3"});
  const std::vector<FinerScene> finer = finer_scenes(given);
  EXPECT_EQ(finer[0].scene.skin.triangle_degree, 8);
  EXPECT_EQ(finer[0].scene.skin.thickness_points, 0);
  EXPECT_EQ(finer[1].scene.skin.thickness_points, 3);
  EXPECT_EQ(finer[2].scene.skin.triangle_degree, 8);
}

// Points that are enough for the scene's own orders need not be for one more.
TEST(FinerScenes, HaveRulesThatSeeEveryDeformation) {
  for (const Scene& scene :
       {test::drag_scene(2, {"/skin/order=3", "/skin/quadrature/triangle_degree=4",
                             "/skin/quadrature/thickness_points=3"}),
        test::drag_scene(2, {"/skin/order=3", R"(/skin/scheme="composite")", "/skin/composite_order=3",
                             "/skin/quadrature/triangle_degree=4"}),
        test::drag_scene(2, {"/skin/order=3", "/skin/quadrature/prism_degree=5"})})
    for (const FinerScene& one : finer_scenes(scene))
      for (const SkinRuleCheck& check : check_skin_rules(one.scene.skin))
        EXPECT_FALSE(check.sees_too_little()) << one.change;
}

TEST(Discretisation, ShiftsAreWhatFinerFitsFind) {
  FitInput input =
      make_input({R"(/skin/scheme="composite")", "/skin/composite_order=3", "/skin/order=3"}, {});
  const FitResult coarse = run_fit(input);
  std::printf("%s", answer_text(coarse).c_str());
  ASSERT_TRUE(coarse.converged);
  ASSERT_EQ(coarse.systematic.size(), 3u);
  const std::vector<FinerScene> finer = finer_scenes(input.scene);
  VectorXd squares = VectorXd::Zero(2);
  for (std::size_t r = 0; r < finer.size(); ++r) {
    const SystematicShift& predicted = coarse.systematic[r];
    ASSERT_EQ(predicted.failure, "");
    FitInput again = input;
    again.scene = finer[r].scene;
    again.options.discretisation_check = false;
    for (std::size_t k = 0; k < 2; ++k) again.options.parameters[k].initial = coarse.parameters[k].value;
    const FitResult fitted = run_fit(again);
    const VectorXd moved = transformed(fitted) - transformed(coarse);
    const Eigen::Map<const VectorXd> shift(predicted.shift.data(), 2);
    std::printf("%s: predicted %+.4f %+.4f, found %+.4f %+.4f\n", predicted.name.c_str(), shift[0], shift[1],
                moved[0], moved[1]);
    EXPECT_LT((moved - shift).norm(), 0.25 * moved.norm() + 1e-3) << predicted.change;
    EXPECT_GT(predicted.rms_px, 0);
    squares += shift.cwiseAbs2();
  }
  // The rest of the variance is what a fit without the check reports.
  input.options.discretisation_check = false;
  const FitResult without = run_fit(input);
  EXPECT_TRUE(without.systematic.empty());
  for (int k = 0; k < 2; ++k) {
    const double noise = without.parameters[k].sigma, all = coarse.parameters[k].sigma;
    EXPECT_NEAR(all * all, noise * noise + squares[k], 1e-9 * all * all);
    EXPECT_LT(coarse.parameters[k].low95, without.parameters[k].low95);
  }
}

TEST(Discretisation, RunsAreKeptAndAStopIsAStop) {
  const std::string folder =
      (fs::temp_directory_path() / ("rhytid_discretisation_" + std::to_string(getpid()))).string();
  FitInput input = make_input({"/skin/order=2"}, {});
  input.evaluations = folder;
  int polls = 0;
  bool is_checking = false;
  FitObserver observer;
  observer.note = [&](const std::string& text) {
    is_checking = is_checking || text.starts_with("discretisation");
  };
  observer.should_stop = [&] { return is_checking && ++polls > 3; };
  const FitResult stopped = run_fit(input, observer);
  EXPECT_TRUE(stopped.stopped);
  EXPECT_FALSE(stopped.converged);

  const FitResult first = run_fit(input), again = run_fit(input);
  ASSERT_EQ(first.systematic.size(), 3u);
  for (std::size_t r = 0; r < 3; ++r) {
    EXPECT_TRUE(fs::exists(fs::path(folder) / ("finer_" + first.systematic[r].name) / "identity.json"));
    EXPECT_EQ(first.systematic[r].shift, again.systematic[r].shift) << "to the last bit";
    EXPECT_LT(again.systematic[r].seconds, 0.5 * first.systematic[r].seconds + 0.05);
  }
  for (std::size_t k = 0; k < 2; ++k) EXPECT_EQ(first.parameters[k].low95, again.parameters[k].low95);
  fs::remove_all(folder);
}

}  // namespace
}  // namespace rhytid::fitting
