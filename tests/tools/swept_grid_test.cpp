// Sweeps over a grid and a table, through the verb.
#include <gmock/gmock.h>

#include "tests/tools/study_call.h"

namespace rhytid::tools {
namespace {

using testing::HasSubstr;
using testing::Not;

const std::vector<std::string> kQuiet = {"--set", "/output/pictures=false", "--set", "/output/vtu=false"};

std::vector<std::string> quiet(const std::vector<std::string>& more) {
  std::vector<std::string> list = kQuiet;
  list.insert(list.end(), more.begin(), more.end());
  return list;
}

TEST(SweptGrid, OfASceneRunsInShardsAndKeepsWhatIsFinished) {
  const StudyPlace place;
  const std::vector<std::string> grid = quiet(
      {"--grid", "/skin/layers/soft/youngs_modulus=20 kPa,40 kPa", "--grid", "/ligaments/stiffness=0.0005"});
  auto part = grid;
  part.insert(part.end(), {"--shard", "2/2"});
  const Outcome second = place.call("sweep", "scene.json", part);
  ASSERT_EQ(second.code, 0) << second.err;
  EXPECT_THAT(second.out, HasSubstr("part 2 of 2 is in " + place.at("out")));
  EXPECT_TRUE(place.has("out/0002/variant.json"));
  for (const char* table : {"results.csv", "results.md", "index.html"})  // another machine may be writing
    EXPECT_FALSE(place.has(std::string("out/") + table)) << table;
  const Outcome all = place.call("sweep", "scene.json", grid);
  ASSERT_EQ(all.code, 0) << all.err;
  EXPECT_THAT(all.err, HasSubstr("0002: complete before, kept"));
  EXPECT_THAT(all.err, HasSubstr("0001: starts"));
  const std::string csv = place.text("out/results.csv");
  EXPECT_THAT(csv, HasSubstr("variant,status,/skin/layers/soft/youngs_modulus,/ligaments/stiffness,faces,"));
  EXPECT_THAT(csv, HasSubstr("\n0001,complete,20 kPa,"));
  EXPECT_THAT(csv, HasSubstr("\n0002,complete,40 kPa,"));
  EXPECT_THAT(place.text("out/results.md"), HasSubstr("| 0002 | complete | 40 kPa | 0.0005 |"));
}

TEST(SweptGrid, OfATableTakesItsNames) {
  const StudyPlace place;
  write_file(place.at("table.csv"), "name,/skin/layers/soft/youngs_modulus\nsoft,20 kPa\n");
  const Outcome call = place.call("sweep", "scene.json", quiet({"--csv", place.at("table.csv")}));
  ASSERT_EQ(call.code, 0) << call.err;
  EXPECT_TRUE(place.has("out/soft/steps.csv"));
}

TEST(SweptGrid, RefusesInOneLine) {
  const StudyPlace place;
  write_file(place.at("table.csv"), "/skin/ordr\n2\n");
  const auto error_of = [&](const std::vector<std::string>& more) {
    const Outcome call = place.call("sweep", "scene.json", more);
    EXPECT_EQ(call.code, 2) << call.err;
    EXPECT_EQ(std::count(call.err.begin(), call.err.end(), '\n'), 1) << call.err;
    EXPECT_FALSE(place.has("out"));
    return call.err;
  };
  EXPECT_THAT(error_of({"--csv", place.at("table.csv")}), HasSubstr("table.csv:2: /skin/ordr: got"));
  EXPECT_THAT(error_of({"--csv", place.at("none.csv")}), HasSubstr("none.csv"));
  EXPECT_THAT(error_of({"--grid", "/skin/surface/grid/cells=1"}),
              HasSubstr("--set: got /skin/surface/grid/cells"));
  EXPECT_THAT(error_of({"--grid", "/skin/order=2,9"}), HasSubstr("0002"));
  EXPECT_THAT(error_of({"--grid", "/skin/layers/0/youngs_modulus=0.02,0.04", "--set",
                        "/skin/layers/soft/youngs_modulus=0.03"}),
              HasSubstr("--set: got /skin/layers/soft/youngs_modulus=0.03, which the sweep sets"));
}

TEST(SweptGrid, AndPlanDoNotShareAFolder) {
  const StudyPlace place;
  const std::string file = place.at("press/experiment.json");
  std::filesystem::create_directories(place.at("press"));
  write_file(file, R"({"scene": "../scene.json", "settings": ["/skin/surface/grid/cells=[4,3]",
    "/output/pictures=false", "/output/vtu=false"], "variants": [{"name": "a"}, {"name": "b"}]})");
  const auto before = std::filesystem::current_path();
  std::filesystem::current_path(place.at(""));
  const std::vector<std::string> unknown = {"--parameter", "/ligaments/stiffness"};
  const auto call = [&](std::vector<std::string> arguments, bool has_unknown = true) {
    if (has_unknown) arguments.insert(arguments.end(), unknown.begin(), unknown.end());
    return call_study(arguments);
  };
  // Folders by default: of the folder of experiment.json, of variants, of studies.
  EXPECT_EQ(call({"sweep", file, "--only", "a"}, false).code, 0);
  const std::string results = place.text("run/press_quick/results.csv");
  EXPECT_EQ(call({"plan", file}).code, 0);
  EXPECT_TRUE(place.has("run/press_quick_plan/swipes.csv"));
  EXPECT_EQ(place.text("run/press_quick/results.csv"), results);
  EXPECT_EQ(call({"sensitivity", file, "--variant", "b", "--size", "full"}).code, 0);
  EXPECT_TRUE(place.has("run/press_b_full_sensitivity/sensitivity.json"));
  EXPECT_EQ(call({"sensitivity", file}).code, 0);
  EXPECT_TRUE(place.has("run/press_sensitivity/sensitivity.json"));
  // Led into each other's they are refused, and change nothing.
  const Outcome plan = call({"plan", file, "-o", "run/press_quick"});
  EXPECT_EQ(plan.code, 2);
  EXPECT_THAT(plan.err, HasSubstr("run/press_quick/a: got a run of a sweep"));
  EXPECT_FALSE(place.has("run/press_quick/swipes.csv"));
  const std::string swipe = place.text("run/press_quick_plan/a/variant.json");
  const Outcome sweep = call({"sweep", file, "-o", "run/press_quick_plan"}, false);
  EXPECT_EQ(sweep.code, 2);
  EXPECT_THAT(sweep.err, HasSubstr("run/press_quick_plan/a: got a swipe of `study plan`"));
  EXPECT_EQ(place.text("run/press_quick_plan/a/variant.json"), swipe);
  std::filesystem::current_path(before);
}

}  // namespace
}  // namespace rhytid::tools
