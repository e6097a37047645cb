// bench pareto: the front, the errors, what an experiment file may compare.
#include <gmock/gmock.h>

#include <cmath>
#include <limits>

#include "sim/core/error.h"
#include "sim/output/atomic_file.h"
#include "tests/support/small_scenes.h"
#include "tests/support/temporary_folder.h"
#include "tools/bench/pareto_report.h"
#include "tools/study/experiment.h"

namespace rhytid::tools {
namespace {

using testing::ElementsAre;
using testing::HasSubstr;

TEST(ParetoFront, HoldsWhatNothingBeats) {
  const double nan = std::numeric_limits<double>::quiet_NaN();
  EXPECT_THAT(pareto_front({{1, 8}, {2, 9}, {3, 2}, {3, 3}, {4, 2}, {5, nan}, {6, 1}}),
              ElementsAre(true, false, true, false, false, false, true));
  // Twins do not beat each other.
  EXPECT_THAT(pareto_front({{1, 1}, {1, 1}}), ElementsAre(true, true));
}

ParetoRun run_of(const MatrixXd& displacements, std::vector<ResultColumn> columns) {
  ParetoRun run;
  run.result.status = "complete";
  run.result.columns = std::move(columns);
  run.displacements = displacements;
  run.forces = displacements.leftCols(2);
  return run;
}

TEST(ParetoErrors, AreRootMeanSquaresOverWhatBothHave) {
  const double nan = std::numeric_limits<double>::quiet_NaN();
  MatrixXd truth(3, 3), seen(3, 3);
  truth << 3, 0, 0, 0, 4, 0, nan, nan, nan;
  seen << 3, 0, 0.3, 0, 4, 0.4, 9, 9, 9;
  const ParetoRun reference = run_of(
      truth,
      {{"wavelength", "mm", 4.}, {"d_mean_square_by /a", "mm2", 3.}, {"d_mean_square_by /b", "mm2", 4.}});
  const ParetoRun run = run_of(
      seen,
      {{"wavelength", "mm", 3.}, {"d_mean_square_by /a", "mm2", 3.}, {"d_mean_square_by /b", "mm2", 4.5}});
  auto errors = errors_against(run, reference);
  EXPECT_NEAR(errors["displacement"], 0.1, 1e-15);
  EXPECT_NEAR(errors["displacement_mm"], 0.5 / std::sqrt(2.), 1e-15);
  EXPECT_NEAR(errors["wavelength"], 0.25, 1e-15);
  EXPECT_NEAR(errors["gradient"], 0.1, 1e-15);
  EXPECT_EQ(errors["force"], 0) << "the error is all in the third component";
  EXPECT_EQ(errors.count("amplitude"), 0U);
  // Other frames, other points, other parameters: nothing to compare.
  errors = errors_against(run_of(seen.topRows(2), {{"d_mean_square_by /a", "mm2", 3.}}), reference);
  EXPECT_EQ(errors.count("displacement"), 0U);
  EXPECT_EQ(errors.count("gradient"), 0U);
}

class ParetoFile : public testing::Test {
 protected:
  ParetoFile() { write_file(folder_ / "scene.json", test::drag_scene(1, 1)); }

  Experiment load(const std::string& groups, const std::string& size = "[8, 6]") const {
    write_file(folder_ / "pareto.json",
               R"({"scene": "scene.json", "compare": {"window": {"centre": [0, 0, 0], "size": )" + size +
                   R"(}, "groups": [)" + groups + R"(]},
      "variants": [{"name": "coarse"}, {"name": "fine"}, {"name": "finer", "size": "full"}]})");
    return load_experiment(folder_ / "pareto.json", StudySize::quick);
  }
  std::string refusal(const std::string& groups, const std::string& size = "[8, 6]") const {
    try {
      load(groups, size);
    } catch (const InputError& error) {
      return error.what();
    }
    return "";
  }

  test::TemporaryFolder folder_;
};

TEST_F(ParetoFile, GroupsCompareVariantsThatAreRun) {
  const Experiment e = load(
      R"({"name": "a", "reference": "fine", "variants": ["coarse", "finer"]},
         {"name": "b", "reference": "finer", "variants": ["coarse"]},
         {"name": "c", "reference": "fine", "variants": ["finer"]})");
  ASSERT_TRUE(e.comparison.has_value());
  ASSERT_EQ(e.comparison->groups.size(), 1U) << "at this size b has no reference and c nothing to compare";
  EXPECT_EQ(e.comparison->groups[0].name, "a");
  EXPECT_THAT(e.comparison->groups[0].variants, ElementsAre("coarse"));
  EXPECT_EQ(e.comparison->spacing, 0.5);
  EXPECT_TRUE(e.comparison->parameters.empty());
}

TEST_F(ParetoFile, WhatCannotBeComparedIsRefusedByPlace) {
  const std::string good = R"({"name": "a", "reference": "fine", "variants": ["coarse"]})";
  EXPECT_EQ(refusal(good), "");
  EXPECT_THAT(refusal(good + "," + good), HasSubstr("/compare/groups/1/name"));
  EXPECT_THAT(refusal(R"({"name": "a/b", "reference": "fine", "variants": ["coarse"]})"),
              HasSubstr("/compare/groups/0/name"));
  EXPECT_THAT(refusal(R"({"name": "a", "reference": "best", "variants": ["coarse"]})"),
              HasSubstr("/compare/groups/0/reference"));
  EXPECT_THAT(refusal(R"({"name": "a", "reference": "fine", "variants": ["coarse", "fine"]})"),
              HasSubstr("/compare/groups/0/variants/1"));
  EXPECT_THAT(refusal(R"({"name": "a", "reference": "fine", "variants": []})"),
              HasSubstr("/compare/groups/a/variants"));
  EXPECT_THAT(refusal(good, "[8, 0.1]"), HasSubstr("/compare/window/size"));
}

}  // namespace
}  // namespace rhytid::tools
