// What neighbours tell of a point.
#include "fitting/tracking/follower.h"

#include <gtest/gtest.h>

namespace rhytid::fitting {
namespace {

/// Nine points 20 px apart that moved by x = F X; the fifth, in the middle, is off by `error`.
std::vector<Follower> followers(const Eigen::Matrix2d& deformation, const Vec2& error) {
  std::vector<Follower> all(9);
  for (int i = 0; i < 9; ++i) {
    Follower& f = all[static_cast<std::size_t>(i)];
    f.track.id = i;
    f.seed = Vec2(20 * (i % 3), 20 * (i / 3));
    f.warp.centre = deformation * f.seed;
  }
  all[4].warp.centre += error;
  return all;
}

TEST(Follower, DeformationIsToldByNeighbours) {
  Eigen::Matrix2d deformation;
  deformation << 1.05, 0.02, 0, 0.96;
  const std::vector<Follower> right = followers(deformation, Vec2::Zero()),
                              wrong = followers(deformation, Vec2(3, -2));
  const Eigen::Matrix2d held = held_gradient(right, right[4]);
  EXPECT_LT((held - deformation).norm(), 0.002);  // the ridge
  // Its own error, 3.6 px in 20, counts less than a tenth.
  EXPECT_LT((held_gradient(wrong, wrong[4]) - deformation).norm(), 0.1 * 3.6 / 20);
}

TEST(Follower, FewOrContradictingNeighboursTellNothing) {
  std::vector<Follower> all = followers(Eigen::Matrix2d::Identity(), Vec2::Zero());
  Eigen::Matrix2d own;
  own << 1.02, 0.01, -0.01, 0.99;
  all[4].warp.gradient = own;
  // Itself and two others: a fit without a check.
  for (std::size_t i = 0; i < 9; ++i) all[i].active = i == 0 || i == 4 || i == 7;
  EXPECT_EQ(held_gradient(all, all[4]), own);
  all = followers(1.5 * Eigen::Matrix2d::Identity(), Vec2::Zero());
  all[4].warp.gradient = own;
  EXPECT_EQ(held_gradient(all, all[4]), own);
}

}  // namespace
}  // namespace rhytid::fitting
