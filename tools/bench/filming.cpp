#include "tools/bench/filming.h"

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <filesystem>
#include <numbers>
#include <opencv2/imgcodecs.hpp>
#include <opencv2/imgproc.hpp>
#include <random>

#include "sim/core/error.h"
#include "tools/render/footage.h"
#include "tools/render/skin_texture.h"

namespace rhytid::tools {
namespace {

namespace fs = std::filesystem;
using fitting::Observation;
using fitting::TrackStatus;

/// The disc that passes from the left edge to the right, through the middle.
struct Disc {
  double radius;
  Vec2 first, last;
  Disc(cv::Size size)
      : radius(0.11 * size.width),
        first(-radius, 0.5 * size.height),
        last(size.width + radius, 0.55 * size.height) {}
  Vec2 centre(double time) const { return first + time * (last - first); }
};

double time_of(double frame, int frames) {
  return frame / std::max(1, frames - 1);
}

void add_disc(cv::Mat* light, double time) {
  const Disc disc(light->size());
  const Vec2 centre = disc.centre(time);
  for (int y = 0; y < light->rows; ++y)
    for (int x = 0; x < light->cols; ++x) {
      const Vec2 d = Vec2(x, y) - centre;
      const double cover = std::clamp(disc.radius - d.norm() + 0.5, 0.0, 1.0);
      if (cover == 0) continue;
      const double own = 0.16 * (1 + 0.4 * gradient_noise(Vec3(0.2 * d.x(), 0.2 * d.y(), 0.3), 7));
      float& value = light->at<float>(y, x);
      value = static_cast<float>((1 - cover) * value + cover * own);
    }
}

cv::Mat disc_mask(cv::Size size, double time) {
  const Disc disc(size);
  const Vec2 c = disc.centre(time);
  cv::Mat mask = cv::Mat::zeros(size, CV_8U);
  constexpr double kMargin = 3;  // as OccluderOptions
  cv::circle(mask, {cvRound(c.x()), cvRound(c.y())}, cvRound(disc.radius + kMargin), cv::Scalar(255),
             cv::FILLED);
  return mask;
}

HeadRoll head_of(const Filming& filming, cv::Size size) {
  HeadRoll head = filming.head;
  head.centre = Vec2(size.width / 2., size.height / 2.);
  return head;
}

cv::Mat rounded(const cv::Mat& levels, double noise, std::mt19937* random) {
  std::normal_distribution<double> normal;
  cv::Mat out(levels.size(), CV_8U);
  for (int y = 0; y < out.rows; ++y)
    for (int x = 0; x < out.cols; ++x)
      out.at<uchar>(y, x) = cv::saturate_cast<uchar>(levels.at<float>(y, x) + noise * normal(*random));
  return out;
}

/// A new folder in `parent` for one film, removed however its use ends.
class FilmFolder {
 public:
  explicit FilmFolder(const std::string& parent) : path_(parent + "/film-XXXXXX") {
    fs::create_directories(parent);
    if (!mkdtemp(path_.data())) throw InputError(parent, "no new folder in it", "a writable folder");
  }
  ~FilmFolder() {
    std::error_code ignored;
    fs::remove_all(path_, ignored);
  }
  FilmFolder(const FilmFolder&) = delete;
  FilmFolder& operator=(const FilmFolder&) = delete;
  const std::string& path() const { return path_; }

 private:
  std::string path_;
};

/// Films and says where.
fitting::FrameSourceOptions film(const FilmedSkin& skin, const Filming& filming, unsigned seed,
                                 const std::string& folder) {
  constexpr double kRate = 25;
  std::mt19937 random(seed);
  fitting::FrameSourceOptions options;
  options.path = folder + (filming.h264 ? "/film.mp4" : "/f_%03d.png");
  std::optional<FootageWriter> video;
  if (filming.h264)
    video.emplace(options.path, "h264", kRate, skin.size().width, skin.size().height);
  else
    options.frames_per_second = kRate;
  for (int f = 0; f < skin.frames(); ++f) {
    const cv::Mat picture = rounded(filmed_levels(skin, filming, f), filming.noise, &random);
    if (video) {
      Image rgb(picture.cols, picture.rows, 3);
      for (int y = 0; y < picture.rows; ++y)
        for (int x = 0; x < picture.cols; ++x) std::fill_n(rgb.pixel(x, y), 3, picture.at<uchar>(y, x));
      video->add(rgb);
      continue;
    }
    char name[32];
    std::snprintf(name, sizeof(name), "/f_%03d.png", f);
    if (!cv::imwrite(folder + name, picture))
      throw InputError(folder + name, "not written", "a writable folder");
  }
  if (video) video->commit();
  return options;
}

/// Errors of all tracks against their paths.
void compare(const FilmedSkin& skin, const Filming& filming, const fitting::TrackSet& tracks,
             TrackingScore* out) {
  const HeadRoll head = head_of(filming, skin.size());
  const Disc disc(skin.size());
  Vec2 mean = Vec2::Zero();
  double squares = 0, chi = 0, chi_all = 0;
  std::vector<double> sigmas;
  for (const fitting::Track& track : tracks.tracks) {
    const std::vector<Vec2> path = skin.path(track.observations.front().pixel, head);
    if (path.empty()) {
      ++out->off_skin;
      continue;
    }
    require(track.observations.back().frame < skin.frames(), "score_filming: a frame that was not filmed");
    const auto shared = track.shared_covariances();
    for (size_t i = 1; i < track.observations.size(); ++i) {
      const Observation& o = track.observations[i];
      const Vec2& truth = path[static_cast<size_t>(o.frame)];
      const double time = time_of(o.frame, skin.frames());
      constexpr double kNear = 18;  // px: a window that the disc's edge is in
      const bool is_covered = filming.has_disc && (truth - disc.centre(time)).norm() < disc.radius + kNear;
      out->expected += !is_covered;
      if (o.status != TrackStatus::ok) continue;
      const Vec2 error = o.pixel - truth;
      const Eigen::Matrix2d covariance = shared[i] + o.covariance;
      const double z2 = error.dot(covariance.ldlt().solve(error)) / 2;
      ++out->observations;
      chi_all += z2;
      sigmas.push_back(std::sqrt(covariance.trace() / 2));
      if (error.norm() > 1) {
        ++out->gross;
        continue;
      }
      squares += error.squaredNorm() / 2, chi += z2, mean += error;
    }
  }
  const double n = std::max(1, out->observations - out->gross);
  out->rms_px = std::sqrt(squares / n), out->bias_px = mean.norm() / n;
  out->normalised = std::sqrt(chi / n);
  out->normalised_all = std::sqrt(chi_all / std::max(1, out->observations));
  if (sigmas.empty()) return;
  std::nth_element(sigmas.begin(), sigmas.begin() + static_cast<long>(sigmas.size() / 2), sigmas.end());
  out->sigma_px = sigmas[sigmas.size() / 2];
}

}  // namespace

cv::Mat filmed_levels(const FilmedSkin& skin, const Filming& filming, int frame) {
  const cv::Size size = skin.size();
  const HeadRoll head = head_of(filming, size);
  const int parts = static_cast<int>(std::lround(filming.exposure * kSubframes));
  require(parts % 2 == 0, "filmed_levels: an exposure of an even number of subframes");
  const double flicker =
      filming.flicker.empty() ? 1 : filming.flicker[static_cast<size_t>(frame) % filming.flicker.size()];
  cv::Mat sum = cv::Mat::zeros(size, CV_32F);
  for (int k = 0; k <= parts; ++k) {
    // Simpson's rule over the exposure, whose middle is the frame's time: a line has its second moment.
    const double t = frame + (k - parts / 2.) / kSubframes, time = time_of(t, skin.frames());
    const double weight = parts == 0 ? 1 : (k == 0 || k == parts ? 1 : k % 2 == 1 ? 4 : 2) / (3. * parts);
    cv::Mat light = skin.light(t, head);
    for (int y = 0; y < size.height; ++y)
      for (int x = 0; x < size.width; ++x) {
        const double u = x / static_cast<double>(size.width), v = y / static_cast<double>(size.width);
        double value = flicker * light.at<float>(y, x);
        if (filming.gain) value *= filming.gain(u, v, time);
        if (filming.added) value += filming.added(u, v, time);
        light.at<float>(y, x) = static_cast<float>(value);
      }
    if (filming.has_disc) add_disc(&light, time);
    sum += weight * light;
  }
  const double defocus = filming.defocus_px * time_of(frame, skin.frames());
  if (defocus > 0.1) cv::GaussianBlur(sum, sum, {0, 0}, defocus, defocus, cv::BORDER_REFLECT);
  cv::pow(cv::max(sum, 0), 1 / kGamma, sum);
  return cv::min(255 * sum, 255);
}

TrackingScore score_filming(const FilmedSkin& skin, const Filming& filming, fitting::TrackerOptions options,
                            unsigned seed, const std::string& folder) {
  TrackingScore score;
  score.filming = filming.name;
  const HeadRoll head = head_of(filming, skin.size());
  skin.prepare(head, &options);
  options.redetect = filming.redetect;
  if (filming.is_disc_masked) {
    const auto other = options.mask;
    const cv::Size size = skin.size();
    const int frames = skin.frames();
    options.mask = [=](const fitting::Frame& frame) {
      const cv::Mat mask = disc_mask(size, time_of(frame.index, frames));
      return other ? cv::Mat(mask | other(frame)) : mask;
    };
  }
  const FilmFolder film_folder(folder);
  fitting::FrameSource source(film(skin, filming, seed, film_folder.path()));
  const fitting::TrackerResult result = fitting::track(source, options);
  score.started = result.report.started;
  score.kept = static_cast<double>(result.report.kept) / result.report.started;
  score.refusals = result.report.refusals;
  score.template_updates = result.report.template_updates, score.redetected = result.report.redetected;
  score.noise_grey = result.report.noise_grey, score.jitter_px = result.report.jitter_px;
  score.exposure = result.report.exposure;
  compare(skin, filming, result.tracks, &score);
  return score;
}

std::string refusals_text(const TrackingScore& score) {
  std::string text;
  for (int i = 1; i < fitting::kNumRefusals; ++i) {
    const int count = score.refusals[static_cast<size_t>(i)];
    if (count == 0) continue;
    text += (text.empty() ? "" : ", ") + std::string(to_string(static_cast<fitting::Refusal>(i))) + " " +
            std::to_string(count);
  }
  return text.empty() ? "-" : text;
}

}  // namespace rhytid::tools
