// Grids and tables of parameters: which runs they make, and what is refused.
#include "tools/study/parameter_sets.h"

#include <gmock/gmock.h>

#include <filesystem>

#include "sim/core/error.h"
#include "sim/output/atomic_file.h"
#include "tools/study/study_run.h"

namespace rhytid::tools {
namespace {

using testing::ElementsAre;
using testing::HasSubstr;

std::vector<std::string> settings_of(const Variant& v) {
  std::vector<std::string> texts;
  for (const Setting& s : v.settings) texts.push_back(s.text);
  return texts;
}

template <class Call>
std::string refusal(Call call) {
  try {
    call();
  } catch (const InputError& error) {
    return error.what();
  }
  return "";
}

class TableFile : public testing::Test {
 protected:
  TableFile() : path_((std::filesystem::temp_directory_path() / "rhytid_parameter_sets.csv").string()) {}
  ~TableFile() override { std::filesystem::remove(path_); }
  std::vector<ParameterSet> read(const std::string& text) {
    write_file(path_, text);
    return table_sets(path_);
  }
  std::string error_of(const std::string& text) {
    return refusal([&] { read(text); });
  }
  std::string path_;
};

TEST(GridSets, AreAllCombinationsTheLastRunningFastest) {
  const auto sets = grid_sets({"/a=1,2 kPa", "/b/c=x,y,z"});
  ASSERT_EQ(sets.size(), 6u);
  EXPECT_EQ(sets[0].name, "0001");
  EXPECT_EQ(sets[5].name, "0006");
  EXPECT_EQ(sets[1].values[0].text, "1");
  EXPECT_EQ(sets[1].values[1].text, "y");
  EXPECT_EQ(sets[3].values[0].text, "2 kPa");
  EXPECT_EQ(sets[3].values[1].address, "/b/c");
}

TEST(GridSets, RefuseWhatIsNoGrid) {
  EXPECT_THAT(refusal([] { grid_sets({"a=1"}); }), HasSubstr("--grid: got 'a=1', expected"));
  EXPECT_THAT(refusal([] { grid_sets({"/a"}); }), HasSubstr("'/a'"));
  EXPECT_THAT(refusal([] { grid_sets({"/a="}); }), HasSubstr("'/a='"));
  EXPECT_THAT(refusal([] { grid_sets({"/a=1,,2"}); }), HasSubstr("a value between all commas"));
  EXPECT_THAT(refusal([] { grid_sets({"/a=1,"}); }), HasSubstr("a value between all commas"));
  EXPECT_THAT(refusal([] { grid_sets({"/a=1", "/a=2"}); }), HasSubstr("/a a second time"));
}

TEST(GridSets, MultiplyTheVariantsOfAnExperiment) {
  Experiment e = experiment_of_scene("folder/scene.json");
  EXPECT_EQ(e.name, "folder");
  const auto of_scene = with_parameter_sets(e, grid_sets({"/a=1,2"}));
  ASSERT_EQ(of_scene.variants.size(), 2u);
  EXPECT_EQ(of_scene.variants[1].name, "0002");
  EXPECT_THAT(settings_of(of_scene.variants[1]), ElementsAre("/a=2"));
  e.variants = {{"soft", {{"/k=0"}}, {}}, {"firm", {{"/k=9"}}, {}}};
  const auto swept = with_parameter_sets(e, grid_sets({"/a=1,2"}));
  ASSERT_EQ(swept.variants.size(), 4u);
  EXPECT_EQ(swept.variants[2].name, "firm.0001");
  EXPECT_THAT(settings_of(swept.variants[3]), ElementsAre("/k=9", "/a=2"));
  // Each run has a folder of its own.
  e.variants = {{"a", {}, {}}, {"a.b", {}, {}}};
  EXPECT_THAT(refusal([&] {
                with_parameter_sets(e, {{"b.c", {}, "sets.csv:2"}, {"c", {}, "sets.csv:3"}});
              }),
              HasSubstr("sets.csv:3: got two runs called 'a.b.c'"));
}

TEST_F(TableFile, HasARowPerRunAndKnowsItsLines) {
  const auto sets = read("# comment\n/skin/order, name, /a\n2, coarse, 20 kPa\n\n3,fine,30 kPa\n");
  ASSERT_EQ(sets.size(), 2u);
  EXPECT_EQ(sets[1].name, "fine");
  EXPECT_EQ(sets[1].values[1].text, "30 kPa");
  EXPECT_EQ(sets[1].origin, path_ + ":5");
  EXPECT_EQ(read("/a\n1\n2\n")[1].name, "0002");
}

TEST_F(TableFile, IsRefusedWithTheLine) {
  EXPECT_THAT(error_of("a\n1\n"), HasSubstr(":1: got \"a\", expected an address as"));
  EXPECT_THAT(error_of("/a,/a\n1,2\n"), HasSubstr("/a a second time"));
  EXPECT_THAT(error_of("/a,/b\n1\n"), HasSubstr(":2"));
  EXPECT_THAT(error_of("/a,/b\n1,\n"), HasSubstr(":2: got an empty cell, expected a value for /b"));
  EXPECT_THAT(error_of("name,/a\nx,1\nx,2\n"), HasSubstr(":3: got \"x\" a second time"));
  EXPECT_THAT(error_of("name,/a\nx y,1\n"), HasSubstr("letters, digits"));
  EXPECT_THAT(error_of("/a\n"), HasSubstr("no rows"));
}

TEST(Shards, TakeEveryRunOnce) {
  for (int run = 0; run < 10; ++run) {
    int taken = 0;
    for (const char* part : {"1/3", "2/3", "3/3"}) taken += parse_shard(part).takes(run);
    EXPECT_EQ(taken, 1) << run;
    EXPECT_TRUE(parse_shard("").takes(run));
  }
  EXPECT_TRUE(parse_shard("2/3").takes(1));
  for (const char* bad : {"0/3", "4/3", "1", "a/b", "1/2/3", "1/", "-1/2"})
    EXPECT_THAT(refusal([&] { parse_shard(bad); }), HasSubstr("--shard")) << bad;
}

}  // namespace
}  // namespace rhytid::tools
