// Case files: what they say arrives, and what is wrong is refused in one line that names place and remedy.
#include "fitting/case.h"

#include <gmock/gmock.h>
#include <unistd.h>

#include <cmath>
#include <filesystem>
#include <fstream>

#include "fitting/case_rules.h"
#include "sim/core/error.h"
#include "sim/scene/load.h"
#include "tests/support/small_scenes.h"

namespace rhytid::fitting {
namespace {

using testing::AllOf;
using testing::HasSubstr;
namespace fs = std::filesystem;

std::vector<std::string> texts(const std::vector<Setting>& settings) {
  std::vector<std::string> all;
  for (const Setting& setting : settings) all.push_back(setting.text);
  return all;
}

class CaseTest : public testing::Test {
 protected:
  void SetUp() override {
    folder_ = fs::temp_directory_path() / ("rhytid_case_" + std::to_string(getpid()) + "_" +
                                           testing::UnitTest::GetInstance()->current_test_info()->name());
    fs::create_directories(folder_);
    write("scene.json", test::drag_scene(2, 3));
  }
  void TearDown() override { fs::remove_all(folder_); }

  std::string write(const std::string& name, const std::string& text) {
    std::ofstream(folder_ / name) << text;
    return (folder_ / name).string();
  }
  std::string error_of(const std::string& text, const std::vector<std::string>& settings = {}) {
    try {
      load_case(write("case.json", text), settings);
    } catch (const InputError& error) {
      EXPECT_EQ(std::string(error.what()).find('\n'), std::string::npos);
      return error.what();
    }
    return "no error";
  }

  fs::path folder_;
};

TEST_F(CaseTest, ConsidersParametersNumbersAndPaths) {
  EXPECT_FALSE(load_case(write("case.json", R"({"scene": "scene.json"})")).fit.consider);
  const Case c = load_case(write("case.json", R"({"scene": "scene.json", "fit": {"consider": [
      {"address": "/colliders/finger/friction/coefficient", "sigma": 0.2},
      {"address": "/base/stiffness", "relative": 0.5},
      {"address": "/colliders/0/path/1/position/2", "sigma": "50 um"},
      {"address": "/skin/layers/0/thickness", "relative": 0.1},
      {"address": "/base/onset", "sigma": "2 um"},
      {"address": "/colliders/0/path", "sigma": 0.3}]}})"));
  ASSERT_TRUE(c.fit.consider);
  ASSERT_EQ(c.fit.consider->size(), 3u);
  EXPECT_EQ((*c.fit.consider)[0].prior_sigma, 0.2);
  EXPECT_NEAR(*(*c.fit.consider)[1].prior_sigma, std::log(1.5), 1e-12);
  EXPECT_EQ((*c.fit.consider)[2].prior_sigma, 0.05);
  ASSERT_EQ(c.fit.consider_quantities.size(), 2u);
  EXPECT_EQ(c.fit.consider_quantities[0].address, "/skin/layers/soft/thickness");
  EXPECT_EQ(c.fit.consider_quantities[0].sigma, 0.1);
  EXPECT_TRUE(c.fit.consider_quantities[0].is_relative);
  EXPECT_EQ(c.fit.consider_quantities[1].sigma, 0.002);
  EXPECT_FALSE(c.fit.consider_quantities[1].is_relative);
  ASSERT_EQ(c.fit.consider_paths.size(), 1u);
  EXPECT_EQ(c.fit.consider_paths[0].address, "/colliders/finger/path");
  EXPECT_EQ(c.fit.consider_paths[0].sigma, 0.3);
}

TEST_F(CaseTest, ConsiderSaysWhatItCannot) {
  const auto error = [this](const std::string& item) {
    return error_of(R"({"scene": "scene.json", "fit": {"consider": [)" + item + "]}}");
  };
  EXPECT_THAT(error(R"({"address": "/skin/layers/soft/thicknes", "relative": 0.1})"),
              AllOf(HasSubstr("case.json:1: /fit/consider/0/address: got \"/skin/layers/soft/thicknes\""),
                    HasSubstr("nearest is /skin/layers/soft/thickness")));
  EXPECT_THAT(error(R"({"address": "/skin/layers/soft/thickness"})"),
              HasSubstr("got neither \"sigma\" nor \"relative\""));
  EXPECT_THAT(error(R"({"address": "/skin/layers/soft/thickness", "sigma": "3 kPa"})"),
              AllOf(HasSubstr("/fit/consider/0/sigma: got \"3 kPa\""), HasSubstr("a length")));
  EXPECT_THAT(error(R"({"address": "/skin/layers/soft/thickness", "sigma": -0.1})"),
              HasSubstr("/fit/consider/0/sigma: got -0.1, expected a deviation >= 0"));
  EXPECT_THAT(error(R"({"address": "/skin/layers/soft/poissons_ratio", "relative": 0.1})"),
              AllOf(HasSubstr("/fit/consider/0/relative"), HasSubstr("expected sigma")));
  EXPECT_THAT(error(R"({"address": "/base/normal/0", "relative": 0.1})"), HasSubstr("the value is not > 0"));
  EXPECT_THAT(error(R"({"address": "/colliders/finger/path", "relative": 0.1})"), HasSubstr("sigma, in mm"));
  EXPECT_THAT(error(R"({"address": "/skin/surface/crop/radius", "relative": 0.1})"),
              HasSubstr("expected a number of the scene, nearest is"));
}

TEST_F(CaseTest, SettingsGrowByTheNumberBehindTheLast) {
  const std::string path = write("case.json", R"({"scene": "scene.json"})");
  const Case c = load_case(path, {"/settings/0=/skin/order=3", "/settings/1=/time/frames=5"});
  EXPECT_THAT(texts(c.scene_settings), testing::ElementsAre("/skin/order=3", "/time/frames=5"));
}

TEST_F(CaseTest, ValuesOfTheSceneAreRefusedWithTheWayToSetThem) {
  const std::string hint = error_of(R"({"scene": "scene.json", "settings": ["/time/frames=2"]})",
                                    {"/skin/layers/film/thickness=0.2 mm"});
  EXPECT_THAT(hint, HasSubstr("--set \"/settings/1=/skin/layers/film/thickness=0.2 mm\""));
  // A setting of the case is no --set.
  EXPECT_THAT(error_of("{\"scene\": \"scene.json\",\n\"settings\": [\"/skin/ordr=2\"]}"),
              HasSubstr("case.json:2: /settings/0: /skin/ordr: got"));
  EXPECT_THAT(error_of("{\"scene\": \"scene.json\",\n\"settings\": [\"/skin/order\"]}"),
              HasSubstr("case.json:2: /settings/0 \"/skin/order\": got no '='"));
  EXPECT_THAT(error_of(R"({"scene": "scene.json"})", {"/settings/0=/skin/order=x"}),
              HasSubstr("case.json (--set): /settings/0: /skin/order: got \"x\""));
  EXPECT_THAT(error_of(R"({"extends": "scene.json"})"), HasSubstr("got a scene, expected a case"));
  EXPECT_THAT(
      error_of(R"({"scene": "scene.json", "measure": {}, "variants": []})"),
      HasSubstr("case.json: got an experiment, expected a case (rhytid study sweep runs experiments"));
  write("scene.json", R"({"skin": {"surface": {}, "layers": []}})");
  EXPECT_THAT(error_of(R"({"scene": "scene.json"})"),
              HasSubstr("e.g. --set /settings/0=/skin/surface/file=PATH"));
}

TEST(CaseRules, EveryKeyHasAMeaning) {
  for (const std::vector<Rule>* rules : {&case_rules(), &scene_rules()})
    for (const Rule& rule : *rules) EXPECT_FALSE(rule.doc.empty()) << rule.pointer;
}

TEST_F(CaseTest, DefaultsAreThoseOfTheStructs) {
  const Case c = load_case(write("case.json", R"({"scene": "scene.json"})"));
  EXPECT_EQ(c.name, "drag");
  EXPECT_EQ(c.scene, (folder_ / "scene.json").string());
  EXPECT_EQ(c.truth_scene, "");
  EXPECT_EQ(c.render.width, RenderCase().width);
  EXPECT_EQ(c.render.noise, RenderCase().noise);
  EXPECT_EQ(c.track.max_tracks, TrackCase().max_tracks);
  EXPECT_EQ(c.track.window, TrackCase().window);
  EXPECT_FALSE(c.track.roi);
  EXPECT_EQ(c.fit.max_evaluations, FitCase().max_evaluations);
  EXPECT_EQ(c.fit.min_sigma, FitCase().min_sigma);
  EXPECT_TRUE(c.fit.parameters.empty());
}

TEST_F(CaseTest, QuantitiesTakeTheUnitOfTheirParameter) {
  const Case c = load_case(write("case.json", R"({
    "scene": "scene.json", "settings": ["/time/frames=2"],
    "truth": {"settings": ["/skin/layers/film/youngs_modulus=2 MPa"]},
    "render": {"texture_scale": "300 um", "tilt": "0 deg"},
    "track": {"roi": [1, 2, 30, 40]},
    "fit": {"rim_margin": "1 cm", "gauge_layer": "film", "path_deviations": "fit",
      "frame_weights": [{"from": 4, "weight": 0.5, "half_every": 1}], "parameters": [
      {"address": "/skin/layers/1/youngs_modulus", "initial": "500 kPa", "lower": "1 kPa", "upper": 3,
       "transform": "logit", "prior_sigma": 0.7},
      {"address": "/colliders/finger/friction/coefficient", "initial": 0.3}]}})"));
  ASSERT_EQ(c.fit.parameters.size(), 2u);
  const FitParameter& film = c.fit.parameters[0];
  EXPECT_EQ(film.address, "/skin/layers/film/youngs_modulus");
  EXPECT_EQ(film.initial, 0.5);
  EXPECT_EQ(film.lower, 0.001);
  EXPECT_EQ(film.upper, 3.0);
  EXPECT_EQ(film.transform, ParameterTransform::logit);
  EXPECT_EQ(film.prior_sigma, 0.7);
  EXPECT_FALSE(c.fit.parameters[1].lower);
  EXPECT_EQ(c.fit.rim_margin, 10);
  EXPECT_EQ(c.fit.path_deviations, "fit");
  ASSERT_EQ(c.fit.frame_weights.size(), 1u);
  EXPECT_EQ(frame_weight(c.fit.frame_weights, 5), 0.25);
  EXPECT_EQ(c.render.texture_scale, 0.3);
  EXPECT_EQ(c.render.tilt, 0);
  EXPECT_EQ(c.track.roi, (std::array<double, 4>{1, 2, 30, 40}));
  EXPECT_EQ(c.truth_scene, c.scene);
  EXPECT_THAT(texts(c.truth_settings),
              testing::ElementsAre("/time/frames=2", "/skin/layers/film/youngs_modulus=2 MPa"));
}

TEST_F(CaseTest, WrongCasesAreRefusedWithPlaceAndRemedy) {
  EXPECT_THAT(error_of(R"({"scene": "scene.json", "rendr": {}})"),
              AllOf(HasSubstr("case.json:1: /rendr"), HasSubstr("nearest is \"render\"")));
  EXPECT_THAT(error_of("{\"scene\": \"scene.json\",\n\"render\": {\"noise\": -1}}"),
              AllOf(HasSubstr("case.json:2: /render/noise: got -1"), HasSubstr("from 0 to 64")));
  EXPECT_THAT(error_of(R"({})"), AllOf(HasSubstr("/scene"), HasSubstr("required")));
  EXPECT_THAT(error_of(R"({"scene": "absent.json"})"), HasSubstr("absent.json"));
  EXPECT_THAT(error_of(R"({"scene": "scene.json", "track": {"roi": [1, 2, 3]}})"), HasSubstr("/track/roi"));
  EXPECT_THAT(error_of(R"({"scene": "scene.json", "track": {"window": 20}})"),
              AllOf(HasSubstr("case.json:1: /track/window: got 20"), HasSubstr("odd")));
  const auto parameter = [this](const std::string& text) {
    return error_of("{\"scene\": \"scene.json\", \"fit\": {\"parameters\": [" + text + "]}}");
  };
  EXPECT_THAT(parameter(R"({"address": "/skin/layers/film/youngs_modulu"})"),
              AllOf(HasSubstr("/fit/parameters/0/address"),
                    HasSubstr("nearest is /skin/layers/film/youngs_modulus")));
  EXPECT_THAT(parameter(R"({"address": "/skin/layers/film/youngs_modulus", "initial": "3 mm"})"),
              AllOf(HasSubstr("/fit/parameters/0/initial"), HasSubstr("a pressure")));
  EXPECT_THAT(parameter(R"({"address": "/skin/layers/film/youngs_modulus", "lower": "2 MPa"})"),
              AllOf(HasSubstr("/fit/parameters/0/initial"), HasSubstr("the scene's value")));
  EXPECT_THAT(parameter(R"({"address": "/skin/layers/film/youngs_modulus", "lower": 5, "upper": 4})"),
              HasSubstr("lower < upper"));
  EXPECT_THAT(parameter(R"({"address": "/skin/layers/film/youngs_modulus"},
                           {"address": "/skin/layers/1/youngs_modulus"})"),
              AllOf(HasSubstr("/fit/parameters/1/address"), HasSubstr("a second time")));
  EXPECT_THAT(error_of(R"({"scene": "scene.json", "fit": {"frame_weights": [{"from": 4, "to": 3}]}})"),
              AllOf(HasSubstr("/fit/frame_weights/0/to"), HasSubstr("at least from, 4")));
  EXPECT_THAT(error_of(R"({"scene": "scene.json", "fit": {"gauge_layer": "flim"}})"),
              HasSubstr("nearest is \"film\""));
}

TEST_F(CaseTest, OverridesAndExtends) {
  write("base.json", R"({"scene": "scene.json", "render": {"noise": 3, "seed": 4}})");
  const std::string path = write("case.json", R"({"extends": "base.json", "render": {"noise": 2}})");
  const Case c = load_case(path, {"/render/seed=9"});
  EXPECT_EQ(c.render.noise, 2);
  EXPECT_EQ(c.render.seed, 9u);
  EXPECT_THAT(error_of(R"({"scene": "scene.json"})", {"/render/sed=9"}), HasSubstr("\"seed\""));
}

TEST_F(CaseTest, FilesAreLookedForBesideTheCaseThenInTheFolder) {
  Case c = load_case(write("case.json", R"({"scene": "scene.json", "footage": "f.mp4"})"));
  EXPECT_EQ(footage_path(c, "out"), "out/f.mp4");
  EXPECT_EQ(tracks_path(c, "out"), "out/tracks.csv");
  EXPECT_EQ(camera_path(c, "out"), "out/camera.yaml");
  write("f.mp4", "");
  EXPECT_EQ(footage_path(c, "out"), (folder_ / "f.mp4").string());
}

TEST_F(CaseTest, ClipsHaveWhatTheyLeaveOutFromTheCase) {
  const std::string path = write("case.json", R"({
    "scene": "scene.json", "settings": ["/time/frames=2"], "camera": "a.yaml",
    "truth": {"settings": ["/skin/order=3"]},
    "clips": [
      {"name": "left", "tracks": "left.csv"},
      {"name": "up", "settings": ["/time/offset=0.01"],
       "cameras": [{"name": "near", "camera": "b.yaml", "tracks": "up1.csv"}, {"name": "far"}]}],
    "fit": {"parameters": [{"address": "/skin/layers/film/youngs_modulus"},
                           {"address": "/clips/*/colliders/0/friction/coefficient", "initial": 0.5},
                           {"address": "/clips/up/time/offset", "prior_sigma": 0.01}]}})");
  const Case c = load_case(path);
  ASSERT_EQ(c.clips.size(), 2u);
  EXPECT_EQ(c.name, "case");
  ASSERT_EQ(c.fit.parameters.size(), 4u);
  const auto named = [&](int k) { return c.fit.parameters[k].clip + ":" + c.fit.parameters[k].address; };
  EXPECT_EQ(named(0), ":/skin/layers/film/youngs_modulus");
  EXPECT_EQ(named(1), "left:/colliders/finger/friction/coefficient");
  EXPECT_EQ(named(2), "up:/colliders/finger/friction/coefficient");
  EXPECT_EQ(named(3), "up:/time/offset");
  EXPECT_EQ(c.fit.parameters[2].initial, 0.5);
  const std::vector<Scene> scenes = scenes_of(c);
  EXPECT_EQ(scenes[0].time.offset, 0);
  EXPECT_EQ(scenes[1].time.offset, 0.01);
  EXPECT_EQ(scenes[1].time.frames, 2);

  const Case left = case_of_view(c, 0, 0), far = case_of_view(c, 1, 1);
  EXPECT_TRUE(left.clips.empty());
  EXPECT_EQ(left.camera, (folder_ / "a.yaml").string());
  EXPECT_EQ(tracks_path(left, folder_of_view(c, 0, 0, "out")), "out/left/left.csv");
  EXPECT_THAT(texts(left.truth_settings), testing::ElementsAre("/time/frames=2", "/skin/order=3"));
  EXPECT_EQ(far.camera, left.camera);
  EXPECT_THAT(texts(far.truth_settings),
              testing::ElementsAre("/time/frames=2", "/time/offset=0.01", "/skin/order=3"));
  EXPECT_EQ(folder_of_view(c, 1, 1, "out"), "out/up/far");
  EXPECT_EQ(view_named(c, "up/far"), (std::pair{1, 1}));
  EXPECT_THROW(view_named(c, "up"), InputError);
  // Clips go by their names in settings too.
  EXPECT_EQ(load_case(path, {"/clips/up/settings/0=/time/offset=0.02"}).clips[1].scene_settings.back().text,
            "/time/offset=0.02");
}

// The truth of the case is that of a clip as if the clip were the case: its scene where the truth has none, its
// settings before those of the truth.
TEST_F(CaseTest, ClipsResolveTheTruthOfTheCase) {
  write("other.json", test::drag_scene(2, 3));
  write("true.json", test::drag_scene(2, 3));
  const auto clips = [this](const std::string& truth) {
    return load_case(
               write("case.json", R"({"scene": "scene.json", "settings": ["/time/frames=2"], )" + truth + R"(
      "clips": [{"name": "same"},
                {"name": "other", "scene": "other.json", "settings": ["/time/offset=0.01"]},
                {"name": "own", "scene": "other.json", "settings": ["/time/offset=0.01"],
                 "truth": {"scene": "true.json", "settings": ["/skin/order=2"]}}]})"))
        .clips;
  };
  const auto path = [this](const char* name) { return (folder_ / name).string(); };
  const std::vector<ClipCase> plain = clips(R"("truth": {"settings": ["/skin/order=3"]},)");
  EXPECT_EQ(plain[0].truth_scene, path("scene.json"));
  EXPECT_EQ(plain[1].truth_scene, path("other.json"));
  EXPECT_THAT(texts(plain[1].truth_settings),
              testing::ElementsAre("/time/frames=2", "/time/offset=0.01", "/skin/order=3"));
  const std::vector<ClipCase> named =
      clips(R"("truth": {"scene": "true.json", "settings": ["/skin/order=3"]},)");
  EXPECT_EQ(named[1].truth_scene, path("true.json"));
  EXPECT_THAT(texts(named[0].truth_settings), testing::ElementsAre("/skin/order=3"));
  EXPECT_THAT(texts(named[1].truth_settings), testing::ElementsAre("/time/offset=0.01", "/skin/order=3"));
  EXPECT_EQ(named[2].truth_scene, path("true.json"));
  EXPECT_THAT(texts(named[2].truth_settings), testing::ElementsAre("/skin/order=2"));
  EXPECT_EQ(clips("")[1].truth_scene, "");
}

TEST_F(CaseTest, ViewsHaveImagesOfColmapOfTheirOwn) {
  const Case c = load_case(write("case.json", R"({
    "scene": "scene.json", "camera": "colmap", "camera_image": "a.jpg", "camera_unit": "2 cm",
    "clips": [{"name": "left"},
              {"name": "up", "camera_image": "b.jpg"},
              {"name": "down", "cameras": [{"name": "near", "camera_image": "c.jpg", "camera_unit": 5},
                                           {"name": "far", "camera": "far.yaml"}]}]})"));
  const Case left = case_of_view(c, 0, 0), up = case_of_view(c, 1, 0), near = case_of_view(c, 2, 0),
             far = case_of_view(c, 2, 1);
  EXPECT_EQ(left.camera_image, "a.jpg");
  EXPECT_EQ(left.camera_unit, 20.0);
  EXPECT_EQ(up.camera_image, "b.jpg");
  EXPECT_EQ(up.camera_unit, 20.0);
  EXPECT_EQ(near.camera, left.camera);
  EXPECT_EQ(near.camera_image, "c.jpg");
  EXPECT_EQ(near.camera_unit, 5.0);
  EXPECT_EQ(far.camera, (folder_ / "far.yaml").string());
  EXPECT_EQ(far.camera_image, "") << "a camera of its own";
  EXPECT_FALSE(far.camera_unit);
  EXPECT_EQ(near.view_pointer, "/clips/2/cameras/0");
  EXPECT_THAT(error_of(R"({"scene": "scene.json",
                           "clips": [{"name": "a", "camera_image": "a.jpg", "cameras": [{"name": "x"}]}]})"),
              HasSubstr("cameras"));
}

TEST_F(CaseTest, WrongClipsAreRefused) {
  const auto clips = [this](const std::string& list, const std::string& more = "") {
    return error_of("{\"scene\": \"scene.json\", \"clips\": [" + list + "]" + more + "}");
  };
  const auto address = [&](const std::string& text) {
    return clips(R"({"name": "left"}, {"name": "up"})",
                 R"(, "fit": {"parameters": [{"address": ")" + text + "\"}]}");
  };
  EXPECT_THAT(clips(R"({"tracks": "a.csv"})"), AllOf(HasSubstr("/clips/0/name"), HasSubstr("required")));
  EXPECT_THAT(clips(R"({"name": "a"}, {"name": "a"})"), HasSubstr("a second time"));
  EXPECT_THAT(clips(R"({"name": "a"})", R"(, "tracks": "all.csv")"),
              AllOf(HasSubstr("/tracks"), HasSubstr("each of the clips has its own")));
  EXPECT_THAT(clips(R"({"name": "a", "settings": ["/skin/ordr=2"]})"),
              AllOf(HasSubstr("clip 'a'"), HasSubstr("/skin/ordr")));
  EXPECT_THAT(clips(R"({"name": "a", "tracks": "a.csv", "cameras": [{"name": "x"}]})"), HasSubstr("cameras"));
  EXPECT_THAT(address("/clips/uq/time/offset"), HasSubstr("nearest is \"up\""));
  EXPECT_THAT(address("/clips/up/time/ofset"),
              AllOf(HasSubstr("/fit/parameters/0/address"), HasSubstr("nearest is /time/offset")));
  EXPECT_THAT(address("/clips/*/skin/layers/fat/youngs_modulus"), HasSubstr("/fit/parameters/0/address"));
  EXPECT_THAT(address(R"(/clips/up/time/offset"}, {"address": "/clips/*/time/offset)"),
              HasSubstr("a second time"));
  EXPECT_THAT(address(R"(/time/offset"}, {"address": "/clips/up/time/offset)"), HasSubstr("a second time"));
  EXPECT_THAT(error_of(R"({"scene": "scene.json",
                           "fit": {"parameters": [{"address": "/clips/up/time/offset"}]}})"),
              HasSubstr("the case has no clips"));
}

}  // namespace
}  // namespace rhytid::fitting
