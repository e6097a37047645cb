// What every output and every sweep must satisfy on a run: duality of every parameter's own direction, and
// Taylor slopes.
#pragma once

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

#include "tests/adjoint/certified_case.h"

namespace rhytid::adjoint {

/// Largest |⟨Jv, w⟩ − ⟨v, Jᵀw⟩| over directions, relative to the larger of the sums or a hundredth of their
/// terms.
inline double duality(const CertifiedCase& c, const Output& output, const std::vector<VectorXd>& weights,
                      const MatrixXd& directions, const AdjointResult& adjoint) {
  const auto tangent = tangent_sweep(c.model(), c.scene_model.native(), c.run, output, directions);
  double worst = 0;
  for (Eigen::Index k = 0; k < directions.cols(); ++k) {
    double forward = 0, terms = 0;
    for (int f = 0; f <= c.run.frames(); ++f) {
      if (output.size(f) == 0) continue;
      const VectorXd product = tangent.frames[f].col(k).cwiseProduct(weights[f]);
      forward += product.sum();
      terms += product.cwiseAbs().sum();
    }
    EXPECT_GT(terms, 0) << "direction " << k;
    const double backward = directions.col(k).dot(adjoint.native_bar);
    worst = std::max(worst, std::fabs(forward - backward) / std::max(std::fabs(forward), 1e-2 * terms));
  }
  return worst;
}

inline std::vector<std::string> addresses_of(const CertifiedCase& c) {
  std::vector<std::string> all;
  for (const ParameterSpec& s : all_parameters(c.scene_model.scene()))
    if (c.scene_model.is_smooth_in(s.address, c.run)) all.push_back(s.address);
  return all;
}

/// Heights of sources over flat skin: they are projected to it.
inline std::vector<std::string> heights_of_sources(const Scene& scene) {
  std::vector<std::string> none;
  if (!scene.ligaments) return none;
  for (const SourceScene& source : scene.ligaments->sources)
    none.push_back("/ligaments/sources/" + source.name + "/position/2");
  return none;
}

/// All that can have no effect in these scenes: relaxation times of layers that do not relax, and heights.
inline std::vector<std::string> without_effect(const Scene& scene) {
  std::vector<std::string> none;
  for (const LayerScene& layer : scene.skin.layers)
    if (layer.relaxing_fraction == 0) none.push_back("/skin/layers/" + layer.name + "/relaxation_time");
  for (std::string& address : heights_of_sources(scene)) none.push_back(std::move(address));
  return none;
}

/// Duality of every parameter's own direction and Taylor slopes along a random direction and the gradient.
/// Every parameter but those expected to has an effect: a sweep that loses one must not choose its own test.
/// The random direction is balanced, so that each parameter has a like share of its slope, except that none
/// counts for less than `smallest_share` of the largest (where one's share would drown in rounding).
inline void expect_right_gradient(const CertifiedCase& c, const Output& output,
                                  const std::vector<VectorXd>& weights, double smallest_share = 1e-5) {
  ASSERT_TRUE(c.run.complete) << c.run.failure;
  const AdjointResult adjoint = adjoint_sweep(c.model(), c.scene_model.native(), c.run, output, weights);
  std::vector<std::string> addresses, without;
  for (const std::string& a : addresses_of(c)) {
    const double slope = ParameterSpace(c.scene_model, {a}).jacobian().col(0).dot(adjoint.native_bar);
    (slope != 0 ? addresses : without).push_back(a);
  }
  ASSERT_EQ(without, without_effect(c.scene_model.scene()));
  const ParameterSpace space(c.scene_model, addresses);
  const double transposes = duality(c, output, weights, space.jacobian(), adjoint);
  EXPECT_LT(transposes, 1e-12);
  const VectorXd gradient = space.jacobian().transpose() * adjoint.native_bar;
  const FunctionalDifference functional(c.scene_model, c.run, output, weights, certificate_minimiser({}));
  std::mt19937 rng(3);
  std::normal_distribution<double> normal;
  VectorXd random(space.size());
  const double floor = smallest_share * gradient.cwiseAbs().maxCoeff();
  for (Eigen::Index k = 0; k < random.size(); ++k)
    random[k] = normal(rng) / std::max(std::fabs(gradient[k]), floor);
  const double noise = measure_noise(functional, space, random);
  for (const VectorXd& direction : {random, gradient}) {
    const TaylorSeries s = taylor_test(functional, space, direction, gradient, noise, {});
    EXPECT_TRUE(s.passed) << s.sentence;
    EXPECT_LT(s.first_order_error, 1e-5);
    std::printf("duality %.1e, %s\n", transposes, s.sentence.c_str());
  }
}

}  // namespace rhytid::adjoint
