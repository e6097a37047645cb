// A fit that was stopped goes on from its log to the same bits; a log of another fit is never mixed in; a
// point without derivative is a refused step. (A real kill -9 of the program: tests/tools/fitting_verbs.sh.)
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <unistd.h>

#include <cstring>
#include <filesystem>
#include <fstream>
#include <nlohmann/json.hpp>

#include "fitting/evaluation_log.h"
#include "fitting/optimise.h"
#include "sim/output/atomic_file.h"
#include "tests/fitting/synthetic_tracks.h"

namespace rhytid::fitting {
namespace {

namespace fs = std::filesystem;
using testing::HasSubstr;
using testing::IsEmpty;

class Resume : public testing::Test {
 protected:
  void SetUp() override {
    folder_ = fs::temp_directory_path() / ("rhytid_resume_" + std::to_string(getpid()));
    fs::create_directories(folder_);
    const Scene scene = test::drag_scene(3);
    const Camera camera = test::make_camera();
    input_ = {scene, camera, test::make_tracks(scene, camera, 2, 0.02, 3), test::three_parameters(), {}};
  }
  void TearDown() override { fs::remove_all(folder_); }

  struct Outcome {
    FitResult result;
    std::string record;  ///< fit.json and residuals.csv without wall clock times
    int fresh = 0, replayed = 0;
    std::vector<std::string> notes;
  };
  /// Fits with the log in `name`; stops in the run after `stop_after` fresh ones (0 = never).
  Outcome fit(const std::string& name, int stop_after = 0) {
    input_.evaluations = (folder_ / name).string();
    Outcome out;
    FitObserver observer;
    observer.run = [&out](const FitProgress& p) { ++(p.replayed ? out.replayed : out.fresh); };
    observer.note = [&out](const std::string& text) { out.notes.push_back(text); };
    observer.should_stop = [&out, stop_after] { return stop_after > 0 && out.fresh >= stop_after; };
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
  std::vector<fs::path> files(const std::string& name, const std::string& kind) const {
    std::vector<fs::path> found;
    for (const auto& entry : fs::directory_iterator(folder_ / name))
      if (entry.path().filename().string().rfind(kind, 0) == 0) found.push_back(entry.path());
    std::sort(found.begin(), found.end());
    return found;
  }

  fs::path folder_;
  FitInput input_;
};

TEST_F(Resume, StoppedFitEndsAtTheSameBits) {
  for (const char* optimiser : {"ceres", "nlopt"}) {
    input_.options.optimiser = optimiser;
    const std::string whole_name = std::string("whole_") + optimiser,
                      name = std::string("stopped_") + optimiser;
    const Outcome whole = fit(whole_name);
    EXPECT_TRUE(whole.result.converged) << whole.result.status;
    EXPECT_THAT(whole.notes, IsEmpty());
    EXPECT_EQ(whole.replayed, 0);
    ASSERT_GT(whole.fresh, 4);

    const Outcome first = fit(name, 2);
    EXPECT_THAT(first.result.status, HasSubstr("stopped"));
    const Outcome second = fit(name, 2);
    EXPECT_EQ(second.replayed, 2);
    const Outcome last = fit(name);
    EXPECT_EQ(last.replayed, 4);
    EXPECT_EQ(last.fresh, whole.fresh - 4);
    EXPECT_THAT(last.notes, testing::ElementsAre(HasSubstr("resumed: 4 runs")));
    EXPECT_EQ(last.record, whole.record) << optimiser;

    const Outcome again = fit(name);
    EXPECT_EQ(again.fresh, 0) << "a finished fit simulates nothing";
    EXPECT_EQ(again.record, whole.record);
  }
}

TEST_F(Resume, DamagedOrMissingRecordsAreComputedAgain) {
  const Outcome whole = fit("log");
  const auto runs = files("log", "run"), tangents = files("log", "tangent");
  ASSERT_GT(runs.size(), 2u);
  ASSERT_GT(tangents.size(), 1u);
  fs::resize_file(runs[1], fs::file_size(runs[1]) - 8);  // cannot come from a kill; a disk may do it
  std::ofstream(runs[2]) << "nonsense";
  fs::remove(tangents.back());  // the run is there, its states are not
  const Outcome repaired = fit("log");
  EXPECT_EQ(repaired.fresh, 2);
  EXPECT_EQ(repaired.record, whole.record);
}

TEST_F(Resume, AnotherFitsLogIsSetAside) {
  input_.options.max_evaluations = 2;
  const Outcome first = fit("log");
  EXPECT_EQ(first.result.status, "max_evaluations");
  // A larger budget is the same fit.
  input_.options.max_evaluations = 3;
  const Outcome longer = fit("log");
  EXPECT_EQ(longer.replayed, 2);
  EXPECT_EQ(longer.fresh, 1);

  input_.tracks.tracks[0].observations[2].pixel.x() += 1e-9;
  const Outcome other = fit("log");
  EXPECT_EQ(other.replayed, 0);
  ASSERT_EQ(other.notes.size(), 1u);
  EXPECT_THAT(other.notes[0], testing::AllOf(HasSubstr("(other tracks)"), HasSubstr("set aside in")));
  EXPECT_EQ(files("log.old", "run").size(), 3u);
  EXPECT_EQ(files("log", "run").size(), 3u);

  input_.scene.solver.relative_tolerance *= 0.5;
  input_.options.parameters[0].lower = 0.01;
  EXPECT_THAT(fit("log").notes.at(0),
              testing::AllOf(HasSubstr("(other scene, parameters)"), testing::EndsWith("log.old2")));
  EXPECT_EQ(files("log.old2", "run").size(), 3u);
  write_file((folder_ / "log" / "identity.json").string(), "{");
  EXPECT_THAT(fit("log").notes.at(0), HasSubstr("unknown format"));
  input_.anew = true;
  const Outcome anew = fit("log");
  EXPECT_EQ(anew.replayed, 0);
  EXPECT_THAT(anew.notes.at(0), HasSubstr("not wanted"));
}

TEST_F(Resume, ALogThatWasSetAsideIsTakenBackByItsFit) {
  input_.options.max_evaluations = 2;
  const Outcome first = fit("log");
  const double pixel = input_.tracks.tracks[0].observations[2].pixel.x();
  input_.tracks.tracks[0].observations[2].pixel.x() += 1e-9;
  const Outcome other = fit("log");
  EXPECT_EQ(other.fresh, 2);
  input_.tracks.tracks[0].observations[2].pixel.x() = pixel;
  const Outcome back = fit("log");
  EXPECT_EQ(back.replayed, 2);
  EXPECT_EQ(back.fresh, 0);
  EXPECT_EQ(back.record, first.record);
  EXPECT_THAT(back.notes.at(0), testing::AllOf(HasSubstr("set aside in"), HasSubstr("taken back from"),
                                               testing::EndsWith("log.old")));
  EXPECT_FALSE(fs::exists(folder_ / "log.old")) << "it is the log again";
  EXPECT_EQ(files("log.old2", "run").size(), 2u) << "the other fit's";
  input_.anew = true;
  EXPECT_EQ(fit("log").replayed, 0) << "what is not wanted is not taken back";
}

/// The path of a mesh says nothing: another content is another scene.
TEST_F(Resume, AChangedMeshFileIsAnotherScene) {
  const std::string mesh = (folder_ / "mesh.obj").string();
  const auto write_mesh = [&](const char* corner) {
    std::string text;
    for (int j = 0; j <= 3; ++j)
      for (int i = 0; i <= 4; ++i)
        text += "v " + std::to_string(4 * i - 8) + " " + std::to_string(4 * j - 6) +
                (i + j == 0 ? corner : " 0\n");
    for (int j = 0; j < 3; ++j)
      for (int i = 0; i < 4; ++i) {
        const int a = 1 + i + 5 * j;
        text += "f " + std::to_string(a) + " " + std::to_string(a + 1) + " " + std::to_string(a + 6) + " " +
                std::to_string(a + 5) + "\n";
      }
    write_file(mesh, text);
  };
  const auto identity = [&] {
    nlohmann::json json = scene_to_json(test::drag_scene(1));
    json["skin"]["surface"] = {{"file", mesh}, {"mm_per_unit", 1}};
    input_.scene = parse_scene(json, "mesh.json");
    const FitProblem problem(input_.scene, input_.options, input_.camera, input_.tracks);
    return fit_identity(input_, problem);
  };
  write_mesh(" 0\n");
  const FitIdentity before = identity(), same = identity();
  EXPECT_EQ(same, before);
  write_mesh(" 0.001\n");
  const FitIdentity after = identity();
  ASSERT_EQ(after.size(), before.size());
  for (std::size_t k = 0; k < after.size(); ++k)
    EXPECT_EQ(after[k] == before[k], after[k].first != "scene") << after[k].first;
}

TEST_F(Resume, SameNumbersOfOtherSettingsAreAnotherFit) {
  const FitProblem problem(input_.scene, input_.options, input_.camera, input_.tracks);
  FitClip clip{{}, {}, input_.scene, {input_.camera}, input_.tracks};
  FitCase frames = input_.options, waves = input_.options;
  frames.frame_weights = {{1, 8, 0.05, 0.5}};
  waves.waves = WaveBand{1, 8, 0.05};
  const FitIdentity of_frames = fit_identity(clip, frames, problem);
  clip.weight = 0.5;
  EXPECT_NE(of_frames, fit_identity(clip, waves, problem));
}

TEST_F(Resume, PointWithoutDerivativeIsARefusedStep) {
  const Outcome whole = fit("log");
  // Pretend that the second accepted point could be run but not differentiated.
  const auto tangents = files("log", "tangent");
  ASSERT_GT(tangents.size(), 1u);
  const std::string content = read_file(tangents[1].string());
  VectorXd t(3);
  std::memcpy(t.data(), content.data() + content.find('\n') + 1, 3 * sizeof(double));
  {
    const FitProblem problem(input_.scene, input_.options, input_.camera, input_.tracks);
    EvaluationLog log((folder_ / "log").string(), fit_identity(input_, problem));
    log.add(EvaluationLog::Kind::tangent, t, {.failure = "the Hessian does not factor"});
  }
  const Outcome refused = fit("log");
  EXPECT_TRUE(refused.result.converged) << refused.result.status;
  EXPECT_GT(refused.fresh, 0) << "another way was taken";
  EXPECT_NEAR(refused.result.final_cost, whole.result.final_cost, 1e-5 * whole.result.final_cost);
  // Where already the start has no derivative there is nothing to refuse.
  std::memcpy(t.data(),
              read_file(tangents[0].string()).data() + read_file(tangents[0].string()).find('\n') + 1,
              3 * sizeof(double));
  {
    const FitProblem problem(input_.scene, input_.options, input_.camera, input_.tracks);
    EvaluationLog log((folder_ / "log").string(), fit_identity(input_, problem));
    log.add(EvaluationLog::Kind::tangent, t, {.failure = "the Hessian does not factor"});
  }
  const Outcome lost = fit("log");
  EXPECT_THAT(lost.result.status,
              testing::AllOf(HasSubstr("failed"), HasSubstr("the Hessian does not factor")));
}

// The start is known from a log and every other run fails: steps shrink until the optimisers call it
// convergence.
TEST_F(Resume, NoConvergenceWhereNoStepCanBeRun) {
  const FitIdentity identity = {{"test", "of steps"}};
  const std::string folder = (folder_ / "start").string();
  const auto problem = [&] { return FitProblem(input_.scene, input_.options, input_.camera, input_.tracks); };
  FitProblem sound = problem();
  EvaluationLog log(folder, identity);
  sound.log = &log;
  const VectorXd start = sound.parametrisation().initial();
  ASSERT_TRUE(sound.jacobian(start) && sound.gradient(start));
  input_.scene.solver.max_iterations = 1;
  input_.scene.time.max_bisections = 0;
  for (const auto optimise : {fit_with_ceres, fit_with_nlopt}) {
    EvaluationLog again(folder, identity);
    FitProblem broken = problem();
    broken.log = &again;
    Search search(broken);
    const OptimiserOutcome outcome = optimise(search, {.max_evaluations = 300}, {});
    EXPECT_EQ(outcome.status, OptimiserOutcome::Status::failed);
    EXPECT_THAT(outcome.detail, HasSubstr("no step from the best point could be run: "));
    EXPECT_EQ(outcome.t, start);
    EXPECT_GT(broken.counters().failed_runs, 3);
  }
}

}  // namespace
}  // namespace rhytid::fitting
