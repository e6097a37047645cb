// A path whose file states how well it is known: what is read, and fits to a finger that was elsewhere by as much.
#include "fitting/path_deviations.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <Eigen/Eigenvalues>
#include <cmath>
#include <cstdio>
#include <fstream>
#include <random>

#include "fitting/consider.h"
#include "sim/output/text.h"
#include "sim/scene/collider_motion.h"
#include "sim/scene/read_path.h"
#include "tests/fitting/small_drag.h"
#include "tests/support/temporary_folder.h"

namespace rhytid::fitting {
namespace {

using testing::Contains;
using testing::HasSubstr;
using testing::ThrowsMessage;

constexpr int kFrames = test::kDragFrames;
// Of all knots alike, best known across the line of sight of make_camera, and of each by itself.
const Vec3 kSight = Vec3(5, -20, 55).normalized();
const Mat3 kShared =
    0.005 * 0.005 * Mat3::Identity() + (0.015 * 0.015 - 0.005 * 0.005) * kSight * kSight.transpose();
constexpr double kOwnSigma = 0.002;

class PathDeviationsTest : public testing::Test {
 protected:
  std::string written(const std::string& text) const {
    std::ofstream(file_) << text;
    return file_;
  }

  /// The truth's path, seen at the frames with errors of `seed`; 0: without. Its columns say how large they are.
  std::string measured_path(unsigned seed) const {
    const Scene truth = test::drag_scene(kFrames);
    const ColliderMotion motion(truth.colliders[0], 0);
    std::mt19937 rng(seed);
    std::normal_distribution<double> normal;
    const auto draw = [&] { return seed == 0 ? Vec3(0, 0, 0) : Vec3(normal(rng), normal(rng), normal(rng)); };
    const Vec3 offset = kShared.llt().matrixL() * draw();
    std::string text = "time,x,y,z";
    for (const char* what : {"own", "shared"})
      for (const char* pair : {"xx", "xy", "xz", "yy", "yz", "zz"})
        text += std::string(",") + what + "_" + pair;
    for (int f = 0; f <= kFrames; ++f) {
      const double time = f / 24.;
      const Vec3 place = motion.at(time).centre + offset + kOwnSigma * draw();
      text += "\n" + exact_text(time);
      for (const double x : place) text += "," + exact_text(x);
      const Mat3 own = kOwnSigma * kOwnSigma * Mat3::Identity();
      for (const Mat3* c : {&own, &kShared})
        for (int a = 0; a < 3; ++a)
          for (int b = a; b < 3; ++b) text += "," + exact_text((*c)(a, b));
    }
    return written(text + "\n");
  }

  /// Film and a source's strength from tracks of the truth, the finger on a path that was measured.
  FitInput make_input(unsigned seed, const std::string& use) const {
    FitInput input = test::small_drag(
        {"/colliders/finger/path=null", "/colliders/finger/path_file=" + measured_path(seed)});
    input.options.path_deviations = use;
    return input;
  }

  rhytid::test::TemporaryFolder folder_;
  std::string file_ = folder_ / "path.csv";
};

TEST_F(PathDeviationsTest, AreReadBehindTheKnots) {
  EXPECT_FALSE(read_path_deviations(written("time,x,y,z\n0,1,2,3\n")));
  auto known = read_path_deviations(
      written("time,x,y,z,sigma_x,sigma_y,sigma_z\n0,1,2,3,0.1,0.2,0.3\n1,1,2,3,0,0,1\n"));
  ASSERT_TRUE(known);
  ASSERT_EQ(known->own.size(), 2u);
  EXPECT_TRUE(known->own[0].isApprox(Vec3(0.01, 0.04, 0.09).asDiagonal().toDenseMatrix()));
  EXPECT_EQ(known->shared, Mat3::Zero());
  EXPECT_EQ(read_path(file_)[0].position, Vec3(1, 2, 3)) << "a simulation passes them over";
  measured_path(1);
  known = read_path_deviations(file_);
  ASSERT_TRUE(known);
  EXPECT_TRUE(known->shared.isApprox(kShared, 1e-12));
  EXPECT_EQ(known->own.size(), 5u);

  const auto refusal = [&](const std::string& text) {
    return [this, text] { read_path_deviations(written(text)); };
  };
  EXPECT_THAT(refusal("time,x,y,z,sigma_x\n0,1,2,3,1\n"),
              ThrowsMessage<InputError>(HasSubstr("only some of the columns")));
  EXPECT_THAT(refusal("time,x,y,z,sigma_x,sigma_y,sigma_z\n0,1,2,3,1,-1,1\n"),
              ThrowsMessage<InputError>(HasSubstr(":2")));
  EXPECT_THAT(refusal("time,x,y,z,own_xx,own_xy,own_xz,own_yy,own_yz,own_zz\n0,1,2,3,1,2,0,1,0,1\n"),
              ThrowsMessage<InputError>(HasSubstr("no covariance")));
}

TEST_F(PathDeviationsTest, AreOfKnotsThatTheFitSees) {
  FitInput given = make_input(1, "consider");
  JointFitInput input{.clips = {{"", "", given.scene, {}, {}, {}}}, .options = given.options};
  EXPECT_EQ(with_path_errors(input).path_errors.size(), 3u + 3u * 5u);
  input.options.last_frame = 2;
  EXPECT_EQ(with_path_errors(input).path_errors.size(), 3u + 3u * 3u);
  EXPECT_THAT(with_path_errors(input).path_notes,
              Contains(HasSubstr("is known to 0.015 mm for all knots alike and to 0.002 mm")));
  input.options.path_deviations = "fit";
  const JointFitInput fitted = with_path_errors(input);
  EXPECT_EQ(fitted.path_errors.size(), 9u);
  EXPECT_EQ(fitted.options.parameters.size(), 5u);
  EXPECT_EQ(fitted.clips[0].scene.colliders[0].path_file, "");
  input.options.path_deviations = "ignore";
  EXPECT_TRUE(with_path_errors(input).path_errors.empty());
}

// A path in the scene, or in a file that states nothing.
TEST_F(PathDeviationsTest, ThatNothingStatesAreThoseOfTheCaseOrTheDefault) {
  JointFitInput input{.clips = {{"", "", test::drag_scene(kFrames), {}, {}, {}}}, .options = {}};
  const auto offsets = [&input] { return with_path_errors(input).path_errors; };
  ASSERT_EQ(offsets().size(), 3u);
  const FitParameter z = offsets()[0];
  EXPECT_EQ(z.name, "finger path offset 1 (0.25 mm, z)");
  EXPECT_EQ(z.group, "finger path offset");
  ASSERT_EQ(z.moves.size(), 3u) << "all knots alike";
  EXPECT_EQ(z.moves[2].first, "/colliders/finger/path/2/position/2");
  EXPECT_EQ(z.moves[2].second, kPathSigma);
  EXPECT_THAT(with_path_errors(input).path_notes,
              Contains(HasSubstr("is known to 0.25 mm for all knots alike in each direction, by default")));
  input.options.parameters = {test::fitted("/colliders/finger/path/1/position/2")};
  EXPECT_EQ(offsets().size(), 2u) << "z is fitted";
  input.options.parameters.clear();
  input.options.path_deviations = "ignore";
  EXPECT_TRUE(offsets().empty());
  input.options.path_deviations = "fit";
  EXPECT_EQ(with_path_errors(input).options.parameters.size(), 3u);
  input.options.path_deviations = "consider";
  input.options.consider.emplace();
  EXPECT_TRUE(offsets().empty()) << "the case says that all is exact";
  input.options.consider_paths = {{.address = "/colliders/finger/path", .sigma = 0.1}};
  ASSERT_EQ(offsets().size(), 3u);
  EXPECT_EQ(offsets()[0].moves[0].second, 0.1);
  input.clips[0].name = "a";
  input.options.consider_paths.insert(input.options.consider_paths.begin(),
                                      {.address = "/colliders/finger/path", .clip = "a", .sigma = 0});
  EXPECT_TRUE(offsets().empty()) << "of its clip";
  input.clips[0].name = "b";
  EXPECT_EQ(offsets().size(), 3u) << "of another clip";
  input.options.consider_paths = {{.address = "/colliders/finger/path", .sigma = 0}};
  EXPECT_TRUE(offsets().empty());

  const Scene of_file =
      test::drag_scene(kFrames, {"/colliders/finger/path=null",
                                 "/colliders/finger/path_file=" + written("time,x,y,z\n0,1,2,9\n1,1,2,9\n")});
  input = {.clips = {{"", "", of_file, {}, {}, {}}}, .options = {}};
  EXPECT_EQ(offsets().size(), 3u);
  input.options.consider.emplace();
  EXPECT_TRUE(offsets().empty());
  EXPECT_THAT(with_path_errors(input).path_notes, Contains(HasSubstr("taken for exact")));
}

TEST_F(PathDeviationsTest, MakeIntervalsHoldTheTruthThatTheyMissedBefore) {
  int with = 0, without = 0, all = 0;
  for (unsigned seed = 1; seed <= 4; ++seed) {
    FitInput input = make_input(seed, "consider");
    input.evaluations = folder_ / ("log" + std::to_string(seed));
    const FitResult known = run_fit(input);
    input.options.path_deviations = "ignore";
    const FitResult exact = run_fit(input);
    if (seed == 1) std::printf("%s", answer_text(known).c_str());
    ASSERT_TRUE(known.converged && exact.converged);
    EXPECT_THAT(known.notes,
                Contains(HasSubstr("is in the intervals: finger path offset, finger path by knot")));
    with += test::intervals_that_hold(known), without += test::intervals_that_hold(exact), all += 2;
    for (const SystematicShift& shift : known.systematic) EXPECT_EQ(shift.failure, "");
    for (std::size_t k = 0; k < 2; ++k) {
      EXPECT_EQ(known.parameters[k].value, exact.parameters[k].value);
      EXPECT_GT(known.parameters[k].sigma, exact.parameters[k].sigma);
    }
  }
  std::printf("intervals that hold the truth: %d of %d, with the path taken for exact %d\n", with, all,
              without);
  EXPECT_GE(with, all - 1);
  EXPECT_LE(without, all / 2);
}

// As many observations as it takes to fit are enough to consider any number of knots; what fails takes nothing else along.
TEST_F(PathDeviationsTest, AreConsideredWhereObservationsAreFewerThanKnots) {
  FitInput input = make_input(1, "consider");
  input.options.consider.reset();
  input.tracks.tracks.resize(2);  // 16 numbers in 4 frames for 2 parameters, and 18 + 1 that are held
  const FitResult found = run_fit(input);
  ASSERT_EQ(found.systematic.size(), 6u);  // and the layers' thicknesses, all together
  for (const SystematicShift& shift : found.systematic) EXPECT_EQ(shift.failure, "") << shift.name;
}

TEST_F(PathDeviationsTest, ThatCannotBeConsideredLeaveFrictionAlone) {
  FitInput input = make_input(1, "consider");
  const JointFitInput given{.clips = {{"", "", input.scene, {input.camera}, input.tracks}},
                            .options = input.options};
  JointFitInput known = with_path_errors(given);
  known.options.consider.reset();
  known.path_errors[0].moves.front().first = "/colliders/finger/path/99/position/0";
  JointProblem problem(known.clips, known.options);
  const VectorXd t = problem.initial();
  const auto at = problem.linearised(t);
  ASSERT_TRUE(at);
  FitResult result;
  result.systematic = considered_shifts(known, problem, t, *at, MatrixXd::Identity(2, 2), {});
  ASSERT_EQ(result.systematic.size(), 3u);
  EXPECT_NE(result.systematic[0].failure, "");
  EXPECT_THAT(result.systematic[2].name, HasSubstr("friction"));
  EXPECT_EQ(result.systematic[2].failure, "");
  add_path_notes(known, result);
  EXPECT_THAT(result.notes, Contains(HasSubstr("is not in the intervals: finger path offset (")));
}

TEST_F(PathDeviationsTest, FittedOffsetIsKnownBetterThanItsFileSays) {
  const FitResult fitted = run_fit(make_input(2, "fit"));
  std::printf("%s", answer_text(fitted).c_str());
  ASSERT_TRUE(fitted.converged);
  ASSERT_EQ(fitted.parameters.size(), 5u);
  EXPECT_EQ(test::intervals_that_hold(fitted), 2);
  EXPECT_THAT(fitted.parameters[2].name, HasSubstr("finger path offset 1"));
  EXPECT_LT(fitted.parameters[2].sigma, 0.9) << "the tracks know more of it than the file";
  EXPECT_EQ(fitted.address_in_clip(fitted.parameters[2], 0), "");
  ASSERT_TRUE(fitted.fitted_scene);
  const Scene measured =
      test::drag_scene(kFrames, {"/colliders/finger/path=null", "/colliders/finger/path_file=" + file_});
  const Vec3 moved =
      fitted.fitted_scene->colliders[0].path[2].position - measured.colliders[0].path[2].position;
  Vec3 expected = Vec3::Zero();
  const Eigen::SelfAdjointEigenSolver<Mat3> eigen(kShared);
  EXPECT_GT(moved.norm(), 1e-3);
  expected = fitted.parameters[2].value * std::sqrt(eigen.eigenvalues()[2]) * eigen.eigenvectors().col(2);
  EXPECT_NEAR(std::fabs(moved.dot(eigen.eigenvectors().col(2))), expected.norm(), 1e-9);
}

}  // namespace
}  // namespace rhytid::fitting
