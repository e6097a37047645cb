#include "fitting/landmarks.h"

#include <Eigen/Cholesky>
#include <Eigen/Geometry>
#include <Eigen/SVD>
#include <algorithm>
#include <charconv>
#include <cmath>
#include <filesystem>
#include <fstream>
#include <limits>
#include <map>
#include <opencv2/calib3d.hpp>
#include <optional>
#include <set>

#include "fitting/pose.h"
#include "fitting/utf8.h"
#include "sim/core/csv_reader.h"
#include "sim/core/error.h"
#include "sim/output/text.h"
#include "sim/scene/located_json.h"

namespace rhytid::fitting {
namespace {

constexpr double kDegrees = 57.29577951308232;

// --- the file

/// Columns of the header, by name. Throws InputError unless they are one of the two forms.
std::map<std::string, std::size_t> read_header(const std::string& where,
                                               const std::vector<std::string>& fields) {
  static const std::set<std::string> known = {"name", "x_px", "y_px", "vertex",
                                              "x_mm", "y_mm", "z_mm", "sigma_px"};
  std::map<std::string, std::size_t> columns;
  for (std::size_t i = 0; i < fields.size(); ++i)
    if (!known.contains(fields[i]) || !columns.emplace(fields[i], i).second)
      throw InputError(where, "column '" + fields[i] + "'",
                       "each of name, x_px, y_px and vertex (or x_mm, y_mm, z_mm) once, and maybe sigma_px");
  const bool has_vertex = columns.contains("vertex");
  std::vector<std::string> wanted = {"name", "x_px", "y_px"};
  if (!has_vertex) wanted.insert(wanted.end(), {"x_mm", "y_mm", "z_mm"});
  for (const std::string& name : wanted)
    if (!columns.contains(name))
      throw InputError(where, "no column " + name, "name, x_px, y_px and vertex (or x_mm, y_mm, z_mm)");
  if (has_vertex && columns.contains("x_mm"))
    throw InputError(where, "both vertex and x_mm", "one of the two ways to say where a landmark is");
  return columns;
}

template <class Number>
Number number_of(const std::string& where, const std::string& name, const std::string& text,
                 const char* expected) {
  Number value = 0;
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), value);
  if (error != std::errc() || end != text.data() + text.size() || !std::isfinite(static_cast<double>(value)))
    throw InputError(where, name + " '" + text + "'", expected);
  return value;
}

// --- the pose

std::vector<SightedPoint> sighted(const std::vector<Landmark>& landmarks) {
  std::vector<SightedPoint> points;
  for (const Landmark& l : landmarks)
    points.push_back({l.pixel, l.point, Eigen::Matrix2d::Identity() / (l.sigma * l.sigma)});
  return points;
}

/// SQPnP; nothing when it finds no pose.
std::optional<Camera> first_pose(const std::vector<Landmark>& landmarks, const Camera& camera) {
  std::vector<cv::Point3d> points;
  std::vector<cv::Point2d> pixels;
  for (const Landmark& l : landmarks) {
    points.emplace_back(l.point.x(), l.point.y(), l.point.z());
    // Undistorted by our own camera, whose inverse is exact.
    const Vec2 seen = camera.undistorted(l.pixel);
    pixels.emplace_back(seen.x(), seen.y());
  }
  cv::Mat turn, shift;
  try {
    if (!cv::solvePnP(points, pixels, cv::Mat::eye(3, 3, CV_64F), cv::noArray(), turn, shift, false,
                      cv::SOLVEPNP_SQPNP))
      return std::nullopt;
  } catch (const cv::Exception&) {
    return std::nullopt;
  }
  const Vec3 w(turn.at<double>(0), turn.at<double>(1), turn.at<double>(2));
  const Vec3 t(shift.at<double>(0), shift.at<double>(1), shift.at<double>(2));
  if (!w.allFinite() || !t.allFinite()) return std::nullopt;
  Camera found = camera;
  found.rotation =
      w.norm() > 0 ? Eigen::AngleAxisd(w.norm(), w.normalized()).toRotationMatrix() : Mat3::Identity();
  found.translation = t;
  return found;
}

/// Principal axes of the landmarks, longest first, and their rms extents.
Eigen::JacobiSVD<Eigen::MatrixXd> principal_axes(const std::vector<Landmark>& landmarks) {
  Eigen::MatrixXd points(static_cast<Eigen::Index>(landmarks.size()), 3);
  const Vec3 middle = centroid(sighted(landmarks));
  for (Eigen::Index i = 0; i < points.rows(); ++i)
    points.row(i) = (landmarks[static_cast<std::size_t>(i)].point - middle).transpose();
  return Eigen::JacobiSVD<Eigen::MatrixXd>(points, Eigen::ComputeThinV);
}

/// The pose that flat landmarks nearly allow as well: their normal mirrored about the line of sight.
Camera mirrored(const std::vector<Landmark>& landmarks, const Camera& pose) {
  const Vec3 normal = pose.rotation * principal_axes(landmarks).matrixV().col(2);
  const Vec3 m = pose.rotation * centroid(sighted(landmarks)) + pose.translation, sight = m.normalized();
  const Vec3 other = 2 * normal.dot(sight) * sight - normal;
  const Mat3 turn = Eigen::Quaterniond::FromTwoVectors(normal, other).toRotationMatrix();
  Camera other_side = pose;
  other_side.rotation = turn * pose.rotation;
  other_side.translation = turn * (pose.translation - m) + m;
  return other_side;
}

/// The better of the two minima, and how much worse the other one's χ² is.
struct Minima {
  Camera best;
  double chi_square = 0;
  double second = std::numeric_limits<double>::infinity();  ///< χ² of the other
  double angle = 0;                                         ///< rad between the two
};

std::optional<Minima> minima(const std::vector<Landmark>& landmarks, const Camera& camera) {
  const std::optional<Camera> start = first_pose(landmarks, camera);
  if (!start) return std::nullopt;
  const std::vector<SightedPoint> points = sighted(landmarks);
  Camera one = refine_pose(points, *start);
  Camera two = refine_pose(points, mirrored(landmarks, one));
  double first = pose_normal(points, one).chi_square, second = pose_normal(points, two).chi_square;
  if (second < first) {
    std::swap(one, two);
    std::swap(first, second);
  }
  if (!std::isfinite(first)) return std::nullopt;
  const double angle = Eigen::AngleAxisd(Mat3(one.rotation * two.rotation.transpose())).angle();
  return Minima{one, first, angle > 1e-3 ? second : std::numeric_limits<double>::infinity(), angle};
}

/// Every landmark's distance from where the others put it, px.
std::vector<double> leave_one_out(const std::vector<Landmark>& landmarks, const Camera& camera,
                                  const Camera& pose, std::vector<double>& scale_without) {
  std::vector<double> distances;
  for (std::size_t i = 0; i < landmarks.size(); ++i) {
    std::vector<Landmark> others = landmarks;
    others.erase(others.begin() + static_cast<std::ptrdiff_t>(i));
    // Where one landmark is far off, the pose of all is no start for the others.
    Camera best = refine_pose(sighted(others), pose);
    double chi_square = pose_normal(sighted(others), best).chi_square;
    if (const std::optional<Minima> found = minima(others, camera); found && found->chi_square < chi_square) {
      best = found->best;
      chi_square = found->chi_square;
    }
    distances.push_back((landmarks[i].pixel - best.project(landmarks[i].point)).norm());
    const double freedom = 2.0 * static_cast<double>(others.size()) - 6;
    scale_without.push_back(std::sqrt(chi_square / freedom));
  }
  return distances;
}

}  // namespace

std::vector<Landmark> read_landmarks(const std::string& path, double sigma,
                                     const std::function<Vec3(long)>& vertex) {
  std::ifstream file(path, std::ios::binary);
  if (std::filesystem::is_directory(path)) throw InputError(path, "a folder", "a CSV of landmarks");
  if (!file) throw InputError(path, "no readable file", "a CSV of landmarks: name,x_px,y_px,vertex");
  std::map<std::string, std::size_t> columns;
  std::vector<Landmark> landmarks;
  std::set<std::string> names;
  for_csv_lines(file, path, [&](const CsvLine& line) {
    const std::string& where = line.place;
    const std::vector<std::string>& fields = line.cells;
    if (columns.empty()) {
      columns = read_header(where, fields);
      return;
    }
    if (fields.size() != columns.size())
      throw InputError(where, std::to_string(fields.size()) + " fields",
                       std::to_string(columns.size()) + " as in the header");
    const auto text = [&](const std::string& name) { return fields[columns.at(name)]; };
    const auto number = [&](const std::string& name) {
      return number_of<double>(where, name, text(name), "a finite number");
    };
    Landmark l;
    l.place = where;
    l.name = text("name");
    if (!is_utf8(l.name)) throw InputError(where, "name '" + shown_text(l.name) + "'", "text in UTF-8");
    if (l.name.empty() || !names.insert(l.name).second)
      throw InputError(where, "name '" + l.name + "'", "a name of its own for every landmark");
    l.pixel = {number("x_px"), number("y_px")};
    if (columns.contains("vertex")) {
      const long index = number_of<long>(where, "vertex", text("vertex"), "a vertex number from 0");
      try {
        l.point = vertex(index);
      } catch (const InputError& error) {
        throw InputError(where, "vertex " + std::to_string(index), error.what());
      }
    } else {
      l.point = {number("x_mm"), number("y_mm"), number("z_mm")};
    }
    l.sigma = columns.contains("sigma_px") ? number("sigma_px") : sigma;
    if (!(l.sigma > 0)) throw InputError(where, "sigma_px " + text("sigma_px"), "a positive number");
    landmarks.push_back(l);
  });
  if (landmarks.empty()) throw InputError(path, "no landmark", "a header and a line per landmark");
  return landmarks;
}

PoseEstimate estimate_pose(const std::vector<Landmark>& landmarks, const Camera& camera,
                           const std::string& where) {
  const std::size_t n = landmarks.size();
  if (n < 4)
    throw InputError(where, std::to_string(n) + (n == 1 ? " landmark" : " landmarks"),
                     "at least 4, better 6 or more, spread over the face");
  const Eigen::VectorXd extents = principal_axes(landmarks).singularValues();
  if (extents[1] < 0.01 * extents[0])
    throw InputError(where, "landmarks on a line", "landmarks spread over the face");
  const std::optional<Minima> found = minima(landmarks, camera);
  if (!found)
    throw InputError(where, "landmarks that no pose in front of the camera explains",
                     "pixels x, y and vertices that belong together");

  PoseEstimate estimate;
  estimate.camera = found->best;
  for (const Landmark& l : landmarks) {
    estimate.residuals.push_back(l.pixel - estimate.camera.project(l.point));
    estimate.rms += estimate.residuals.back().squaredNorm();
  }
  estimate.rms = std::sqrt(estimate.rms / static_cast<double>(n));
  const double freedom = 2.0 * static_cast<double>(n) - 6;
  estimate.reduced_chi_square = found->chi_square / freedom;

  const PoseNormal l = pose_normal(sighted(landmarks), found->best);
  estimate.covariance =
      std::max(1.0, estimate.reduced_chi_square) * l.hessian.ldlt().solve(Matrix6d::Identity());
  const Vec3 sight =
      (found->best.rotation * centroid(sighted(landmarks)) + found->best.translation).normalized();
  const auto parts = [&](const Mat3& covariance, double& across, double& along) {
    const double along_variance = sight.dot(covariance * sight);
    along = std::sqrt(along_variance);
    across = std::sqrt(std::max(0.0, (covariance.trace() - along_variance) / 2));
  };
  parts(estimate.covariance.topLeftCorner<3, 3>(), estimate.tilt_sigma, estimate.roll_sigma);
  parts(estimate.covariance.bottomRightCorner<3, 3>(), estimate.across_sigma, estimate.depth_sigma);

  if (found->second < found->chi_square + 9 * std::max(1.0, estimate.reduced_chi_square)) {
    estimate.other_tilt = found->angle;
    estimate.doubts.push_back(
        "a pose tilted by " + short_text(kDegrees * found->angle, 2) +
        " degrees against this one explains the landmarks nearly as well: add some that "
        "lie nearer to or farther from the camera than the others");
  }
  const double scale = std::sqrt(estimate.reduced_chi_square);
  bool is_one_wrong = false;
  if (n >= 5) {
    std::vector<double> scale_without;
    estimate.left_out = leave_one_out(landmarks, camera, found->best, scale_without);
    // With 5 landmarks the other 4 have two degrees of freedom left: too few to accuse the fifth.
    const auto worst = std::min_element(scale_without.begin(), scale_without.end()) - scale_without.begin();
    const std::size_t w = static_cast<std::size_t>(worst);
    is_one_wrong = n >= 6 && scale > 2 && scale > 3 * scale_without[w];
    if (is_one_wrong)
      estimate.doubts.push_back("'" + landmarks[w].name + "' lies " + short_text(estimate.left_out[w], 2) +
                                " px from where the others put it, which agree among themselves: check its "
                                "vertex and pixel");
  }
  if (!is_one_wrong && scale > 2)
    estimate.doubts.push_back("the landmarks are off by " + short_text(scale, 2) +
                              " times their deviation: the mesh is not this face, the camera's calibration "
                              "is wrong, or the stated deviation is too small");
  return estimate;
}

}  // namespace rhytid::fitting
