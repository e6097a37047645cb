// A twin experiment's footage end to end: rendered, opened, compared with its own ground truth, tracked.
#include <gmock/gmock.h>
#include <unistd.h>

#include <Eigen/Geometry>
#include <filesystem>
#include <fstream>
#include <nlohmann/json.hpp>
#include <opencv2/calib3d.hpp>
#include <opencv2/imgcodecs.hpp>
#include <opencv2/imgproc.hpp>
#include <opencv2/videoio.hpp>

#include "fitting/cameras.h"
#include "fitting/observations.h"
#include "sim/output/atomic_file.h"
#include "sim/scene/collider_motion.h"
#include "sim/scene/load.h"
#include "sim/scene/scene_model.h"
#include "tests/tools/program_call.h"
#include "tools/render/finger.h"
#include "tools/render/skin_camera.h"
#include "tools/render/skin_renderer.h"
#include "tools/render/surface_view.h"
#include "tools/verb.h"

namespace rhytid::tools {
std::unique_ptr<Verb> make_verb_render();
std::unique_ptr<Verb> make_verb_track();

namespace {

namespace fs = std::filesystem;
using testing::HasSubstr;

constexpr const char* scene_text = R"({
  "name": "small",
  "skin": {
    "surface": {"grid": {"size": ["16 mm", "12 mm"], "cells": [4, 3]}},
    "order": 2,
    "layers": [{"name": "skin", "thickness": "1.5 mm", "order": 1, "youngs_modulus": "50 kPa"}]
  },
  "base": {"shape": "plane", "stiffness": "0.1 MPa/mm", "onset": "0.02 mm"},
  "colliders": [
    {"name": "finger", "shape": "sphere", "radius": "2 mm", "stiffness": "0.1 MPa/mm", "onset": "0.02 mm",
     "friction": {"coefficient": 0.8, "slip_speed": "2 mm/s"},
     "path": [{"time": 0, "position": [-4, -3, 2.02]}, {"time": 0.1, "position": [-4, -3, 1.5]},
              {"time": 0.3, "position": [-2, -3, 1.5]}]}],
  "time": {"frame_rate": "20 Hz", "frames": 4}
})";
constexpr const char* case_text = R"({
  "scene": "scene.json",
  "truth": {"settings": ["/skin/layers/skin/youngs_modulus=80 kPa"]},
  "render": {"width": 160, "height": 120, "texture_scale": "0.6 mm", "truth_spacing": 8},
  "track": {"max_tracks": 60, "min_distance": 6}
})";

Outcome run(const std::vector<std::string>& arguments) {
  return call_program(arguments, make_verb_render(), make_verb_track());
}

/// One rendered twin for all tests.
class TwinFootage : public testing::Test {
 protected:
  static void SetUpTestSuite() {
    folder_ = fs::temp_directory_path() / ("rhytid_twin_" + std::to_string(getpid()));
    fs::create_directories(folder_);
    std::ofstream(folder_ / "scene.json") << scene_text;
    std::ofstream(folder_ / "case.json") << case_text;
    rendered_ = run({"render", path("case.json"), "-o", path("out"), "--threads", "2"});
  }
  static void TearDownTestSuite() { fs::remove_all(folder_); }
  void SetUp() override { ASSERT_EQ(rendered_.code, 0) << rendered_.err; }

  static std::string path(const std::string& name) { return (folder_ / name).string(); }

  static inline fs::path folder_;
  static inline Outcome rendered_;
};

TEST_F(TwinFootage, VideoOpensWithTheFitsFrames) {
  cv::VideoCapture video(path("out/footage.avi"));
  ASSERT_TRUE(video.isOpened());
  EXPECT_NEAR(video.get(cv::CAP_PROP_FPS), 20, 1e-3);
  int frames = 0;
  for (cv::Mat frame; video.read(frame); ++frames) EXPECT_EQ(frame.size(), cv::Size(160, 120));
  EXPECT_EQ(frames, 5);
  const auto truth = nlohmann::json::parse(read_file(path("out/truth.json")));
  double modulus = 0;
  for (const auto& p : truth["parameters"])
    if (p["address"] == "/skin/layers/skin/youngs_modulus") modulus = p["value"];
  EXPECT_EQ(modulus, 0.08);
}

/// All frames of a video, BGR.
std::vector<cv::Mat> frames_of(const std::string& path) {
  std::vector<cv::Mat> frames;
  cv::VideoCapture video(path);
  for (cv::Mat frame; video.read(frame);) frames.push_back(frame.clone());
  return frames;
}

double mean_difference(const cv::Mat& a, const cv::Mat& b) {
  cv::Mat difference;
  cv::absdiff(a, b, difference);
  const cv::Scalar mean = cv::mean(difference);
  return (mean[0] + mean[1] + mean[2]) / 3;
}

bool has_h264_encoder(const std::string& scratch) {
  cv::VideoWriter writer;
  return writer.open(scratch, cv::CAP_FFMPEG, cv::VideoWriter::fourcc('a', 'v', 'c', '1'), 20, {160, 120});
}

TEST_F(TwinFootage, H264HoldsTheSameFrames) {
  const std::vector<std::string> arguments = {"render",     path("case.json"), "-o",
                                              path("h264"), "--set",           "/render/codec=h264"};
  const Outcome film = run(arguments);
  if (!has_h264_encoder(path("probe.mp4"))) {
    EXPECT_EQ(film.code, 2);
    EXPECT_THAT(film.err, HasSubstr("footage.mp4: got no working encoder for h264, expected"));
    EXPECT_FALSE(fs::exists(path("h264/truth_motion.bin"))) << "refused before the simulation, not after it";
    GTEST_SKIP() << "no H.264 encoder: its absence was tested";
  }
  ASSERT_EQ(film.code, 0) << film.err;
  EXPECT_THAT(film.out, HasSubstr("footage.mp4: 5 frames at 20 Hz, 160 x 120 px"));
  cv::VideoCapture video(path("h264/footage.mp4"));
  ASSERT_TRUE(video.isOpened());
  EXPECT_NEAR(video.get(cv::CAP_PROP_FPS), 20, 1e-3);
  const std::vector<cv::Mat> frames = frames_of(path("h264/footage.mp4")),
                             jpegs = frames_of(path("out/footage.avi"));
  ASSERT_EQ(frames.size(), 5u);
  ASSERT_EQ(jpegs.size(), 5u);
  // Each is its own frame and no neighbour: from frame 2 on the motion shows above the coding.
  double worst = 0, closest_other = 255;
  for (std::size_t f = 0; f < 5; ++f) {
    ASSERT_EQ(frames[f].size(), cv::Size(160, 120));
    for (std::size_t g = 0; g < 5; ++g) {
      const double difference = mean_difference(frames[f], jpegs[g]);
      if (f == g) worst = std::max(worst, difference);
      if (f != g && std::max(f, g) > 2) closest_other = std::min(closest_other, difference);
    }
  }
  for (const int f : {0, 2, 4}) {  // before any codec
    const cv::Mat exact = cv::imread(path("h264/frame_000") + std::to_string(f) + ".png");
    worst = std::max(worst, mean_difference(frames[static_cast<std::size_t>(f)], exact));
  }
  std::printf("H.264: frames differ by %.2f grey levels at most, from others by %.2f\n", worst,
              closest_other);
  EXPECT_LT(worst, 5);
  EXPECT_GT(closest_other, 1.1 * worst);
}

TEST_F(TwinFootage, MotionIsThatOfTheTruthsRun) {
  const SceneModel truth(load_scene(path("scene.json"), {"/skin/layers/skin/youngs_modulus=80 kPa"}));
  const Trajectory run = simulate(truth.model(), truth.native(), truth.run_options());
  ASSERT_TRUE(run.complete) << run.failure;
  const MovingSurface surface = read_motion(path("out/truth_motion.bin"));
  ASSERT_EQ(surface.frames(), 5);
  const SkinMesh& mesh = truth.model().mesh;
  double largest = 0;
  for (int f = 0; f < 5; ++f)
    for (int face = 0; face < mesh.num_faces; ++face) {
      const int node = mesh.outer_nodes(face)[0];  // the corner u = v = 0
      const Vec3 x = mesh.rest.row(node).transpose() + run.at_frame(f).u.segment<3>(3 * node);
      EXPECT_LT((surface.position({face, 0, 0}, f) - x).norm(), 1e-12);
      largest = std::max(largest, (x - Vec3(mesh.rest.row(node).transpose())).norm());
    }
  EXPECT_GT(largest, 0.3);  // mm: something happens in the footage
}

TEST_F(TwinFootage, TruthTracksAreExactProjections) {
  const fitting::TrackSet tracks = fitting::read_tracks(path("out/truth_tracks.csv"));
  const fitting::Camera camera = fitting::read_camera(path("out/camera.yaml"));
  const MovingSurface surface = read_motion(path("out/truth_motion.bin"));
  const SubdividedSurface tessellation(surface.mesh, SurfaceSide::outer, 4);
  const SurfaceView view(surface, tessellation, camera, 0);
  const Scene scene = load_scene(path("scene.json"));
  ASSERT_GT(tracks.tracks.size(), 100u);
  int ok = 0, covered = 0;
  for (const fitting::Track& track : tracks.tracks) {
    const fitting::Observation* first = track.at(0);
    ASSERT_NE(first, nullptr);
    if (first->status != fitting::TrackStatus::ok) continue;
    const auto point = view.pick(first->pixel);
    ASSERT_TRUE(point);
    EXPECT_NEAR(first->pixel.x(), std::round(first->pixel.x()), 1e-9);
    for (const fitting::Observation& o : track.observations) {
      const Vec3 x = surface.position(*point, o.frame);
      const Vec3 tip = ColliderMotion(scene.colliders[0], 0).at(o.time_s).centre;
      const Vec3 sight = (x - camera.centre()).normalized();
      const double clearance = sight.cross(tip - camera.centre()).norm() - 2;
      if (o.status == fitting::TrackStatus::ok) {
        ++ok;
        EXPECT_LT((o.pixel - camera.project(x)).norm(), 1e-9);
        EXPECT_GE(clearance, -1e-9);
      } else {
        covered += o.status == fitting::TrackStatus::occluded ? 1 : 0;
      }
    }
  }
  EXPECT_GT(ok, 300);
  EXPECT_GT(covered, 5);
}

TEST_F(TwinFootage, TrackerFindsTheTruth) {
  const Outcome tracked = run({"track", path("case.json"), "-o", path("out"), "--threads", "2"});
  ASSERT_EQ(tracked.code, 0) << tracked.err;
  EXPECT_THAT(tracked.out, HasSubstr("against the truth: rms"));
  const auto record = nlohmann::json::parse(read_file(path("out/track.json")));
  EXPECT_EQ(record["frames_processed"], 5);
  const auto& error = record["error_against_truth"];
  EXPECT_GT(error["observations"].get<int>(), 100);
  EXPECT_EQ(error["off_skin"], 0);
  EXPECT_LT(error["rms_px"].get<double>(), 0.2) << tracked.out;
  EXPECT_GT(error["rms_px"].get<double>(), 1e-4);  // 0 would mean that truth was compared with itself
  EXPECT_TRUE(fs::exists(path("out/overlay.png")));
}

TEST_F(TwinFootage, OverlayVideoShowsTheTracksOverTheFootage) {
  ASSERT_EQ(run({"track", path("case.json"), "-o", path("out"), "--threads", "2"}).code, 0);
  const bool is_h264 = has_h264_encoder(path("probe.mp4"));
  EXPECT_EQ(fs::exists(path("out/overlay.mp4")), is_h264);
  EXPECT_EQ(fs::exists(path("out/overlay.avi")), !is_h264);
  const std::vector<cv::Mat> overlay = frames_of(path(is_h264 ? "out/overlay.mp4" : "out/overlay.avi")),
                             footage = frames_of(path("out/footage.avi"));
  ASSERT_EQ(overlay.size(), 5u);
  const fitting::TrackSet tracks = fitting::read_tracks(path("out/tracks.csv"));
  for (int f = 0; f < 5; ++f) {
    const cv::Mat& drawn = overlay[static_cast<std::size_t>(f)];
    const cv::Mat& plain = footage[static_cast<std::size_t>(f)];
    ASSERT_EQ(drawn.size(), plain.size());
    // Where there are dots the picture has changed, elsewhere it has not.
    cv::Mat difference, near = cv::Mat::zeros(plain.size(), CV_8U);
    cv::absdiff(drawn, plain, difference);
    int dots = 0;
    for (const fitting::Track& t : tracks.tracks)
      for (const fitting::Observation& o : t.observations) {
        if (o.frame > f || (o.frame < f && o.status != fitting::TrackStatus::ok)) continue;
        const Vec2 at = o.status == fitting::TrackStatus::ok ? o.pixel : t.at(f - 1)->pixel;
        dots += o.frame == f && o.status == fitting::TrackStatus::ok;
        cv::circle(near, {static_cast<int>(std::lround(at.x())), static_cast<int>(std::lround(at.y()))}, 5,
                   255, cv::FILLED);
      }
    ASSERT_GT(dots, 10);
    cv::rectangle(near, {0, 0, 160, 24}, 255, cv::FILLED);  // the caption
    const auto mean = [](const cv::Scalar& s) { return (s[0] + s[1] + s[2]) / 3; };
    cv::Mat away;
    cv::bitwise_not(near, away);
    cv::rectangle(near, {0, 0, 160, 24}, 0, cv::FILLED);
    EXPECT_GT(mean(cv::mean(difference, near)), 3 * mean(cv::mean(difference, away))) << "frame " << f;
    EXPECT_LT(mean(cv::mean(difference, away)), 6) << "frame " << f;
  }
}

TEST_F(TwinFootage, VideoWithoutACase) {
  const Outcome tracked = run({"track", "--video", path("out/footage.avi"), "--roi", "30,20,100,60",
                               "--max-tracks", "20", "--frames", "3", "-o", path("direct")});
  ASSERT_EQ(tracked.code, 0) << tracked.err;
  const fitting::TrackSet tracks = fitting::read_tracks(path("direct/tracks.csv"));
  ASSERT_FALSE(tracks.tracks.empty());
  EXPECT_LE(tracks.tracks.size(), 20u);
  for (const fitting::Track& track : tracks.tracks) {
    EXPECT_EQ(track.observations.back().frame, 2);
    EXPECT_GE(track.observations[0].pixel.x(), 30);
    EXPECT_LT(track.observations[0].pixel.y(), 80);
  }
  EXPECT_EQ(run({"track", "-o", path("direct")}).code, 2);
}

/// What a case says of tracking can be said without one, to the same bits.
TEST_F(TwinFootage, OptionsOfVideoAreThoseOfACase) {
  const Outcome by_case =
      run({"track", path("case.json"), "--video", path("out/footage.avi"), "-o", path("by_case"), "--set",
           "/track/mask_finger=false", "--set",
           R"(/track={"max_tracks": 30, "min_distance": 5, "window": 15, "model": "translation",
               "roi": [30, 20, 100, 60], "mask_finger": false})"});
  ASSERT_EQ(by_case.code, 0) << by_case.err;
  const std::vector<std::string> options = {
      "--roi", "30,20,100,60", "--max-tracks", "30",      "--min-distance",
      "5",     "--window",     "15",           "--model", "translation"};
  std::vector<std::string> arguments = {"track", "--video", path("out/footage.avi"), "-o",
                                        path("by_options")};
  arguments.insert(arguments.end(), options.begin(), options.end());
  const Outcome by_options = run(arguments);
  ASSERT_EQ(by_options.code, 0) << by_options.err;
  EXPECT_EQ(read_file(path("by_options/tracks.csv")), read_file(path("by_case/tracks.csv")));
  // Each of them has a say.
  for (std::size_t k = 0; k < options.size(); k += 2) {
    std::vector<std::string> fewer = {"track", "--video", path("out/footage.avi"), "-o", path("fewer")};
    for (std::size_t i = 0; i < options.size(); ++i)
      if (i != k && i != k + 1) fewer.push_back(options[i]);
    ASSERT_EQ(run(fewer).code, 0);
    EXPECT_NE(read_file(path("fewer/tracks.csv")), read_file(path("by_options/tracks.csv"))) << options[k];
  }
}

TEST_F(TwinFootage, ThereAndBackIsPrintedAndRecorded) {
  const std::vector<std::string> arguments = {"track",      "--video", path("out/footage.avi"), "-o",
                                              path("back"), "--roi",   "30,20,100,60"};
  const Outcome once = run(arguments);
  ASSERT_EQ(once.code, 0) << once.err;
  EXPECT_THAT(once.out, HasSubstr("flow there and back per frame: median"));
  EXPECT_FALSE(nlohmann::json::parse(read_file(path("back/track.json"))).contains("there_and_back_px"));
  std::vector<std::string> twice = arguments;
  twice.push_back("--there-and-back");
  const Outcome back = run(twice);
  ASSERT_EQ(back.code, 0) << back.err;
  EXPECT_THAT(back.out, HasSubstr("there and back over the whole clip: median"));
  const auto record = nlohmann::json::parse(read_file(path("back/track.json")));
  EXPECT_EQ(record["there_and_back_px"]["sent"], record["tracks"]["kept"]);
  EXPECT_GT(record["there_and_back_px"]["returned"].get<int>(), 10);
  EXPECT_LT(record["there_and_back_px"]["median"].get<double>(), 0.2);
  EXPECT_GT(record["there_and_back_px"]["median"].get<double>(), 1e-4);
}

TEST_F(TwinFootage, SameBitsForAnyNumberOfThreads) {
  const Outcome again = run({"render", path("case.json"), "-o", path("again"), "--threads", "1"});
  ASSERT_EQ(again.code, 0) << again.err;
  for (const char* name : {"frame_0000.png", "frame_0002.png", "frame_0004.png", "truth_tracks.csv",
                           "truth_motion.bin", "footage.avi"})
    EXPECT_EQ(read_file(path("again/") + name), read_file(path("out/") + name)) << name;
  const Outcome other =
      run({"render", path("case.json"), "-o", path("again"), "--keep-motion", "--set", "/render/seed=2"});
  ASSERT_EQ(other.code, 0) << other.err;
  EXPECT_NE(read_file(path("again/frame_0002.png")), read_file(path("out/frame_0002.png")));
}

/// Mean of sRGB grey levels of 255, in linear light.
PictureLevels mean_light(const std::vector<PictureLevels>& pictures) {
  PictureLevels mean = pictures[0];
  for (size_t i = 0; i < mean.values.size(); ++i) {
    double sum = 0;
    for (const PictureLevels& p : pictures) {
      const double v = p.values[i] / 255;
      sum += v <= 0.04045 ? v / 12.92 : std::pow((v + 0.055) / 1.055, 2.4);
    }
    sum /= static_cast<double>(pictures.size());
    mean.values[i] = 255 * (sum <= 0.0031308 ? 12.92 * sum : 1.055 * std::pow(sum, 1 / 2.4) - 0.055);
  }
  return mean;
}

double rms_difference(const cv::Mat& bgr, const PictureLevels& levels) {
  double sum = 0;
  for (int y = 0; y < bgr.rows; ++y)
    for (int x = 0; x < bgr.cols; ++x)
      for (int c = 0; c < 3; ++c) {
        const double other = levels.values[3 * (static_cast<size_t>(y) * bgr.cols + x) + c];
        sum += std::pow(bgr.at<cv::Vec3b>(y, x)[2 - c] - other, 2);
      }
  return std::sqrt(sum / (3. * bgr.rows * bgr.cols));
}

// The same truth filmed at 16 times the frame rate with a closed shutter: what an open one adds up.
TEST_F(TwinFootage, OpenShuttersAddUpTheFramesOfAFasterCamera) {
  const std::string truth =
      R"(/truth/settings=["/skin/layers/skin/youngs_modulus=80 kPa", "/time/frame_rate=320 Hz", "/time/frames=96"])";
  const auto film = [&](const std::string& folder, const std::vector<std::string>& more) {
    std::vector<std::string> arguments = {"render", path("case.json"), "-o", path(folder), "--set", truth,
                                          "--set",  "/render/noise=0"};
    arguments.insert(arguments.end(), more.begin(), more.end());
    const Outcome outcome = run(arguments);
    EXPECT_EQ(outcome.code, 0) << outcome.err;
  };
  const std::string slow = R"(/settings=["/time/frames=6"])";
  film("fast", {"--set", R"(/settings=["/time/frame_rate=320 Hz", "/time/frames=96"])"});
  film("closed", {"--set", slow});
  film("open", {"--set", slow, "--exposure", "0.75"});

  const MovingSurface surface = read_motion(path("fast/truth_motion.bin"));
  ASSERT_EQ(surface.frames(), 97);
  const fitting::Camera camera = fitting::read_camera(path("fast/camera.yaml"));
  const SubdividedSurface tessellation(surface.mesh, SurfaceSide::outer, subdivision_for(surface, camera, 3));
  const Scene scene = load_scene(path("scene.json"));
  const SkinRenderer renderer(surface, tessellation, scene, camera,
                              {.width = 160, .height = 120, .noise = 0, .texture_scale = 0.6});
  std::vector<PictureLevels> pictures;
  for (int f = 48 - 6; f <= 48 + 6; ++f) pictures.push_back(renderer.levels(f));
  const PictureLevels mean = mean_light(pictures);
  const double apart = rms_difference(cv::imread(path("open/frame_0003.png")), mean),
               blur = rms_difference(cv::imread(path("closed/frame_0003.png")), mean);
  std::printf("open shutter: %.2f grey from the mean of the frames meanwhile, a closed one %.2f\n", apart,
              blur);
  EXPECT_LT(apart, 0.4 * blur);  // 0.29 grey is the rounding of the picture
  EXPECT_EQ(nlohmann::json::parse(read_file(path("open/truth.json")))["footage"]["exposure"], 0.75);
  EXPECT_EQ(read_file(path("open/truth_tracks.csv")), read_file(path("closed/truth_tracks.csv")));
  EXPECT_EQ(run({"render", path("case.json"), "-o", path("bad"), "--exposure", "1.5"}).code, 2);
}

TEST_F(TwinFootage, FinerTruthKeepsTheFitsFrameTimes) {
  const std::string settings = R"(/truth/settings=["/time/frame_rate=60 Hz", "/time/frames=6"])";
  const Outcome fine = run({"render", path("case.json"), "-o", path("fine"), "--set", settings});
  ASSERT_EQ(fine.code, 0) << fine.err;
  const MovingSurface surface = read_motion(path("fine/truth_motion.bin"));
  ASSERT_EQ(surface.frames(), 3);
  for (int f = 0; f < 3; ++f) EXPECT_NEAR(surface.times[static_cast<size_t>(f)], f / 20.0, 1e-12);
  const Outcome odd = run({"render", path("case.json"), "-o", path("fine"), "--set",
                           R"(/truth/settings=["/time/frame_rate=50 Hz"])"});
  EXPECT_EQ(odd.code, 2);
  EXPECT_THAT(odd.err, HasSubstr("an integer multiple"));
}

TEST_F(TwinFootage, DistortedCameraSeesTheSameSkin) {
  const MovingSurface surface = read_motion(path("out/truth_motion.bin"));
  const SubdividedSurface tessellation(surface.mesh, SurfaceSide::outer, 8);
  const Scene scene = load_scene(path("scene.json"));
  fitting::Camera straight = fitting::read_camera(path("out/camera.yaml")), bent = straight;
  fitting::RenderCase options{.width = 160, .height = 120, .noise = 0, .texture_scale = 0.6};
  const Image by_raster = SkinRenderer(surface, tessellation, scene, straight, options).render(3);
  bent.distortion[0] = 1e-13;  // rays instead of scan conversion, the same picture
  const Image by_rays = SkinRenderer(surface, tessellation, scene, bent, options).render(3);
  int different = 0;
  for (size_t i = 0; i < by_rays.pixels().size(); ++i)
    different += std::abs(int(by_rays.pixels()[i]) - int(by_raster.pixels()[i])) > 2 ? 1 : 0;
  EXPECT_LT(different, 60);  // of 57600: pixels on outlines
  // With real distortion a picture undistorted by OpenCV shows the straight camera's picture again.
  bent.distortion = {-3, 0, 0, 0, 0};
  Image warped = SkinRenderer(surface, tessellation, scene, bent, options).render(3);
  const cv::Mat seen(120, 160, CV_8UC3, warped.pixels().data());
  const cv::Matx33d K(straight.intrinsics(0, 0), 0, straight.intrinsics(0, 2), 0, straight.intrinsics(1, 1),
                      straight.intrinsics(1, 2), 0, 0, 1);
  cv::Mat flat;
  cv::undistort(seen, flat, K, std::vector<double>{-3, 0, 0, 0, 0});
  double sum = 0, unwarped = 0;
  for (int y = 30; y < 90; ++y)
    for (int x = 40; x < 120; ++x) {
      sum += std::abs(int(flat.at<cv::Vec3b>(y, x)[0]) - int(by_raster.pixel(x, y)[0]));
      unwarped += std::abs(int(seen.at<cv::Vec3b>(y, x)[0]) - int(by_raster.pixel(x, y)[0]));
    }
  EXPECT_LT(sum / 4800, 4);        // grey levels: the interpolation of the undistortion
  EXPECT_LT(sum, 0.6 * unwarped);  // the distortion was there
}

TEST(Finger, RayMeetsTheCapsuleWhereItsDistanceIsTheRadius) {
  const Finger finger{Vec3(1, 2, 3), Vec3(4, 2, 9), 2};
  const Vec3 eye(-3, 8, 40);
  int hits = 0;
  for (int i = 0; i < 400; ++i) {
    const Vec3 target(-4 + 0.6 * (i % 20), -3 + 0.6 * (i / 20), 5);
    const auto s = finger.hit(eye, target - eye);
    // Independent: the least distance from the axis along the ray, sampled.
    double least = 1e9;
    for (int k = 0; k <= 4000; ++k) {
      const Vec3 x = eye + 2e-3 * k / 4 * (target - eye);
      least = std::min(least, (x - finger.axis_point(x)).norm());
    }
    if (std::abs(least - 2) < 1e-3) continue;
    EXPECT_EQ(s.has_value(), least < 2);
    if (!s) continue;
    ++hits;
    const Vec3 x = eye + *s * (target - eye);
    EXPECT_NEAR((x - finger.axis_point(x)).norm(), 2, 1e-9);
    EXPECT_GT((eye + 0.999 * *s * (target - eye) - finger.axis_point(x)).norm(), 2);
  }
  EXPECT_GT(hits, 40);
}

}  // namespace
}  // namespace rhytid::tools
