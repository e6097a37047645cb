#include "fitting/calibration.h"

#include <Eigen/Cholesky>
#include <algorithm>
#include <cmath>
#include <numbers>
#include <numeric>
#include <opencv2/calib3d.hpp>

#include "fitting/identifiability.h"
#include "fitting/median.h"
#include "sim/core/error.h"
#include "sim/output/text.h"
#include "sim/solve/cholmod_session.h"

namespace rhytid::fitting {
namespace {

constexpr int kLeastPhotographs = 3;    ///< two determine the lens in principle; a third can contradict
constexpr int kMostGroups = 8;          ///< of photographs, for predictions and the jackknife
constexpr double kOutlierFactor = 3;    ///< times the median of the photographs
constexpr double kOutlierFloor = 0.25;  ///< px: below it nothing is an outlier
constexpr double kMostExcess = 1.2;     ///< mean square error of the model taken, over that of the best
constexpr int kCells = 10;              ///< per side, for the coverage

using Values = std::array<double, kNumLensParameters>;
using Flags = std::array<bool, 5>;  ///< k1 k2 p1 p2 k3

struct Term {
  const char* name;
  Flags has;
};
constexpr std::array<Term, 7> kLadder = {{
    {"none", {false, false, false, false, false}},
    {"k1", {true, false, false, false, false}},
    {"k1 k2", {true, true, false, false, false}},
    {"k1 p1 p2", {true, false, true, true, false}},
    {"k1 k2 k3", {true, true, false, false, true}},
    {"k1 k2 p1 p2", {true, true, true, true, false}},
    {"k1 k2 p1 p2 k3", {true, true, true, true, true}},
}};
constexpr std::size_t kRobustModel =
    5;  ///< of the ladder: rich enough to tell misread boards from distortion

int num_terms(const Flags& has) {
  return static_cast<int>(std::count(has.begin(), has.end(), true));
}

int opencv_flags(const Flags& has) {
  int flags = 0;
  if (!has[0]) flags |= cv::CALIB_FIX_K1;
  if (!has[1]) flags |= cv::CALIB_FIX_K2;
  if (!has[2]) flags |= cv::CALIB_ZERO_TANGENT_DIST;
  if (!has[4]) flags |= cv::CALIB_FIX_K3;
  return flags;
}

using Points2 = std::vector<cv::Point2f>;
using Points3 = std::vector<cv::Point3f>;

Points3 board_points(const BoardSize& size, double square) {
  Points3 points;
  for (int row = 0; row < size.rows; ++row)
    for (int column = 0; column < size.columns; ++column)
      points.emplace_back(static_cast<float>(column * square), static_cast<float>(row * square), 0.F);
  return points;
}

Points2 image_points(const BoardView& board) {
  Points2 points;
  for (const Vec2& p : board.corners)
    points.emplace_back(static_cast<float>(p.x()), static_cast<float>(p.y()));
  return points;
}

Mat3 rotation_matrix(const cv::Mat& rvec) {
  cv::Mat r;
  cv::Rodrigues(rvec, r);
  Mat3 out;
  for (int i = 0; i < 9; ++i) out(i / 3, i % 3) = r.at<double>(i / 3, i % 3);
  return out;
}

Vec3 vector3(const cv::Mat& v) {
  const cv::Mat flat = v.reshape(1, 3);
  return {flat.at<double>(0), flat.at<double>(1), flat.at<double>(2)};
}

/// A lens with the poses it was fitted with.
struct Fit {
  cv::Mat K, D;
  std::vector<cv::Mat> rvecs, tvecs;
  std::vector<double> rms;  ///< px, per photograph
  Values values{};
};

class Fitter {
 public:
  Fitter(const std::vector<CalibrationPhotograph>& photographs, double square, cv::Size picture)
      : picture_(picture) {
    for (const CalibrationPhotograph& p : photographs) {
      object_.push_back(p.is_used ? board_points(p.board.size, square) : Points3());
      image_.push_back(image_points(p.board));
    }
  }

  /// Of the photographs `used`, from `start` when there is one.
  Fit fit(const std::vector<int>& used, const Flags& has, const Fit* start = nullptr) const {
    std::vector<Points3> object;
    std::vector<Points2> image;
    for (const int i : used) {
      object.push_back(object_[static_cast<std::size_t>(i)]);
      image.push_back(image_[static_cast<std::size_t>(i)]);
    }
    Fit f;
    int flags = opencv_flags(has);
    if (start != nullptr) {
      f.K = start->K.clone();
      f.D = start->D.clone();
      for (int k = 0; k < 5; ++k)
        if (!has[static_cast<std::size_t>(k)]) f.D.at<double>(k) = 0;
      flags |= cv::CALIB_USE_INTRINSIC_GUESS;
    }
    cv::Mat errors;
    cv::calibrateCamera(object, image, picture_, f.K, f.D, f.rvecs, f.tvecs, cv::noArray(), cv::noArray(),
                        errors, flags,
                        cv::TermCriteria(cv::TermCriteria::COUNT + cv::TermCriteria::EPS, 60, 1e-10));
    f.D = f.D.reshape(1, 1).colRange(0, 5).clone();
    for (int i = 0; i < errors.rows; ++i) f.rms.push_back(errors.at<double>(i));
    f.values = {f.K.at<double>(0, 0), f.K.at<double>(1, 1), f.K.at<double>(0, 2),
                f.K.at<double>(1, 2), f.D.at<double>(0),    f.D.at<double>(1),
                f.D.at<double>(2),    f.D.at<double>(3),    f.D.at<double>(4)};
    return f;
  }

  /// Deviations of the lens parameters if all corners erred independently and alike, σ² from what is left;
  /// 0 for terms that were not fitted. OpenCV has them too; those of 4.6 are too large by √2, since it
  /// counted corners, not coordinates.
  Values deviations(const Fit& f, const std::vector<int>& used, const Flags& has) const {
    std::vector<int> fitted = {0, 1, 2, 3};  // of kLensParameters
    for (int k = 0; k < 5; ++k)
      if (has[static_cast<std::size_t>(k)]) fitted.push_back(4 + k);
    const auto n = static_cast<Eigen::Index>(fitted.size());
    MatrixXd hessian = MatrixXd::Zero(n, n);  // of the lens, the poses eliminated
    double squares = 0, coordinates = 0;
    for (std::size_t i = 0; i < used.size(); ++i) {
      const auto photograph = static_cast<std::size_t>(used[i]);
      Points2 projected;
      cv::Mat all;  // columns: rotation, translation, fx fy, cx cy, distortion
      cv::projectPoints(object_[photograph], f.rvecs[i], f.tvecs[i], f.K, f.D, projected, all);
      squares += std::pow(cv::norm(projected, image_[photograph], cv::NORM_L2), 2);
      coordinates += all.rows;
      MatrixXd lens(all.rows, n), pose(all.rows, 6);
      for (int row = 0; row < all.rows; ++row) {
        for (Eigen::Index k = 0; k < n; ++k)
          lens(row, k) = all.at<double>(row, 6 + fitted[static_cast<std::size_t>(k)]);
        for (int k = 0; k < 6; ++k) pose(row, k) = all.at<double>(row, k);
      }
      const MatrixXd cross = pose.transpose() * lens;
      hessian += lens.transpose() * lens - cross.transpose() * (pose.transpose() * pose).ldlt().solve(cross);
    }
    const double freedom = coordinates - static_cast<double>(n) - 6 * static_cast<double>(used.size());
    const MatrixXd covariance = squares / freedom * hessian.ldlt().solve(MatrixXd::Identity(n, n));
    Values sigma{};
    for (Eigen::Index k = 0; k < n; ++k)
      sigma[static_cast<std::size_t>(fitted[static_cast<std::size_t>(k)])] = std::sqrt(covariance(k, k));
    return sigma;
  }

  /// Mean square of a photograph that the lens was not fitted to, px²: only its pose is fitted.
  double predicted(const Fit& lens, int photograph) const {
    const auto i = static_cast<std::size_t>(photograph);
    cv::Mat rvec, tvec;
    cv::solvePnP(object_[i], image_[i], lens.K, lens.D, rvec, tvec);
    Points2 projected;
    cv::projectPoints(object_[i], rvec, tvec, lens.K, lens.D, projected);
    return std::pow(cv::norm(projected, image_[i], cv::NORM_L2), 2) / static_cast<double>(projected.size());
  }

 private:
  cv::Size picture_;
  std::vector<Points3> object_;
  std::vector<Points2> image_;
};

void require_enough(const std::vector<CalibrationPhotograph>& photographs, std::size_t used) {
  if (used >= kLeastPhotographs) return;
  std::string reasons;
  for (const CalibrationPhotograph& p : photographs)
    if (!p.is_used && reasons.size() < 300)
      reasons += (reasons.empty() ? "; " : ", ") + p.file + ": " + p.reason;
  throw InputError("calibrate", counted(static_cast<long>(used), "photograph") + " with a board" + reasons,
                   "at least " + std::to_string(kLeastPhotographs) + ", from different sides");
}

std::vector<int> used_photographs(const std::vector<CalibrationPhotograph>& photographs) {
  std::vector<int> used;
  for (std::size_t i = 0; i < photographs.size(); ++i)
    if (photographs[i].is_used) used.push_back(static_cast<int>(i));
  return used;
}

/// Takes out photographs whose corners do not fit those of the others; the fit of what is left.
Fit without_outliers(const Fitter& fitter, std::vector<CalibrationPhotograph>& photographs) {
  for (;;) {
    const std::vector<int> used = used_photographs(photographs);
    require_enough(photographs, used.size());
    Fit f = fitter.fit(used, kLadder[kRobustModel].has);
    const auto worst = std::max_element(f.rms.begin(), f.rms.end());
    const double usual = median(f.rms);
    if (*worst <= std::max(kOutlierFloor, kOutlierFactor * usual)) return f;
    CalibrationPhotograph& p =
        photographs[static_cast<std::size_t>(used[static_cast<std::size_t>(worst - f.rms.begin())])];
    p.is_used = false;
    p.rms_px = *worst;
    p.reason =
        "its corners are off by " + short_text(*worst, 3) + " px (others " + short_text(usual, 3) + ")";
  }
}

/// Group of the k-th of the used photographs. Neighbours are often alike, and err alike: they stay together,
/// since a group that has its like among the others shows neither how well unseen photographs are predicted nor
/// how much the lens depends on it.
std::size_t group_of(std::size_t k, std::size_t groups, std::size_t used) {
  return k * groups / used;
}

struct Predictions {
  std::vector<double> errors;   ///< mean square per photograph, px²
  std::vector<Values> without;  ///< the lens without each group
};

double mean(const std::vector<double>& values) {
  return std::accumulate(values.begin(), values.end(), 0.0) / static_cast<double>(values.size());
}

/// Whether chance explains that `best` predicts the photographs better than `other`: Student's t, 95 %, on the
/// logarithms of the ratios. Errors differ by factors from photograph to photograph, and their differences with
/// them: on those one bad photograph would hide what all of them say.
bool is_as_good(const std::vector<double>& other, const std::vector<double>& best) {
  if (mean(other) > kMostExcess * mean(best)) return false;
  constexpr double kExact = 1e-12;  // px²: below it only rounding is left
  const auto n = static_cast<double>(best.size());
  std::vector<double> ratios, squares;
  for (std::size_t i = 0; i < best.size(); ++i)
    ratios.push_back(std::log(std::max(other[i], kExact) / std::max(best[i], kExact)));
  const double excess = mean(ratios);
  for (const double ratio : ratios) squares.push_back((ratio - excess) * (ratio - excess));
  return excess <= student_quantile_975(n - 1) * std::sqrt(mean(squares) / (n - 1));
}

/// Index into the ladder.
std::size_t simplest_as_good_as_the_best(const std::vector<Predictions>& models) {
  const auto error = [&models](std::size_t m) { return mean(models[m].errors); };
  std::size_t best = 0;
  for (std::size_t m = 1; m < models.size(); ++m)
    if (error(m) < error(best)) best = m;
  std::size_t chosen = best;
  for (std::size_t m = 0; m < models.size(); ++m) {
    const int less = num_terms(kLadder[chosen].has) - num_terms(kLadder[m].has);
    if ((less > 0 || (less == 0 && error(m) < error(chosen))) &&
        is_as_good(models[m].errors, models[best].errors))
      chosen = m;
  }
  return chosen;
}

void fill_parameters(const Fit& fit, const Values& deviations, const Predictions& predictions,
                     const Flags& has, Calibration* c) {
  const auto groups = static_cast<double>(predictions.without.size());
  for (std::size_t k = 0; k < kNumLensParameters; ++k) {
    LensParameter& p = c->parameters[k];
    p.value = fit.values[k];
    p.is_fitted = k < 4 || has[k - 4];
    if (!p.is_fitted) continue;
    double middle = 0, squares = 0;
    for (const Values& v : predictions.without) middle += v[k] / groups;
    for (const Values& v : predictions.without) squares += (v[k] - middle) * (v[k] - middle);
    p.linear_sigma = deviations[k];
    p.jackknife_sigma = std::sqrt((groups - 1) / groups * squares);
    p.sigma = std::max(p.linear_sigma, p.jackknife_sigma);
    const double linear = student_quantile_975(1e6) * p.linear_sigma;
    const double half = std::max(linear, student_quantile_975(groups - 1) * p.jackknife_sigma);
    p.low = p.value - half, p.high = p.value + half;
  }
}

void fill_camera(const Fit& fit, int width, int height, Camera* camera) {
  camera->intrinsics << fit.values[0], 0, fit.values[2], 0, fit.values[1], fit.values[3], 0, 0, 1;
  std::copy(fit.values.begin() + 4, fit.values.end(), camera->distortion.begin());
  camera->width = width, camera->height = height;
}

/// Pose, residuals and tilt of the used photographs, coverage of the picture.
void fill_photographs(const Fit& fit, const std::vector<int>& used, Calibration* c) {
  double squares = 0;
  long corners = 0;
  std::array<std::array<bool, kCells>, kCells> covered{};
  const Vec2 middle(0.5 * (c->camera.width - 1), 0.5 * (c->camera.height - 1));
  for (std::size_t k = 0; k < used.size(); ++k) {
    CalibrationPhotograph& p = c->photographs[static_cast<std::size_t>(used[k])];
    p.rotation = rotation_matrix(fit.rvecs[k]);
    p.translation = vector3(fit.tvecs[k]);
    Camera camera = c->camera;
    camera.rotation = p.rotation, camera.translation = p.translation;
    const Points3 board = board_points(p.board.size, c->square > 0 ? c->square : 1);
    double sum = 0;
    p.residuals.clear(), p.worst_px = 0;
    for (std::size_t i = 0; i < board.size(); ++i) {
      const Vec2& corner = p.board.corners[i];
      p.residuals.push_back(corner - camera.project(Vec3(board[i].x, board[i].y, 0)));
      sum += p.residuals.back().squaredNorm();
      p.worst_px = std::max(p.worst_px, p.residuals.back().norm());
      c->reach = std::max(c->reach, (corner - middle).norm() / middle.norm());
      const auto cell = [](double at, int size) {
        return static_cast<std::size_t>(std::clamp(static_cast<int>(at / size * kCells), 0, kCells - 1));
      };
      covered[cell(corner.x() + 0.5, c->camera.width)][cell(corner.y() + 0.5, c->camera.height)] = true;
    }
    p.rms_px = std::sqrt(sum / static_cast<double>(board.size()));
    squares += sum, corners += static_cast<long>(board.size());
    const Vec3 centre =
        camera.rotation * Vec3(0.5 * board.back().x, 0.5 * board.back().y, 0) + camera.translation;
    p.tilt = std::acos(std::min(1.0, std::abs(p.rotation.col(2).dot(centre.normalized()))));
  }
  c->rms_px = std::sqrt(squares / static_cast<double>(corners));
  for (const auto& column : covered)
    c->coverage += static_cast<double>(std::count(column.begin(), column.end(), true)) / (kCells * kCells);
}

void warn(Calibration* c) {
  const auto percent = [](double share) { return fixed_text(100 * share, 0) + " %"; };
  const auto degrees = [](double angle) {
    return fixed_text(angle * 180 / std::numbers::pi, 0) + " degrees";
  };
  std::vector<std::string>& w = c->warnings;
  if (c->used < 8)
    w.push_back("only " + std::to_string(c->used) + " photographs: ten or more determine a lens better");
  double largest = 0;
  int tilted = 0;
  for (const CalibrationPhotograph& p : c->photographs)
    if (p.is_used) largest = std::max(largest, p.tilt), tilted += p.tilt > 15 * std::numbers::pi / 180;
  if (tilted < 3)
    w.push_back(
        "the board was hardly tilted (at most " + degrees(largest) +
        "): focal length and distance are told apart only by tilt, 20 to 45 degrees to different sides");
  if (c->reach < 0.8)
    w.push_back("no corner of a board lies farther out than " + percent(c->reach) +
                " of the way from the picture's middle to its corners: distortion beyond is extrapolated");
  if (c->coverage < 0.5)
    w.push_back("corners cover " + percent(c->coverage) +
                " of the picture: hold the board into all parts of it");
  if (c->rms_px > 1)
    w.push_back(
        "corners are off by " + short_text(c->rms_px, 3) +
        " px: blurred photographs, a board that is not flat, or a lens that this model does not describe");
  const LensParameter& f = c->parameters[0];
  if (f.high - f.low > 0.04 * f.value)
    w.push_back("the focal length is known to ± " + short_text(50 * (f.high - f.low) / f.value, 2) +
                " % only");
}

}  // namespace

std::optional<Calibration> calibrate(std::vector<CalibrationPhotograph> photographs, int width, int height,
                                     const CalibrationOptions& options) {
  // Each step of OpenCV's fit solves a system of ten unknowns: threads that wait for each other there took a
  // minute for a second's work on a busy machine.
  const SingleThreadBlas single;
  Calibration c;
  for (CalibrationPhotograph& p : photographs) {
    p.is_used = !p.board.corners.empty();
    if (!p.is_used) continue;
    c.board = p.board.size;
  }
  c.square = options.square;
  require_enough(photographs, used_photographs(photographs).size());
  const Fitter fitter(photographs, options.square > 0 ? options.square : 1, cv::Size(width, height));
  try {
    const Fit robust = without_outliers(fitter, photographs);
    const std::vector<int> used = used_photographs(photographs);
    const std::size_t groups = std::min<std::size_t>(used.size(), kMostGroups);
    std::vector<Predictions> predictions(kLadder.size());
    const int all = static_cast<int>(kLadder.size() * groups);
    for (std::size_t m = 0; m < kLadder.size(); ++m) {
      predictions[m].errors.resize(used.size());
      for (std::size_t g = 0; g < groups; ++g) {
        if (options.progress && !options.progress(static_cast<int>(m * groups + g), all)) return std::nullopt;
        std::vector<int> kept;
        for (std::size_t k = 0; k < used.size(); ++k)
          if (group_of(k, groups, used.size()) != g) kept.push_back(used[k]);
        const Fit f = fitter.fit(kept, kLadder[m].has, &robust);
        predictions[m].without.push_back(f.values);
        for (std::size_t k = 0; k < used.size(); ++k)
          if (group_of(k, groups, used.size()) == g) predictions[m].errors[k] = fitter.predicted(f, used[k]);
      }
    }
    const std::size_t chosen = simplest_as_good_as_the_best(predictions);
    const Fit fit = fitter.fit(used, kLadder[chosen].has, &robust);
    for (const double value : fit.values)
      if (!std::isfinite(value))
        throw InputError("calibrate", "no lens that fits", "photographs of one flat board");
    for (std::size_t m = 0; m < kLadder.size(); ++m)
      c.models.push_back(
          {kLadder[m].name, num_terms(kLadder[m].has), std::sqrt(mean(predictions[m].errors)), m == chosen});
    c.model = kLadder[chosen].name;
    c.photographs = std::move(photographs);
    c.used = static_cast<int>(used.size());
    fill_camera(fit, width, height, &c.camera);
    fill_parameters(fit, fitter.deviations(fit, used, kLadder[chosen].has), predictions[chosen],
                    kLadder[chosen].has, &c);
    fill_photographs(fit, used, &c);
  } catch (const cv::Exception& e) {
    throw InputError("calibrate", "corners that no lens explains (" + e.err + ")",
                     "photographs of one flat board from different sides");
  }
  warn(&c);
  return c;
}

double place_at_board(const BoardView& board, double square, Camera* camera) {
  const auto& K = camera->intrinsics;
  const cv::Matx33d matrix(K(0, 0), 0, K(0, 2), 0, K(1, 1), K(1, 2), 0, 0, 1);
  const std::vector<double> distortion(camera->distortion.begin(), camera->distortion.end());
  const Points3 object = board_points(board.size, square);
  cv::Mat rvec, tvec;
  cv::solvePnP(object, image_points(board), matrix, distortion, rvec, tvec);
  camera->rotation = rotation_matrix(rvec);
  camera->translation = vector3(tvec);
  double squares = 0;
  for (std::size_t i = 0; i < object.size(); ++i)
    squares += (board.corners[i] - camera->project(Vec3(object[i].x, object[i].y, 0))).squaredNorm();
  return std::sqrt(squares / static_cast<double>(object.size()));
}

}  // namespace rhytid::fitting
