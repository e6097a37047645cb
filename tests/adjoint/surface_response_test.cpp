// Surface means that are known, their derivatives, and the gauge that positions cannot tell.
#include "adjoint/surface_response.h"

#include <gtest/gtest.h>

#include <random>

#include "adjoint/certificate.h"
#include "adjoint/directions.h"
#include "adjoint/parameter_space.h"
#include "sim/scene/load.h"
#include "tests/support/small_scenes.h"

namespace rhytid::adjoint {
namespace {

SceneModel flat_patch(int order) {
  return SceneModel(parse_scene_text(test::drag_scene(order, 2), "drag.json", test::coarse()));
}

VectorXd random_vector(Eigen::Index size, unsigned seed) {
  std::mt19937 rng(seed);
  std::normal_distribution<double> normal;
  return VectorXd::NullaryExpr(size, [&] { return normal(rng); });
}

TEST(ColumnAreas, AddUpToTheSurface) {
  for (const int order : {1, 2, 3, 4}) {
    const SceneModel built = flat_patch(order);
    const VectorXd areas = column_areas(built.model().mesh, true);
    EXPECT_NEAR(areas.sum(), 16 * 12, 1e-10) << order;
    EXPECT_GT(areas.minCoeff(), 0) << order;
  }
}

TEST(MeanSquareDisplacement, OfALiftedSurfaceIsItsHeightSquared) {
  const SceneModel built = flat_patch(3);
  const SkinMesh& mesh = built.model().mesh;
  State state = built.model().rest_state();
  // Only the outer surface counts.
  for (int c = 0; c < mesh.num_columns; ++c)
    state.u.segment<3>(3 * mesh.node(c, mesh.num_levels - 1)) << 0, 3, 4;
  const MeanSquareDisplacement mean(mesh, 2);
  EXPECT_EQ(mean.values(1, state).size(), 0);
  EXPECT_NEAR(mean.values(2, state)[0], 25, 1e-12);
}

TEST(MeanSquareDisplacement, TangentAndAdjointAreItsDerivative) {
  const SceneModel built = flat_patch(2);
  State state = built.model().rest_state();
  state.u = random_vector(state.u.size(), 1);
  const MeanSquareDisplacement mean(built.model().mesh);
  const VectorXd du = random_vector(state.u.size(), 2);
  const double tangent = mean.tangent(1, state, du, MatrixXd())(0, 0);
  const double h = 1e-3;  // the function is quadratic: central differences are exact
  State up = state, down = state;
  up.u += h * du, down.u -= h * du;
  EXPECT_NEAR(tangent, (mean.values(1, up)[0] - mean.values(1, down)[0]) / (2 * h),
              1e-10 * std::abs(tangent));
  VectorXd u_bar = VectorXd::Zero(state.u.size()), s_bar;
  mean.adjoint(1, state, VectorXd::Constant(1, 1.0), u_bar, s_bar);
  EXPECT_NEAR(u_bar.dot(du), tangent, 1e-12 * std::abs(tangent));
}

TEST(OuterDisplacements, TangentAndAdjointPair) {
  const SceneModel built = flat_patch(2);
  const State state = built.model().rest_state();
  const OuterDisplacements output(built.model().mesh);
  const VectorXd du = random_vector(state.u.size(), 3), w = random_vector(output.size(1), 4);
  VectorXd u_bar = VectorXd::Zero(du.size()), s_bar;
  output.adjoint(1, state, w, u_bar, s_bar);
  EXPECT_NEAR(w.dot(output.tangent(1, state, du, MatrixXd()).col(0)), u_bar.dot(du), 1e-11);
  EXPECT_GT(u_bar.norm(), 1);
}

TEST(SurfaceResponse, HasTheFiguresOfItsRows) {
  const SceneModel built = flat_patch(1);
  const SkinMesh& mesh = built.model().mesh;
  TangentResult tangent;
  tangent.frames = {MatrixXd(0, 2), MatrixXd::Zero(3 * mesh.num_columns, 2),
                    MatrixXd::Zero(3 * mesh.num_columns, 2)};
  for (int c = 0; c < mesh.num_columns; ++c) {
    tangent.frames[1](3 * c, 0) = 3;      // everywhere 3 mm along x, in the first frame only
    tangent.frames[2](3 * c + 2, 1) = 4;  // 4 mm along z, in the second
  }
  tangent.frames[2](3 * 2 + 1, 1) = 3;  // and one node 3 mm along y
  const SurfaceResponse r = surface_response(mesh, tangent);
  EXPECT_NEAR(r.rms[0], 3 / std::sqrt(2), 1e-12);
  EXPECT_NEAR(r.rms_of_frame(0, 0), 3, 1e-12);
  EXPECT_EQ(r.rms_of_frame(1, 0), 0);
  EXPECT_NEAR(r.largest[1], 5, 1e-12);
  EXPECT_NEAR(r.last(2, 1), 5, 1e-12);
  EXPECT_NEAR(r.last(0, 1), 4, 1e-12);
  const MatrixXd square = r.root.transpose() * r.root;
  const double share = column_areas(mesh, true)[2] / (16 * 12);
  EXPECT_NEAR(square(0, 0), 9, 1e-12);
  EXPECT_NEAR(square(0, 1), 0, 1e-12);
  EXPECT_NEAR(square(1, 1), 16 + 9 * share, 1e-12);
  // Seen along z, the second parameter moves that node alone; how far it moves is as before.
  for (const double length : {2.0, 1e-200, 1e200}) {
    const SurfaceResponse seen = surface_response(mesh, tangent, Vec3(0, 0, -length));
    const MatrixXd seen_square = seen.root.transpose() * seen.root;
    EXPECT_NEAR(seen_square(0, 0), 9, 1e-12);
    EXPECT_NEAR(seen_square(1, 1), 9 * share, 1e-12) << length;
    EXPECT_EQ(seen.rms, r.rms);
    EXPECT_EQ(seen.largest, r.largest);
    EXPECT_EQ(seen.rms_of_frame, r.rms_of_frame);
    EXPECT_EQ(seen.last, r.last);
  }
}

TEST(SurfaceResponse, OfARunCannotTellAllStiffnessesTogether) {
  const SceneModel built = flat_patch(2);
  RunOptions options = built.run_options();
  options.minimiser = certificate_minimiser(options.minimiser);
  const Trajectory run = simulate(built.model(), built.native(), options);
  ASSERT_TRUE(run.complete) << run.failure;
  std::vector<std::string> addresses;
  for (const ParameterSpec& spec : all_parameters(built.scene())) addresses.push_back(spec.address);
  const ParameterSpace space(built, addresses);
  const SurfaceResponse r = surface_response(
      built.model().mesh, tangent_sweep(built.model(), built.native(), run,
                                        OuterDisplacements(built.model().mesh), space.jacobian()));
  const auto gauge = gauge_coordinates(built.model(), space.jacobian());
  ASSERT_TRUE(gauge);
  for (int k = 0; k < space.size(); ++k) {
    const std::string& address = addresses[k];
    const bool is_stiffness = address.ends_with("youngs_modulus") || address.ends_with("/stiffness");
    EXPECT_NEAR((*gauge)[k], is_stiffness ? 1 : 0, 1e-9) << address;
  }
  EXPECT_LT((r.root * *gauge).norm(), 1e-9 * r.root.norm());
  EXPECT_GT(r.root.norm(), 0.01);
  // Without the bone's stiffness the others do not span it.
  const ParameterSpace some(built, {"/ligaments/stiffness", "/skin/layers/film/youngs_modulus"});
  EXPECT_FALSE(gauge_coordinates(built.model(), some.jacobian()));
}

}  // namespace
}  // namespace rhytid::adjoint
