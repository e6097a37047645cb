// The sphere found by its outline in pictures that are known exactly: a shaded ball over texture, with noise.
#include "fitting/finger_outline.h"

#include <gtest/gtest.h>

#include <Eigen/Geometry>
#include <cmath>
#include <numbers>
#include <opencv2/imgproc.hpp>
#include <random>

#include "sim/core/error.h"
#include "tests/fitting/finger_camera.h"

namespace rhytid::fitting {
namespace {

constexpr double kRadius = 6;

/// Smooth random grey of a typical size, about 0 with a deviation of 1.
cv::Mat texture(std::mt19937& random, double size) {
  cv::Mat noise(480, 640, CV_32F);
  std::normal_distribution<float> normal;
  for (int i = 0; i < noise.rows; ++i)
    for (int j = 0; j < noise.cols; ++j) noise.at<float>(i, j) = normal(random);
  cv::GaussianBlur(noise, noise, {0, 0}, size);
  cv::Scalar mean, deviation;
  cv::meanStdDev(noise, mean, deviation);
  return noise / deviation[0];
}

struct Scenery {
  double texture = 10;  ///< grey levels, of skin and ball
  double noise = 1.5;   ///< grey levels
  double hidden_from =
      0;  ///< rad about the ball's centre in the picture: the ball is not drawn in this sector
  double hidden_to = 0;
};

/// The ball's share of a pixel is that of an edge seen through a lens and a pixel of σ 0.6 px together.
cv::Mat picture_of(const Camera& camera, const Vec3& centre, unsigned seed, const Scenery& scenery = {}) {
  std::mt19937 random(seed);
  const cv::Mat skin = texture(random, 3), ball = texture(random, 2);
  std::normal_distribution<double> normal;
  const Vec2 middle = camera.project(centre);
  const double scale = sphere_outline(centre, kRadius, camera, 12).front().px_per_mm;
  cv::Mat picture(camera.height, camera.width, CV_8UC3);
  for (int y = 0; y < camera.height; ++y)
    for (int x = 0; x < camera.width; ++x) {
      const Ray ray = camera.pixel_ray(Vec2(x, y));
      const Vec3 w = centre - ray.origin, across = w - w.dot(ray.direction) * ray.direction;
      const double e = scale * (across.norm() - kRadius), angle = std::atan2(y - middle.y(), x - middle.x());
      double share = 0.5 * std::erfc(e / (0.6 * std::numbers::sqrt2));
      if (angle > scenery.hidden_from && angle < scenery.hidden_to) share = 0;
      // Light falls from the left; dim toward the right, where skin is darker too.
      const double light = 1 - 0.3 * across.x() / kRadius;
      for (int c = 0; c < 3; ++c) {
        const double of_skin = 150 - 20 * c + scenery.texture * skin.at<float>(y, x),
                     of_ball = light * (185 - 40 * c) + scenery.texture * ball.at<float>(y, x);
        const double value = (1 - share) * of_skin + share * of_ball + scenery.noise * normal(random);
        picture.at<cv::Vec3b>(y, x)[c] = cv::saturate_cast<unsigned char>(value);
      }
    }
  return picture;
}

/// Error of a centre across and along the line of sight, mm.
std::pair<double, double> split(const Camera& camera, const Vec3& centre, const Vec3& error) {
  const Vec3 sight = (centre - camera.centre()).normalized();
  return {(error - error.dot(sight) * sight).norm(), std::fabs(error.dot(sight))};
}

TEST(SphereOutline, LiesWhereLinesOfSightTouch) {
  const Camera camera = finger_camera();
  const Vec3 centre(0.7, -1.2, 5);
  for (const OutlinePoint& p : sphere_outline(centre, kRadius, camera, 40)) {
    const OutlineResidual e = outline_residual(camera.pixel_ray(p.pixel), centre, kRadius, p.px_per_mm);
    EXPECT_NEAR(e.value, 0, 1e-7);
    // One px outward along the normal is one px of e.
    const double h = 1e-3;
    EXPECT_NEAR(
        outline_residual(camera.pixel_ray(p.pixel + h * p.normal), centre, kRadius, p.px_per_mm).value, h,
        1e-3 * h);
  }
  EXPECT_TRUE(sphere_outline(camera.centre() + Vec3(0, 0, 1), kRadius, camera, 40).empty());
}

TEST(OutlineResidual, DerivativeIsThatOfTheValue) {
  const Camera camera = finger_camera();
  const Vec3 centre(0.7, -1.2, 5);
  const Ray ray = camera.pixel_ray({250, 300});
  const OutlineResidual at = outline_residual(ray, centre, kRadius, 17);
  for (int k = 0; k < 3; ++k) {
    const auto error = [&](double h) {
      const Vec3 d = h * Vec3::Unit(k);
      return std::fabs((outline_residual(ray, centre + d, kRadius, 17).value -
                        outline_residual(ray, centre - d, kRadius, 17).value) /
                           (2 * h) -
                       at.by_centre[k]);
    };
    EXPECT_LT(error(1e-3), 1e-4);
    EXPECT_NEAR(error(0.2) / error(0.1), 4, 0.2);
  }
}

TEST(FindSphere, RecoversTheCentreAndStatesItsError) {
  const Camera camera = finger_camera();
  std::mt19937 random(7);
  std::uniform_real_distribution<double> uniform(-1, 1);
  constexpr int kDraws = 40;
  double normalised = 0, worst_across = 0, worst_depth = 0;
  for (int draw = 0; draw < kDraws; ++draw) {
    const Vec3 centre(2 * uniform(random), 2 * uniform(random), 5 + uniform(random));
    const Vec3 start = centre + 0.4 * Vec3(uniform(random), uniform(random), uniform(random));
    const OutlineEstimate found =
        find_sphere(picture_of(camera, centre, 100 + static_cast<unsigned>(draw)), camera, start, kRadius);
    ASSERT_EQ(found.lost, "");
    const Vec3 error = found.centre - centre;
    const auto [across, depth] = split(camera, centre, error);
    worst_across = std::max(worst_across, across);
    worst_depth = std::max(worst_depth, depth);
    const Vec3 sight = (centre - camera.centre()).normalized(), side = sight.unitOrthogonal();
    for (const Vec3& axis : {sight, side, Vec3(sight.cross(side))})
      normalised += std::pow(axis.dot(error), 2) / axis.dot(found.covariance * axis) / 3 / kDraws;
    EXPECT_GT(found.depth_sigma, found.across_sigma);
    EXPECT_GT(found.used, 0.8 * found.samples);
  }
  std::printf("worst error across %.4f mm, in depth %.4f mm; normalised %.2f\n", worst_across, worst_depth,
              normalised);
  EXPECT_LT(worst_across, 0.02);
  EXPECT_LT(worst_depth, 0.2);
  EXPECT_GT(normalised, 0.6);  // 120 values: 1 ± 0.13; a variance linearised at fixed weights gives 1.9
  EXPECT_LT(normalised, 1.5);
}

TEST(FindSphere, AHiddenThirdWidensTheErrorAndIsLeftOut) {
  const Camera camera = finger_camera();
  const Vec3 centre(0.4, -0.8, 5), start = centre + Vec3(0.3, -0.3, 0.2);
  const OutlineEstimate whole = find_sphere(picture_of(camera, centre, 3), camera, start, kRadius);
  const OutlineEstimate part = find_sphere(
      picture_of(camera, centre, 3, {.hidden_from = 0.3, .hidden_to = 0.3 + 2 * std::numbers::pi / 3}),
      camera, start, kRadius);
  ASSERT_EQ(part.lost, "");
  EXPECT_LT(part.used, 0.70 * part.samples);
  EXPECT_GT(part.depth_sigma, whole.depth_sigma);
  const auto [across, depth] = split(camera, centre, part.centre - centre);
  std::printf("a third hidden: across %.4f mm, depth %.4f mm, stated %.4f and %.4f\n", across, depth,
              part.across_sigma, part.depth_sigma);
  EXPECT_LT(across, 0.04);
  EXPECT_LT(depth, 0.3);
}

TEST(FindSphere, SaysWhatItCannotFind) {
  const Camera camera = finger_camera();
  const Vec3 centre(0.4, -0.8, 5);
  const cv::Mat picture = picture_of(camera, centre, 5);
  EXPECT_NE(find_sphere(picture, camera, centre + Vec3(3, 0, 0), kRadius).lost, "");  // 50 px away
  std::mt19937 random(11);
  for (const double size : {1.5, 3.0, 6.0, 12.0})
    for (int draw = 0; draw < 3; ++draw) {  // no finger at all
      cv::Mat bytes;
      texture(random, size).convertTo(bytes, CV_8U, 20, 128);
      const OutlineEstimate none = find_sphere(bytes, camera, centre, kRadius);
      EXPECT_NE(none.lost, "") << "texture of " << size << " px: " << none.used << " of " << none.samples;
    }
  EXPECT_EQ(find_sphere(picture, camera, camera.centre(), kRadius).lost, "not in front of the camera");
  EXPECT_THROW((void)find_sphere(picture(cv::Rect(0, 0, 100, 100)), camera, centre, kRadius), ContractError);
}

}  // namespace
}  // namespace rhytid::fitting
