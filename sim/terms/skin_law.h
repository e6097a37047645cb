// Skin at a material point: Hencky-Fung equilibrium spring, Maxwell branch, volumetric penalty.
//
//   ψ = μ∞/C (exp(C q) − 1) + w μ_m q_e + K/2 (J − 1)²,    q = tr Ē²,  q_e = tr Ē_e²
//   Ē = dev ½ ln C,   Ē_e = dev ½ ln X,   X = L⁻¹ C L⁻ᵀ,   Ĉ^v = L Lᵀ the pre-relaxed viscous history
//   S = 2 ∂ψ/∂C = [ 2 μ∞ e^(Cq) Ē + 2 w μ_m L⁻ᵀ Ē_e Lᵀ + K (J−1) J I ] C⁻¹
//
// Only eigenvalues of C and of C (C^v)⁻¹ enter, so C^v = F^vᵀ F^v (6 numbers, det 1) is the whole history; it
// is kept as C^v − I, and strain as Y = C − I, so that the rest state is exact.
//
// Source   the publication, "Material Modeling", "Viscous Time Integration"; deviation: C^v instead of F^v
//          (identical to round-off), damper schemes other than `literal`.
// Units    μ∞, μ_m, K [MPa], C [1], τ [s], dt [s]; ψ [MPa = mJ/mm³].
// Shapes   e = Y [6] (xx yy zz xy xz yz), σ = ∂ψ/∂Y [6] (off-diagonal entries count both halves), history C^v − I [6].
// Smooth   analytic for J > 0; the caller rejects J ≤ 0.
// Tests    tests/sim/terms/skin_law_test.cpp
#pragma once

#include <array>

#include "sim/math/sym3.h"
#include "sim/terms/damper.h"
#include "sim/terms/skin_response.h"
#include "sim/terms/skin_tangent.h"

namespace rhytid {
inline namespace RHYTID_ISA {

/// C̄ − I from Y = C − I, C̄ = J^(−2/3) C.
template <class T>
void isochoric(const T* y, T* ybar) {
  using std::expm1;
  using std::log1p;
  const T scale = expm1(log1p(det_minus_one(y)) * (-1. / 3));  // (det C)^(−1/3) − 1
  for (int c = 0; c < 6; ++c) ybar[c] = y[c] + y[c] * scale;
  for (int c = 0; c < 3; ++c) ybar[c] += scale;
}

/// Deviator of ½ log(I + Y) into e, and q = tr e².
template <class T>
T half_log_deviator(const T* y, T* e) {
  log_one_plus(y, e);
  const T mean = (e[0] + e[1] + e[2]) * (1. / 3);
  for (int c = 0; c < 3; ++c) e[c] = (e[c] - mean) * 0.5;
  for (int c = 3; c < 6; ++c) e[c] = e[c] * 0.5;
  return e[0] * e[0] + e[1] * e[1] + e[2] * e[2] + 2.0 * (e[3] * e[3] + e[4] * e[4] + e[5] * e[5]);
}

/// The equilibrium part: energy and N with S = N C⁻¹, N symmetric and coaxial with C. `volume` scales K.
template <class T>
T equilibrium(const T* y, const T* theta, double volume, T* n) {
  using std::exp;
  using std::expm1;
  using std::log1p;
  const T q = half_log_deviator(y, n);
  const T& mu = theta[SkinTheta::mu_inf];
  const T& stiffening = theta[SkinTheta::stiffening];
  const T bulk = volume * theta[SkinTheta::bulk];
  const T z = stiffening * q;
  const T factor = 2.0 * mu * exp(z);
  const T jm1 = expm1(0.5 * log1p(det_minus_one(y)));  // J − 1
  const T pressure = bulk * jm1 * (jm1 + 1.0);
  for (int c = 0; c < 6; ++c) n[c] = factor * n[c];
  for (int c = 0; c < 3; ++c) n[c] += pressure;
  return mu * q * relative_expm1(z) + 0.5 * bulk * jm1 * jm1;  // (e^z − 1)/C = q (e^z − 1)/z
}

/// Stored equilibrium energy by part: distortion (Fung), volume.
template <class T>
void equilibrium_parts(const T* y, const T* theta, double volume, T* out) {
  T part[3], n[6];
  for (int k = 0; k < 2; ++k) {
    for (int c = 0; c < 3; ++c) part[c] = theta[c];
    part[k == 0 ? SkinTheta::bulk : SkinTheta::mu_inf] = T(0.0);
    out[k] = equilibrium(y, part, volume, n);
  }
}

/// Energy of the Maxwell spring at strain C = I + Y with history C^v = I + V.
template <class T>
T maxwell_energy(const T* y, const T* v, const T& mu_m) {
  T l[6], m[6], difference[6], x[6], unused[6];
  cholesky_one_plus(v, l);
  invert_lower(l, m);
  for (int c = 0; c < 6; ++c) difference[c] = y[c] - v[c];
  congruence_lower(m, difference, x);
  return mu_m * half_log_deviator(x, unused);
}

/// sigma = ∂ψ/∂Y from S = sym(A C⁻¹), A a general matrix [3][3] that makes A C⁻¹ symmetric.
template <class T>
void stress_from(const T (*a)[3], const T* y, T* sigma) {
  T inverse[6];
  inverse_one_plus(y, inverse);
  for (int c = 0; c < 6; ++c) {
    const int i = kSymRow[c], j = kSymCol[c];
    T sij = a[i][0] * inverse[kSym[0][j]] + a[i][1] * inverse[kSym[1][j]] + a[i][2] * inverse[kSym[2][j]];
    if (c < 3) {
      sigma[c] = 0.5 * sij;
    } else {
      const T sji =
          a[j][0] * inverse[kSym[0][i]] + a[j][1] * inverse[kSym[1][i]] + a[j][2] * inverse[kSym[2][i]];
      sigma[c] = 0.5 * (sij + sji);  // both halves of ½ S
    }
  }
}

/// 1/C; 0 where C is as good as 0.
inline double inverse_stiffening(const double* theta) {
  const double c = theta[SkinTheta::stiffening];
  return c > 1e-12 ? 1 / c : 0;
}

/// Viscoelastic skin. Prepared data: Ĉ^v − I, the history relaxed toward the old configuration.
struct SkinLaw {
  static constexpr int ne = 6, ns = 6, np = 6, ntheta = 5, nrest = 0;
  static constexpr const char* name = "skin";
  DamperScheme scheme = DamperScheme::exponential;
  double volume = 1;  ///< 0 when a VolumeLaw at points of its own carries K

  template <class T>
  void prepare(const T* y_old, const T* history, const T* theta, const double*, double dt,
               T* prepared) const {
    const Damper<T> d = damper(scheme, theta[SkinTheta::tau], dt);
    if (has_lookback()) {
      T ybar[6];
      isochoric(y_old, ybar);
      geometric_mean(history, ybar, d.pre, prepared);
    } else {
      for (int c = 0; c < 6; ++c) prepared[c] = history[c];
    }
  }

  /// Energy density; writes σ = ∂ψ/∂Y.
  template <class T>
  T stress(const T* y, const T* prepared, const T* theta, const double*, double dt, T* sigma) const {
    T n[6], l[6], m[6], difference[6], x[6], ee[6];
    T psi = equilibrium(y, theta, volume, n);
    cholesky_one_plus(prepared, l);
    invert_lower(l, m);
    for (int c = 0; c < 6; ++c) difference[c] = y[c] - prepared[c];
    congruence_lower(m, difference, x);  // X − I
    const T qe = half_log_deviator(x, ee);
    const T k = damper(scheme, theta[SkinTheta::tau], dt).weight * theta[SkinTheta::mu_m];
    psi += k * qe;
    // A = N + 2 k L⁻ᵀ Ē_e Lᵀ
    const T lower[3][3] = {{l[0], T(0.0), T(0.0)}, {l[3], l[1], T(0.0)}, {l[4], l[5], l[2]}};
    const T inverse[3][3] = {{m[0], T(0.0), T(0.0)}, {m[3], m[1], T(0.0)}, {m[4], m[5], m[2]}};
    T el[3][3], a[3][3];
    for (int i = 0; i < 3; ++i)
      for (int j = 0; j < 3; ++j) {
        T sum = ee[kSym[i][0]] * lower[j][0];
        for (int r = 1; r <= j; ++r) sum += ee[kSym[i][r]] * lower[j][r];
        el[i][j] = sum;
      }
    const T twice = 2.0 * k;
    for (int i = 0; i < 3; ++i)
      for (int j = 0; j < 3; ++j) {
        T sum = inverse[i][i] * el[i][j];
        for (int r = i + 1; r < 3; ++r) sum += inverse[r][i] * el[r][j];
        a[i][j] = n[kSym[i][j]] + twice * sum;
      }
    stress_from(a, y, sigma);
    return psi;
  }

  /// The same in closed form with the tangent (packed_kernel.h); the constants are the damper's weight and 1/C.
  static constexpr int num_constants = 2;
  void constants(const double* theta, double dt, double* c) const {
    c[0] = damper(scheme, theta[SkinTheta::tau], dt).weight;
    c[1] = inverse_stiffening(theta);
  }
  template <class V>
  V response(const V* y, const V* prepared, const V* theta, const V* constants, V* sigma,
             V (*tangent)[6]) const {
    clear_response(sigma, tangent);
    V m[6], x[6];
    maxwell_strain(y, prepared, m, x);
    SpringState<V> of_y, of_x;
    spring_states(y, x, of_y, of_x);
    const V equilibrium_energy = equilibrium_response(y, of_y, theta, volume, sigma, tangent);
    return equilibrium_energy +
           maxwell_response(of_x, m, V(constants[0] * theta[SkinTheta::mu_m]), sigma, tangent);
  }
  /// prepare() and update() in closed form (packed_history.h); the constants are the damper's pre and post.
  static constexpr int num_history_constants = 2;
  void history_constants(const double* theta, double dt, double* c) const {
    const Damper<double> d = damper(scheme, theta[SkinTheta::tau], dt);
    c[0] = d.pre;
    c[1] = d.post;
  }
  template <class V>
  void prepare_history(const V* y_old, const V* history, const V* constants, V* prepared) const {
    isochoric_mean(history, y_old, constants[0], prepared);
  }
  template <class V>
  void update_history(const V* y, const V* prepared, const V* constants, V* history) const {
    isochoric_mean(prepared, y, constants[1], history);
  }
  /// Derivatives of a step in closed form (packed_tangent.h); the constants are DamperSlopes.
  static constexpr int num_tangent_constants = DamperSlopes::count;
  void tangent_constants(const double* theta, double dt, double* c) const {
    const Damper<Dual<1>> d = damper(scheme, Dual<1>::variable(theta[SkinTheta::tau], 0), dt);
    c[DamperSlopes::pre] = d.pre.v, c[DamperSlopes::pre_slope] = d.pre.d[0];
    c[DamperSlopes::weight] = d.weight.v, c[DamperSlopes::weight_slope] = d.weight.d[0];
    c[DamperSlopes::post] = d.post.v, c[DamperSlopes::post_slope] = d.post.d[0];
  }
  /// The damper advances toward the old strain before the step.
  bool has_lookback() const { return scheme == DamperScheme::exponential || scheme == DamperScheme::strang; }
  template <class V>
  SkinTangent<V> tangent_at(const TangentPoint<V>& point) const {
    return SkinTangent<V>(point, has_lookback(), volume);
  }
  /// The energy density again, and the Mandel stress M = C S; jm1 = J − 1.
  template <class V>
  V mandel(const V* y, const V& jm1, const V* prepared, const V* theta, const V* constants, V (*m)[3]) const {
    V mean, z[3][3];
    const LogDeviator<V> d = log_deviator_symmetric(y, mean), e = maxwell_deviator(y, prepared, z);
    if (any_of(!(d.ordinary & e.ordinary))) return mandel_by_vectors(*this, y, prepared, theta, constants, m);
    const V k = constants[0] * theta[SkinTheta::mu_m];
    const V psi = equilibrium_mandel(y, jm1, d, mean, theta, constants[1], volume, m);
    add_log_deviator(e, k, z, m);
    return psi + k * e.square;
  }

  template <class T>
  void update(const T* y, const T* prepared, const T* theta, const double*, double dt, T* history) const {
    T ybar[6];
    isochoric(y, ybar);
    geometric_mean(prepared, ybar, damper(scheme, theta[SkinTheta::tau], dt).post, history);
  }

  static constexpr std::array<const char*, 3> stored_names = {"fung", "volumetric", "maxwell"};
  template <class T>
  void stored(const T* y, const T* history, const T* theta, const double*, T* out) const {
    equilibrium_parts(y, theta, volume, out);
    out[2] = maxwell_energy(y, history, theta[SkinTheta::mu_m]);
  }
  /// What the Maxwell spring loses as it relaxes at the old strain before the step and at the new one after.
  double dissipated(const double* y_old, const double* history, const double* y, const double* prepared,
                    const double* history_new, const double* theta, const double*, double) const {
    const double mu_m = theta[SkinTheta::mu_m];
    return maxwell_energy(y_old, history, mu_m) - maxwell_energy(y_old, prepared, mu_m) +
           maxwell_energy(y, prepared, mu_m) - maxwell_energy(y, history_new, mu_m);
  }
};

/// Skin without a Maxwell branch: no history, half the work. θ = μ∞, C, K.
struct ElasticSkinLaw {
  static constexpr int ne = 6, ns = 0, np = 0, ntheta = 3, nrest = 0;
  static constexpr const char* name = "skin";
  double volume = 1;  ///< as in SkinLaw

  template <class T>
  void prepare(const T*, const T*, const T*, const double*, double, T*) const {}
  template <class T>
  T stress(const T* y, const T*, const T* theta, const double*, double, T* sigma) const {
    T n[6], a[3][3];
    const T psi = equilibrium(y, theta, volume, n);
    for (int i = 0; i < 3; ++i)
      for (int j = 0; j < 3; ++j) a[i][j] = n[kSym[i][j]];
    stress_from(a, y, sigma);
    return psi;
  }
  static constexpr int num_constants = 1;
  void constants(const double* theta, double, double* c) const { c[0] = inverse_stiffening(theta); }
  template <class V>
  V response(const V* y, const V*, const V* theta, const V*, V* sigma, V (*tangent)[6]) const {
    clear_response(sigma, tangent);
    SpringState<V> s;
    spring_state(y, s);
    return equilibrium_response(y, s, theta, volume, sigma, tangent);
  }
  static constexpr int num_tangent_constants = 0;
  void tangent_constants(const double*, double, double*) const {}
  static bool has_lookback() { return false; }
  template <class V>
  ElasticSkinTangent<V> tangent_at(const TangentPoint<V>& point) const {
    return ElasticSkinTangent<V>(point, volume);
  }
  template <class V>
  V mandel(const V* y, const V& jm1, const V* prepared, const V* theta, const V* constants, V (*m)[3]) const {
    V mean;
    const LogDeviator<V> d = log_deviator_symmetric(y, mean);
    if (any_of(!d.ordinary)) return mandel_by_vectors(*this, y, prepared, theta, constants, m);
    return equilibrium_mandel(y, jm1, d, mean, theta, constants[0], volume, m);
  }

  template <class T>
  void update(const T*, const T*, const T*, const double*, double, T*) const {}

  static constexpr std::array<const char*, 2> stored_names = {"fung", "volumetric"};
  template <class T>
  void stored(const T* y, const T*, const T* theta, const double*, T* out) const {
    equilibrium_parts(y, theta, volume, out);
  }
};

/// The volumetric term alone, for points of its own (fewer through the thickness): ψ = K/2 (J − 1)². θ = K.
struct VolumeLaw {
  static constexpr int ne = 6, ns = 0, np = 0, ntheta = 1, nrest = 0;
  static constexpr const char* name = "volume";

  template <class T>
  void prepare(const T*, const T*, const T*, const double*, double, T*) const {}
  template <class T>
  T stress(const T* y, const T*, const T* theta, const double*, double, T* sigma) const {
    using std::expm1;
    using std::log1p;
    const T jm1 = expm1(0.5 * log1p(det_minus_one(y)));
    const T half_pressure = 0.5 * theta[0] * jm1 * (jm1 + 1.0);
    T inverse[6];
    inverse_one_plus(y, inverse);
    for (int c = 0; c < 6; ++c) sigma[c] = (c < 3 ? 1.0 : 2.0) * half_pressure * inverse[c];
    return 0.5 * theta[0] * jm1 * jm1;
  }
  template <class T>
  void update(const T*, const T*, const T*, const double*, double, T*) const {}
};

}  // namespace RHYTID_ISA
}  // namespace rhytid
