// Predicted gain of a further view against a problem that has it.
#include "fitting/further_views.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <Eigen/LU>
#include <cmath>
#include <cstdio>

#include "tests/fitting/synthetic_tracks.h"

namespace rhytid::fitting {
namespace {

constexpr int kFrames = 4;
constexpr double kSigma = 0.02;

FitClip make_clip(const std::vector<Camera>& cameras) {
  const Scene scene = test::drag_scene(kFrames);
  FitClip clip{"", "", scene, cameras, {}};
  for (std::size_t c = 0; c < cameras.size(); ++c)  // the same points, with noise of their own
    for (Track& track : test::make_tracks(scene, cameras[c], 4, c == 0 ? kSigma : 0, 1).tracks) {
      for (Observation& o : track.observations) o.covariance = kSigma * kSigma * Eigen::Matrix2d::Identity();
      clip.tracks.tracks.push_back(track);
    }
  return clip;
}

VectorXd deviations(JointProblem& problem, const VectorXd& t) {
  const auto at = problem.linearised(t);
  const MatrixXd h = at->jacobian.transpose() * at->jacobian;
  return h.inverse().diagonal().cwiseSqrt();
}

// To the left of the first camera, looking at `middle` from as far.
Camera to_the_left(const Camera& camera, const Vec3& middle) {
  const Vec3 right = camera.rotation.row(0).transpose(), down = camera.rotation.row(1).transpose();
  const Vec3 arm = camera.centre() - middle;
  // The part of the arm across `down` turned by 45°, toward −right.
  const Vec3 along = arm.dot(down) * down, across = arm - along, side = arm.dot(right) * right;
  const Vec3 back = across - side;
  const double c = std::sqrt(0.5);
  const double a = arm.dot(right), b = back.norm();
  const Vec3 turned = (c * a - c * b) * right + (c * b + c * a) * back.normalized();
  Camera left = camera;
  left.name = "left";
  const Vec3 centre = middle + along + turned;
  Mat3 axes;  // the same turn of the axes: columns right, down, forward in world
  const Vec3 forward = camera.rotation.row(2).transpose();
  const auto turn = [&](const Vec3& v) {
    const Vec3 v_along = v.dot(down) * down;
    const Vec3 n = back.normalized();
    const double x = v.dot(right), y = v.dot(n);
    return Vec3(v_along + (c * x - c * y) * right + (c * y + c * x) * n);
  };
  axes.row(0) = turn(right).transpose();
  axes.row(1) = turn(down).transpose();
  axes.row(2) = turn(forward).transpose();
  left.rotation = axes;
  left.translation = -axes * centre;
  return left;
}

TEST(FurtherViews, PredictWhatASecondCameraBrings) {
  const Camera camera = test::make_camera();
  JointProblem one({make_clip({camera})}, test::three_parameters());
  const VectorXd t = one.initial() + Vec3(0.1, 0.2, -0.1);
  ASSERT_FALSE(one.evaluate(t).failed);
  const VectorXd before = deviations(one, t);
  const std::vector<FurtherView> views = further_views(one, t, *one.linearised(t));
  ASSERT_GE(views.size(), 3u);
  EXPECT_EQ(views[0].name, "the same once more");
  for (const double ratio : views[0].ratios) EXPECT_NEAR(ratio, std::sqrt(0.5), 1e-9);

  Vec3 middle = Vec3::Zero();
  const std::vector<Vec3> points = one.clip(0).rest_points();
  for (const Vec3& x : points) middle += x / static_cast<double>(points.size());
  const Camera left = to_the_left(camera, middle);
  EXPECT_LT((left.centre() - camera.centre()).dot(camera.rotation.row(0)), -1);
  JointProblem two({make_clip({camera, left})}, test::three_parameters());
  ASSERT_FALSE(two.evaluate(t).failed) << two.last_failure();
  const VectorXd after = deviations(two, t);
  const auto predicted = std::find_if(views.begin(), views.end(), [](const FurtherView& v) {
    return v.name == "another camera 45° to the left";
  });
  ASSERT_NE(predicted, views.end());
  for (int k = 0; k < 3; ++k) {
    std::printf("%d: predicted %.4f, found %.4f\n", k, predicted->ratios[k], after[k] / before[k]);
    // The second camera's tracks near the rim may be others, and Huber's weights are its own.
    EXPECT_NEAR(predicted->ratios[k], after[k] / before[k], 0.03 * predicted->ratios[k]);
    EXPECT_LT(predicted->ratios[k], 1);
  }
}

TEST(FurtherViews, FewPointsAndSettledSkinHaveOnlyTheRepeat) {
  const auto only_repeat = [](FitClip clip) {
    FitCase fit = test::three_parameters();
    fit.rim_margin = 0;
    JointProblem problem({clip}, fit);
    const VectorXd t = problem.initial();
    ASSERT_FALSE(problem.evaluate(t).failed);
    const std::vector<FurtherView> views = further_views(problem, t, *problem.linearised(t));
    ASSERT_EQ(views.size(), 1u);
    for (const double ratio : views[0].ratios) EXPECT_NEAR(ratio, std::sqrt(0.5), 1e-9);
  };
  FitClip settled = make_clip({test::make_camera()});
  settled.scene = test::drag_scene(
      kFrames, {R"(/skin/pre_stretch={"stretch": 1.05, "across": 1.02, "direction": [1, 0, 0]})"});
  only_repeat(settled);
  // Two tracks, wherever they are on the skin.
  FitClip two = make_clip({test::make_camera()});
  const std::size_t middle = two.tracks.tracks.size() / 2;
  two.tracks.tracks = {two.tracks.tracks[middle], two.tracks.tracks[middle + 3]};
  only_repeat(two);
}

}  // namespace
}  // namespace rhytid::fitting
