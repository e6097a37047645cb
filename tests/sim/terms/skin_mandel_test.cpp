// Energy and Mandel stress of skin without eigenvectors, against long double with them; the error of the law's own scalar
// form is printed beside it.
#include <gtest/gtest.h>

#include <Eigen/Eigenvalues>
#include <Eigen/Geometry>
#include <functional>

#include "law_cases.h"

namespace rhytid::test {
namespace {

using Long = long double;
using LongMat = Eigen::Matrix<Long, 3, 3>;

constexpr double kDt = 1. / 24, epsilon = 0x1p-52;

struct Point {
  double y[6], history[6], theta[5] = {0.2, 1.5, 17, 0.8, 1. / 12}, jm1;
};

LongMat matrix(const double* y) {
  LongMat m;
  for (int i = 0; i < 3; ++i)
    for (int j = 0; j < 3; ++j) m(i, j) = y[kSym[i][j]];
  return m;
}

/// dev ½ ln(I + Y), from Y: tiny strains keep their digits.
LongMat half_log_deviator(const LongMat& y) {
  const Eigen::SelfAdjointEigenSolver<LongMat> eigen(y);
  Eigen::Matrix<Long, 3, 1> logs;
  for (int i = 0; i < 3; ++i) logs[i] = std::log1p(eigen.eigenvalues()[i]) / 2;
  logs.array() -= logs.mean();
  return eigen.eigenvectors() * logs.asDiagonal() * eigen.eigenvectors().transpose();
}

/// J − 1 from Y.
Long volume_change(const double* y) {
  Long d[6];
  for (int i = 0; i < 6; ++i) d[i] = y[i];
  const Long det = det_minus_one(d);
  return det / (1 + std::sqrt(1 + det));
}

struct Reference {
  Long energy, strain;  ///< size of the strains that energy and stress come from
  LongMat mandel;
  Long stiffness;
};

template <class Law>
Reference reference(const Law& law, const Point& p) {
  const LongMat y = matrix(p.y), v = matrix(p.history), e = half_log_deviator(y);
  const Long q = e.squaredNorm(), mu = p.theta[0], stiffening = p.theta[1], bulk = p.theta[2];
  const Long jm1 = volume_change(p.y), grown = std::expm1(stiffening * q);
  Reference r;
  const Long fung = stiffening > 0 ? grown / stiffening : q;
  r.energy = mu * fung + bulk / 2 * jm1 * jm1;
  r.mandel = 2 * mu * (1 + grown) * e + bulk * jm1 * (1 + jm1) * LongMat::Identity();
  r.stiffness = 2 * mu * (1 + grown) + 3 * bulk;
  r.strain = std::max(y.norm(), v.norm());
  if constexpr (Law::np > 0) {
    double constants[Law::num_constants];
    law.constants(p.theta, kDt, constants);
    const Long k = static_cast<Long>(constants[0]) * p.theta[3];
    const LongMat l = (LongMat::Identity() + v).llt().matrixL(), inverse = l.inverse();
    const LongMat elastic = half_log_deviator(inverse * (y - v) * inverse.transpose());
    r.energy += k * elastic.squaredNorm();
    r.mandel += 2 * k * l * elastic * inverse;
    r.stiffness += 2 * k;
  }
  return r;
}

struct Errors {
  double energy = 0, stress = 0;
  void include(const Reference& r, Long energy_found, const LongMat& mandel) {
    const Long scale = r.stiffness * r.strain * static_cast<Long>(epsilon);
    const auto larger = [](double a, Long b) { return b <= a ? a : static_cast<double>(b); };  // NaN too
    if (scale == 0) {
      if (energy_found != 0 || mandel.norm() != 0) stress = energy = 1e300;
      return;
    }
    stress = larger(stress, (mandel - r.mandel).norm() / scale);
    energy = larger(energy, std::abs(energy_found - r.energy) / (scale * r.strain));
  }
};

/// C S for S = 2 ∂ψ/∂C.
LongMat mandel_of(const Point& p, const double* sigma) {
  LongMat s;
  for (int i = 0; i < 3; ++i)
    for (int j = 0; j < 3; ++j) s(i, j) = i == j ? 2 * sigma[i] : sigma[kSym[i][j]];
  return s + matrix(p.y) * s;
}

/// All points in packs; what the last pack lacks is its first point again.
template <class Law>
void check(const char* name, const Law& law, const std::vector<Point>& points, double bound) {
  Errors packed, scalar;
  for (std::size_t first = 0; first < points.size(); first += kLanes) {
    const auto of = [&](std::size_t k) -> const Point& {
      return points[first + k < points.size() ? first + k : first];
    };
    Lanes y[6], history[6], theta[5], constants[Law::num_constants], jm1 = {}, m[3][3];
    for (int k = 0; k < kLanes; ++k) {
      const Point& p = of(k);
      double c[Law::num_constants];
      law.constants(p.theta, kDt, c);
      for (int i = 0; i < Law::num_constants; ++i) constants[i][k] = c[i];
      for (int i = 0; i < 6; ++i) y[i][k] = p.y[i], history[i][k] = p.history[i];
      for (int i = 0; i < 5; ++i) theta[i][k] = p.theta[i];
      jm1[k] = p.jm1;
    }
    const Lanes psi = law.template mandel<Lanes>(y, jm1, history, theta, constants, m);
    for (int k = 0; k < kLanes; ++k) {
      const Reference r = reference(law, of(k));
      LongMat found;
      for (int i = 0; i < 3; ++i)
        for (int j = 0; j < 3; ++j) found(i, j) = m[i][j][k];
      packed.include(r, psi[k], found);
    }
  }
  for (const Point& p : points) {
    double sigma[6];
    const double psi = law.template stress<double>(p.y, p.history, p.theta, nullptr, kDt, sigma);
    scalar.include(reference(law, p), psi, mandel_of(p, sigma));
  }
  std::printf("  %-34s stress %9.1f (scalar %9.1f)  energy %8.1f (%8.1f)\n", name, packed.stress,
              scalar.stress, packed.energy, scalar.energy);
  EXPECT_LE(packed.stress, bound) << name;
  EXPECT_LE(packed.energy, bound) << name;
}

using Stretches = std::function<Vec3(Rng&)>;

/// C = Fᵀ F − I of stretches that turn with `rng`, from stretches less 1.
void set_strain(const Vec3& less_one, Rng& rng, double* y) {
  const Mat3 q = Eigen::Quaterniond(uniform(rng, 4).normalized().data()).toRotationMatrix();
  const Mat3 m =
      q * Mat3((2 * less_one.array() + less_one.array().square()).matrix().asDiagonal()) * q.transpose();
  for (int c = 0; c < 6; ++c) y[c] = m(kSymRow[c], kSymCol[c]);
}

std::vector<Point> draw(const Stretches& stretches, const Stretches& of_history, int count = 2000) {
  Rng rng(41);
  std::vector<Point> points(static_cast<std::size_t>(count));
  for (Point& p : points) {
    set_strain(stretches(rng), rng, p.y);
    set_strain(of_history(rng), rng, p.history);
    p.jm1 = static_cast<double>(volume_change(p.y));
  }
  return points;
}

Stretches between(double low, double high) {
  return [=](Rng& rng) {
    std::uniform_real_distribution<double> d(std::log(low), std::log(high));
    return Vec3(std::expm1(d(rng)), std::expm1(d(rng)), std::expm1(d(rng)));
  };
}
Stretches around(double centre, double gap) {
  return [=](Rng& rng) { return Vec3(Vec3::Constant(centre) + gap * Vec3(uniform(rng, 3))); };
}
Stretches pair(double gap) {
  return [=](Rng& rng) {
    const VectorXd d = uniform(rng, 3, 0.3);
    return Vec3(d[0], d[1], d[1] + gap * d[2]);
  };
}

/// Errors in epsilons of stiffness times strain: what rounding of the strain alone makes of the stress.
TEST(SkinMandel, AgainstLongDouble) {
  const SkinLaw skin;
  std::printf("errors in epsilons of the natural scale\n");
  const Stretches history = between(0.8, 1.25), rest = around(0, 0);
  check("stretches 0.8 to 1.25", skin, draw(between(0.8, 1.25), history), 20);
  check("stretches 0.5 to 2", skin, draw(between(0.5, 2), history), 60);
  check("stretches 0.3 to 3", skin, draw(between(0.3, 3), between(0.7, 1.4)), 500);
  check("stretches 0.1 to 10", skin, draw(between(0.1, 10), history), 5000);
  check("stretches 0.5 to 2, history 0.2 to 5", skin, draw(between(0.5, 2), between(0.2, 5)), 500);
  check("rest", skin, draw(rest, rest, 8), 0);
  check("rest, history 0.8 to 1.25", skin, draw(rest, history), 20);
  check("a pair", skin, draw(pair(0), history), 20);
  for (const double gap : {1e-13, 1e-10, 1e-8, 1e-6, 1e-3}) {
    const std::string to = " to 1e" + std::to_string(std::lround(std::log10(gap)));
    check(("a pair" + to).c_str(), skin, draw(pair(gap), history), 20);
    check(("a pair" + to + ", no history").c_str(), skin, draw(pair(gap), rest), 20);
    check(("three" + to).c_str(), skin, draw(around(0.3, gap), rest), 20);
  }
  for (const double tiny : {1e-4, 1e-8, 1e-13, 1e-30, 1e-100})
    check(("strains of 1e" + std::to_string(std::lround(std::log10(tiny)))).c_str(), skin,
          draw(around(0, tiny), around(0, tiny)), 20);
  const ElasticSkinLaw elastic;
  check("elastic, stretches 0.5 to 2", elastic, draw(between(0.5, 2), rest), 60);
  check("elastic, rest", elastic, draw(rest, rest, 8), 0);
}

TEST(SkinMandel, WhatIsNotADeformationGivesNaN) {
  const SkinLaw law;
  for (const int which : {0, 1, 2}) {
    double y[6] = {0.1, 0.2, -0.1, 0.05, 0, 0.02}, history[6] = {}, constants[SkinLaw::num_constants],
           m[3][3];
    if (which == 0) y[1] = -1.3;
    if (which == 1) y[4] = std::nan("");
    if (which == 2) history[2] = -1.1;
    const double theta[5] = {0.2, 1.5, 17, 0.8, 0.1};
    law.constants(theta, kDt, constants);
    EXPECT_FALSE(std::isfinite(law.mandel<double>(y, 0.1, history, theta, constants, m))) << which;
  }
}

}  // namespace
}  // namespace rhytid::test
