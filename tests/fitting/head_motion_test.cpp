// The head's pose in each frame from points that stand still on it: accuracy and its covariance, robustness,
// and fits of skin on a head that moves.
#include "fitting/head_motion.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <Eigen/Geometry>
#include <Eigen/LU>
#include <cmath>
#include <cstdio>
#include <random>

#include "sim/core/error.h"
#include "tests/fitting/synthetic_tracks.h"

namespace rhytid::fitting {
namespace {

using testing::HasSubstr;

constexpr double kDegree = 0.017453292519943295;

/// The camera as a head sees it that has turned about its x and y axes and moved, more from frame to frame.
Camera moved(const Camera& camera, double amount) {
  Camera c = camera;
  const Mat3 turn = (Eigen::AngleAxisd(3 * kDegree * amount, Vec3::UnitX()) *
                     Eigen::AngleAxisd(-2 * kDegree * amount, Vec3::UnitY()))
                        .toRotationMatrix();
  const Vec3 shift = amount * Vec3(0.8, -1.1, 0.6);
  c.rotation = camera.rotation * turn;
  c.translation = camera.rotation * shift + camera.translation;
  return c;
}

/// The point at the depth of `near` that is seen at a pixel.
Vec3 seen_at(const Camera& camera, const Vec2& pixel, const Vec3& near) {
  const Ray ray = camera.pixel_ray(pixel);
  const Vec3 forward = camera.rotation.row(2).transpose();
  return ray.origin + ray.direction * (forward.dot(near - ray.origin) / forward.dot(ray.direction));
}

/// A cloud of points with tracks in frames 0..frames, the camera moving, noise of `sigma` px.
struct Cloud {
  TrackSet tracks;
  std::vector<StillTrack> still;
};

/// With noise of `first_sigma` in frame 0 too the points lie where that frame shows them, at their depth.
Cloud make_cloud(int points, int frames, const Camera& camera, double sigma, unsigned seed,
                 double first_sigma = 0) {
  std::mt19937 rng(seed);
  std::normal_distribution<double> noise(0, sigma);
  std::uniform_real_distribution<double> place(-10, 10);
  Cloud cloud;
  for (int i = 0; i < points; ++i) {
    const Vec3 x(place(rng), 0.7 * place(rng), 0.2 * place(rng));
    const Vec2 off = first_sigma > 0 ? first_sigma * Vec2(noise(rng), noise(rng)) / sigma : Vec2(0, 0);
    Track track{i, camera.name, {}};
    for (int f = 0; f <= frames; ++f) {
      Observation o;
      o.frame = f;
      o.status = TrackStatus::ok;
      o.pixel = moved(camera, f).project(x);
      o.pixel += f > 0 ? Vec2(noise(rng), noise(rng)) : off;
      o.covariance =
          (f > 0 ? sigma * sigma : std::max(1e-12, first_sigma * first_sigma)) * Eigen::Matrix2d::Identity();
      track.observations.push_back(o);
    }
    cloud.tracks.tracks.push_back(std::move(track));
    cloud.still.push_back({i, first_sigma > 0 ? seen_at(camera, camera.project(x) + off, x) : x});
  }
  return cloud;
}

/// (ω, τ) that takes `from` to `to` about a world point.
Vector6d difference(const Camera& from, const Camera& to, const Vec3& middle) {
  const Eigen::AngleAxisd turn(Mat3(to.rotation * from.rotation.transpose()));
  Vector6d d;
  d.head<3>() = turn.angle() * turn.axis();
  d.tail<3>() = (to.rotation * middle + to.translation) - (from.rotation * middle + from.translation);
  return d;
}

TEST(HeadMotion, IsExactWithoutNoise) {
  const Camera camera = test::make_camera();
  const Cloud cloud = make_cloud(12, 3, camera, 0, 1);
  const HeadMotion motion = estimate_head_motion(cloud.tracks, cloud.still, camera, 3, 1e-3, 3);
  for (int f = 0; f <= 3; ++f) {
    EXPECT_TRUE(motion.known[f]);
    EXPECT_LT(difference(moved(camera, f), motion.cameras[f], motion.middle).norm(), 1e-8) << f;
  }
  EXPECT_NEAR(motion.largest_turn, difference(camera, moved(camera, 3), motion.middle).head<3>().norm(),
              1e-8);
  EXPECT_EQ(motion.pixel_covariance(0, Vec3(1, 2, 3)).norm(), 0) << "frame 0 is the reference";
}

// Errors of 200 poses against their covariance: Σ eᵀ Σ⁻¹ e / 6 is χ² with 1200 degrees of freedom over 200.
TEST(HeadMotion, CovarianceIsThatOfTheErrors) {
  const Camera camera = test::make_camera();
  double sum = 0, pixels = 0;
  constexpr int kDraws = 200;
  const Vec3 elsewhere(-6, 4, 1);
  for (int draw = 0; draw < kDraws; ++draw) {
    const Cloud cloud = make_cloud(25, 1, camera, 0.2, 100 + draw);
    const HeadMotion motion = estimate_head_motion(cloud.tracks, cloud.still, camera, 1, 1e-3, 0);
    const Vector6d e = difference(moved(camera, 1), motion.cameras[1], motion.middle);
    // max(1, χ²) widens the covariance in half of the draws: by its mean, not by much.
    sum += e.dot(motion.covariance[1].inverse() * e) / 6;
    const Vec2 off = motion.cameras[1].project(elsewhere) - moved(camera, 1).project(elsewhere);
    pixels += off.dot(motion.pixel_covariance(1, elsewhere).inverse() * off) / 2;
  }
  std::printf("normalised squares: pose %.3f, pixel %.3f\n", sum / kDraws, pixels / kDraws);
  EXPECT_NEAR(sum / kDraws, 0.93, 0.13);
  EXPECT_NEAR(pixels / kDraws, 0.93, 0.25);
}

// Frame 0 errs too: it places the points, and that error is in every later frame alike.
TEST(HeadMotion, CovarianceHasRoomForTheNoiseOfFrameZero) {
  const Camera camera = test::make_camera();
  double sum = 0;
  constexpr int kDraws = 200;
  for (int draw = 0; draw < kDraws; ++draw) {
    const Cloud cloud = make_cloud(25, 1, camera, 0.2, 300 + draw, 0.2);
    const HeadMotion motion = estimate_head_motion(cloud.tracks, cloud.still, camera, 1, 1e-3, 0);
    const Vector6d e = difference(moved(camera, 1), motion.cameras[1], motion.middle);
    sum += e.dot(motion.covariance[1].inverse() * e) / 6;
  }
  std::printf("normalised squares with noise in frame 0: %.3f\n", sum / kDraws);
  EXPECT_NEAR(sum / kDraws, 0.93, 0.13);
}

TEST(HeadMotion, DiscountsAPointThatMovesAndMissesFrames) {
  const Camera camera = test::make_camera();
  Cloud cloud = make_cloud(20, 3, camera, 0.1, 5);
  const HeadMotion clean = estimate_head_motion(cloud.tracks, cloud.still, camera, 3, 1e-3, 3);
  for (Observation& o : cloud.tracks.tracks[4].observations) o.pixel += o.frame * Vec2(6, -4);
  for (int i = 0; i < 16; ++i) cloud.tracks.tracks[i].observations[2].status = TrackStatus::occluded;
  const HeadMotion motion = estimate_head_motion(cloud.tracks, cloud.still, camera, 3, 1e-3, 3);
  EXPECT_FALSE(motion.known[2]) << "four points are too few";
  ASSERT_TRUE(motion.known[3]);
  const Vec2 at = clean.cameras[3].project(Vec3(3, 3, 0));
  EXPECT_LT((motion.cameras[3].project(Vec3(3, 3, 0)) - at).norm(), 0.15)
      << "18 px off without the loss, over 20";
  const HeadMotion plain = estimate_head_motion(cloud.tracks, cloud.still, camera, 3, 1e-3, 0);
  EXPECT_GT((plain.cameras[3].project(Vec3(3, 3, 0)) - at).norm(), 0.25);
  EXPECT_GT(plain.reduced_chi_square, 4);
}

/// A longer patch, held at both ends, where points stand still.
Scene long_scene(int frames) {
  return parse_scene_text(
      rhytid::test::drag_scene(2, frames), "drag.json",
      {R"(/skin/surface/grid/size=["28 mm", "12 mm"])", "/skin/surface/grid/cells=[7,3]",
       R"(/skin/held=[{"name": "one", "box": {"low": [-15, -7, -3], "high": [-9.9, 7, 3]}},
                      {"name": "other", "box": {"low": [9.9, -7, -3], "high": [15, 7, 3]}}])"});
}

TEST(HeadMotion, AFitTakesItOut) {
  constexpr int kFrames = 4;
  const Scene scene = long_scene(kFrames);
  const Camera camera = test::make_camera();
  std::vector<Camera> by_frame;
  for (int f = 0; f <= kFrames; ++f) by_frame.push_back(moved(camera, 0.5 * f));
  FitCase fit = test::three_parameters();
  fit.rim_margin = 0.5;
  const FitInput still_head{scene, camera, test::make_tracks(scene, camera, 6, 0.03, 2), fit, {}};
  FitInput moving_head{scene, camera, test::make_tracks(scene, by_frame, 6, 0.03, 2), fit, {}};
  const FitResult reference = run_fit(still_head);
  ASSERT_TRUE(reference.converged);
  moving_head.options.still = {{"one", Vec3(-14, -6, -1), Vec3(-10.1, 6, 3)},
                               {"other", Vec3(10.1, -6, -1), Vec3(14, 6, 3)}};

  // Derivatives of points before a camera that moves.
  FitProblem problem(scene, moving_head.options, camera, moving_head.tracks);
  ASSERT_EQ(problem.head_motion().size(), 1u);
  EXPECT_GT(problem.head_motion()[0].num_tracks, 12);
  const VectorXd t = problem.initial() + Vec3(0.03, -0.02, 0.05);
  const VectorXd z = problem.evaluate(t).residuals;
  const auto jacobian = problem.jacobian(t);
  const auto gradient = problem.gradient(t);
  ASSERT_TRUE(jacobian && gradient);
  EXPECT_LT((jacobian->transpose() * z - *gradient).norm(), 1e-8 * gradient->norm());
  const Vec3 direction(0.5, 1, -0.7);
  const double h = 1e-4;
  const VectorXd plus = problem.evaluate(t + h * direction).residuals,
                 minus = problem.evaluate(t - h * direction).residuals;
  EXPECT_LT((*jacobian * direction - (plus - minus) / (2 * h)).norm(), 1e-4 * (*jacobian * direction).norm());

  const FitResult found = run_fit(moving_head);
  std::printf("%s", answer_text(found).c_str());
  ASSERT_TRUE(found.converged);
  EXPECT_THAT(found.notes, testing::Contains(HasSubstr("stand still on it")));
  EXPECT_LT(found.reduced_chi_square, 1.3);
  for (std::size_t k = 0; k < 3; ++k) {
    const FittedParameter &a = found.parameters[k], &b = reference.parameters[k];
    EXPECT_LT(std::fabs(std::log(a.value / b.value)), 3 * std::hypot(a.sigma, b.sigma)) << a.name;
    EXPECT_LT(a.sigma, 2 * b.sigma) << "the poses cost little";
  }
  moving_head.options.still.clear();
  EXPECT_GT(run_fit(moving_head).reduced_chi_square, 100) << "the motion is no small thing";
  moving_head.options.still = {{"nowhere", Vec3(50, 50, 50), Vec3(60, 60, 60)}};
  try {
    run_fit(moving_head);
    FAIL() << "no still track";
  } catch (const InputError& error) {
    EXPECT_THAT(error.what(), AllOf(HasSubstr("/fit/still"), HasSubstr("0 tracks"), HasSubstr("at least 6")));
  }
}

}  // namespace
}  // namespace rhytid::fitting
