// Attachment of tracks to the curved surface, and the projection of material points with its derivatives.
#include "fitting/registration.h"

#include <gtest/gtest.h>

#include "fitting/projected_points.h"
#include "tests/fitting/synthetic_tracks.h"

namespace rhytid::fitting {
namespace {

/// The patch bent onto a cylinder with true curved faces.
Scene bent_scene(int frames) {
  return test::drag_scene(frames, {"/skin/surface/grid/bend_radius=20 mm", "/skin/order=3"});
}

TEST(Registration, FindsTheMaterialPointOfEveryPixelToRoundOff) {
  const Camera camera = test::make_camera();
  const SceneModel model(bent_scene(1));
  std::vector<adjoint::MaterialPoint> points;
  for (int f = 0; f < model.model().mesh.num_faces; ++f)
    for (const auto& [u, v] : {std::pair{0.31, 0.42}, {0.02, 0.03}, {0.5, 0.5}, {0.0, 0.7}, {0.985, 0.01}})
      points.push_back({f, u, v, true});
  const adjoint::PointInterpolation at(model.model().mesh, points);
  TrackSet set;
  for (int i = 0; i < at.num_points(); ++i) {
    Observation o;
    o.status = TrackStatus::ok;
    o.pixel = camera.project(at.rest(i));
    set.tracks.push_back({i, camera.name, {o}});
  }
  const Registration found = register_tracks(set, camera, model.model().mesh, 0);
  // Pixels exactly on the outline may miss the flat triangles by a hair; nothing else may be lost.
  EXPECT_GE(found.report.registered, at.num_points() - 24);
  EXPECT_EQ(found.report.registered + found.report.left_out(), at.num_points());
  for (const RegisteredTrack& r : found.tracks) {
    const adjoint::PointInterpolation back(model.model().mesh, {r.point});
    EXPECT_LT((back.rest(0) - at.rest(r.track)).norm(), 2e-8) << r.track;
  }
}

TEST(Registration, LeavesOutTracksNearTheRimAndUnseenOnes) {
  const Camera camera = test::make_camera();
  const SceneModel model(test::drag_scene(1));
  TrackSet set;
  // The patch spans 16 × 12 mm and the outer surface lies at z = 0 or above; x = 7.5 is 0.5 mm off the rim.
  const double z = model.model().mesh.rest.col(2).maxCoeff();
  int id = 0;
  for (const double x : {0.0, 7.5, 6.5, 30.0}) {
    Observation o;
    o.status = TrackStatus::ok;
    o.pixel = camera.project({x, 0.3, z});
    set.tracks.push_back({id++, camera.name, {o}});
  }
  Observation late;
  late.frame = 2;
  late.status = TrackStatus::ok;
  set.tracks.push_back({id++, camera.name, {late}});
  const Registration found = register_tracks(set, camera, model.model().mesh, 1.0);
  EXPECT_EQ(found.report.registered, 2);
  EXPECT_EQ(found.report.near_rim, 1);
  EXPECT_EQ(found.report.missed_mesh, 1);
  EXPECT_EQ(found.report.not_seen, 1);
}

TEST(ProjectedPoints, TangentMatchesDifferencesAndAdjointIsItsTranspose) {
  const Camera camera = test::make_camera();
  const SceneModel model(bent_scene(1));
  const ProjectedPoints output(model.model().mesh,
                               {{0, 0.2, 0.3, true}, {7, 0.6, 0.1, true}, {3, 0.1, 0.1, true}}, camera,
                               {{}, {2, 0}, {1}});
  EXPECT_EQ(output.size(0), 0);
  EXPECT_EQ(output.size(1), 4);
  EXPECT_EQ(output.size(2), 2);
  EXPECT_EQ(output.size(3), 0);
  std::mt19937 rng(3);
  std::normal_distribution<double> normal;
  State state = model.model().rest_state();
  for (double& x : state.u) x = 0.1 * normal(rng);
  MatrixXd du(state.u.size(), 2), ds = MatrixXd::Zero(state.history.size(), 2);
  for (double& x : du.reshaped()) x = normal(rng);
  VectorXd weights(output.size(1));
  for (double& x : weights) x = normal(rng);
  const MatrixXd tangent = output.tangent(1, state, du, ds);
  VectorXd u_bar = VectorXd::Zero(state.u.size()), s_bar = VectorXd::Zero(state.history.size());
  output.adjoint(1, state, weights, u_bar, s_bar);
  for (int k = 0; k < 2; ++k) {
    const double forward = weights.dot(tangent.col(k));
    EXPECT_NEAR(forward, u_bar.dot(du.col(k)), 1e-12 * std::fabs(forward));
    State plus = state, minus = state;
    const double h = 1e-5;
    plus.u += h * du.col(k);
    minus.u -= h * du.col(k);
    const VectorXd difference = (output.values(1, plus) - output.values(1, minus)) / (2 * h);
    EXPECT_LT((difference - tangent.col(k)).norm(), 1e-6 * tangent.col(k).norm());
  }
}

}  // namespace
}  // namespace rhytid::fitting
