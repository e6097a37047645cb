// Grids and tables of parameters: which runs they make, and what is refused.
#include "tools/study/parameter_sets.h"

#include <gmock/gmock.h>

#include "sim/core/error.h"
#include "sim/output/atomic_file.h"
#include "tests/support/small_scenes.h"
#include "tests/support/temporary_folder.h"
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
  std::vector<ParameterSet> read(const std::string& text) {
    write_file(path_, text);
    return table_sets(path_);
  }
  std::string error_of(const std::string& text) {
    return refusal([&] { read(text); });
  }
  const test::TemporaryFolder folder_;
  const std::string path_ = folder_ / "parameter_sets.csv";
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
  // That of a table is no folder's, however it is put together.
  e.variants = {{"results", {}, {}}, {"swipes", {}, {}}};
  EXPECT_THAT(refusal([&] {
                with_parameter_sets(e, {{"csv", {}, "sets.csv:2"}});
              }),
              HasSubstr("sets.csv:2: got \"results.csv\", which is a file of the sweep"));
  e.variants.erase(e.variants.begin());
  EXPECT_THAT(refusal([&] {
                with_parameter_sets(e, {{"csv", {}, "sets.csv:2"}});
              }),
              HasSubstr("got \"swipes.csv\", which is a file of the plan"));
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
  EXPECT_THAT(error_of("name\nx\n"), HasSubstr(":1: got no address, expected a column of values"));
}

// A value has many addresses: items by name and by number, and all that is around it.
TEST_F(TableFile, ARunHasTheValuesThatItsTableSays) {
  write_file(path_, test::drag_scene(2, 2));
  Experiment e = experiment_of_scene(path_);
  const auto error_of_run = [&](const std::vector<std::string>& axes, const std::vector<std::string>& set) {
    const Experiment swept = with_parameter_sets(e, grid_sets(axes));
    return refusal([&] { check_swept_values(swept, swept.variants.back(), set); });
  };
  const std::string film = "/skin/layers/film/youngs_modulus=1,2";
  EXPECT_EQ(error_of_run({film}, {"/skin/layers/0/youngs_modulus=3", "/skin/order=3"}), "");
  EXPECT_EQ(error_of_run({film, "/skin/layers/soft/youngs_modulus=3"}, {}), "");
  EXPECT_THAT(error_of_run({film}, {"/skin/layers/1/youngs_modulus=3"}),
              HasSubstr("--set: got /skin/layers/1/youngs_modulus=3, which the sweep sets in every run as "
                        "/skin/layers/film/youngs_modulus"));
  EXPECT_THAT(error_of_run({film}, {"/skin/layers/01/youngs_modulus=3"}), HasSubstr("--set: got"));
  EXPECT_THAT(error_of_run({film}, {"/skin/layers=[]"}), HasSubstr("--set: got /skin/layers=[]"));
  EXPECT_THAT(error_of_run({film}, {"/skin/layers/1/name=crust", "/skin/layers/crust/youngs_modulus=3"}),
              HasSubstr("--set: got /skin/layers/crust/youngs_modulus=3"));
  EXPECT_THAT(error_of_run({"/skin/surface/grid/cells/0=3,4"}, {"/skin/surface/grid/cells=[4,3]"}),
              HasSubstr("--set: got /skin/surface/grid/cells=[4,3]"));
  EXPECT_THAT(error_of_run({"/ligaments/sources/0/strength=1,2", "/ligaments/sources/left/strength=3"}, {}),
              HasSubstr("--grid: got /ligaments/sources/left/strength, of which "
                        "/ligaments/sources/0/strength sets a part or the whole"));
  EXPECT_THAT(error_of_run({film, "/skin={}"}, {}), HasSubstr("--grid: got /skin, of which"));
  // What the experiment sets before the sweep is meant to be swept over.
  e.variants = {{"thin", {{"/skin/layers/1/youngs_modulus=9"}}, {}}};
  EXPECT_EQ(error_of_run({film}, {}), "");
}

TEST(FileNames, AreDifferentForDifferentTexts) {
  EXPECT_THAT(
      file_names({"film youngs_modulus", "film-2.b", "a b", "a_b", "A B", "\u00e9", "\u00e8", "a_b_2"}),
      ElementsAre("film_youngs_modulus", "film-2.b", "a_b", "a_b_2", "A_B_3", "__", "___2", "a_b_2_2"));
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
