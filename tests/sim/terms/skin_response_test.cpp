// The closed-form response of skin against the same law through dual numbers: random states and the ones that
// hurt (repeated eigenvalues, nearly repeated, tiny and large strains), one point and packs.
#include <gtest/gtest.h>

#include "sim/math/spectral3.h"
#include "skin_points.h"

namespace rhytid::test {
namespace {

using Vec6 = Eigen::Matrix<double, 6, 1>;
using Tangent = Eigen::Matrix<double, 6, 6, Eigen::RowMajor>;

constexpr double kDt = 1. / 24;

template <class Law>
double by_duals(const Law& law, const Point& p, Vec6& sigma, Tangent& tangent) {
  Dual<6> y[6], history[6], theta[5], s[6];
  for (int c = 0; c < 6; ++c) y[c] = Dual<6>::variable(p.y[c], c), history[c] = p.history[c];
  for (int c = 0; c < 5; ++c) theta[c] = p.theta[c];
  const Dual<6> psi = law.template stress<Dual<6>>(y, history, theta, nullptr, kDt, s);
  for (int c = 0; c < 6; ++c) {
    sigma[c] = s[c].v;
    for (int d = 0; d < 6; ++d) tangent(c, d) = s[c].d[d];
  }
  return psi.v;
}

template <class Law>
double in_closed_form(const Law& law, const Point& p, Vec6& sigma, Tangent& tangent) {
  double constants[Law::num_constants], d[6][6];
  law.constants(p.theta.data(), kDt, constants);
  const double psi =
      law.template response<double>(p.y.data(), p.history.data(), p.theta.data(), constants, sigma.data(), d);
  for (int i = 0; i < 6; ++i)
    for (int j = 0; j < 6; ++j) tangent(i, j) = d[i][j];
  return psi;
}

template <class Law>
void compare(const Law& law) {
  for (const Point& p : points()) {
    Vec6 sigma, reference;
    Tangent tangent, wanted;
    const double psi = in_closed_form(law, p, sigma, tangent), energy = by_duals(law, p, reference, wanted);
    SCOPED_TRACE(testing::Message() << "Y = " << p.y.transpose() << ", history " << p.history.transpose());
    // The natural scale of stress is stiffness times strain: where strains cancel, their rounding stays.
    const double strain = std::max(p.y.norm(), p.history.norm());
    EXPECT_NEAR(psi, energy, 2e-14 * wanted.norm() * strain * strain);
    EXPECT_LE((sigma - reference).norm(), 1e-14 * wanted.norm() * strain + 1e-300);
    EXPECT_LE((tangent - wanted).norm(), 3e-14 * wanted.norm());
    EXPECT_EQ((tangent - tangent.transpose()).norm(), 0);
  }
}

TEST(SkinResponse, ViscoelasticClosedFormIsTheLaw) {
  compare(SkinLaw{});
}
TEST(SkinResponse, ElasticClosedFormIsTheLaw) {
  compare(ElasticSkinLaw{});
}

TEST(SkinResponse, PackIsLaneByLaneTheSingle) {
  const std::vector<Point> all = points();
  const SkinLaw law;
  for (std::size_t first = 0; first + kLanes <= all.size(); first += kLanes) {
    Lanes y[6], history[6], theta[5], constants[SkinLaw::num_constants], sigma[6], tangent[6][6];
    for (int k = 0; k < kLanes; ++k) {
      const Point& p = all[first + k];
      double c[SkinLaw::num_constants];
      law.constants(p.theta.data(), kDt, c);
      for (int i = 0; i < SkinLaw::num_constants; ++i) constants[i][k] = c[i];
      for (int i = 0; i < 6; ++i) y[i][k] = p.y[i], history[i][k] = p.history[i];
      for (int i = 0; i < 5; ++i) theta[i][k] = p.theta[i];
    }
    const Lanes psi = law.response<Lanes>(y, history, theta, constants, sigma, tangent);
    for (int k = 0; k < kLanes; ++k) {
      Vec6 s;
      Tangent t;
      const double single = in_closed_form(law, all[first + k], s, t);
      EXPECT_NEAR(psi[k], single, 1e-14 * std::abs(single));
      for (int i = 0; i < 6; ++i) {
        EXPECT_NEAR(sigma[i][k], s[i], 1e-14 * t.norm());
        for (int j = 0; j < 6; ++j) EXPECT_NEAR(tangent[i][j][k], t(i, j), 1e-13 * t.norm());
      }
    }
  }
}

TEST(Spectral3, JacobiReproducesTheMatrix) {
  for (const Point& p : points()) {
    double e[3], q[3][3];
    eigen_sym3_packed(p.y.data(), e, q);
    for (int c = 0; c < 6; ++c) {
      const int i = kSymRow[c], j = kSymCol[c];
      double sum = 0, dot = 0;
      for (int k = 0; k < 3; ++k) sum += e[k] * q[i][k] * q[j][k], dot += q[k][i] * q[k][j];
      EXPECT_NEAR(sum, p.y[c], 4e-15 * p.y.norm());
      EXPECT_NEAR(dot, i == j, 4e-15);
    }
  }
}

TEST(Spectral3, LogDifferenceIsSmoothWhereItsArgumentsMeet) {
  for (double a : {0.1, 1.0, 7.0})
    for (double gap : {0.0, 1e-15, 1e-9, 1e-3, 0.1, 0.28, 0.29, 0.6, 3.0}) {
      const double b = a * (1 + gap);
      const double exact = b == a ? 1 / a
                                  : static_cast<double>(std::log1p((static_cast<long double>(b) - a) / a) /
                                                        (static_cast<long double>(b) - a));
      EXPECT_NEAR(log_difference(a, b, std::log(a), std::log(b)), exact, 3e-15 * exact) << a << " " << gap;
    }
}

}  // namespace
}  // namespace rhytid::test
