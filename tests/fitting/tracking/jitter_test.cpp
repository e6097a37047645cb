// What tracks jump beside their neighbours.
#include "fitting/tracking/jitter.h"

#include <gtest/gtest.h>

#include <cmath>
#include <random>

namespace rhytid::fitting {
namespace {

constexpr int kFrames = 8;
constexpr double kStated = 0.02;

/// A grid of points whose velocity changes in every frame, affinely over the picture; white errors of `own` px, of which
/// kStated are stated, and of `jumps` px more; every `wild`-th track is off by 0.5 px.
TrackSet grid(double own, double jumps, int wild = 0) {
  std::mt19937 random(5);
  std::normal_distribution<double> normal;
  TrackSet set;
  const double speeds[kFrames] = {0, 3, -2, 5, 5, -4, 0, 2};
  for (int y = 0; y < 7; ++y)
    for (int x = 0; x < 8; ++x) {
      Track t;
      t.id = static_cast<int>(set.tracks.size());
      const Vec2 X(20.0 * x, 18.0 * y);
      Vec2 at = X;
      for (int f = 0; f < kFrames; ++f) {
        at += speeds[f] * Vec2(1 + 0.004 * X.x() - 0.002 * X.y(), 0.3 + 0.003 * X.y());
        const bool is_wild = wild > 0 && t.id % wild == 0;
        const Vec2 white(normal(random), normal(random)), more(normal(random), normal(random));
        Observation o;
        o.frame = f;
        o.status = TrackStatus::ok;
        o.pixel = f == 0 ? X : Vec2(at + own * white + (is_wild ? 0.5 : jumps) * more);
        o.covariance = kStated * kStated * Eigen::Matrix2d::Identity();
        t.observations.push_back(o);
      }
      set.tracks.push_back(t);
    }
  return set;
}

TEST(Jitter, IsWhatTheCovariancesLackAndNotTheMotion) {
  EXPECT_LT(measure_jitter(grid(kStated, 0)), 0.2 * kStated);
  EXPECT_EQ(measure_jitter(grid(0.5 * kStated, 0)), 0);
  EXPECT_NEAR(measure_jitter(grid(kStated, 0.07)), 0.07, 0.007);
}

TEST(Jitter, AFewTracksMayBeWrong) {
  EXPECT_NEAR(measure_jitter(grid(kStated, 0.07, 25)), 0.07, 0.02);
}

TEST(Jitter, IsAddedToAllButTheFirst) {
  TrackSet set = grid(kStated, 0);
  set.tracks[3].observations[0].status = TrackStatus::lost;
  add_jitter(0.03, &set);
  const double own = kStated * kStated;
  EXPECT_EQ(set.tracks[0].observations[0].covariance(0, 0), own);
  EXPECT_DOUBLE_EQ(set.tracks[0].observations[1].covariance(0, 0), own + 9e-4);
  EXPECT_EQ(set.tracks[0].observations[1].covariance(0, 1), 0);
  EXPECT_EQ(set.tracks[3].observations[1].covariance(0, 0), own);
  EXPECT_DOUBLE_EQ(set.tracks[3].observations[2].covariance(1, 1), own + 9e-4);
}

TEST(Jitter, TooLittleToCompareIsNone) {
  TrackSet set = grid(kStated, 0.5);
  for (Track& t : set.tracks) t.observations.resize(3);
  EXPECT_EQ(measure_jitter(set), 0);  // one would need the first
  set = grid(kStated, 0.5);
  set.tracks.resize(8);
  EXPECT_EQ(measure_jitter(set), 0);  // no eight neighbours
}

}  // namespace
}  // namespace rhytid::fitting
