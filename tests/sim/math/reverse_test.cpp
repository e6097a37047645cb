// Reverse-mode numbers against forward-mode ones: operations, functions, matrix functions, packs.
#include "sim/math/reverse.h"

#include <gtest/gtest.h>

#include <random>

namespace rhytid {
namespace {

/// A function of seven numbers that uses every operation there is.
template <class T>
T everything(const T* x) {
  using std::exp;
  using std::expm1;
  using std::log1p;
  using std::sqrt;
  T a = x[0] * x[1] + 2.0 * x[2] - x[3] / x[4] + 1.0;
  a += exp(0.3 * x[0]) * (1.0 - x[5]) - (x[1] - 0.5) / 3.0;
  a -= log1p(x[2]) * sqrt(x[3]) + 1.0 / x[4];
  a *= expm1(x[5]) + relative_expm1(x[6]) + relative_expm1(4.0 * x[0]);
  T y[6], out[6];
  for (int c = 0; c < 6; ++c) y[c] = (c < 3 ? 0.3 : 0.1) * x[c];
  log_one_plus(y, out);
  for (int c = 0; c < 6; ++c) a += (1.0 + c) * out[c];
  power_one_plus(y, x[6], out);
  for (int c = 0; c < 6; ++c) a += out[c] * out[5 - c] - 0.2 * c * out[c];
  return -a + x[6] * 3.0;
}

std::vector<double> numbers(unsigned seed) {
  std::mt19937 random(seed);
  std::uniform_real_distribution<double> uniform(0.2, 0.9);
  std::vector<double> x(7);
  for (double& v : x) v = uniform(random);
  return x;
}

Dual<7> by_dual(const std::vector<double>& at) {
  Dual<7> x[7];
  for (int k = 0; k < 7; ++k) x[k] = Dual<7>::variable(at[static_cast<std::size_t>(k)], k);
  return everything(x);
}

TEST(Reverse, OneSweepGivesAllDerivatives) {
  for (unsigned seed = 1; seed <= 5; ++seed) {
    const std::vector<double> at = numbers(seed);
    const Dual<7> expected = by_dual(at);
    auto& tape = ReverseTape<double>::mine();
    tape.begin();
    Reverse<double> x[7];
    for (int k = 0; k < 7; ++k) x[k] = Reverse<double>::input(at[static_cast<std::size_t>(k)]);
    const Reverse<double> y = everything(x);
    EXPECT_NEAR(y.v, expected.v, 1e-14 * std::abs(expected.v));
    tape.clear_bars();
    tape.bar(y.node) = 1;
    tape.sweep();
    for (int k = 0; k < 7; ++k)
      EXPECT_NEAR(tape.bar(x[k].node), expected.d[k], 1e-13 * (1 + std::abs(expected.d[k]))) << k;
  }
}

TEST(Reverse, LanesAreIndependent) {
  std::vector<std::vector<double>> at;
  for (int lane = 0; lane < kLanes; ++lane) at.push_back(numbers(10 + static_cast<unsigned>(lane)));
  auto& tape = ReverseTape<Lanes>::mine();
  tape.begin();
  Reverse<Lanes> x[7];
  for (int k = 0; k < 7; ++k) {
    Lanes v = {};
    for (int lane = 0; lane < kLanes; ++lane)
      v[lane] = at[static_cast<std::size_t>(lane)][static_cast<std::size_t>(k)];
    x[k] = Reverse<Lanes>::input(v);
  }
  const Reverse<Lanes> y = everything(x);
  tape.clear_bars();
  tape.bar(y.node) = broadcast<Lanes>(1);
  tape.sweep();
  for (int lane = 0; lane < kLanes; ++lane) {
    const Dual<7> expected = by_dual(at[static_cast<std::size_t>(lane)]);
    EXPECT_NEAR(y.v[lane], expected.v, 1e-13 * std::abs(expected.v));
    for (int k = 0; k < 7; ++k)
      EXPECT_NEAR(tape.bar(x[k].node)[lane], expected.d[k], 1e-13 * (1 + std::abs(expected.d[k])));
  }
}

TEST(Reverse, MatrixFunctionsWhereEigenvaluesMeet) {
  for (const double shear : {0., 1e-9}) {
    const double y0[6] = {0.2, 0.2, 0.2, shear, 0, 0};
    auto& tape = ReverseTape<double>::mine();
    tape.begin();
    Reverse<double> y[6], out[6];
    Dual<6> yd[6], expected[6];
    for (int c = 0; c < 6; ++c) {
      y[c] = Reverse<double>::input(y0[c]);
      yd[c] = Dual<6>::variable(y0[c], c);
    }
    log_one_plus(y, out);
    log_one_plus(yd, expected);
    for (int o = 0; o < 6; ++o) {
      tape.clear_bars();
      tape.bar(out[o].node) = 1;
      tape.sweep();
      for (int c = 0; c < 6; ++c) EXPECT_NEAR(tape.bar(y[c].node), expected[o].d[c], 1e-14);
    }
  }
}

TEST(Reverse, ConstantsLeaveNoRecordAndTooLongARecordIsRefused) {
  auto& tape = ReverseTape<double>::mine();
  tape.begin();
  const Reverse<double> c = Reverse<double>::constant(2);
  EXPECT_EQ((c * c + 1.0).node, 0);
  EXPECT_EQ(exp(c).node, 0);
  Reverse<double> x = Reverse<double>::input(1);
  EXPECT_THROW(for (int k = 0; k < 10000; ++k) x = x * c, std::length_error);
}

TEST(RelativeExpm1, ValueAndSlope) {
  for (const double z : {-3., -0.11, -0.0999, -1e-3, 0., 1e-9, 0.0999, 0.1001, 2.}) {
    // In extended precision; near zero by two terms of the series.
    const long double x = z, tiny = std::fabs(x) < 1e-6L;
    const long double value = tiny ? 1 + x / 2 : std::expm1(x) / x;
    const long double slope = tiny ? 0.5L + x / 3 : (std::exp(x) - value) / x;
    EXPECT_NEAR(relative_expm1(z), static_cast<double>(value), 3e-16 * static_cast<double>(value)) << z;
    EXPECT_NEAR(relative_expm1_slope(z), static_cast<double>(slope), 4e-15 * static_cast<double>(slope)) << z;
  }
}

}  // namespace
}  // namespace rhytid
