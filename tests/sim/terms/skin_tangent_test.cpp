// Derivatives of a step of skin in closed form against the same step through dual numbers, one point at a time: random
// states and the ones that hurt.
#include <gtest/gtest.h>

#include "skin_points.h"

namespace rhytid::test {
namespace {

constexpr double kDt = 1. / 24;
/// Directions: old strain, history, parameters; for the new history the strain too.
constexpr int kInputs = 6 + 6 + 5, kAll = kInputs + 6;
using Number = Dual<kAll>;

/// Derivatives of stress and new history by all inputs.
struct Slopes {
  Eigen::Matrix<double, 6, kInputs> stress;
  Eigen::Matrix<double, 6, kAll> history;
};

/// A step from `old` to `p`, with the history and parameters of `old`.
template <class Law>
Slopes by_duals(const Law& law, const Point& old, const Point& p) {
  Number y_old[6], y[6], history[6], theta[5], prepared[6] = {}, sigma[6], updated[6] = {};
  for (int c = 0; c < 6; ++c) {
    y_old[c] = Number::variable(old.y[c], c);
    history[c] = Number::variable(old.history[c], 6 + c);
    y[c] = Number::variable(p.y[c], kInputs + c);
  }
  for (int c = 0; c < 5; ++c) theta[c] = Number::variable(old.theta[c], 12 + c);
  law.template prepare<Number>(y_old, history, theta, nullptr, kDt, prepared);
  (void)law.template stress<Number>(y, prepared, theta, nullptr, kDt, sigma);
  law.template update<Number>(y, prepared, theta, nullptr, kDt, updated);
  Slopes out;
  for (int c = 0; c < 6; ++c)
    for (int k = 0; k < kAll; ++k) {
      if (k < kInputs) out.stress(c, k) = sigma[c].d[k];
      out.history(c, k) = updated[c].d[k];
    }
  return out;
}

template <class Law>
Slopes in_closed_form(const Law& law, const Point& old, const Point& p) {
  double prepared[6], constants[Law::num_tangent_constants + 1];
  law.template prepare<double>(old.y.data(), old.history.data(), old.theta.data(), nullptr, kDt, prepared);
  law.tangent_constants(old.theta.data(), kDt, constants);
  const auto at = law.template tangent_at<double>({p.y.data(), old.y.data(), old.history.data(), prepared,
                                                   old.theta.data(), constants, true, true, true, true});
  double to_old[6][6] = {}, to_now[6][6];
  if (law.has_lookback()) rotation_of_symmetric(at.to_old, to_old);
  rotation_of_symmetric(at.to_now, to_now);
  Slopes out;
  for (int k = 0; k < kAll; ++k) {
    double inputs[kAll] = {}, dy_old[6], dy[6], d[6] = {}, framed[6], result[6] = {};
    inputs[k] = 1;
    multiply_symmetric(to_old, inputs, dy_old);
    multiply_symmetric(to_now, inputs + kInputs, dy);
    at.prepared(dy_old, inputs + 6, inputs + 12, d);
    at.stress(d, inputs + 12, framed);
    multiply_transposed(to_now, framed, result);
    if (k < kInputs)
      for (int c = 0; c < 6; ++c) out.stress(c, k) = result[c];
    for (double& x : result) x = 0;
    at.update(d, dy, inputs + 12, result);
    for (int c = 0; c < 6; ++c) out.history(c, k) = result[c];
  }
  return out;
}

/// Every column by itself: those by parameters are as small as the strain.
template <class Law>
double compare(const Law& law) {
  const std::vector<Point> all = points();
  Rng rng(61);
  std::uniform_int_distribution<std::size_t> any(0, all.size() - 1);
  double worst = 0;
  for (const Point& p : all)
    for (const Point& old : {p, all[any(rng)]}) {
      const Slopes a = in_closed_form(law, old, p), b = by_duals(law, old, p);
      SCOPED_TRACE(testing::Message() << "Y = " << p.y.transpose() << ", old " << old.y.transpose()
                                      << ", history " << old.history.transpose());
      const double strain = std::max({p.y.norm(), old.y.norm(), old.history.norm()});
      for (int k = 0; k < kAll; ++k) {
        // Where a parameter's derivative is a difference of strains, the rounding of strains stays.
        const bool by_parameter = k >= 12 && k < kInputs;
        const double unit = old.theta.head(4).norm();
        if (k < kInputs) {
          const double scale = std::max(b.stress.col(k).norm(), by_parameter ? 10 * strain : 1e-3 * unit);
          EXPECT_LE((a.stress.col(k) - b.stress.col(k)).norm(), 2e-13 * scale + 1e-300) << "stress by " << k;
          if (scale > 0) worst = std::max(worst, (a.stress.col(k) - b.stress.col(k)).norm() / scale);
        }
        const double scale = std::max(b.history.col(k).norm(), by_parameter ? 10 * strain : 1e-3);
        EXPECT_LE((a.history.col(k) - b.history.col(k)).norm(), 2e-13 * scale + 1e-300) << "history by " << k;
        if (scale > 0) worst = std::max(worst, (a.history.col(k) - b.history.col(k)).norm() / scale);
      }
    }
  return worst;
}

TEST(SkinTangent, ClosedFormIsTheLawForEveryDamper) {
  for (const DamperScheme scheme : {DamperScheme::exponential, DamperScheme::literal, DamperScheme::strang,
                                    DamperScheme::backward_euler, DamperScheme::none})
    std::printf("viscoelastic: %.1e\n", compare(SkinLaw{scheme}));
  std::printf("volume elsewhere: %.1e\n", compare(SkinLaw{DamperScheme::exponential, 0}));
}

TEST(SkinTangent, ElasticClosedFormIsTheLaw) {
  std::printf("elastic: %.1e\n", compare(ElasticSkinLaw{}));
}

}  // namespace
}  // namespace rhytid::test
