// The noise model of a track against its dense joint covariance, and its robust form against differences.
#include "fitting/track_noise.h"

#include <gtest/gtest.h>

#include <Eigen/Cholesky>
#include <Eigen/LU>
#include <random>

#include "sim/core/error.h"

namespace rhytid::fitting {
namespace {

struct NoisyTrack {
  Eigen::Matrix2d first;
  std::vector<Eigen::Matrix2d> later;
  std::vector<TrackNoise::Renewal> renewals = {};
  VectorXd r;
  MatrixXd dr;
};

NoisyTrack make(int n) {
  std::mt19937 rng(11);
  std::normal_distribution<double> normal;
  const auto covariance = [&] {
    Eigen::Matrix2d a;
    for (double& x : a.reshaped()) x = normal(rng);
    return Eigen::Matrix2d(0.02 * (a * a.transpose() + 0.3 * Eigen::Matrix2d::Identity()));
  };
  NoisyTrack s;
  s.first = covariance();
  for (int f = 0; f < n; ++f) s.later.push_back(covariance());
  s.r.resize(2 * n);
  s.dr.resize(2 * n, 3);
  for (double& x : s.r) x = 0.2 * normal(rng);
  for (double& x : s.dr.reshaped()) x = normal(rng);
  return s;
}

MatrixXd joint_covariance(const NoisyTrack& s) {
  const int n = static_cast<int>(s.later.size());
  MatrixXd sum(2 * n, 2 * n);
  for (int a = 0; a < n; ++a)
    for (int b = 0; b < n; ++b)
      sum.block<2, 2>(2 * a, 2 * b) = s.first + (a == b ? s.later[a] : Eigen::Matrix2d::Zero().eval());
  for (const TrackNoise::Renewal& renewal : s.renewals)
    for (int a = renewal.from; a < n; ++a)
      for (int b = renewal.from; b < n; ++b) sum.block<2, 2>(2 * a, 2 * b) += renewal.covariance;
  return sum;
}

class PlainTrackNoise : public testing::TestWithParam<int> {};

// Without renewals and with two of them, the second at once from two templates.
TEST_P(PlainTrackNoise, CostIsTheJointGaussian) {
  NoisyTrack s = make(6);
  if (GetParam() > 0) s.renewals = {{2, s.later[0]}, {5, s.later[1]}, {5, s.later[4]}};
  const MatrixXd precision = joint_covariance(s).inverse();
  const TrackNoise noise(s.first, s.later, 0, s.renewals);
  EXPECT_EQ(noise.num_shifts(), 1 + static_cast<int>(s.renewals.size()));
  const auto at = noise.evaluate(s.r);
  EXPECT_NEAR(at.cost, 0.5 * s.r.dot(precision * s.r), 1e-12 * at.cost);
  EXPECT_LT((at.gradient - precision * s.r).norm(), 1e-11 * at.gradient.norm());
  const MatrixXd j = noise.whitened_jacobian(s.r, at, s.dr);
  EXPECT_LT((j.transpose() * j - s.dr.transpose() * precision * s.dr).norm(), 1e-10 * j.squaredNorm());
  EXPECT_LT((j.transpose() * at.whitened - s.dr.transpose() * precision * s.r).norm(),
            1e-10 * (j.transpose() * at.whitened).norm());
  // Innovations are a whitening of the same Gaussian.
  EXPECT_NEAR(noise.innovations(s.r, at).squaredNorm(), 2 * at.cost, 1e-10 * at.cost);
  EXPECT_LT((noise.weighted_jacobian(at, s.dr) - j).norm(), 1e-12 * j.norm());
}

INSTANTIATE_TEST_SUITE_P(WithAndWithoutRenewals, PlainTrackNoise, testing::Values(0, 1));

// A track file's renewals become shifts of the frames that are used, whether the frames between are used or
// not.
TEST(TrackNoise, ReadsRenewalsFromATrack) {
  const NoisyTrack s = make(6);
  Track track;
  for (int f = 0; f <= 6; ++f)
    track.observations.push_back(
        {f, f / 25., TrackStatus::ok, Vec2(f, f), f == 0 ? s.first : s.later[f - 1], 1, f == 3});
  track.observations.insert(track.observations.begin() + 3, Observation{2, 0.1, TrackStatus::lost});
  track.observations.erase(track.observations.begin() +
                           2);  // frame 2 is lost: the template was cut in frame 1
  std::vector<const Observation*> used;
  for (const int i : {3, 5, 6}) used.push_back(&track.observations[i]);
  const TrackNoise noise(track, used, 1e-9, 0);
  NoisyTrack seen{
      s.first, {s.later[2], s.later[4], s.later[5]}, {{0, s.later[0]}}, s.r.head(6), s.dr.topRows(6)};
  ASSERT_EQ(noise.num_shifts(), 2);
  EXPECT_EQ(noise.shift_of(0), 1);
  EXPECT_NEAR(noise.evaluate(seen.r).cost, 0.5 * seen.r.dot(joint_covariance(seen).inverse() * seen.r),
              1e-10);
  const auto shared = track.shared_covariances();
  EXPECT_EQ(shared[1], s.first);
  EXPECT_EQ(shared[6], s.first + s.later[0]);
  // Behind the last frame used a renewal shifts nothing.
  track.observations[6].renewed = true;
  EXPECT_EQ(TrackNoise(track, {&track.observations[3], &track.observations[5]}, 1e-9, 0).num_shifts(), 2);
}

TEST(TrackNoise, RobustCostHasTheStatedDerivatives) {
  NoisyTrack s = make(6);
  s.r.segment<2>(4) += Vec2(5, -3);  // far outside
  s.r.segment<2>(8) += Vec2(0.5, 0.4);
  s.renewals = {{3, s.later[2]}};
  const TrackNoise noise(s.first, s.later, 2.0, s.renewals);
  const auto at = noise.evaluate(s.r);
  EXPECT_LT(at.weights[2], 0.2);
  EXPECT_LT(at.cost, TrackNoise(s.first, s.later, 0, s.renewals).evaluate(s.r).cost);
  const MatrixXd j = noise.whitened_jacobian(s.r, at, s.dr);
  const VectorXd by_rows = j.transpose() * at.whitened, by_r = s.dr.transpose() * at.gradient;
  EXPECT_LT((by_rows - by_r).norm(), 1e-9 * by_r.norm());
  for (int k = 0; k < 3; ++k) {
    const double h = 1e-5;
    const VectorXd dz =
        (noise.evaluate(s.r + h * s.dr.col(k)).whitened - noise.evaluate(s.r - h * s.dr.col(k)).whitened) /
        (2 * h);
    EXPECT_LT((dz - j.col(k)).norm(), 1e-6 * j.col(k).norm());
    const double difference =
        (noise.evaluate(s.r + h * s.dr.col(k)).cost - noise.evaluate(s.r - h * s.dr.col(k)).cost) / (2 * h);
    EXPECT_NEAR(difference, by_r[k], 1e-6 * by_r.norm());
  }
}

TEST(TrackNoise, OneWildFrameDoesNotMoveTheShift) {
  NoisyTrack s = make(8);
  s.r.setZero();
  s.r.segment<2>(6) = Vec2(40, 40);
  const TrackNoise robust(s.first, s.later, 2.0), plain(s.first, s.later, 0);
  EXPECT_LT(robust.evaluate(s.r).shift.norm(), 0.05 * plain.evaluate(s.r).shift.norm());
}

TEST(TrackNoise, RefusesWhatIsNotACovariance) {
  const Eigen::Matrix2d one = Eigen::Matrix2d::Identity();
  EXPECT_THROW(TrackNoise(one, {Eigen::Matrix2d::Zero()}, 0), ContractError);
  EXPECT_THROW(TrackNoise(-one, {one}, 0), ContractError);
  const Eigen::Matrix2d raised = with_floor(Eigen::Vector2d(1e-6, 4).asDiagonal(), 0.1);
  EXPECT_NEAR(raised(0, 0), 0.01, 1e-15);
  EXPECT_NEAR(raised(1, 1), 4, 1e-14);
}

}  // namespace
}  // namespace rhytid::fitting
