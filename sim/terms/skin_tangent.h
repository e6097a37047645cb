// Derivatives of a step of skin by what it starts from and by its parameters in closed form, for V = double or a pack of
// points: what the tangent and adjoint blocks of the element kernels run. The same law as skin_law.h, whose dual numbers
// are the reference that the tests compare this with.
//
// The history advances by geometric means, whose derivatives are products in the common frame X of two matrices
// (sim/math/geometric_mean.h). The Maxwell spring k |dev ½ ln(P⁻¹C)|² has ∂ψ/∂C = X⁻ᵀ (k ē/D) X⁻¹ in that of P and C,
// and at fixed C
//
//   d ∂ψ/∂C = X⁻ᵀ [ −k/2 (ℓ ∘ p − D⁻¹ tr p/3) + ē/D dk ] X⁻¹     p = X⁻¹ dP X⁻ᵀ,  ℓ divided differences of ln at D
//
// Frames and factors belong to a point and a step; a direction is a few small products with them. Strains come, and
// stresses go, in the frame: X⁻¹ dY X⁻ᵀ, and what multiplies that.
//
// Source   Daleckii-Krein; Units and shapes as in skin_law.h.
// Smooth   divided differences without difference quotients where eigenvalues meet.
// Tests    tests/sim/terms/skin_tangent_test.cpp, tangent_kernel_test.cpp
#pragma once

#include "sim/math/geometric_mean.h"
#include "sim/terms/skin_response.h"

namespace rhytid {
inline namespace RHYTID_ISA {

/// What a point is given: strains and parameters of a step, and what will be asked for.
template <class V>
struct TangentPoint {
  const V *y, *y_old, *history, *prepared, *theta;
  const V* constants;   ///< the law's tangent_constants
  bool start;           ///< derivatives by the old state and the history
  bool stress, update;  ///< derivatives of which
  bool parameters;      ///< some direction changes a parameter
};

/// Damper numbers and their derivatives by τ, as constants of a step.
struct DamperSlopes {
  static constexpr int pre = 0, pre_slope = 1, weight = 2, weight_slope = 3, post = 4, post_slope = 5,
                       count = 6;
};

/// The equilibrium spring: at fixed strain σ depends on parameters alone.
template <class V>
struct EquilibriumSlopes {
  V by_theta[3][6];  ///< ∂σ/∂(μ∞, C, K) in a frame

  /// At strain Y; `volume` scales K; columns of x: the frame X, or null for I.
  void set(const V* y, const V (*x)[3], const V* theta, double volume) {
    SpringState<V> s;
    spring_state(y, s);
    if (x)
      for (int i = 0; i < 3; ++i) {
        const V q[3] = {s.vectors[0][i], s.vectors[1][i], s.vectors[2][i]};
        for (int k = 0; k < 3; ++k) s.vectors[k][i] = x[0][k] * q[0] + x[1][k] * q[1] + x[2][k] * q[2];
      }
    V r[6][6];
    rotation_of_symmetric(s.vectors, r, 3);
    const V grown = lane_expm1(V(theta[SkinTheta::stiffening] * s.q)) + 1.0;
    const V det = det_minus_one(y), j = lane_sqrt(det + 1.0), bulk = 0.5 * volume * j * (det / (j + 1.0));
    const V by_stiffening = theta[SkinTheta::mu_inf] * s.q;
    V pressure[3], distortion[3];
    for (int i = 0; i < 3; ++i) {
      const V inverse = 1.0 / s.c[i];
      distortion[i] = grown * s.deviator[i] * inverse;
      pressure[i] = bulk * inverse;
    }
    for (int e = 0; e < 6; ++e) {
      const V shape = distortion[0] * r[0][e] + distortion[1] * r[1][e] + distortion[2] * r[2][e];
      by_theta[SkinTheta::mu_inf][e] = shape;
      by_theta[SkinTheta::stiffening][e] = by_stiffening * shape;
      by_theta[SkinTheta::bulk][e] = pressure[0] * r[0][e] + pressure[1] * r[1][e] + pressure[2] * r[2][e];
    }
  }
  [[gnu::always_inline]] void add(const V* dtheta, V* dsigma) const {
    for (int e = 0; e < 6; ++e)
      dsigma[e] += by_theta[0][e] * dtheta[0] + by_theta[1][e] * dtheta[1] + by_theta[2][e] * dtheta[2];
  }
  void add_transpose(const V* sigma_bar, V* theta_bar) const {
    for (int c = 0; c < 3; ++c)
      for (int e = 0; e < 6; ++e) theta_bar[c] += by_theta[c][e] * sigma_bar[e];
  }
};

/// Viscoelastic skin at a point.
template <class V>
class SkinTangent {
 public:
  V to_old[3][3], to_now[3][3];  ///< X⁻ᵀ of history and old strain; of prepared history and strain

  /// `looks_back`: the damper advances before the step too; else prepared = history. `volume` scales K.
  SkinTangent(const TangentPoint<V>& point, bool looks_back, double volume)
      : looks_back_(looks_back && point.start), parameters_(point.parameters), constants_(point.constants) {
    CommonFrame<V> old, now;
    V strain[6], eigenvalues[3];
    now.begin(point.prepared, point.y, strain);
    if (looks_back_) {
      V old_strain[6], old_eigenvalues[3];
      old.begin(point.history, point.y_old, old_strain);
      eigen_sym3_packed(old_strain, old_eigenvalues, old.q, strain, eigenvalues, now.q);
      old.finish(old_eigenvalues);
    } else {
      eigen_sym3_packed(strain, eigenvalues, now.q);
    }
    now.finish(eigenvalues);
    now.inverse_rows(to_now);
    V x[3][3];
    now.columns(x);
    if (looks_back_)
      set_start(old, point);
    else if (point.start)
      rotation_of_symmetric(to_now, history_to_frame_);
    if (point.stress) set_stress(now, x, point, volume);
    if (point.update) set_update(now, x, point);
  }

  /// d(prepared) in the frame, from directions of the old strain in its frame, the history and the parameters.
  [[gnu::always_inline]] void prepared(const V* dy_old, const V* ds_old, const V* dtheta, V* p) const {
    if (!looks_back_) return multiply_symmetric(history_to_frame_, ds_old, p);
    V a[6], mean[6];
    multiply_symmetric(history_to_frame_, ds_old, a);
    start_.apply(a, dy_old, V(constants_[DamperSlopes::pre_slope] * dtheta[SkinTheta::tau]), mean);
    multiply_symmetric(old_to_now_, mean, p);
  }
  /// dσ in the frame at fixed strain.
  [[gnu::always_inline]] void stress(const V* p, const V* dtheta, V* dsigma) const {
    const V mean = (p[0] + p[1] + p[2]) * (1. / 3);
    for (int i = 0; i < 3; ++i) dsigma[i] = by_prepared_[i] * (p[i] - mean);
    for (int i = 3; i < 6; ++i) dsigma[i] = by_prepared_[i] * p[i];
    if (!parameters_) return;
    equilibrium_.add(dtheta, dsigma);
    const V dk =
        constants_[DamperSlopes::weight] * dtheta[SkinTheta::mu_m] + weight_by_tau_ * dtheta[SkinTheta::tau];
    for (int i = 0; i < 3; ++i) dsigma[i] += by_stiffness_[i] * dk;
  }
  /// d(new history), with a direction of the strain in the frame.
  [[gnu::always_inline]] void update(const V* p, const V* dy, const V* dtheta, V* ds_new) const {
    V mean[6];
    end_.apply(p, dy, V(constants_[DamperSlopes::post_slope] * dtheta[SkinTheta::tau]), mean);
    multiply_symmetric(from_frame_, mean, ds_new);
  }

  /// The transposes. Of stress(), from what multiplies dσ: writes what multiplies p, adds to theta_bar.
  void stress_transpose(const V* sigma_bar, V* p_bar, V* theta_bar) const {
    for (int i = 0; i < 6; ++i) p_bar[i] = by_prepared_[i] * sigma_bar[i];
    const V mean = (p_bar[0] + p_bar[1] + p_bar[2]) * (1. / 3);
    for (int i = 0; i < 3; ++i) p_bar[i] -= mean;
    equilibrium_.add_transpose(sigma_bar, theta_bar);
    const V k_bar =
        by_stiffness_[0] * sigma_bar[0] + by_stiffness_[1] * sigma_bar[1] + by_stiffness_[2] * sigma_bar[2];
    theta_bar[SkinTheta::mu_m] += constants_[DamperSlopes::weight] * k_bar;
    theta_bar[SkinTheta::tau] += weight_by_tau_ * k_bar;
  }
  /// Of update(): adds to p_bar and theta_bar, writes y_bar.
  void update_transpose(const V* s_bar, V* p_bar, V* y_bar, V* theta_bar) const {
    V mean[6], a[6];
    multiply_transposed(from_frame_, s_bar, mean);
    theta_bar[SkinTheta::tau] += constants_[DamperSlopes::post_slope] * end_.transpose(mean, a, y_bar);
    for (int i = 0; i < 6; ++i) p_bar[i] += a[i];
  }
  /// Of prepared(): writes s_old_bar, and y_old_bar where something looks back, adds to theta_bar.
  void prepared_transpose(const V* p_bar, V* y_old_bar, V* s_old_bar, V* theta_bar) const {
    if (!looks_back_) return multiply_transposed(history_to_frame_, p_bar, s_old_bar);
    V mean[6], a[6];
    multiply_transposed(old_to_now_, p_bar, mean);
    theta_bar[SkinTheta::tau] += constants_[DamperSlopes::pre_slope] * start_.transpose(mean, a, y_old_bar);
    multiply_transposed(history_to_frame_, a, s_old_bar);
  }

 private:
  [[gnu::noinline]] void set_start(const CommonFrame<V>& old, const TangentPoint<V>& point) {
    old.inverse_rows(to_old);
    rotation_of_symmetric(to_old, history_to_frame_);
    V x[3][3], both[3][3];
    old.columns(x);
    for (int k = 0; k < 3; ++k)  // (X_now⁻¹ X_old)ᵀ
      for (int i = 0; i < 3; ++i)
        both[k][i] = to_now[0][i] * x[0][k] + to_now[1][i] * x[1][k] + to_now[2][i] * x[2][k];
    rotation_of_symmetric(both, old_to_now_);
    start_.set(old, det_minus_one(point.y_old), constants_[DamperSlopes::pre]);
  }
  [[gnu::noinline]] void set_stress(const CommonFrame<V>& now, const V (*x)[3], const TangentPoint<V>& point,
                                    double volume) {
    const V mu_m = point.theta[SkinTheta::mu_m], k = constants_[DamperSlopes::weight] * mu_m;
    const V mean = (now.log_d[0] + now.log_d[1] + now.log_d[2]) * (1. / 3);
    weight_by_tau_ = constants_[DamperSlopes::weight_slope] * mu_m;
    for (int i = 0; i < 3; ++i) {
      const V inverse = 1.0 / now.d[i];
      by_prepared_[i] = -0.5 * k * inverse;
      by_stiffness_[i] = 0.5 * (now.log_d[i] - mean) * inverse;
    }
    for (int c = 3; c < 6; ++c) {  // twice: σ counts both halves
      const int i = kSymRow[c], j = kSymCol[c];
      by_prepared_[c] = -k * log_difference(now.d[i], now.d[j], now.log_d[i], now.log_d[j]);
    }
    if (parameters_) equilibrium_.set(point.y, x, point.theta, volume);
  }
  [[gnu::noinline]] void set_update(const CommonFrame<V>& now, const V (*x)[3],
                                    const TangentPoint<V>& point) {
    V rows[3][3];
    for (int i = 0; i < 3; ++i)
      for (int j = 0; j < 3; ++j) rows[i][j] = x[j][i];
    rotation_of_symmetric(rows, from_frame_);
    end_.set(now, det_minus_one(point.y), constants_[DamperSlopes::post]);
  }

  bool looks_back_, parameters_;
  const V* constants_;
  V history_to_frame_[6][6];  // that of old where something looks back, else that of now
  V old_to_now_[6][6], from_frame_[6][6];
  MeanSlopes<V> start_, end_;
  EquilibriumSlopes<V> equilibrium_;
  V by_prepared_[6], by_stiffness_[3], weight_by_tau_;
};

/// Skin without a Maxwell branch: parameters alone. Its frame is that of rest.
template <class V>
class ElasticSkinTangent {
 public:
  V to_old[3][3], to_now[3][3];

  ElasticSkinTangent(const TangentPoint<V>& point, double volume) : parameters_(point.parameters) {
    for (int i = 0; i < 3; ++i)
      for (int j = 0; j < 3; ++j) to_old[i][j] = to_now[i][j] = broadcast<V>(i == j);
    if (point.stress && parameters_) equilibrium_.set(point.y, nullptr, point.theta, volume);
  }
  void prepared(const V*, const V*, const V*, V*) const {}
  void stress(const V*, const V* dtheta, V* dsigma) const {
    for (int e = 0; e < 6; ++e) dsigma[e] = broadcast<V>(0);
    if (parameters_) equilibrium_.add(dtheta, dsigma);
  }
  void update(const V*, const V*, const V*, V*) const {}
  void stress_transpose(const V* sigma_bar, V*, V* theta_bar) const {
    equilibrium_.add_transpose(sigma_bar, theta_bar);
  }
  void update_transpose(const V*, V*, V*, V*) const {}
  void prepared_transpose(const V*, V*, V*, V*) const {}

 private:
  bool parameters_;
  EquilibriumSlopes<V> equilibrium_;
};

}  // namespace RHYTID_ISA
}  // namespace rhytid
