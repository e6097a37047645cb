// bench recovery: that a draw is what render, track and fit do, the arithmetic of its tables, what its variants change,
// what is kept.
#include <gmock/gmock.h>

#include <cmath>
#include <filesystem>
#include <limits>
#include <nlohmann/json.hpp>
#include <sstream>

#include "fitting/colmap.h"
#include "sim/output/atomic_file.h"
#include "sim/scene/load.h"
#include "sim/scene/parameter.h"
#include "tests/support/paths.h"
#include "tests/tools/program_call.h"
#include "tools/bench/recovery_report.h"
#include "tools/render/twin_run.h"
#include "tools/verb.h"

namespace rhytid::tools {
std::unique_ptr<Verb> make_verb_render();
std::unique_ptr<Verb> make_verb_track();
std::unique_ptr<Verb> make_verb_fit();
std::unique_ptr<Verb> make_verb_fitting_bench();

namespace {

namespace fs = std::filesystem;
using testing::ElementsAre;
using testing::HasSubstr;
using testing::Not;

constexpr double kNan = std::numeric_limits<double>::quiet_NaN();

TEST(RecoveryShare, IsWilsonsInterval) {
  const double z2 = 1.959963984540054 * 1.959963984540054;
  EXPECT_NEAR(share_interval(0, 10).high, z2 / (10 + z2), 1e-14);
  EXPECT_EQ(share_interval(0, 10).low, 0);
  EXPECT_NEAR(share_interval(10, 10).low, 10 / (10 + z2), 1e-14);
  EXPECT_NEAR(share_interval(5, 10).low, 0.2366, 1e-4);
  EXPECT_NEAR(share_interval(5, 10).high, 0.7634, 1e-4);
  EXPECT_EQ(share_interval(0, 0).low, 0);
  EXPECT_EQ(share_interval(0, 0).high, 1);
}

/// A draw of one parameter with truth 1 in a logarithm.
RecoveryDraw draw_of(int number, double error, double half_width, double sigma) {
  RecoveryDraw d;
  d.draw = number, d.answered = true, d.status = "converged";
  d.parameters.push_back({"/a", "MPa", "log", 1, std::exp(error), std::exp(error - half_width),
                          std::exp(error + half_width), error, sigma});
  return d;
}

TEST(RecoverySummary, IsThatOfTheErrors) {
  RecoveryGroup group{"c", "as_is", "", {}};
  group.draws = {draw_of(0, 0.1, 0.2, 0.1), draw_of(1, 0.3, 0.2, 0.2), draw_of(2, -0.1, 0.05, kNan),
                 draw_of(3, 9, 1, 1)};
  group.draws[3].answered = false;
  const std::vector<RecoverySummary> all = summarise(group);
  ASSERT_EQ(all.size(), 1u);
  EXPECT_EQ(all[0].draws, 3);
  EXPECT_EQ(all[0].inside, 1);
  EXPECT_EQ(all[0].undetermined, 1);
  EXPECT_NEAR(all[0].bias, 0.1, 1e-15);
  EXPECT_NEAR(all[0].spread, 0.2, 1e-15);
  EXPECT_NEAR(all[0].rms, std::sqrt(0.11 / 3), 1e-15);
  EXPECT_NEAR(all[0].sigma, 0.15, 1e-15);
}

TEST(RecoveryDraw, ReadsBackAsItWas) {
  RecoveryDraw draw = draw_of(7, 0.1, 0.2, kNan);
  draw.reduced_chi_square = 1.5, draw.rms_px = 0.25, draw.tracks = 40, draw.observations = 300;
  draw.forward_runs = 6, draw.cpu_seconds = 1.25, draw.seconds = 2.5;
  const RecoveryDraw read = read_draw(draw_result(draw, {}));
  EXPECT_EQ(read.draw, 7);
  EXPECT_TRUE(read.answered);
  EXPECT_EQ(read.status, "converged");
  EXPECT_EQ(read.reduced_chi_square, 1.5);
  EXPECT_EQ(read.rms_px, 0.25);
  EXPECT_EQ(read.tracks, 40);
  EXPECT_EQ(read.observations, 300);
  EXPECT_EQ(read.forward_runs, 6);
  EXPECT_EQ(read.cpu_seconds, 1.25);
  EXPECT_EQ(read.seconds, 2.5);
  ASSERT_EQ(read.parameters.size(), 1u);
  EXPECT_EQ(read.parameters[0].address, "/a");
  EXPECT_EQ(read.parameters[0].unit, "MPa");
  EXPECT_EQ(read.parameters[0].transform, "log");
  EXPECT_EQ(read.parameters[0].value, std::exp(0.1));
  EXPECT_EQ(read.parameters[0].high95, std::exp(0.1 + 0.2));
  EXPECT_EQ(read.parameters[0].error, 0.1);
  EXPECT_TRUE(std::isnan(read.parameters[0].sigma));
  draw.answered = false, draw.status = "no point to track", draw.parameters.clear();
  EXPECT_FALSE(read_draw(draw_result(draw, {})).answered);
  EXPECT_EQ(read_draw(draw_result(draw, {})).status, "no point to track");
}

class RecoveryVariants : public testing::Test {
 protected:
  explicit RecoveryVariants(const std::string& name = "recovery_swipe")
      : c_(fitting::load_case(source_dir() + "/data/scenes/" + name + "/case.json")),
        fit_(load_scene(c_.scene, c_.scene_settings)),
        truth_(truth_scene(c_)) {}
  std::optional<VariedCase> varied(const std::string& name) const {
    return varied_case(c_, fit_, truth_, name);
  }
  Scene scene_of(const std::string& name) const {
    return load_scene(varied(name)->c.scene, varied(name)->c.scene_settings);
  }
  fitting::Case c_;
  Scene fit_, truth_;
};

TEST_F(RecoveryVariants, ChangeWhatTheySay) {
  EXPECT_EQ(scene_to_json(scene_of("as_is")), scene_to_json(fit_));
  EXPECT_EQ(varied("noise_x4")->c.render.noise, 4 * c_.render.noise);
  EXPECT_EQ(varied("quarter_tracks")->keep_every, 4);
  const std::string friction = "/colliders/finger/friction/coefficient";
  EXPECT_NEAR(get_parameter(scene_of("friction_held"), friction), 0.7 * 2.5, 1e-15);
  const auto held = varied("friction_held");
  EXPECT_EQ(held->c.fit.parameters.size(), c_.fit.parameters.size() - 1);
  for (const fitting::FitParameter& p : held->c.fit.parameters) EXPECT_NE(p.address, friction);
  EXPECT_NEAR(scene_of("thicker").skin.layers[0].thickness, 2.2, 1e-14);
  EXPECT_EQ(scene_of("thicker").skin.layers[1].thickness, fit_.skin.layers[1].thickness);
  for (std::size_t k = 0; k < 3; ++k)
    EXPECT_LT((scene_of("finger_shifted").colliders[0].path[k].position - fit_.colliders[0].path[k].position -
               Vec3(0.5, 0, 0))
                  .norm(),
              1e-14);
  EXPECT_FALSE(varied("other_damper")) << "no time is fitted";
  EXPECT_FALSE(varied("half_step"));
}

TEST_F(RecoveryVariants, TheFitsOwnTruthHasTheTruthsValues) {
  const VariedCase same = *varied("same_discretisation");
  const Scene truth = truth_scene(same.c);
  for (const ParameterSpec& spec : all_parameters(fit_))
    EXPECT_EQ(get_parameter(truth, spec.address), get_parameter(truth_, spec.address)) << spec.address;
  EXPECT_EQ(truth.skin.order, fit_.skin.order);
  EXPECT_EQ(truth.time.substeps, fit_.time.substeps);
  EXPECT_NE(truth_.skin.order, fit_.skin.order) << "the case itself has another discretisation";
}

class RelaxingVariants : public RecoveryVariants {
 protected:
  RelaxingVariants() : RecoveryVariants("recovery_relaxing") {}
};

TEST_F(RelaxingVariants, ChangeTheIntegrationOfFittedTimes) {
  EXPECT_EQ(fit_.time.damper, DamperScheme::exponential);
  EXPECT_EQ(scene_of("other_damper").time.damper, DamperScheme::literal);
  EXPECT_EQ(scene_of("half_step").time.substeps, 2 * fit_.time.substeps);
  for (const RecoveryVariant& v : recovery_variants()) EXPECT_TRUE(varied(v.name)) << v.name;
}

/// The tiny twin of fitting_verbs.sh, and the programs on it.
class RecoveryBench : public testing::Test {
 protected:
  RecoveryBench() : folder_(fs::temp_directory_path() / ("rhytid_recovery_" + std::to_string(getpid()))) {
    fs::create_directories(folder_);
    write_file(at("scene.json"), R"({
      "name": "tiny",
      "skin": {
        "surface": {"grid": {"size": ["16 mm", "12 mm"], "cells": [4, 3]}}, "order": 2,
        "layers": [{"name": "skin", "thickness": "1.5 mm", "order": 1, "youngs_modulus": "50 kPa"}]
      },
      "base": {"shape": "plane", "stiffness": "0.1 MPa/mm", "onset": "0.02 mm"},
      "colliders": [
        {"name": "finger", "shape": "sphere", "radius": "2 mm", "stiffness": "0.1 MPa/mm", "onset": "0.02 mm",
         "friction": {"coefficient": 0.5, "slip_speed": "2 mm/s"},
         "path": [{"time": 0, "position": [-4, -3, 2.02]}, {"time": 0.1, "position": [-4, -3, 1.5]},
                  {"time": 0.2, "position": [-3, -3, 1.5]}]}],
      "time": {"frame_rate": "20 Hz", "frames": 3}})");
    write_file(at("case.json"), R"({
      "name": "tiny", "scene": "scene.json",
      "truth": {"settings": ["/colliders/finger/friction/coefficient=0.8", "/time/substeps=2"]},
      "render": {"width": 160, "height": 120, "texture_scale": "0.6 mm", "seed": 3},
      "track": {"max_tracks": 60, "min_distance": 6},
      "fit": {"parameters": [{"address": "/colliders/finger/friction/coefficient", "initial": 0.6, "lower": 0.1}]}})");
  }
  ~RecoveryBench() override { fs::remove_all(folder_); }
  std::string at(const std::string& name) const { return (folder_ / name).string(); }

  Outcome call(std::vector<std::string> arguments) const {
    arguments.insert(arguments.end(), {"--threads", "1"});
    return call_program(arguments, make_verb_render(), make_verb_track(), make_verb_fit(),
                        make_verb_fitting_bench());
  }
  Outcome recovery(const std::string& folder, std::vector<std::string> more) const {
    more.insert(more.begin(), {"bench", "recovery", at("case.json"), "-o", at(folder)});
    return call(more);
  }
  /// Rows of recovery.csv without the columns of the machine.
  std::vector<std::string> rows(const std::string& folder) const {
    std::vector<std::string> all;
    std::istringstream lines(read_file(at(folder + "/recovery.csv")));
    for (std::string line; std::getline(lines, line);) {
      for (int k = 0; k < 2; ++k) line.resize(line.rfind(','));
      all.push_back(line);
    }
    return all;
  }

  fs::path folder_;
};

TEST_F(RecoveryBench, ADrawIsWhatTheVerbsDoAndIsDoneOnce) {
  const Outcome first = recovery("a", {"--draws", "2", "--variants", "half_tracks", "--variant-draws", "1"});
  ASSERT_EQ(first.code, 0) << first.err;
  for (const char* verb : {"render", "track", "fit"}) {
    const Outcome outcome = call({verb, at("case.json"), "-o", at("real")});
    ASSERT_EQ(outcome.code, 0) << outcome.err;
  }
  const auto fit = nlohmann::json::parse(read_file(at("real/fit.json")));
  const auto& parameter = fit["parameters"][0];
  const RecoveryDraw draw = read_draw(*read_variant(at("a/runs/tiny/as_is/0000")));
  ASSERT_EQ(draw.parameters.size(), 1u);
  EXPECT_EQ(draw.parameters[0].value, parameter["value"].get<double>());
  EXPECT_EQ(draw.parameters[0].low95, parameter["low95"].get<double>());
  EXPECT_EQ(draw.parameters[0].high95, parameter["high95"].get<double>());
  EXPECT_EQ(draw.parameters[0].sigma, parameter["sigma"].get<double>());
  EXPECT_EQ(draw.parameters[0].truth, 0.8);
  EXPECT_NEAR(draw.parameters[0].error, std::log(draw.parameters[0].value / 0.8), 1e-12);
  EXPECT_EQ(read_file(at("a/runs/tiny/as_is/0000/tracks.csv")), read_file(at("real/tracks.csv")));
  EXPECT_NE(read_file(at("a/runs/tiny/as_is/0001/tracks.csv")), read_file(at("real/tracks.csv")))
      << "another draw has other noise";
  const RecoveryDraw half = read_draw(*read_variant(at("a/runs/tiny/half_tracks/0000")));
  EXPECT_NEAR(half.tracks, 0.5 * draw.tracks, 0.25 * draw.tracks);
  EXPECT_FALSE(fs::exists(at("a/runs/tiny/as_is/0000/footage.avi")));
  for (const char* file :
       {"summary.csv", "recovery.md", "index.html", "tiny_colliders_finger_friction_coefficient_draws.svg",
        "tiny_colliders_finger_friction_coefficient_variants.svg"})
    EXPECT_TRUE(fs::exists(at(std::string("a/") + file))) << file;

  // One draw more, of which the first two are not done again.
  const auto written = fs::last_write_time(at("a/runs/tiny/as_is/0001/variant.json"));
  const Outcome more = recovery("a", {"--draws", "3"});
  ASSERT_EQ(more.code, 0) << more.err;
  EXPECT_THAT(more.err, HasSubstr("tiny, as_is: 2 of 3 draws kept"));
  EXPECT_EQ(fs::last_write_time(at("a/runs/tiny/as_is/0001/variant.json")), written);
  EXPECT_EQ(rows("a").size(), 4u);

  // Two shards make no tables, and the same draws.
  EXPECT_EQ(recovery("b", {"--draws", "3", "--shard", "1/2"}).code, 0);
  EXPECT_FALSE(fs::exists(at("b/recovery.csv")));
  EXPECT_TRUE(fs::exists(at("b/runs/tiny/as_is/0002/variant.json")));
  EXPECT_FALSE(fs::exists(at("b/runs/tiny/as_is/0001/variant.json")));
  EXPECT_EQ(recovery("b", {"--draws", "3", "--shard", "2/2"}).code, 0);
  const Outcome tables = recovery("b", {"--draws", "3"});
  EXPECT_THAT(tables.err, HasSubstr("3 of 3 draws kept"));
  EXPECT_EQ(rows("b"), rows("a"));

  // Other noise is another study.
  const Outcome other = recovery("a", {"--draws", "1", "--set", "/render/noise=3"});
  EXPECT_THAT(other.err, HasSubstr("tiny, as_is: 0 of 1 draw kept"));
  EXPECT_NE(rows("a")[1], rows("b")[1]);
}

// A camera of COLMAP is two files: a pose that changed is another study too.
TEST_F(RecoveryBench, KnowsACameraOfColmapByWhatItSees) {
  fitting::Camera camera;
  camera.name = "a.png";
  camera.intrinsics << 400, 0, 79.5, 0, 400, 59.5, 0, 0, 1;
  camera.rotation = Vec3(1, -1, -1).asDiagonal();
  camera.translation = {0, 0, 60};
  camera.width = 160, camera.height = 120;
  fs::create_directories(at("colmap"));
  fitting::write_colmap_cameras({camera}, at("colmap"), 1);
  const std::vector<std::string> arguments = {
      "--draws", "1", "--set", "/camera=" + at("colmap"), "--set", "/camera_unit=1 mm"};
  const Outcome first = recovery("a", arguments);
  ASSERT_EQ(first.code, 0) << first.err;
  EXPECT_THAT(recovery("a", arguments).err, HasSubstr("tiny, as_is: 1 of 1 draw kept"));
  camera.translation = {0.5, 0, 60};
  fitting::write_colmap_cameras({camera}, at("colmap"), 1);
  EXPECT_THAT(recovery("a", arguments).err, HasSubstr("tiny, as_is: 0 of 1 draw kept"));
}

TEST_F(RecoveryBench, RefusesWhatItCannotRepeat) {
  EXPECT_THAT(recovery("x", {"--variants", "worse"}).err,
              HasSubstr("--variants: got 'worse', expected all, none"));
  const Outcome real = recovery("x", {"--set", "/truth=null"});
  EXPECT_EQ(real.code, 2);
  EXPECT_THAT(real.err, HasSubstr("/truth: got nothing, expected a truth to find again"));
  EXPECT_FALSE(fs::exists(at("x/runs")));
}

}  // namespace
}  // namespace rhytid::tools
