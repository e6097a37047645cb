// Packed logarithms and exponentials against long double, in units in the last place, for every instruction set that
// this machine has; and the deviator of a matrix logarithm from them against the logarithms of its eigenvalues.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <functional>
#include <limits>
#include <random>
#include <vector>

#include "sim/terms/kernel_choice.h"
#include "tests/sim/math/lane_functions_of.h"

namespace rhytid::test {
namespace {

constexpr double infinity = std::numeric_limits<double>::infinity(), epsilon = 0x1p-52;
using Numbers = std::vector<double>;

std::vector<LaneFunctions> instruction_sets() {
  std::vector<LaneFunctions> all = {lane_functions_baseline};
#ifdef RHYTID_HAVE_AVX2
  if (has_instructions("avx2")) all.push_back(lane_functions_avx2);
#endif
#ifdef RHYTID_HAVE_AVX512
  if (has_instructions("avx512")) all.push_back(lane_functions_avx512);
#endif
  return all;
}

/// Distance of a double from a number, in units in the last place of that number as a double.
double ulps(double value, long double exact) {
  const double nearest = static_cast<double>(exact);
  if (!std::isfinite(nearest)) return value == nearest ? 0 : infinity;
  const double size = std::max(std::abs(nearest), std::numeric_limits<double>::min());
  const long double unit = static_cast<long double>(std::nextafter(size, infinity)) - size;
  return static_cast<double>(std::abs(value - exact) / unit);
}

double worst_ulps(void (*f)(const double*, double*, int),
                  const std::function<long double(long double)>& exact, const Numbers& x) {
  Numbers out(x.size());
  f(x.data(), out.data(), static_cast<int>(x.size()));
  double worst = 0;
  for (std::size_t i = 0; i < x.size(); ++i) {
    const double error = ulps(out[i], exact(x[i]));
    if (!(error <= worst)) worst = error;
  }
  return worst;
}

/// Numbers whose magnitudes are spread evenly over powers of two.
Numbers spread(std::mt19937& rng, double smallest, double largest, bool negative, int count = 200'000) {
  std::uniform_real_distribution<double> power(std::log2(smallest), std::log2(largest)), sign(-1, 1);
  Numbers x(static_cast<std::size_t>(count));
  for (double& value : x) value = std::exp2(power(rng)) * (negative && sign(rng) < 0 ? -1 : 1);
  return x;
}

TEST(LaneFunctions, Log1p) {
  std::mt19937 rng(1);
  const auto exact = [](long double x) { return std::log1p(x); };
  Numbers near_minus_one = spread(rng, 1e-15, 0.5, false);
  for (double& x : near_minus_one) x = x - 1;
  for (const LaneFunctions& f : instruction_sets()) {
    const double tiny = worst_ulps(f.log1p, exact, spread(rng, 1e-300, 1e-3, true)),
                 usual = worst_ulps(f.log1p, exact, spread(rng, 1e-3, 0.99, true)),
                 large = worst_ulps(f.log1p, exact, spread(rng, 0.9, 1e300, false)),
                 singular = worst_ulps(f.log1p, exact, near_minus_one);
    std::printf("%s: log1p to %.2f ulp (tiny), %.2f (usual), %.2f (large), %.2f (near -1)\n", f.isa, tiny,
                usual, large, singular);
    EXPECT_LE(std::max({tiny, usual, large, singular}), 1.8);
    const Numbers edges = {0, -0.0, -1, -1.5, infinity, std::nan(""), 1e308, 1};
    Numbers out(8);
    f.log1p(edges.data(), out.data(), 8);
    EXPECT_EQ(out[0], 0);
    EXPECT_EQ(out[1], 0);
    EXPECT_EQ(out[2], -infinity);
    EXPECT_TRUE(std::isnan(out[3]));
    EXPECT_EQ(out[4], infinity);
    EXPECT_TRUE(std::isnan(out[5]));
    EXPECT_NEAR(out[6], std::log(1e308), 1e-12);
    EXPECT_NEAR(out[7], std::log(2.0), 1e-16);
  }
}

TEST(LaneFunctions, Expm1) {
  std::mt19937 rng(2);
  const auto exact = [](long double x) { return std::expm1(x); };
  for (const LaneFunctions& f : instruction_sets()) {
    const double tiny = worst_ulps(f.expm1, exact, spread(rng, 1e-300, 1e-3, true)),
                 usual = worst_ulps(f.expm1, exact, spread(rng, 1e-3, 3, true)),
                 large = worst_ulps(f.expm1, exact, spread(rng, 3, 709.7, true));
    std::printf("%s: expm1 to %.2f ulp (tiny), %.2f (usual), %.2f (large)\n", f.isa, tiny, usual, large);
    EXPECT_LE(std::max({tiny, usual, large}), 2);
    const Numbers edges = {0, -0.0, -infinity, infinity, std::nan(""), 709.78271289338397, 709.8, -800};
    Numbers out(8);
    f.expm1(edges.data(), out.data(), 8);
    EXPECT_EQ(out[0], 0);
    EXPECT_EQ(out[1], 0);
    EXPECT_EQ(out[2], -1);
    EXPECT_EQ(out[3], infinity);
    EXPECT_TRUE(std::isnan(out[4]));
    EXPECT_NEAR(out[5] / std::expm1(edges[5]), 1, 1e-15);
    EXPECT_EQ(out[6], infinity);
    EXPECT_EQ(out[7], -1);
  }
}

TEST(LaneFunctions, Sinhc) {
  std::mt19937 rng(5);
  const auto exact = [](long double x) { return std::sinh(x) / x; };
  for (const LaneFunctions& f : instruction_sets()) {
    const double tiny = worst_ulps(f.sinhc, exact, spread(rng, 1e-300, 1e-3, true)),
                 usual = worst_ulps(f.sinhc, exact, spread(rng, 1e-3, 1, true)),
                 around = worst_ulps(f.sinhc, exact, spread(rng, 0.5, 2, true)),
                 large = worst_ulps(f.sinhc, exact, spread(rng, 1, 700, true));
    std::printf("%s: sinhc to %.2f ulp (tiny), %.2f (usual), %.2f (around 1), %.2f (large)\n", f.isa, tiny,
                usual, around, large);
    EXPECT_LE(std::max({tiny, usual, around, large}), 3);
    const Numbers edges = {0, -0.0, std::nan(""), 1, -1, 1, 1, 1};
    Numbers out(8);
    f.sinhc(edges.data(), out.data(), 8);
    EXPECT_EQ(out[0], 1);
    EXPECT_EQ(out[1], 1);
    EXPECT_TRUE(std::isnan(out[2]));
    EXPECT_NEAR(out[3], std::sinh(1.0), 1e-15);
    EXPECT_EQ(out[3], out[4]);
  }
}

/// Logarithm of a quotient whose terms differ by a given number, which need not be representable by them.
TEST(LaneFunctions, LogQuotients) {
  std::mt19937 rng(3);
  for (const LaneFunctions& f : instruction_sets()) {
    for (const auto& [smallest, largest] : {std::pair{1e-300, 1e-20}, {1e-20, 1e-3}, {1e-3, 120.}}) {
      const Numbers gap = spread(rng, smallest, largest, false), scale = spread(rng, 1e-3, 1e3, false);
      const std::size_t n = gap.size();
      Numbers a(n), b(n), difference(n), log(n), slope(n);
      for (std::size_t i = 0; i < n; ++i) {
        b[i] = scale[i];
        difference[i] = scale[i] * gap[i];
        a[i] = b[i] + difference[i];
        if (i % 2 == 1) {  // the other way round
          std::swap(a[i], b[i]);
          difference[i] = -difference[i];
        }
        if (gap[i] > 1e-2) difference[i] = a[i] - b[i];
      }
      f.log_quotients(a.data(), b.data(), difference.data(), log.data(), slope.data(), static_cast<int>(n));
      double worst_log = 0, worst_slope = 0;
      for (std::size_t i = 0; i < n; ++i) {
        // Numbers that lie close are given by the smaller one and the difference.
        const long double low = std::min(a[i], b[i]), high = std::max(a[i], b[i]),
                          step =
                              gap[i] > 1e-2 ? high - low : std::abs(static_cast<long double>(difference[i])),
                          exact = std::log1p(step / low);
        worst_log = std::max(worst_log, ulps(std::abs(log[i]), exact));
        worst_slope = std::max(worst_slope, ulps(slope[i], exact / step));
      }
      std::printf("%s: gaps %.0e to %.0e: ln a/b to %.2f ulp, slope to %.2f\n", f.isa, smallest, largest,
                  worst_log, worst_slope);
      EXPECT_LE(worst_log, 6);
      EXPECT_LE(worst_slope, 6);
    }
    const Numbers a = {1, 2, 0.7, 5, 1, 1, 1, 1}, zero(8);
    Numbers log(8), slope(8);
    f.log_quotients(a.data(), a.data(), zero.data(), log.data(), slope.data(), 8);
    for (std::size_t i = 0; i < 8; ++i) {
      EXPECT_EQ(log[i], 0);
      EXPECT_NEAR(slope[i] * a[i], 1, epsilon);
    }
  }
}

struct Spectra {
  const char* name;
  double bound;                                      ///< of the error, in ε
  std::function<void(std::mt19937&, double*)> draw;  ///< eigenvalues of A, less 1
};

/// a₁ x + a₂ (x² − ⅔ J₂) at the eigenvalues of the deviator, against ln A's deviator from its eigenvalues.
TEST(LogDeviator, AgainstLogarithmsOfEigenvalues) {
  const auto stretches = [](double low, double high) {
    return [=](std::mt19937& rng, double* e) {
      std::uniform_real_distribution<double> d(std::log(low), std::log(high));
      for (int i = 0; i < 3; ++i) e[i] = std::expm1(2 * d(rng));
    };
  };
  const auto pair = [](double gap) {
    return [=](std::mt19937& rng, double* e) {
      std::uniform_real_distribution<double> d(-0.3, 0.6);
      e[0] = d(rng), e[1] = d(rng), e[2] = e[1] + gap * d(rng);
    };
  };
  const auto around = [](double centre, double gap) {
    return [=](std::mt19937& rng, double* e) {
      std::uniform_real_distribution<double> d(-1, 1);
      for (int i = 0; i < 3; ++i) e[i] = centre + gap * d(rng);
    };
  };
  const std::vector<Spectra> cases = {{"stretches 0.8 to 1.25", 8, stretches(0.8, 1.25)},
                                      {"stretches 0.5 to 2", 40, stretches(0.5, 2)},
                                      {"stretches 0.32 to 3.16", 1500, stretches(0.32, 3.16)},
                                      {"a pair", 10, pair(0)},
                                      {"a pair to 1e-13", 10, pair(1e-13)},
                                      {"a pair to 1e-10", 10, pair(1e-10)},
                                      {"a pair to 1e-6", 10, pair(1e-6)},
                                      {"a pair to 1e-3", 10, pair(1e-3)},
                                      {"three to 1e-3 about 1.4", 8, around(0.4, 1e-3)},
                                      {"three to 1e-9 about 1.4", 8, around(0.4, 1e-9)},
                                      {"strains of 1e-4", 8, around(0, 1e-4)},
                                      {"strains of 1e-9", 8, around(0, 1e-9)},
                                      {"strains of 1e-20", 8, around(0, 1e-20)},
                                      {"strains of 1e-60", 8, around(0, 1e-60)},
                                      {"strains of 1e-160", 8, around(0, 1e-160)}};
  constexpr std::size_t n = 20'000;
  std::printf("worst error of dev ln A, in epsilons of its own size:\n");
  for (const LaneFunctions& f : instruction_sets())
    for (const Spectra& c : cases) {
      std::mt19937 rng(4);
      Numbers mean(n), j2(n), j3(n), a1(n), a2(n), square(n), ordinary(n);
      std::vector<long double> x(3 * n), wanted(3 * n);
      for (std::size_t i = 0; i < n; ++i) {
        double e[3];
        c.draw(rng, e);
        const long double m = (static_cast<long double>(e[0]) + e[1] + e[2]) / 3;
        for (std::size_t k = 0; k < 3; ++k)
          for (const double other : e) {  // by differences, which keep their digits
            const long double step = static_cast<long double>(e[k]) - other;
            x[3 * i + k] += step / 3;
            wanted[3 * i + k] += std::log1p(step / (1 + static_cast<long double>(other))) / 3;
          }
        const long double* const p = &x[3 * i];
        mean[i] = static_cast<double>(1 + m);
        j2[i] = static_cast<double>((p[0] * p[0] + p[1] * p[1] + p[2] * p[2]) / 2);
        j3[i] = static_cast<double>(p[0] * p[1] * p[2]);
      }
      f.log_deviator(mean.data(), j2.data(), j3.data(), a1.data(), a2.data(), square.data(), ordinary.data(),
                     static_cast<int>(n));
      double worst = 0, worst_square = 0;
      for (std::size_t i = 0; i < n; ++i) {
        ASSERT_EQ(ordinary[i], 1) << c.name;
        long double size = 0, error = 0, norm = 0;
        for (std::size_t k = 0; k < 3; ++k) {
          const long double at = x[3 * i + k], exact = wanted[3 * i + k];
          const long double value = a1[i] * at + a2[i] * (at * at - 2 * static_cast<long double>(j2[i]) / 3);
          size = std::max(size, std::abs(exact));
          error = std::max(error, std::abs(value - exact));
          norm += exact * exact / 4;
        }
        worst = std::max(worst, static_cast<double>(error / size / epsilon));
        if (norm > 1e-290L)
          worst_square =
              std::max(worst_square, static_cast<double>(std::abs(square[i] / norm - 1) / epsilon));
      }
      std::printf("  %-12s %-26s %8.1f, its square %8.1f\n", f.isa, c.name, worst, worst_square);
      EXPECT_LE(worst, c.bound) << f.isa << ", " << c.name;
      EXPECT_LE(worst_square, 2 * c.bound) << f.isa << ", " << c.name;
    }
}

TEST(LogDeviator, IsExactlyZeroForMultiplesOfTheIdentityAndKnowsItsLimits) {
  for (const LaneFunctions& f : instruction_sets()) {
    // c, J₂, J₃ of: 1, 2, 1/2, then (101, 0.9, 0.9), (3, 1, −0.1), NaN twice, and rounding below zero.
    const double nan = std::nan("");
    const auto j2 = [](double a, double b, double c) {
      const double m = (a + b + c) / 3;
      return ((a - m) * (a - m) + (b - m) * (b - m) + (c - m) * (c - m)) / 2;
    };
    const auto j3 = [](double a, double b, double c) {
      const double m = (a + b + c) / 3;
      return (a - m) * (b - m) * (c - m);
    };
    const Numbers c = {1, 2, 0.5, 102.8 / 3, 3.9 / 3, nan, 1, 1},
                  second = {0, 0, 0, j2(101, 0.9, 0.9), j2(3, 1, -0.1), 0, nan, -1e-18},
                  third = {0, 0, 0, j3(101, 0.9, 0.9), j3(3, 1, -0.1), 0, nan, 1e-30};
    Numbers a1(8), a2(8), square(8), ordinary(8);
    f.log_deviator(c.data(), second.data(), third.data(), a1.data(), a2.data(), square.data(),
                   ordinary.data(), 8);
    for (std::size_t i = 0; i < 3; ++i) {
      EXPECT_EQ(a1[i] * c[i], 1);
      EXPECT_EQ(a2[i], 0);
      EXPECT_EQ(square[i], 0);
      EXPECT_EQ(ordinary[i], 1);
    }
    EXPECT_EQ(ordinary[3], 0);
    EXPECT_EQ(ordinary[4], 0);
    EXPECT_EQ(ordinary[5], 0);
    EXPECT_EQ(ordinary[6], 0);
    EXPECT_EQ(square[7], 0);
  }
}

}  // namespace
}  // namespace rhytid::test
