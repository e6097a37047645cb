// Counts and descriptors of wrinkles on waves whose length, height, direction and extent are known.
#include "sim/output/wrinkles.h"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <numbers>

#include "sim/core/error.h"

namespace rhytid {
namespace {

constexpr double kPi = std::numbers::pi;

/// A sin(2π s/λ) between two ends, faded over one wavelength; 0.1 mm apart, 80 mm long.
VectorXd train(double amplitude, double wavelength, double begin, double end) {
  VectorXd h(801);
  for (int i = 0; i < h.size(); ++i) {
    const double s = 0.1 * i;
    const double fade =
        0.25 * (1 + std::tanh(4 * (s - begin) / wavelength)) * (1 + std::tanh(4 * (end - s) / wavelength));
    h[i] = amplitude * fade * std::sin(2 * kPi * s / wavelength);
  }
  return h;
}

TEST(Wrinkles, ATrainOfWavesHasItsLengthHeightAndExtent) {
  for (const double wavelength : {2., 3.8, 5.5}) {
    const VectorXd h = train(0.07, wavelength, 20, 60);
    const WrinkleDescriptors d = describe(wrinkle_sums(h, 0.1));
    EXPECT_NEAR(d.wavelength, wavelength, 0.01 * wavelength);
    EXPECT_NEAR(d.amplitude, 0.07, 0.02 * 0.07);
    EXPECT_NEAR(d.extent, 40, 0.06 * 40);
    const WrinkleCount count = count_wrinkles(h, 0.1);
    EXPECT_NEAR(count.crests, 40 / wavelength, 1.5);
    EXPECT_NEAR(count.sign_changes, 2 * 40 / wavelength, 2.5);
    EXPECT_NEAR(count.crest_spacing, wavelength, 0.02 * wavelength);
    EXPECT_NEAR(count.largest, 0.07, 1e-3);
  }
}

TEST(Wrinkles, CountsAreExactOnAWholeSine) {
  VectorXd h(1901);
  for (int i = 0; i < h.size(); ++i) h[i] = std::sin(2 * kPi * 19 * i / 1900.);
  const WrinkleCount count = count_wrinkles(h, 0.2);
  EXPECT_EQ(count.crests, 19);
  EXPECT_EQ(count.sign_changes, 37);
  EXPECT_NEAR(count.crest_spacing, 20, 0.3);
}

TEST(Wrinkles, SmallBumpsAreNoCrests) {
  VectorXd h(1001);
  for (int i = 0; i < h.size(); ++i)
    h[i] = std::sin(2 * kPi * 5 * i / 1000.) + 0.03 * std::sin(2 * kPi * 61 * i / 1000.);
  EXPECT_EQ(count_wrinkles(h, 0.1).crests, 5);
  // Bumps are maxima of their own where they are steeper than the wave: |5 cos| < 0.03 · 61, of the 61
  // some 14.5.
  EXPECT_NEAR(count_wrinkles(h, 0.1, 1e-4).crests, 14.5, 2.5);
}

// A point beside the surface (NaN) would spread over the line and read as no wrinkles.
TEST(Wrinkles, ALineHasNoGaps) {
  VectorXd h = train(0.07, 3.8, 20, 60);
  h[400] = std::numeric_limits<double>::quiet_NaN();
  EXPECT_THROW((void)band_pass(h, 0.1, WrinkleBand{0.5, 8}), ContractError);
  EXPECT_THROW((void)wrinkle_sums(h, 0.1), ContractError);
  EXPECT_THROW((void)count_wrinkles(h, 0.1), ContractError);
}

TEST(Wrinkles, NoWrinklesNoNumbers) {
  const WrinkleDescriptors d = describe(wrinkle_sums(VectorXd(VectorXd::Zero(50)), 0.1));
  EXPECT_EQ(d.amplitude, 0);
  EXPECT_EQ(d.wavelength, 0);
  EXPECT_EQ(count_wrinkles(VectorXd::Zero(50), 0.1).crests, 0);
}

TEST(Wrinkles, RoundingOfAFlatSurfaceIsNone) {
  // What a flat skin under a pre-stretch shows, and the same waves where they are real.
  for (const double height : {5e-17, 1e-14, 1e-7, 1e-5, 1e-2}) {
    const bool is_real = height > 1e-6;
    const VectorXd h = train(height, 3.8, 20, 60);
    const WrinkleCount count = count_wrinkles(h, 0.1);
    EXPECT_EQ(count.crests > 0, is_real) << height;
    EXPECT_EQ(count.sign_changes > 0, is_real) << height;
    EXPECT_NEAR(count.crest_spacing, is_real ? 3.8 : 0, 0.08) << height;
    EXPECT_NEAR(count.largest, height, 0.02 * height);
    const WrinkleDescriptors d = describe(wrinkle_sums(h, 0.1));
    EXPECT_NEAR(d.amplitude, is_real ? height : 0, 0.02 * height);
    EXPECT_NEAR(d.wavelength, is_real ? 3.8 : 0, 0.04) << height;
    EXPECT_EQ(d.extent > 0, is_real) << height;
  }
}

TEST(Wrinkles, LiftingAFlatSurfaceMakesNone) {
  for (const double height : {5e-17, 1e-14, 1e-5}) {
    const VectorXd h = train(height, 3.8, 20, 60).array() + 0.7;
    const bool is_real = height > 1e-6;
    EXPECT_EQ(count_wrinkles(h, 0.1).crests > 0, is_real) << height;
    const WrinkleDescriptors d = describe(wrinkle_sums(h, 0.1));
    EXPECT_EQ(d.amplitude > 0, is_real) << height;
    EXPECT_EQ(d.wavelength > 0, is_real) << height;
    MatrixXd grid(60, 40);
    for (Eigen::Index i = 0; i < grid.rows(); ++i) grid.row(i).setConstant(h[300 + i]);
    EXPECT_EQ(describe(wrinkle_sums(grid, 0.1)).coherence > 0, is_real) << height;
  }
}

TEST(BandPass, HalvesWavesOfItsLimits) {
  // Far from the ends a sine only changes its height.
  for (const double wavelength : {1., 10.}) {
    VectorXd h(2001);
    for (int i = 0; i < h.size(); ++i) h[i] = std::sin(2 * kPi * 0.02 * (i - 1000) / wavelength);
    WrinkleBand band;
    (wavelength < 5 ? band.shortest : band.longest) = wavelength;
    const VectorXd b = band_pass(h, 0.02, band);
    for (int i = 900; i <= 1100; i += 20)
      EXPECT_NEAR(b[i], 0.5 * h[i], 1e-3) << wavelength << " mm, point " << i;
  }
}

TEST(BandPass, KeepsWrinklesAndRemovesTheDentUnderThem) {
  const VectorXd wrinkles = train(0.05, 3, 25, 60);
  VectorXd h = wrinkles;
  for (int i = 0; i < h.size(); ++i) h[i] -= 1.5 * std::exp(-std::pow((0.1 * i - 40) / 20, 2)) + 0.02 * i;
  const VectorXd b = band_pass(h, 0.1, {0.5, 8});
  const WrinkleDescriptors d = describe(wrinkle_sums(b, 0.1)), wanted = describe(wrinkle_sums(wrinkles, 0.1));
  EXPECT_NEAR(d.wavelength, wanted.wavelength, 0.05 * wanted.wavelength);
  EXPECT_NEAR(d.amplitude, wanted.amplitude, 0.1 * wanted.amplitude);
  EXPECT_GT(describe(wrinkle_sums(h, 0.1)).wavelength, 10);
}

TEST(BandPass, IsLinearAndBlindToPlanes) {
  MatrixXd plane(40, 30), wave(40, 30);
  for (int j = 0; j < 30; ++j)
    for (int i = 0; i < 40; ++i) {
      plane(i, j) = 3 + 0.2 * i - 0.4 * j;
      wave(i, j) = std::sin(0.9 * i + 0.3 * j);
    }
  plane(5, 7) = wave(5, 7) = std::nan("");
  const WrinkleBand band{1, 6};
  const MatrixXd of_plane = band_pass(plane, 0.5, band), of_wave = band_pass(wave, 0.5, band);
  const MatrixXd of_both = band_pass(MatrixXd(plane + 2 * wave), 0.5, band);
  for (int j = 0; j < 30; ++j)
    for (int i = 0; i < 40; ++i) {
      if (i == 5 && j == 7) {
        EXPECT_TRUE(std::isnan(of_both(i, j)));
        continue;
      }
      EXPECT_NEAR(of_plane(i, j), 0, 1e-11);
      EXPECT_NEAR(of_both(i, j), 2 * of_wave(i, j), 1e-11);
    }
}

TEST(Field, APacketOfPlaneWavesHasTheDescriptorsOfItsIntegrals) {
  // A exp(−r²/2σ²) sin k·x, many waves wide: ∫b² = π σ² A²/2, ∫b⁴ = 3/8 · π σ²/2 · A⁴, ∫|∇b|² = (k² + 1/σ²)
  // ∫b².
  const double amplitude = 0.1, sigma = 7, k = 2 * kPi / 4;
  for (const double degrees : {0., 30., 75., 90., -40.}) {
    const double angle = degrees * kPi / 180;
    MatrixXd h(241, 221);
    for (int j = 0; j < h.cols(); ++j)
      for (int i = 0; i < h.rows(); ++i) {
        const double x = 0.25 * (i - 120), y = 0.25 * (j - 110);
        h(i, j) = amplitude * std::exp(-0.5 * (x * x + y * y) / (sigma * sigma)) *
                  std::sin(k * (x * std::cos(angle) + y * std::sin(angle)));
      }
    const WrinkleDescriptors d = describe(wrinkle_sums(h, 0.25));
    // An axis, not a vector: ±90 degrees are one direction.
    EXPECT_NEAR(std::cos(2 * (d.direction - angle)), 1, 1e-6) << degrees;
    const double wavelength = 2 * kPi / std::sqrt(k * k + 1 / (sigma * sigma));
    EXPECT_NEAR(d.wavelength, wavelength, 2e-3 * wavelength);
    EXPECT_NEAR(d.amplitude, amplitude / std::sqrt(2), 2e-4 * amplitude);
    EXPECT_NEAR(d.extent, 2 * kPi * sigma * sigma, 2e-3 * 2 * kPi * sigma * sigma);
    EXPECT_GT(d.coherence, 0.98);
  }
}

TEST(Field, CrossedWavesHaveNone) {
  MatrixXd h(161, 161);
  for (int j = 0; j < h.cols(); ++j)
    for (int i = 0; i < h.rows(); ++i)
      h(i, j) = std::sin(2 * kPi / 5 * 0.25 * i) + std::sin(2 * kPi / 5 * 0.25 * j);
  EXPECT_LT(describe(wrinkle_sums(h, 0.25)).coherence, 0.05);
}

}  // namespace
}  // namespace rhytid
