#include "fitting/finger_outline.h"

#include <Eigen/Cholesky>
#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>
#include <opencv2/imgproc.hpp>
#include <optional>

#include "fitting/tracking/spline_image.h"
#include "sim/core/error.h"
#include "sim/output/text.h"

namespace rhytid::fitting {
namespace {

constexpr double kStep = 0.5;        // px between values of a profile: finer than the smoothing resolves
constexpr double kLeastSpacing = 4;  // px between samples: nearer ones would see the same smoothed pixels
constexpr int kFineSteps = 15;       // redrawings; three or four do unless samples change sides
constexpr int kNarrowing = 4;        // of them until the windows are at their narrowest
constexpr double kNarrowest = 1;     // px, first cut of residuals there
constexpr double kSettled = 0.01;    // px that the outline moves from one redrawing to the next
constexpr double kUnsettled = 0.3;   // px: still moving so much at the end is no answer
constexpr double kTukey = 4.685;     // standard deviations: 95 % efficient for normal errors

double quantile(std::vector<double> values, double share) {
  if (values.empty()) return 0;
  const auto at =
      values.begin() + static_cast<std::ptrdiff_t>(share * static_cast<double>(values.size() - 1));
  std::nth_element(values.begin(), at, values.end());
  return *at;
}

/// The smoothed picture as continuous functions, one per channel.
class SmoothPicture {
 public:
  SmoothPicture(const cv::Mat& picture, double smoothing) {
    cv::Mat real, smooth;
    picture.convertTo(real, CV_32F);
    cv::GaussianBlur(real, smooth, {0, 0}, smoothing);
    std::vector<cv::Mat> channels;
    cv::split(smooth, channels);
    for (const cv::Mat& channel : channels) channels_.emplace_back(channel);
  }
  bool contains(const Vec2& p) const { return channels_.front().contains(p.x(), p.y()); }
  /// Derivative of the channels along a direction, grey levels per px.
  Vec3 slope(const Vec2& p, const Vec2& direction) const {
    Vec3 result = Vec3::Zero();
    for (std::size_t k = 0; k < channels_.size(); ++k) {
      const SplineImage::Sample s = channels_[k].sample(p.x(), p.y());
      result[static_cast<Eigen::Index>(k)] = s.dx * direction.x() + s.dy * direction.y();
    }
    return result;
  }

 private:
  std::vector<SplineImage> channels_;
};

/// Strength of edges along the normal of each sample, at offsets −half·kStep .. half·kStep px.
struct Profiles {
  int half = 0;
  std::vector<std::vector<double>> strength;  ///< empty where the picture does not hold the whole profile
};

/// Each profile is the mean over the stretch of outline that belongs to its sample: what runs along the outline
/// stays, texture averages out.
Profiles edge_profiles(const SmoothPicture& picture, const std::vector<OutlinePoint>& outline,
                       double window) {
  constexpr int kParts = 5;
  Profiles profiles;
  profiles.half = static_cast<int>(std::ceil(window / kStep)) + 1;
  const auto n = static_cast<int>(outline.size());
  for (int i = 0; i < n; ++i) {
    const OutlinePoint &before = outline[(i + n - 1) % n], &here = outline[i], &after = outline[(i + 1) % n];
    std::vector<Vec3> sum(2 * profiles.half + 1, Vec3::Zero());
    bool is_inside = true;
    for (int part = 0; part < kParts && is_inside; ++part) {
      // −2/5 .. 2/5 of the way to the neighbours, on the parabola through the three
      const double u = (part - kParts / 2) / static_cast<double>(kParts);
      const Vec2 p = here.pixel + 0.5 * u * (after.pixel - before.pixel) +
                     0.5 * u * u * (after.pixel - 2 * here.pixel + before.pixel);
      const Vec2 normal = (here.normal + 0.5 * u * (after.normal - before.normal)).normalized();
      for (int k = -profiles.half; k <= profiles.half && is_inside; ++k) {
        const Vec2 at = p + k * kStep * normal;
        is_inside = picture.contains(at);
        if (is_inside) sum[k + profiles.half] += picture.slope(at, normal) / kParts;
      }
    }
    std::vector<double>& strength = profiles.strength.emplace_back();
    if (is_inside)
      for (const Vec3& s : sum) strength.push_back(s.norm());
  }
  return profiles;
}

/// A sample's edge: its line of sight and scale.
struct Sighting {
  int sample = 0;
  Vec2 pixel;
  Ray ray;
  double px_per_mm = 0, strength = 0;
  double trust = 1;  ///< an edge's error goes as 1/strength: weight in the sum of squares beside Tukey's
};

std::optional<Sighting> sighting(const Camera& camera, const OutlinePoint& place, int sample, double offset) {
  Sighting s{.sample = sample,
             .pixel = place.pixel + offset * place.normal,
             .ray = {},
             .px_per_mm = place.px_per_mm};
  try {
    s.ray = camera.pixel_ray(s.pixel);
  } catch (const InputError&) {  // beyond the fold of the distortion
    return std::nullopt;
  }
  return s;
}

/// Weighted normal equations at a centre.
struct Normal {
  Mat3 hessian = Mat3::Zero();
  Vec3 gradient = Vec3::Zero();
};

Normal normal_equations(const std::vector<Sighting>& sightings, const std::vector<double>& weights,
                        const Vec3& centre, double radius) {
  Normal normal;
  for (std::size_t i = 0; i < sightings.size(); ++i) {
    if (weights[i] <= 0) continue;
    const OutlineResidual e = outline_residual(sightings[i].ray, centre, radius, sightings[i].px_per_mm);
    const double w = weights[i] * sightings[i].trust;
    normal.hessian += w * e.by_centre * e.by_centre.transpose();
    normal.gradient += w * e.value * e.by_centre;
  }
  return normal;
}

/// One Gauss-Newton step, at most half a radius; nothing where the sightings do not determine the centre.
std::optional<Vec3> step(const Normal& normal, double radius) {
  const Eigen::LDLT<Mat3> factor(normal.hessian);
  if (factor.info() != Eigen::Success || factor.rcond() < 1e-10) return std::nullopt;
  const Vec3 s = -factor.solve(normal.gradient);
  if (!s.allFinite()) return std::nullopt;
  return s.norm() > 0.5 * radius ? Vec3(s * (0.5 * radius / s.norm())) : s;
}

std::vector<double> residuals_at(const std::vector<Sighting>& sightings, const Vec3& centre, double radius) {
  std::vector<double> values;
  for (const Sighting& s : sightings)
    values.push_back(outline_residual(s.ray, centre, radius, s.px_per_mm).value);
  return values;
}

/// Tukey's weights. The scale is that of the residuals below the cut themselves, since more than half may be of
/// something else; `widest` px is the first cut.
std::vector<double> tukey_weights(const std::vector<double>& residuals, double widest) {
  double cut = widest;
  for (int pass = 0; pass < 4; ++pass) {
    std::vector<double> inside;
    for (const double e : residuals)
      if (std::fabs(e) < cut) inside.push_back(std::fabs(e));
    // Below 0.3 px rounding of the picture and not the edge would decide.
    cut = std::clamp(kTukey * 1.4826 * quantile(inside, 0.5), 0.3, widest);
  }
  std::vector<double> weights;
  for (const double e : residuals) {
    const double q = 1 - e * e / (cut * cut);
    weights.push_back(q > 0 ? q * q : 0);
  }
  return weights;
}

/// Weights without the neighbours of runs that do not fit: there what hides the outline leaves it gradually, and
/// takes the edge along by less than the cut.
void leave_out_ends(const std::vector<Sighting>& sightings, int count, std::vector<double>& weights) {
  std::vector<char> fits(static_cast<std::size_t>(count), 0), keep(fits.size(), 1);
  for (std::size_t i = 0; i < sightings.size(); ++i)
    fits[static_cast<std::size_t>(sightings[i].sample)] = weights[i] > 0.05;
  const int margin = static_cast<int>(std::ceil(12 * count / 360.0)), run = std::max(3, count / 30);
  for (int i = 0; i < count; ++i) {
    int length = 0;
    while (length < run && fits[static_cast<std::size_t>((i + length) % count)] == 0) ++length;
    if (length < run) continue;
    for (int k = -margin; k < run + margin; ++k) keep[static_cast<std::size_t>((i + k + count) % count)] = 0;
  }
  for (std::size_t i = 0; i < sightings.size(); ++i)
    if (keep[static_cast<std::size_t>(sightings[i].sample)] == 0) weights[i] = 0;
}

/// Step 1: offsets of all samples by the shift and the change of size that have most edge under the outline.
/// Nothing when that is at the end of the window.
std::optional<std::vector<double>> coarse_offsets(const Profiles& profiles,
                                                  const std::vector<OutlinePoint>& outline, double window) {
  std::vector<double> all;
  for (const auto& s : profiles.strength) all.insert(all.end(), s.begin(), s.end());
  const double m = std::max(1e-6, quantile(all, 0.75));
  const int reach = static_cast<int>(window), change = std::max(1, reach / 4);
  double best = -1;
  Eigen::Vector3i found = Eigen::Vector3i::Zero();
  for (int dr = -change; dr <= change; ++dr)
    for (int dy = -reach; dy <= reach; ++dy)
      for (int dx = -reach; dx <= reach; ++dx) {
        if (dx * dx + dy * dy > reach * reach) continue;
        double score = 0;
        for (std::size_t i = 0; i < outline.size(); ++i) {
          if (profiles.strength[i].empty()) continue;
          const double t = outline[i].normal.dot(Vec2(dx, dy)) + dr;
          const auto k = std::lround(t / kStep) + profiles.half;
          if (k < 0 || k > 2 * profiles.half) continue;
          const double g = profiles.strength[i][static_cast<std::size_t>(k)];
          score += g * g / (g * g + m * m);
        }
        if (score <= best) continue;
        best = score;
        found = {dx, dy, dr};
      }
  if (best <= 0 || found.head<2>().cast<double>().norm() > reach - 1) return std::nullopt;
  std::vector<double> offsets;
  for (const OutlinePoint& place : outline)
    offsets.push_back(place.normal.dot(found.head<2>().cast<double>()) + found[2]);
  return offsets;
}

/// Step 2: the strongest edge of each sample within `window` px. Weak ones are none.
std::vector<Sighting> edges_near(const SmoothPicture& picture, const Camera& camera,
                                 const std::vector<OutlinePoint>& outline, double window) {
  const Profiles profiles = edge_profiles(picture, outline, window);
  std::vector<Sighting> edges;
  std::vector<double> strengths;
  for (std::size_t i = 0; i < outline.size(); ++i) {
    const std::vector<double>& g = profiles.strength[i];
    if (g.empty()) continue;
    const auto peak = std::max_element(g.begin() + 1, g.end() - 1);
    const double left = *(peak - 1), middle = *peak, right = *(peak + 1);
    if (middle < left || middle < right || middle <= 0) continue;  // it rises on beyond the window
    const double bend = left - 2 * middle + right, shift = bend < 0 ? 0.5 * (left - right) / bend : 0;
    const double offset = (static_cast<double>(peak - g.begin()) - profiles.half + shift) * kStep;
    auto edge = sighting(camera, outline[i], static_cast<int>(i), offset);
    if (!edge) continue;
    edge->strength = middle;
    edges.push_back(*edge);
    strengths.push_back(middle);
  }
  const double usual = quantile(strengths, 0.75);
  std::erase_if(edges, [usual](const Sighting& s) { return s.strength < 0.15 * usual; });
  for (Sighting& s : edges) s.trust = std::min(1.0, std::pow(s.strength / usual, 2));
  return edges;
}

/// Cov(c) of finger_outline.h. Edges of weight zero stay out; the others are weighted anew without each block.
Mat3 centre_covariance(const std::vector<Sighting>& sightings, const std::vector<double>& weights,
                       const Vec3& centre, double radius, int count) {
  constexpr int kBlock = 5;  // samples: texture is rarely alike over more of the outline
  Mat3 covariance = Mat3::Zero();
  for (int first = 0; first < count; ++first) {
    std::vector<Sighting> others;
    for (std::size_t i = 0; i < sightings.size(); ++i)
      if (weights[i] > 0 && (sightings[i].sample - first + count) % count >= kBlock)
        others.push_back(sightings[i]);
    Vec3 without = centre;
    for (int pass = 0; pass < 20; ++pass) {
      const auto again = tukey_weights(residuals_at(others, without, radius), kNarrowest);
      const auto move = step(normal_equations(others, again, without, radius), radius);
      if (!move) break;
      without += *move;
      if (move->norm() < 1e-6 * radius) break;
    }
    covariance += (without - centre) * (without - centre).transpose() / kBlock;
  }
  return covariance;
}

double largest_shift(const std::vector<OutlinePoint>& a, const Camera& camera, const Vec3& move) {
  double largest = 0;
  for (const OutlinePoint& p : a)
    largest = std::max(largest, (camera.projection_jacobian(p.point) * move).norm());
  return largest;
}

/// The robust fit to edges that stay as they are: the centre, with the weights at its end (none: not determined).
/// `knows_ends`: runs that do not fit are taken for hidden, not for a start that is off.
std::vector<double> fit_centre(const std::vector<Sighting>& edges, int count, double radius, double widest,
                               bool knows_ends, Vec3& centre) {
  std::vector<double> weights;
  for (int pass = 0; pass < 20; ++pass) {
    weights = tukey_weights(residuals_at(edges, centre, radius), widest);
    if (knows_ends) leave_out_ends(edges, count, weights);
    const auto move = step(normal_equations(edges, weights, centre, radius), radius);
    if (!move) return {};
    centre += *move;
    if (move->norm() < 1e-7 * radius) break;
  }
  return weights;
}

void add_uncertainty(const std::vector<Sighting>& edges, const std::vector<double>& weights,
                     const Camera& camera, double radius, OutlineEstimate& found) {
  const std::vector<double> residuals = residuals_at(edges, found.centre, radius);
  double sum = 0, total = 0;
  for (std::size_t i = 0; i < edges.size(); ++i) {
    sum += weights[i] * residuals[i] * residuals[i];
    total += weights[i];
    found.edges.push_back({edges[i].pixel, residuals[i], weights[i]});
  }
  found.rms = std::sqrt(sum / total);
  found.covariance = centre_covariance(edges, weights, found.centre, radius, found.samples);
  const Vec3 sight = (found.centre - camera.centre()).normalized(), side = sight.unitOrthogonal(),
             third = sight.cross(side);
  Eigen::Matrix<double, 3, 2> across;
  across << side, third;
  const Eigen::Matrix2d c = across.transpose() * found.covariance * across;
  const double mean = 0.5 * c.trace();
  found.across_sigma = std::sqrt(mean + std::sqrt(std::max(0.0, mean * mean - c.determinant())));
  found.depth_sigma = std::sqrt(sight.dot(found.covariance * sight));
}

}  // namespace

std::vector<OutlinePoint> sphere_outline(const Vec3& centre, double radius, const Camera& camera, int count) {
  const Vec3 to_eye = camera.centre() - centre;
  const double distance = to_eye.norm();
  if (!((camera.rotation * centre + camera.translation).z() > radius)) return {};
  const Vec3 axis = to_eye / distance, side = axis.unitOrthogonal(), third = axis.cross(side);
  const double sine = radius / distance, cosine = std::sqrt(1 - sine * sine);
  std::vector<OutlinePoint> outline;
  for (int k = 0; k < count; ++k) {
    const double angle = 2 * std::numbers::pi * k / count;
    const Vec3 outward = std::cos(angle) * side + std::sin(angle) * third,
               along = std::cos(angle) * third - std::sin(angle) * side,
               normal = sine * axis + cosine * outward;  // of the sphere, where the line of sight touches it
    OutlinePoint place;
    place.point = centre + radius * normal;
    place.pixel = camera.project(place.point);
    const Eigen::Matrix<double, 2, 3> jacobian = camera.projection_jacobian(place.point);
    const Vec2 tangent = (jacobian * along).normalized(), growth = jacobian * normal;
    place.normal = Vec2(tangent.y(), -tangent.x());
    if (place.normal.dot(growth) < 0) place.normal = -place.normal;
    place.px_per_mm = place.normal.dot(growth);
    if (!place.pixel.allFinite() || !(place.px_per_mm > 0)) return {};
    outline.push_back(place);
  }
  return outline;
}

OutlineResidual outline_residual(const Ray& ray, const Vec3& centre, double radius, double px_per_mm) {
  const Vec3 w = centre - ray.origin, across = w - w.dot(ray.direction) * ray.direction;
  const double distance = across.norm();
  return {px_per_mm * (distance - radius), px_per_mm * across / distance};
}

OutlineEstimate find_sphere(const cv::Mat& picture, const Camera& camera, const Vec3& start, double radius,
                            const OutlineOptions& options) {
  require((picture.type() == CV_8UC3 || picture.type() == CV_8U) && picture.cols == camera.width &&
              picture.rows == camera.height && picture.cols >= 8 && picture.rows >= 8,
          "find_sphere: a picture of 8 bit with the camera's size");
  require(radius > 0 && options.window >= 4 && options.samples >= 12,
          "find_sphere: a radius, a window of at least 4 px, 12 samples");
  OutlineEstimate found;
  found.centre = start;
  const auto lost = [&found](const std::string& why) {
    found.lost = why;
    return found;
  };
  std::vector<OutlinePoint> outline = sphere_outline(start, radius, camera, options.samples);
  if (outline.empty()) return lost("not in front of the camera");
  double length = 0;
  for (std::size_t i = 0; i < outline.size(); ++i)
    length += (outline[(i + 1) % outline.size()].pixel - outline[i].pixel).norm();
  found.samples = std::clamp(static_cast<int>(length / kLeastSpacing), 12, options.samples);
  const int least = static_cast<int>(std::ceil(options.least_share * found.samples));
  outline = sphere_outline(start, radius, camera, found.samples);

  const SmoothPicture smooth(picture, options.smoothing);
  const auto offsets =
      coarse_offsets(edge_profiles(smooth, outline, options.window), outline, options.window);
  if (!offsets)
    return lost("no outline within " + short_text(options.window) + " px of where it was expected");
  std::vector<Sighting> coarse;
  for (int i = 0; i < found.samples; ++i)
    if (auto s = sighting(camera, outline[static_cast<std::size_t>(i)], i,
                          (*offsets)[static_cast<std::size_t>(i)]))
      coarse.push_back(*s);
  for (int pass = 0; pass < 10; ++pass) {
    const std::vector<double> equal(coarse.size(), 1.0);
    const auto move = step(normal_equations(coarse, equal, found.centre, radius), radius);
    if (!move) return lost("its outline is mostly outside the picture");
    found.centre += *move;
  }

  std::vector<Sighting> edges;
  std::vector<double> weights;
  double moved = std::numeric_limits<double>::infinity();
  for (int pass = 0; pass < kFineSteps && (moved > kSettled || pass < kNarrowing); ++pass) {
    outline = sphere_outline(found.centre, radius, camera, found.samples);
    if (outline.empty()) return lost("not in front of the camera");
    // In the end two of three edges that lie anywhere in the window would not fit: then runs of them are found
    // everywhere, and what is no outline is lost.
    const double narrow = std::min(1.0, pass / (kNarrowing - 1.0)), window = 4 - narrow,
                 widest = 1 + kNarrowest - narrow;
    edges = edges_near(smooth, camera, outline, window);
    Vec3 centre = found.centre;
    weights = fit_centre(edges, found.samples, radius, widest, 2 * pass >= kNarrowing, centre);
    found.used =
        static_cast<int>(std::count_if(weights.begin(), weights.end(), [](double w) { return w > 0.05; }));
    const int needed = pass + 1 < kNarrowing ? least / 2 : least;
    if (found.used < needed)
      return lost(std::to_string(found.used) + " of " + std::to_string(found.samples) +
                  " samples of the outline fit, at least " + std::to_string(needed) + " are needed");
    moved = largest_shift(outline, camera, centre - found.centre);
    found.centre = centre;
  }
  if (moved > kUnsettled) return lost("the search does not settle");
  add_uncertainty(edges, weights, camera, radius, found);
  return found;
}

}  // namespace rhytid::fitting
