// Experiments: the bundled ones can be built at both sizes; what is refused; a sweep keeps what is finished.
#include <gmock/gmock.h>

#include <algorithm>
#include <csignal>
#include <filesystem>
#include <fstream>
#include <sstream>

#include "sim/core/error.h"
#include "sim/output/atomic_file.h"
#include "sim/scene/load.h"
#include "sim/scene/scene_model.h"
#include "tests/support/paths.h"
#include "tests/support/real_data.h"
#include "tests/support/small_scenes.h"
#include "tests/support/temporary_folder.h"
#include "tools/bench/pareto_variant.h"
#include "tools/interrupt.h"
#include "tools/study/sweep.h"
#include "tools/study/variant_result.h"
#include "tools/study/wrinkle_recorder.h"

namespace rhytid::tools {
namespace {

using testing::AllOf;
using testing::HasSubstr;
using testing::Not;
namespace fs = std::filesystem;

TEST(BundledExperiments, CanBeBuiltAtTheQuickSizeAndReadAtTheFullOne) {
  const std::string head = real_file(kHeadFile);
  int found = 0;
  for (const auto& entry : fs::directory_iterator(source_dir() + "/data/scenes")) {
    const std::string file = (entry.path() / "experiment.json").string();
    if (!fs::exists(file)) continue;
    SCOPED_TRACE(file);
    ++found;
    const bool needs_head = entry.path().filename().string().starts_with("head_");
    for (const StudySize size : {StudySize::quick, StudySize::full}) {
      const Experiment e = load_experiment(file, size);
      for (const Variant& v : e.variants) {
        SCOPED_TRACE(v.name);
        std::vector<Setting> settings = v.settings;
        if (needs_head && !head.empty()) settings.push_back({"/skin/surface/file=" + head});
        const Scene scene = load_scene(e.scene, settings);
        if (size == StudySize::full || (needs_head && head.empty())) continue;
        const SceneModel built(scene);
        if (&v != &e.variants.front()) continue;
        if (e.measure.line) {
          EXPECT_EQ(SurfaceSamples(built.model().mesh, *e.measure.line, e.measure.line_points).missing(), 0);
        }
        if (e.measure.window) {
          const SurfaceSamples window(built.model().mesh, *e.measure.window, 1);
          EXPECT_LT(window.missing(), 0.2 * window.rows() * window.columns());
        }
      }
    }
  }
  EXPECT_GE(found, 6);
  // The others were built all the same.
  if (head.empty()) GTEST_SKIP() << why_no_real_file(kHeadFile);
}

TEST(BundledExperiments, ThoseOfBenchParetoCanBeReadAndTheirPointsPlaced) {
  const std::string head = real_file(kHeadFile);
  int found = 0;
  for (const auto& entry : fs::directory_iterator(source_dir() + "/data/scenes")) {
    const std::string file = (entry.path() / "pareto.json").string();
    if (!fs::exists(file)) continue;
    SCOPED_TRACE(file);
    ++found;
    const Experiment e = load_experiment(file, StudySize::quick);
    ASSERT_TRUE(e.comparison.has_value());
    const bool needs_head = entry.path().filename().string().starts_with("head_");
    for (const Variant& v : e.variants) {
      SCOPED_TRACE(v.name);
      std::vector<Setting> settings = v.settings;
      if (needs_head && !head.empty()) settings.push_back({"/skin/surface/file=" + head});
      const Scene scene = load_scene(e.scene, settings);
      for (const std::string& address : e.comparison->parameters)
        EXPECT_NO_THROW((void)describe_parameter(scene, address));
      if (&v != &e.variants.front() || (needs_head && head.empty())) continue;
      const SceneModel built(scene);
      const SurfaceSamples points = comparison_points(built.model().mesh, *e.comparison);
      EXPECT_LT(points.missing(), 0.1 * points.rows() * points.columns());
      EXPECT_EQ(place_samples(built.model().mesh, e.measure).line->missing(), 0);
    }
    // Every variant is there to be compared.
    for (const Variant& v : e.variants)
      EXPECT_TRUE(std::any_of(e.comparison->groups.begin(), e.comparison->groups.end(), [&](const auto& g) {
        return g.reference == v.name || std::count(g.variants.begin(), g.variants.end(), v.name) > 0;
      })) << v.name;
  }
  EXPECT_GE(found, 4);
  if (head.empty()) GTEST_SKIP() << why_no_real_file(kHeadFile);
}

/// Text that sends the process SIGINT as soon as it holds certain words.
class StoppingText : public std::stringbuf {
 public:
  std::string stop_at;

 protected:
  int sync() override {
    if (!stop_at.empty() && str().find(stop_at) != std::string::npos) stop_at.clear(), std::raise(SIGINT);
    return 0;
  }
};

/// The cells of a column.
std::vector<std::string> column(const std::string& csv, const std::string& name) {
  std::vector<std::string> cells;
  std::istringstream lines(csv);
  int wanted = -1;
  for (std::string line; std::getline(lines, line);) {
    std::istringstream row(line);
    int k = 0;
    for (std::string cell; std::getline(row, cell, ','); ++k) {
      if (cell == name)
        wanted = k;
      else if (k == wanted)
        cells.push_back(cell);
    }
  }
  return cells;
}

class StudyFolder : public testing::Test {
 protected:
  StudyFolder() { write_file(folder_ + "/scene.json", test::drag_scene(2, 2)); }

  std::string experiment(
      const std::string& variants,
      const std::string& measure = R"("line": {"from": [-6, 0, 0], "to": [6, 0, 0], "points": 60})") {
    const std::string path = folder_ + "/experiment.json";
    write_file(path, R"({"name": "tiny", "scene": "scene.json",
      "settings": ["/skin/surface/grid/cells=[4,3]", "/output/vtu=false", "/output/pictures=false"],
      "measure": {)" + measure +
                         R"(}, "variants": [)" + variants + "]}");
    return path;
  }
  std::string error_of(const std::string& variants, const std::string& measure) {
    try {
      load_experiment(experiment(variants, measure), StudySize::quick);
    } catch (const InputError& error) {
      return error.what();
    }
    return "";
  }
  /// Runs the sweep; what it said on stderr.
  std::string sweep(const std::string& path, ExitCode expected, const std::vector<std::string>& settings = {},
                    const SweepOptions& sweep_options = {}) {
    const Experiment e = load_experiment(path, StudySize::quick);
    StoppingText text;
    text.stop_at = stop_at_;
    std::ostream said(&text);
    std::ostringstream out;
    Progress progress(ProgressStyle::plain_lines, said);
    CommonOptions options;
    options.settings = settings;
    options.output = folder_ + "/out";
    const Program program{"rhytid", "test", {}, {}};
    VerbContext context{options, program, progress, out};
    const InterruptGuard guard;
    EXPECT_EQ(run_sweep(context, e, sweep_options), expected) << text.str();
    return text.str();
  }
  /// What the sweep refuses to do.
  std::string refusal(const std::string& path, const std::vector<std::string>& settings = {}) {
    try {
      sweep(path, ExitCode::bad_input, settings);
    } catch (const InputError& error) {
      return error.what();
    }
    return "";
  }
  std::string out(const std::string& file) const { return folder_ + "/out/" + file; }
  std::string results() const { return read_file(out("results.csv")); }

  const test::TemporaryFolder temporary_;
  const std::string folder_ = temporary_.path();
  std::string stop_at_;  ///< Ctrl-C comes when the sweep says this
};

const std::string kTwo =
    R"({"name": "soft", "settings": []}, {"name": "stiff", "settings": ["/skin/layers/soft/youngs_modulus=40 kPa"]})";

TEST_F(StudyFolder, FinishedVariantsAreKeptAndChangedOnesRunAgain) {
  const std::string path = experiment(kTwo);
  const std::string first = sweep(path, ExitCode::ok);
  EXPECT_THAT(first, HasSubstr("soft: starts"));
  EXPECT_THAT(first, HasSubstr("stiff: starts"));
  for (const char* file : {"results.csv", "results.md", "index.html", "profiles.svg", "soft/wrinkles.csv",
                           "soft/profile.csv", "soft/above.png", "soft/ligaments.png", "soft/steps.csv"})
    EXPECT_TRUE(fs::exists(folder_ + "/out/" + file)) << file;
  const auto soft = read_variant(folder_ + "/out/soft"), stiff = read_variant(folder_ + "/out/stiff");
  ASSERT_TRUE(soft && stiff);
  EXPECT_EQ(soft->status, "complete");
  const auto value = [](const VariantResult& r, const std::string& name) {
    for (const ResultColumn& c : r.columns)
      if (c.name == name) return c.value.value_or(-1);
    return -2.;
  };
  EXPECT_EQ(value(*soft, "nodes"), 9 * 7 * 4);
  EXPECT_GT(value(*soft, "iterations"), 2);
  EXPECT_GT(value(*soft, "line_amplitude"), 0);
  // The same dent takes more force.
  EXPECT_GT(value(*stiff, "force_finger_z"), 1.2 * value(*soft, "force_finger_z"));

  const std::string table = read_file(folder_ + "/out/results.csv");
  const std::string again = sweep(path, ExitCode::ok);
  EXPECT_THAT(again, HasSubstr("soft: complete before, kept"));
  EXPECT_EQ(read_file(folder_ + "/out/results.csv"), table);
  const std::string changed = sweep(path, ExitCode::ok, {"/colliders/finger/friction/coefficient=0.2"});
  EXPECT_THAT(changed, HasSubstr("soft: starts"));
  EXPECT_NE(read_file(folder_ + "/out/results.csv"), table);
}

TEST_F(StudyFolder, AStoppedVariantGoesOnWhereItWas) {
  const std::string path = experiment(R"({"name": "one", "settings": ["/time/frames=3"]})");
  sweep(path, ExitCode::ok);
  const std::string wrinkles = read_file(out("one/wrinkles.csv")), steps = read_file(out("one/steps.csv"));
  EXPECT_EQ(std::count(wrinkles.begin(), wrinkles.end(), '\n'), 5);  // header, frames 0 to 3
  fs::remove_all(out(""));
  stop_at_ = "simulate 1/3";
  sweep(path, ExitCode::interrupted);
  EXPECT_EQ(read_variant(out("one"))->status, "running");
  EXPECT_LT(read_file(out("one/wrinkles.csv")).size(), wrinkles.size());
  stop_at_ = "";
  const std::string said = sweep(path, ExitCode::ok);
  EXPECT_THAT(said, HasSubstr("one: goes on"));
  EXPECT_THAT(said, HasSubstr("resumed after frame 1"));
  EXPECT_EQ(read_file(out("one/wrinkles.csv")), wrinkles);
  EXPECT_EQ(read_file(out("one/steps.csv")), steps);
  EXPECT_EQ(read_variant(out("one"))->status, "complete");
}

TEST_F(StudyFolder, AStoppedVariantWithDamagedTablesStartsFromTheBeginning) {
  const std::string path = experiment(R"({"name": "one", "settings": ["/time/frames=3"]})");
  sweep(path, ExitCode::ok);
  const std::string wrinkles = read_file(out("one/wrinkles.csv")), steps = read_file(out("one/steps.csv"));
  const auto without_line = [](const std::string& text, int line) {
    std::istringstream lines(text);
    std::string kept;
    int number = 0;
    for (std::string one; std::getline(lines, one);)
      if (number++ != line) kept += one + "\n";
    return kept;
  };
  const auto damaged = [](std::string text) { return text.replace(text.rfind("\n3,") + 1, 1, "three"); };
  const std::pair<const char*, std::string> damages[] = {{"wrinkles.csv", without_line(wrinkles, 2)},
                                                         {"wrinkles.csv", without_line(wrinkles, 4)},
                                                         {"wrinkles.csv", damaged(wrinkles)},
                                                         {"wrinkles.csv", ""},
                                                         {"steps.csv", without_line(steps, 2)},
                                                         {"steps.csv", damaged(steps)},
                                                         {"state.bin", "nothing"}};
  for (const auto& [file, text] : damages) {
    SCOPED_TRACE(std::string(file) + ": " + text);
    VariantResult stopped = *read_variant(out("one"));
    stopped.status = "running";
    write_variant(out("one"), stopped);
    write_file(out("one/") + file, text);
    EXPECT_THAT(sweep(path, ExitCode::ok), HasSubstr("one: goes on"));
    EXPECT_EQ(read_file(out("one/wrinkles.csv")), wrinkles);
    EXPECT_EQ(read_file(out("one/steps.csv")), steps);
    EXPECT_EQ(read_variant(out("one"))->status, "complete");
  }
}

TEST_F(StudyFolder, ChangedFilesMakeAVariantRunAgainFinishedOrNot) {
  const std::string map = folder_ + "/map.csv", path = experiment(R"({"name": "one", "settings": []})");
  const std::vector<std::string> settings = {"/ligaments/map=" + map, "/ligaments/sources=null",
                                             "/ligaments/diffusion_time=null", "/time/frames=3"};
  const auto write_map = [&](const std::string& b) {
    std::string text = "vertex,b\n";
    for (int vertex = 0; vertex < 5 * 4; ++vertex) text += std::to_string(vertex) + "," + b + "\n";
    write_file(map, text);
  };
  write_map("0.3");
  sweep(path, ExitCode::ok, settings);
  const std::string soft = results();
  write_map("9");
  EXPECT_THAT(sweep(path, ExitCode::ok, settings),
              HasSubstr("one: starts anew, with other files than before"));
  const std::string stiff = results();
  EXPECT_NE(stiff, soft);
  // The same while a variant is stopped.
  stop_at_ = "simulate 1/3";
  sweep(path, ExitCode::interrupted, settings, {.only = {}, .anew = true, .frames = {}});
  stop_at_ = "";
  write_map("0.3");
  EXPECT_THAT(sweep(path, ExitCode::ok, settings), HasSubstr("one: starts"));
  EXPECT_EQ(column(results(), "stored_energy_mJ"), column(soft, "stored_energy_mJ"));
  EXPECT_NE(column(results(), "stored_energy_mJ"), column(stiff, "stored_energy_mJ"));
}

TEST_F(StudyFolder, AnotherProgramRunsAgainAndSoDoesAnew) {
  const std::string path = experiment(R"({"name": "one", "settings": []})");
  sweep(path, ExitCode::ok);
  EXPECT_THAT(sweep(path, ExitCode::ok, {}, {.only = {}, .anew = true, .frames = {}}),
              HasSubstr("one: starts"));
  VariantResult of_another = *read_variant(out("one"));
  of_another.identity.program = "another";
  write_variant(out("one"), of_another);
  EXPECT_THAT(sweep(path, ExitCode::ok), HasSubstr("one: starts anew, with other program than before"));
  EXPECT_THAT(sweep(path, ExitCode::ok), HasSubstr("one: complete before, kept"));
}

TEST_F(StudyFolder, TablesLeaveOutResultsOfOtherSettings) {
  const std::string path = experiment(kTwo);
  sweep(path, ExitCode::ok);
  const SweepOptions only_soft{.only = {"soft"}, .anew = false, .frames = {}};
  sweep(path, ExitCode::ok, {"/time/frames=1"}, only_soft);
  EXPECT_THAT(results(), AllOf(HasSubstr("\nsoft,complete"), Not(HasSubstr("stiff"))));
  for (const char* file : {"results.md", "index.html"})
    EXPECT_NE(read_file(out(file)).find("Left out: stiff (finished with other settings)."),
              std::string::npos);
  // Back at the settings of stiff, it is soft that is out of date until it has run.
  stop_at_ = "soft: starts anew";
  sweep(path, ExitCode::interrupted);
  EXPECT_THAT(results(), AllOf(HasSubstr("\nstiff,complete"), Not(HasSubstr("soft"))));
  stop_at_ = "";
  sweep(path, ExitCode::ok);
  EXPECT_THAT(results(), AllOf(HasSubstr("\nstiff,complete"), HasSubstr("\nsoft,complete")));
  EXPECT_THAT(read_file(out("results.md")), Not(HasSubstr("Left out")));
}

TEST_F(StudyFolder, NothingOfAnEarlierRunStaysInAVariant) {
  const std::string path = experiment(R"({"name": "one", "settings": []})");
  sweep(path, ExitCode::ok);
  sweep(path, ExitCode::not_converged,
        {"/solver/max_iterations=1", "/time/max_bisections=0", "/ligaments=null"});
  for (const char* file : {"above.png", "ligaments.png"})
    EXPECT_FALSE(fs::exists(out(std::string("one/") + file))) << file;
  EXPECT_EQ(read_file(out("index.html")).find("<img"), std::string::npos);
  // A folder that no sweep made is left alone.
  fs::create_directories(out("two"));
  write_file(out("two/profile.csv"), "mine");
  EXPECT_THAT(refusal(experiment(R"({"name": "two"})")), HasSubstr("without the run.json of a run"));
  EXPECT_EQ(read_file(out("two/profile.csv")), "mine");
}

TEST_F(StudyFolder, WhatIsWrongWithTheLastShowsBeforeTheFirstRuns) {
  const std::string path =
      experiment(R"({"name": "fine"}, {"name": "small", "settings": ["/skin/surface/grid/size=[10, 8]"]})");
  EXPECT_THAT(refusal(path),
              testing::MatchesRegex(".*experiment.json: variant small: /measure/line: got [0-9]+ "
                                    "points beside the surface, expected .*"));
  EXPECT_FALSE(fs::exists(out("")));
  EXPECT_THAT(
      refusal(experiment("{\"name\": \"fine\"},\n{\"name\": \"bad\", \"settings\": [\"/skin/ordr=2\"]}")),
      HasSubstr("experiment.json:4: /variants/1/settings/0: /skin/ordr: got"));
  EXPECT_THAT(refusal(experiment(R"({"name": "fine"})"), {"/skin/ordr=2"}),
              HasSubstr("scene.json (--set): /skin/ordr: got"));
}

TEST_F(StudyFolder, ACheckpointOfAnotherVariantIsNotGoneOnFrom) {
  const std::string path = experiment(R"({"name": "one", "settings": []})");
  sweep(path, ExitCode::ok);
  // As a kill leaves it that comes while a changed variant is being set up.
  write_variant(folder_ + "/out/one", {"one", {}, "running", "", {}});
  EXPECT_THAT(sweep(path, ExitCode::ok, {"/time/frames=1", "/colliders/finger/radius=5.5 mm"}),
              HasSubstr("one: starts"));
  EXPECT_EQ(read_variant(folder_ + "/out/one")->status, "complete");
}

TEST_F(StudyFolder, AVariantThatDoesNotConvergeIsReportedAndTheOthersRun) {
  const std::string path = experiment(
      R"({"name": "hopeless", "settings": ["/solver/max_iterations=1", "/time/max_bisections=0"]}, {"name": "fine", "settings": []})");
  sweep(path, ExitCode::not_converged);
  EXPECT_EQ(read_variant(folder_ + "/out/hopeless")->status, "not_converged");
  EXPECT_THAT(read_variant(folder_ + "/out/hopeless")->reason, HasSubstr("frame 1"));
  EXPECT_EQ(read_variant(folder_ + "/out/fine")->status, "complete");
}

TEST_F(StudyFolder, ErrorsAreOneLineThatNamesTheKey) {
  EXPECT_THAT(error_of(R"({"name": "a", "settings": ["no pointer"]})", ""),
              HasSubstr(": /variants/0/settings/0: got 'no pointer', expected /json/pointer=value"));
  EXPECT_THAT(error_of(R"({"name": "results.csv"})", ""), HasSubstr("which is a file of the sweep"));
  EXPECT_THAT(
      error_of(R"({"name": "a"})", R"("window": {"centre": [0, 0, 0], "size": [9, 9], "spacing": 1e-5})"),
      HasSubstr("/measure/window/spacing: got 1e-05, which are"));
  EXPECT_THAT(error_of(R"({"name": "a", "setings": []})", ""), HasSubstr("nearest is \"settings\""));
  EXPECT_THAT(error_of(R"({"name": "a b"})", ""), HasSubstr("letters, digits"));
  EXPECT_THAT(error_of(R"({"name": "a"}, {"name": "a"})", ""), HasSubstr("a second time"));
  EXPECT_THAT(error_of(R"({"name": "a"})", R"("wavelengths": ["9 mm", "2 mm"])"),
              HasSubstr("the shorter one first"));
  EXPECT_THAT(error_of(R"({"name": "a"})", R"("line": {"from": [1, 0, 0], "to": [1, 0, 0]})"),
              HasSubstr("two ends"));
  EXPECT_THAT(error_of(R"({"name": "a", "size": "full"})", ""), HasSubstr("none at the size quick"));
}

}  // namespace
}  // namespace rhytid::tools
