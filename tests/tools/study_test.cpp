// Experiments: the bundled ones can be built at both sizes; what is refused; a sweep keeps what is finished.
#include <gmock/gmock.h>

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
#include "tools/study/sweep.h"
#include "tools/study/variant_result.h"

namespace rhytid::tools {
namespace {

using testing::HasSubstr;
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
        std::vector<std::string> settings = v.settings;
        if (needs_head && !head.empty()) settings.push_back("/skin/surface/file=" + head);
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

class StudyFolder : public testing::Test {
 protected:
  StudyFolder() {
    const auto* info = testing::UnitTest::GetInstance()->current_test_info();
    folder_ = (fs::temp_directory_path() / (std::string("rhytid_study_") + info->name())).string();
    fs::remove_all(folder_);
    fs::create_directories(folder_);
    write_file(folder_ + "/scene.json", test::drag_scene(2, 2));
  }
  ~StudyFolder() override { fs::remove_all(folder_); }

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
  std::string sweep(const std::string& path, ExitCode expected,
                    const std::vector<std::string>& settings = {}) {
    const Experiment e = load_experiment(path, StudySize::quick);
    std::ostringstream said, out;
    Progress progress(ProgressStyle::plain_lines, said);
    CommonOptions options;
    options.settings = settings;
    const Program program{"rhytid", "test", {}, {}};
    VerbContext context{options, program, progress, out};
    fs::create_directories(folder_ + "/out");
    EXPECT_EQ(run_sweep(context, e, folder_ + "/out", {}), expected) << said.str();
    return said.str();
  }

  std::string folder_;
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

TEST_F(StudyFolder, AKilledVariantGoesOnWhereItWas) {
  const std::string path = experiment(R"({"name": "one", "settings": []})");
  sweep(path, ExitCode::ok);
  const std::string wrinkles = read_file(folder_ + "/out/one/wrinkles.csv"),
                    steps = read_file(folder_ + "/out/one/steps.csv");
  // As a kill after the last frame leaves it.
  VariantResult killed = *read_variant(folder_ + "/out/one");
  killed.status = "running";
  killed.columns.clear();
  write_variant(folder_ + "/out/one", killed);
  EXPECT_THAT(sweep(path, ExitCode::ok), HasSubstr("one: goes on"));
  EXPECT_EQ(read_file(folder_ + "/out/one/wrinkles.csv"), wrinkles);
  EXPECT_EQ(read_file(folder_ + "/out/one/steps.csv"), steps);
  EXPECT_EQ(read_variant(folder_ + "/out/one")->status, "complete");
}

TEST_F(StudyFolder, ACheckpointOfAnotherVariantIsNotGoneOnFrom) {
  const std::string path = experiment(R"({"name": "one", "settings": []})");
  sweep(path, ExitCode::ok);
  // As a kill leaves it that comes while a changed variant is being set up.
  write_variant(folder_ + "/out/one", {"one", "", "running", "", {}});
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
              HasSubstr("expected /json/pointer=value"));
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
