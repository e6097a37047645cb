// Ranges of parameters, and screenings of a tiny scene through the verb.
#include "tools/study/screen.h"

#include <gmock/gmock.h>

#include <cmath>
#include <map>

#include "sim/core/csv_reader.h"
#include "sim/core/error.h"
#include "sim/scene/load.h"
#include "tests/tools/study_call.h"

namespace rhytid::tools {
namespace {

using testing::HasSubstr;
using testing::Not;

ParameterSpec spec(double value, double lower, double upper, ParameterTransform transform) {
  return {.address = "/x",
          .name = "x",
          .unit = "",
          .dimension = {},
          .lower = lower,
          .upper = upper,
          .transform = transform,
          .value = value};
}

TEST(ParameterRange, IsEvenInTheCoordinate) {
  const ParameterRange log = range_around(spec(2, 0.01, 100, ParameterTransform::log), 3);
  EXPECT_NEAR(log.at(0), 2 / 3., 1e-14);
  EXPECT_NEAR(log.at(0.5), 2, 1e-14);
  EXPECT_NEAR(log.at(1), 6, 1e-14);
  const ParameterRange logit = range_around(spec(0.2, 0, 1, ParameterTransform::logit), 4);
  EXPECT_NEAR(logit.at(0), 1 / 17., 1e-14);  // odds 1/16, 1/4, 1
  EXPECT_NEAR(logit.at(0.5), 0.2, 1e-14);
  EXPECT_NEAR(logit.at(1), 0.5, 1e-14);
  // Places: half of what a fit may move them, wherever the origin is.
  for (const double origin : {0.0, -2.0, 300.0}) {
    const ParameterRange plain =
        range_around(spec(origin, origin - 5, origin + 5, ParameterTransform::none), 2);
    EXPECT_NEAR(plain.at(0), origin - 2.5, 1e-12);
    EXPECT_NEAR(plain.at(0.75), origin + 1.25, 1e-12);
  }
  // Cut at the bounds of a fit.
  EXPECT_EQ(range_around(spec(90, 0.01, 100, ParameterTransform::log), 3).at(1), 100);
  for (const double factor : {1.0, std::nan(""), std::numeric_limits<double>::infinity()})
    EXPECT_THROW(range_around(spec(2, 0, 9, ParameterTransform::log), factor), InputError);
}

TEST(ParameterRange, TablesAreRefusedWithTheLine) {
  const StudyPlace place;
  const Scene scene = load_scene(place.at("scene.json"));
  const auto error_of = [&](const std::string& text) -> std::string {
    write_file(place.at("ranges.csv"), text);
    try {
      read_ranges(place.at("ranges.csv"), scene);
    } catch (const InputError& error) {
      return error.what();
    }
    return "";
  };
  EXPECT_EQ(error_of("address,lower,upper\n/ligaments/stiffness,0.2 kPa,1 kPa\n"), "");
  EXPECT_NEAR(read_ranges(place.at("ranges.csv"), scene)[0].upper, 1e-3, 1e-18);
  EXPECT_THAT(error_of("/ligaments/stiffness,1,2\n"),
              HasSubstr(":1: got '/ligaments/stiffness,1,2', expected address,lower,upper"));
  const std::string header = "address,lower,upper\n";
  EXPECT_THAT(error_of(header + "/ligaments/stifness,1,2\n"), HasSubstr("ranges.csv:2: "));
  EXPECT_THAT(error_of(header + "/ligaments/stifness,1,2\n"), HasSubstr("/ligaments/stiffness"));
  EXPECT_THAT(error_of(header + "/ligaments/stiffness,1 mm,2\n"), HasSubstr(":2: lower"));
  EXPECT_THAT(error_of(header + "/ligaments/stiffness,2,1\n"), HasSubstr("the lower bound first"));
  EXPECT_THAT(error_of(header + "/ligaments/stiffness,-1,1\n"), HasSubstr(":2: "));
  EXPECT_THAT(error_of(header), HasSubstr("no rows"));
}

/// Cells of a table by its header, one map per row.
std::vector<std::map<std::string, std::string>> rows_of(const std::string& path) {
  std::istringstream lines(read_file(path));
  std::vector<std::string> header;
  std::vector<std::map<std::string, std::string>> rows;
  for_csv_lines(lines, path, [&](const CsvLine& line) {
    if (header.empty()) {
      header = line.cells;
      return;
    }
    rows.emplace_back();
    for (std::size_t k = 0; k < header.size(); ++k) rows.back()[header[k]] = line.cells[k];
  });
  return rows;
}

const std::vector<std::string> kTwoParameters = {"--parameter",    "/colliders/finger/stiffness",
                                                 "--parameter",    "/skin/layers/soft/youngs_modulus",
                                                 "--trajectories", "2"};

std::vector<std::string> with(std::vector<std::string> list, const std::vector<std::string>& more) {
  list.insert(list.end(), more.begin(), more.end());
  return list;
}

TEST(Screen, RanksParametersAndKeepsItsRuns) {
  const StudyPlace place;
  const Outcome first = place.call("screen", "scene.json", kTwoParameters);
  ASSERT_EQ(first.code, 0) << first.err;
  for (const char* file :
       {"out/runs.csv", "out/effects.csv", "out/force_finger.svg", "out/force_finger_ranking.svg",
        "out/index.html", "out/screen.txt", "out/runs/00001/variant.json"})
    EXPECT_TRUE(place.has(file)) << file;
  std::map<std::string, std::map<std::string, std::string>> of_force;
  for (auto& row : rows_of(place.at("out/effects.csv")))
    if (row["output"] == "force_finger") of_force[row["address"]] = row;
  ASSERT_EQ(of_force.size(), 2u);
  // A stiffer skin presses harder, and the softer of two springs in a row decides.
  const double of_skin = std::stod(of_force["/skin/layers/soft/youngs_modulus"]["mu"]);
  EXPECT_GT(of_skin, 0);
  EXPECT_EQ(of_force["/skin/layers/soft/youngs_modulus"]["count"], "2");
  // The effects are those of the table of runs.
  const auto runs = rows_of(place.at("out/runs.csv"));
  ASSERT_EQ(runs.size(), 6u);
  double sum = 0;
  for (std::size_t i = 0; i + 1 < runs.size(); ++i) {
    const auto value = [&](std::size_t k, const char* column) { return std::stod(runs[k].at(column)); };
    const double from = value(i, "/skin/layers/soft/youngs_modulus"),
                 to = value(i + 1, "/skin/layers/soft/youngs_modulus");
    if (i == 2 || from == to) continue;  // between trajectories, or the other parameter
    sum +=
        (value(i + 1, "force_finger_N") - value(i, "force_finger_N")) / (std::log(to / from) / std::log(4.0));
  }
  EXPECT_NEAR(of_skin, sum / 2, 1e-9 * std::abs(sum));

  const std::string table = place.text("out/runs.csv"), effects = place.text("out/effects.csv");
  const Outcome again = place.call("screen", "scene.json", kTwoParameters);
  EXPECT_EQ(again.code, 0);
  EXPECT_THAT(again.err, HasSubstr("runs finished before"));
  EXPECT_EQ(place.text("out/effects.csv"), effects);
  // Of another method and other outputs, the plots of the first go; what is not the screening's stays.
  const std::string mine = "mine";
  write_file(place.at("out/force_mine.svg"), mine);
  EXPECT_TRUE(place.has("out/rms_displacement.svg"));
  EXPECT_EQ(place.call("screen", "scene.json", with(kTwoParameters, {"--sobol", "2"})).code, 0);
  for (const char* file : {"effects.csv", "rms_displacement.svg", "force_finger.svg", "max_displacement.svg"})
    EXPECT_FALSE(place.has(std::string("out/") + file)) << file;
  EXPECT_TRUE(place.has("out/rms_displacement_ranking.svg"));
  EXPECT_EQ(place.text("out/force_mine.svg"), mine);
  // Other settings are other runs.
  const Outcome other = place.call("screen", "scene.json", with(kTwoParameters, {"--set", "/time/frames=1"}));
  EXPECT_EQ(other.code, 0) << other.err;
  EXPECT_THAT(other.err, Not(HasSubstr("runs finished before")));
  EXPECT_NE(place.text("out/runs.csv"), table);
}

TEST(Screen, ShardsTogetherMakeTheWhole) {
  const StudyPlace place, whole;
  ASSERT_EQ(whole.call("screen", "scene.json", kTwoParameters).code, 0);
  const Outcome part = place.call("screen", "scene.json", with(kTwoParameters, {"--shard", "1/2"}));
  EXPECT_EQ(part.code, 0) << part.err;
  EXPECT_THAT(part.out, HasSubstr("the figures are preliminary"));
  EXPECT_THAT(part.out, HasSubstr("part 1 of 2 is in"));
  EXPECT_EQ(place.call("screen", "scene.json", with(kTwoParameters, {"--shard", "2/2"})).code, 0);
  EXPECT_FALSE(place.has("out/runs.csv")) << "parts make no tables";
  EXPECT_EQ(place.call("screen", "scene.json", kTwoParameters).code, 0);
  EXPECT_EQ(place.text("out/runs.csv"), whole.text("out/runs.csv"));
  EXPECT_EQ(place.text("out/effects.csv"), whole.text("out/effects.csv"));
}

TEST(Screen, SobolIndicesOfAPairThroughTheVerb) {
  const StudyPlace place;
  const Outcome call =
      place.call("screen", "scene.json", with(kTwoParameters, {"--sobol", "4", "--factor", "1.5"}));
  ASSERT_EQ(call.code, 0) << call.err;
  const auto rows = rows_of(place.at("out/indices.csv"));
  EXPECT_EQ(rows.size(), 3u * 2u);
  for (const auto& row : rows) EXPECT_EQ(row.at("count"), "4");
  EXPECT_EQ(rows_of(place.at("out/runs.csv")).size(), 16u);
  EXPECT_FALSE(place.has("out/effects.csv"));
}

TEST(Screen, RunsThatDoNotConvergeAreCountedAndLeftOut) {
  const StudyPlace place;
  const Outcome call = place.call(
      "screen", "scene.json",
      with(kTwoParameters, {"--set", "/solver/max_iterations=1", "--set", "/time/max_bisections=0"}));
  EXPECT_EQ(call.code, 3);
  EXPECT_THAT(call.out, HasSubstr("did not converge and do not count"));
  EXPECT_TRUE(place.has("out/effects.csv")) << "none of them ran, and it is a Morris screening all the same";
  EXPECT_FALSE(place.has("out/indices.csv"));
}

TEST(Screen, RefusesInOneLine) {
  const StudyPlace place;
  const auto error_of = [&](const std::vector<std::string>& more) {
    const Outcome call = place.call("screen", "scene.json", more);
    EXPECT_EQ(call.code, 2) << call.err;
    EXPECT_EQ(std::count(call.err.begin(), call.err.end(), '\n'), 1) << call.err;
    EXPECT_FALSE(place.has("out"));
    return call.err;
  };
  EXPECT_THAT(error_of({"--parameter", "/ligaments/stifness"}), HasSubstr("/ligaments/stiffness"));
  EXPECT_THAT(error_of({"--factor", "1"}), HasSubstr("--factor: got 1, expected a number above 1"));
  EXPECT_THAT(error_of({"--set", "/time/frames=0"}), HasSubstr("/time/frames: got 0, expected at least one"));
  EXPECT_THAT(error_of({"--shard", "3/2"}), HasSubstr("--shard: got '3/2'"));
  EXPECT_THAT(error_of({"--levels", "3"}), HasSubstr("--levels"));
  EXPECT_THAT(error_of({"--variant", "x"}), HasSubstr("--variant"));
}

}  // namespace
}  // namespace rhytid::tools
