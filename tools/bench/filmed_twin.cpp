#include <algorithm>
#include <cmath>
#include <filesystem>
#include <opencv2/imgproc.hpp>

#include "fitting/case_camera.h"
#include "sim/core/error.h"
#include "sim/scene/load.h"
#include "tools/bench/filmed_skin.h"
#include "tools/render/exposure.h"
#include "tools/render/scene_masks.h"
#include "tools/render/skin_camera.h"
#include "tools/render/surface_view.h"
#include "tools/render/twin_run.h"

namespace rhytid::tools {
namespace {

constexpr int kParts = 8;               ///< pictures of a frame interval, kSubframes of filming.h
constexpr double finger_margin_px = 4;  ///< as `rhytid track` has it

/// The run with kParts frames for each of its own, and half a frame more at both ends: part k is at frame k/kParts − 1/2.
MovingSurface parted(const MovingSurface& surface, int frames) {
  MovingSurface out{surface.mesh, {}, {}, surface.scene};
  for (int k = 0; k <= kParts * frames; ++k) {
    const double at = static_cast<double>(k) / kParts - 0.5;
    out.times.push_back(time_between(surface, at));
    out.displacements.push_back(displacement_between(surface, at));
  }
  return out;
}

/// The part at the time t, frames.
int part_at(double t) {
  return static_cast<int>(std::lround((t + 0.5) * kParts));
}

class TwinSkin : public FilmedSkin {
 public:
  TwinSkin(const MovingSurface& run, Scene scene, const fitting::Case& c, int frames)
      : frames_(frames),
        surface_(parted(run, frames)),
        scene_(std::move(scene)),
        camera_(c.camera.empty() ? automatic_camera(surface_, c.render.width, c.render.height, c.render.tilt)
                                 : fitting::read_case_camera(c)),
        tessellation_(surface_.mesh, SurfaceSide::outer, subdivision_for(surface_, camera_, 3)),
        renderer_(surface_, tessellation_, scene_, camera_, c.render),
        at_rest_(surface_, tessellation_, camera_, part_at(0)) {}

  cv::Size size() const override { return {camera_.width, camera_.height}; }
  int frames() const override { return frames_; }

  cv::Mat light(double t, const HeadRoll& head) const override {
    const int part = std::clamp(part_at(t), 0, surface_.frames() - 1);
    const auto [place, is_new] = drawn_.try_emplace(part);
    if (is_new) place->second = draw(part);
    cv::Mat out(size(), CV_32F);
    const fitting::SplineImage& picture = place->second;
    for (int y = 0; y < out.rows; ++y)
      for (int x = 0; x < out.cols; ++x) {
        const Vec2 at = head.backward({x, y}, t);
        out.at<float>(y, x) = static_cast<float>(
            picture.sample(std::clamp(at.x(), 1., out.cols - 3.), std::clamp(at.y(), 1., out.rows - 3.))
                .value);
      }
    return cv::max(out, 0);
  }

  std::vector<Vec2> path(const Vec2& first, const HeadRoll& head) const override {
    const auto point = at_rest_.pick(head.backward(first, 0));
    std::vector<Vec2> list;
    for (int f = 0; point && f < frames_; ++f)
      list.push_back(head.forward(camera_.project(surface_.position(*point, part_at(f))), f));
    return list;
  }

  void prepare(const HeadRoll& head, fitting::TrackerOptions* o) const override {
    o->seeds.region_mask = patch_mask(surface_, camera_, o->window_px / 2);
    const Vec3 direction = finger_direction(surface_.mean_normal(), camera_);
    o->mask = [this, direction, head](const fitting::Frame& frame) {
      const cv::Mat still = finger_mask(scene_, surface_.times[static_cast<size_t>(part_at(frame.index))],
                                        direction, camera_, finger_margin_px);
      cv::Mat moved(still.size(), CV_8U);
      for (int y = 0; y < moved.rows; ++y)
        for (int x = 0; x < moved.cols; ++x) {
          const Vec2 at = head.backward({x, y}, frame.index);
          const int u = static_cast<int>(std::lround(at.x())), v = static_cast<int>(std::lround(at.y()));
          const bool is_inside = u >= 0 && v >= 0 && u < moved.cols && v < moved.rows;
          moved.at<uchar>(y, x) = is_inside ? still.at<uchar>(v, u) : uchar{0};
        }
      return moved;
    };
  }

 private:
  fitting::SplineImage draw(int part) const {
    const PictureLevels levels = renderer_.levels(part);
    cv::Mat grey(levels.height, levels.width, CV_32F);
    for (int i = 0; i < levels.width * levels.height; ++i) {
      const double* rgb = &levels.values[3 * static_cast<size_t>(i)];
      const double luma = 0.299 * rgb[0] + 0.587 * rgb[1] + 0.114 * rgb[2];
      grey.at<float>(i / levels.width, i % levels.width) = static_cast<float>(std::pow(luma / 255, kGamma));
    }
    return fitting::SplineImage(grey);
  }

  int frames_;
  MovingSurface surface_;
  Scene scene_;
  fitting::Camera camera_;
  SubdividedSurface tessellation_;
  SkinRenderer renderer_;
  SurfaceView at_rest_;
  mutable std::map<int, fitting::SplineImage> drawn_;
};

}  // namespace

std::unique_ptr<FilmedSkin> make_twin_skin(const fitting::Case& c, int max_frames, const std::string& folder,
                                           Progress& progress) {
  std::filesystem::create_directories(folder);
  const SceneModel truth(truth_scene(c));
  const std::string motion = folder + "/truth_motion.bin";
  const TwinRun run =
      kept_twin(truth, frame_stride(load_scene(c.scene, c.scene_settings), truth.scene()), motion, progress);
  if (progress.interrupted()) return nullptr;
  if (!run.complete)
    throw InputError(c.file, "a truth whose run ended early: " + run.failure, "one that ends");
  write_motion(run.surface, motion);
  return std::make_unique<TwinSkin>(run.surface, truth.scene(), c,
                                    std::min(max_frames, run.surface.frames()));
}

}  // namespace rhytid::tools
