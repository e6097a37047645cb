// Stress and tangent of skin in closed form, for V = double or a pack of points: what the element kernels
// run. The same law as skin_law.h, whose dual numbers are the reference that the tests compare this with.
//
// A spring sees the eigenvalues c_i = 1 + y_i of some symmetric matrix with eigenvectors q_i. With Kirchhoff
// principal stresses t_i = f ē_i + p (ē_i the deviator of ½ ln c_i) and T_ij = ∂t_i/∂(½ ln c_j):
//
//   S_i = t_i/c_i          σ = ½ Σ S_i q_i q_iᵀ                    (σ = ∂ψ/∂Y; off-diagonals count both
//   halves) ∂S_i/∂c_j = ½ T_ij/(c_i c_j) − δ_ij t_i/c_i² (S_i − S_j)/(c_i − c_j) = ¼ f [ln c_i, ln c_j]
//   (1/c_i + 1/c_j) − ½ (t_i + t_j)/(c_i c_j)
//
// and the tangent is ½ Rᵀ diag-block(∂S/∂c, 2 (S_i − S_j)/(c_i − c_j)) R, R the change of Y to Qᵀ dY Q. The
// Maxwell spring is the same on X = M C Mᵀ with q̃ = Mᵀ q for q, M = L⁻¹, Ĉ^v = L Lᵀ.
//
// Source   Daleckii-Krein; Units and shapes as in skin_law.h; tangent [6][6] = ∂σ/∂Y.
// Smooth   divided differences without difference quotients where eigenvalues meet.
// Tests    tests/sim/terms/skin_response_test.cpp
#pragma once

#include "sim/math/log_deviator.h"
#include "sim/math/spectral3.h"

namespace rhytid {
inline namespace RHYTID_ISA {

struct SkinTheta {
  static constexpr int mu_inf = 0, stiffening = 1, bulk = 2, mu_m = 3, tau = 4;
};

/// Eigenvalues' logarithmic strains of a spring and what follows from them.
template <class V>
struct SpringState {
  V vectors[3][3];   ///< columns q_i, or q̃_i
  V c[3], log_c[3];  ///< c_i, ln c_i
  V deviator[3], q;  ///< ē_i and Σ ē_i²
};

/// What follows from the eigenvalues e of Y; the eigenvectors are there.
template <class V>
void finish_spring_state(const V* e, SpringState<V>& s) {
  for (int i = 0; i < 3; ++i) {
    s.c[i] = e[i] + 1.0;
    s.log_c[i] = lane_log1p(e[i]);
  }
  const V mean = (s.log_c[0] + s.log_c[1] + s.log_c[2]) * (1. / 3);
  for (int i = 0; i < 3; ++i) s.deviator[i] = 0.5 * (s.log_c[i] - mean);
  s.q = s.deviator[0] * s.deviator[0] + s.deviator[1] * s.deviator[1] + s.deviator[2] * s.deviator[2];
}
template <class V>
void spring_state(const V* y, SpringState<V>& s) {
  V e[3];
  eigen_sym3_packed(y, e, s.vectors);
  finish_spring_state(e, s);
}
/// Of two springs at once.
template <class V>
void spring_states(const V* y, const V* x, SpringState<V>& s, SpringState<V>& t) {
  V e[3], f[3];
  eigen_sym3_packed(y, e, s.vectors, x, f, t.vectors);
  finish_spring_state(e, s);
  finish_spring_state(f, t);
}

/// Adds a spring's σ, and its tangent unless null: t_i = f ē_i + p, T_ij = f (δ_ij − 1/3) + g ē_i ē_j + h.
template <class V>
void add_spring(const SpringState<V>& s, const V& f, const V& p, const V& g, const V& h, V* sigma,
                V (*tangent)[6]) {
  V r[6][6];
  rotation_of_symmetric(s.vectors, r, tangent ? 6 : 3);
  V t[3], inverse[3];
  for (int i = 0; i < 3; ++i) {
    t[i] = f * s.deviator[i] + p;
    inverse[i] = 1.0 / s.c[i];
    const V half = 0.5 * t[i] * inverse[i];
    for (int e = 0; e < 6; ++e) sigma[e] += half * r[i][e];
  }
  if (!tangent) return;
  V z[6][6];  // ½ block · R
  for (int i = 0; i < 3; ++i) {
    V row[3];
    for (int j = 0; j < 3; ++j) {
      V big = g * s.deviator[i] * s.deviator[j] + h - f * (1. / 3);
      if (i == j) big += f;
      row[j] = 0.25 * big * inverse[i] * inverse[j];
      if (i == j) row[j] -= 0.5 * t[i] * inverse[i] * inverse[i];
    }
    for (int e = 0; e < 6; ++e) z[i][e] = row[0] * r[0][e] + row[1] * r[1][e] + row[2] * r[2][e];
  }
  for (int a = 3; a < 6; ++a) {
    const int i = kSymRow[a], j = kSymCol[a];
    const V log_slope = log_difference(s.c[i], s.c[j], s.log_c[i], s.log_c[j]);
    const V shear =
        0.25 * f * log_slope * (inverse[i] + inverse[j]) - 0.5 * (t[i] + t[j]) * inverse[i] * inverse[j];
    for (int e = 0; e < 6; ++e) z[a][e] = shear * r[a][e];
  }
  for (int d = 0; d < 6; ++d)
    for (int e = d; e < 6; ++e) {
      V sum = tangent[d][e];
      for (int a = 0; a < 6; ++a) sum += r[a][d] * z[a][e];
      tangent[d][e] = tangent[e][d] = sum;
    }
}

/// The equilibrium part: energy; `volume` scales K; adds σ and, unless null, the tangent. `s`: the state of Y.
template <class V>
V equilibrium_response(const V* y, const SpringState<V>& s, const V* theta, double volume, V* sigma,
                       V (*tangent)[6]) {
  const V &mu = theta[SkinTheta::mu_inf], &stiffening = theta[SkinTheta::stiffening];
  const V bulk = volume * theta[SkinTheta::bulk];
  const V z = stiffening * s.q, grown = lane_expm1(z);
  const V f = 2.0 * mu * (grown + 1.0);
  const V det = det_minus_one(y), j = lane_sqrt(det + 1.0), jm1 = det / (j + 1.0);
  add_spring(s, f, bulk * jm1 * j, 2.0 * f * stiffening, bulk * j * (jm1 + j), sigma, tangent);
  // (e^z − 1)/C → q as C → 0
  const V fung = select(stiffening > 1e-12, grown / stiffening, s.q * (1.0 + 0.5 * z));
  return mu * fung + 0.5 * bulk * jm1 * jm1;
}

/// X − I of the Maxwell spring, X = M C Mᵀ, from Y = C − I and the history Ĉ^v − I; M = L⁻¹.
template <class V>
void maxwell_strain(const V* y, const V* prepared, V* m, V* x) {
  V l[6], difference[6];
  cholesky_one_plus(prepared, l, [](const V& a) { return lane_sqrt(a); });
  invert_lower(l, m);
  for (int c = 0; c < 6; ++c) difference[c] = y[c] - prepared[c];
  congruence_lower(m, difference, x);
}

/// The Maxwell spring of stiffness k = w μ_m, `s` the state of its strain: energy, σ and tangent added.
template <class V>
V maxwell_response(SpringState<V>& s, const V* m, const V& k, V* sigma, V (*tangent)[6]) {
  for (int i = 0; i < 3; ++i) {  // q̃ = Mᵀ q
    V* const v0 = &s.vectors[0][i];
    V* const v1 = &s.vectors[1][i];
    V* const v2 = &s.vectors[2][i];
    *v0 = m[0] * *v0 + m[3] * *v1 + m[4] * *v2;
    *v1 = m[1] * *v1 + m[5] * *v2;
    *v2 = m[2] * *v2;
  }
  const V zero = broadcast<V>(0);
  add_spring(s, 2.0 * k, zero, zero, zero, sigma, tangent);
  return k * s.q;
}

/// Adds f (a₁ D + a₂ (D² − ⅔ J₂ I)) to M for a general D.
template <class V>
[[gnu::always_inline]] inline void add_log_deviator(const LogDeviator<V>& d, const V& f,
                                                    const V (*deviator)[3], V (*m)[3]) {
  const V linear = f * d.a1, quadratic = f * d.a2, constant = quadratic * d.third_trace;
  for (int i = 0; i < 3; ++i)
    for (int j = 0; j < 3; ++j) {
      V sum = m[i][j] + linear * deviator[i][j] +
              quadratic * (deviator[i][0] * deviator[0][j] + deviator[i][1] * deviator[1][j] +
                           deviator[i][2] * deviator[2][j]);
      if (i == j) sum -= constant;
      m[i][j] = sum;
    }
}

/// The equilibrium part without eigenvectors: energy, and its Mandel stress M = C S = 2 μ∞ e^(Cq) Ē + K (J−1) J I.
/// jm1 = J − 1; inverse_stiffening = 1/C, or 0 for C → 0.
template <class V>
[[gnu::always_inline]] inline V equilibrium_mandel(const V* y, const V& jm1, const LogDeviator<V>& d,
                                                   const V& mean, const V* theta, const V& inverse_stiffening,
                                                   double volume, V (*m)[3]) {
  const V &mu = theta[SkinTheta::mu_inf], &stiffening = theta[SkinTheta::stiffening];
  const V bulk = volume * theta[SkinTheta::bulk];
  const V z = stiffening * d.square, grown = lane_expm1(z);
  const V pressure = bulk * jm1 * (jm1 + 1.0);
  const V f = mu * (grown + 1.0), linear = f * d.a1, quadratic = f * d.a2;
  const V d0 = y[0] - mean, d1 = y[1] - mean, d2 = y[2] - mean,
          constant = pressure - quadratic * d.third_trace;
  m[0][0] = linear * d0 + quadratic * (d0 * d0 + y[3] * y[3] + y[4] * y[4]) + constant;
  m[1][1] = linear * d1 + quadratic * (d1 * d1 + y[3] * y[3] + y[5] * y[5]) + constant;
  m[2][2] = linear * d2 + quadratic * (d2 * d2 + y[4] * y[4] + y[5] * y[5]) + constant;
  m[0][1] = m[1][0] = linear * y[3] + quadratic * (y[3] * (d0 + d1) + y[4] * y[5]);
  m[0][2] = m[2][0] = linear * y[4] + quadratic * (y[4] * (d0 + d2) + y[3] * y[5]);
  m[1][2] = m[2][1] = linear * y[5] + quadratic * (y[5] * (d1 + d2) + y[3] * y[4]);
  // (e^z − 1)/C → q as C → 0
  const V fung = select(inverse_stiffening > 0, grown * inverse_stiffening, d.square * (1.0 + 0.5 * z));
  return mu * fung + 0.5 * bulk * jm1 * jm1;
}

/// Σ over dev ln(I + Y), Y symmetric; `mean` = tr Y/3.
template <class V>
[[gnu::always_inline]] inline LogDeviator<V> log_deviator_symmetric(const V* y, V& mean) {
  mean = (y[0] + y[1] + y[2]) * (1. / 3);
  const V d0 = y[0] - mean, d1 = y[1] - mean, d2 = y[2] - mean;
  const V s3 = y[3] * y[3], s4 = y[4] * y[4], s5 = y[5] * y[5];
  const V j2 = 0.5 * (d0 * d0 + d1 * d1 + d2 * d2) + s3 + s4 + s5;
  const V j3 = d0 * (d1 * d2 - s5) - d1 * s4 - d2 * s3 + 2.0 * (y[3] * y[4] * y[5]);
  return log_deviator<V>(mean + 1.0, j2, j3);
}

/// The Maxwell spring likewise: dev ln(C C^v⁻¹), C C^v⁻¹ − I = (Y − V) C^v⁻¹ into z, its deviator.
template <class V>
[[gnu::always_inline]] inline LogDeviator<V> maxwell_deviator(const V* y, const V* prepared, V (*z)[3]) {
  V inverse[6], e[6];
  inverse_one_plus(prepared, inverse);
  for (int c = 0; c < 6; ++c) e[c] = y[c] - prepared[c];
  for (int i = 0; i < 3; ++i)
    for (int j = 0; j < 3; ++j)
      z[i][j] = e[kSym[i][0]] * inverse[kSym[0][j]] + e[kSym[i][1]] * inverse[kSym[1][j]] +
                e[kSym[i][2]] * inverse[kSym[2][j]];
  const V mean = (z[0][0] + z[1][1] + z[2][2]) * (1. / 3);
  for (int i = 0; i < 3; ++i) z[i][i] -= mean;
  const V p01 = z[0][1] * z[1][0], p02 = z[0][2] * z[2][0], p12 = z[1][2] * z[2][1];
  const V j2 = 0.5 * (z[0][0] * z[0][0] + z[1][1] * z[1][1] + z[2][2] * z[2][2]) + p01 + p02 + p12;
  const V j3 = z[0][0] * (z[1][1] * z[2][2] - p12) - z[1][1] * p02 - z[2][2] * p01 +
               z[0][1] * z[1][2] * z[2][0] + z[0][2] * z[1][0] * z[2][1];
  LogDeviator<V> d = log_deviator<V>(mean + 1.0, j2, j3);
  // A history that is itself stretched by more makes C C^v⁻¹ far from symmetric.
  const V trace = prepared[0] + prepared[1] + prepared[2] + 3.0,
          inverse_trace = inverse[0] + inverse[1] + inverse[2];
  d.ordinary = d.ordinary & (trace * inverse_trace < 300.0) & (trace > 0);
  return d;
}

/// Energy and Mandel stress of a law by eigenvectors: right for all states.
template <class Law, class V>
[[gnu::noinline, gnu::cold]] V mandel_by_vectors(const Law& law, const V* y, const V* prepared,
                                                 const V* theta, const V* constants, V (*m)[3]) {
  V sigma[6];
  const V psi = law.template response<V>(y, prepared, theta, constants, sigma, nullptr);
  for (int i = 0; i < 3; ++i)
    for (int j = 0; j < 3; ++j) {
      V sum = broadcast<V>(0);
      for (int k = 0; k < 3; ++k) {
        const V c = i == k ? y[i] + 1.0 : y[kSym[i][k]];
        sum += c * (k == j ? 2.0 * sigma[j] : sigma[kSym[k][j]]);
      }
      m[i][j] = sum;
    }
  return psi;
}

/// Zeroes what the responses above add to.
template <class V>
void clear_response(V* sigma, V (*tangent)[6]) {
  for (int c = 0; c < 6; ++c) {
    sigma[c] = broadcast<V>(0);
    if (tangent)
      for (int d = 0; d < 6; ++d) tangent[c][d] = broadcast<V>(0);
  }
}

}  // namespace RHYTID_ISA
}  // namespace rhytid
