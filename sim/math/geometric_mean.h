// Weighted geometric means A #_t B of symmetric positive definite matrices and their derivatives in closed form, for V =
// double or a pack: how the Maxwell damper advances (damper.h). sym3.h has the same by any scalar type.
//
// A pair of matrices has a common frame X = L Q, A = L Lᵀ, L⁻¹ B L⁻ᵀ = Q D Qᵀ:
//
//   A = X Xᵀ,  B = X D Xᵀ,  A #_t B = X Dᵗ Xᵀ
//   d(A #_t B) = X [ f ∘ b + g ∘ a + Dᵗ ln D dt ] Xᵀ          a = X⁻¹ dA X⁻ᵀ,  b = X⁻¹ dB X⁻ᵀ
//   f   divided differences of xᵗ at D;    g   those of x^(1−t) at D⁻¹, since A #_t B = B #_(1−t) A
//
// Source   Daleckii-Krein; the congruence of the mean; divided differences as in sym3.h
// Shapes   matrices in the storage of sym3.h, A and B as A − I and B − I
// Units    dimensionless
// Smooth   analytic for positive definite A and B
// Tests    tests/sim/terms/skin_tangent_test.cpp
#pragma once

#include "sim/math/lane_functions.h"
#include "sim/math/spectral3.h"

namespace rhytid {
inline namespace RHYTID_ISA {

/// out = M x for 6 × 6.
template <class V>
[[gnu::always_inline]] inline void multiply_symmetric(const V (*m)[6], const V* x, V* out) {
  for (int c = 0; c < 6; ++c) {
    V sum = m[c][0] * x[0];
    for (int e = 1; e < 6; ++e) sum += m[c][e] * x[e];
    out[c] = sum;
  }
}

/// out = Mᵀ x.
template <class V>
[[gnu::always_inline]] inline void multiply_transposed(const V (*m)[6], const V* x, V* out) {
  for (int e = 0; e < 6; ++e) {
    V sum = m[0][e] * x[0];
    for (int c = 1; c < 6; ++c) sum += m[c][e] * x[c];
    out[e] = sum;
  }
}

/// The frame of A and B.
template <class V>
struct CommonFrame {
  V lower[6], inverse_lower[6], q[3][3], d[3], log_d[3];

  /// Given A − I and B − I: L⁻¹ B L⁻ᵀ − I, whose eigenvalues and vectors finish() wants.
  void begin(const V* a, const V* b, V* strain) {
    V difference[6];
    cholesky_one_plus(a, lower, [](const V& x) { return lane_sqrt(x); });
    invert_lower(lower, inverse_lower);
    for (int c = 0; c < 6; ++c) difference[c] = b[c] - a[c];
    congruence_lower(inverse_lower, difference, strain);
  }
  /// q is there.
  void finish(const V* eigenvalues) {
    for (int i = 0; i < 3; ++i) {
      d[i] = eigenvalues[i] + 1.0;
      log_d[i] = lane_log1p(eigenvalues[i]);
    }
  }
  /// X = L Q.
  void columns(V (*x)[3]) const {
    const V* const l = lower;
    for (int i = 0; i < 3; ++i) {
      x[0][i] = l[0] * q[0][i];
      x[1][i] = l[3] * q[0][i] + l[1] * q[1][i];
      x[2][i] = l[4] * q[0][i] + l[5] * q[1][i] + l[2] * q[2][i];
    }
  }
  /// X⁻ᵀ = L⁻ᵀ Q.
  void inverse_rows(V (*x)[3]) const {
    const V* const m = inverse_lower;
    for (int i = 0; i < 3; ++i) {
      x[0][i] = m[0] * q[0][i] + m[3] * q[1][i] + m[4] * q[2][i];
      x[1][i] = m[1] * q[1][i] + m[5] * q[2][i];
      x[2][i] = m[2] * q[2][i];
    }
  }
};

/// The derivative of A #_t C̄ in the frame of A and C.
template <class V>
struct MeanSlopes {
  V by_a[6], by_c[6], by_t[3], by_trace[3], inverse_d[3];

  /// From the frame, det C − 1 and t.
  void set(const CommonFrame<V>& frame, const V& det_minus_one, const V& t) {
    const V shift = lane_log1p(det_minus_one) * (-1. / 3), scale = lane_expm1(shift) + 1.0, rest = 1.0 - t;
    V log_d[3], power[3], root[3];  // ln d̄, d̄^(t/2), d̄^(−1/2)
    for (int i = 0; i < 3; ++i) {
      log_d[i] = frame.log_d[i] + shift;
      power[i] = lane_expm1(V(0.5 * t * log_d[i])) + 1.0;
      root[i] = lane_expm1(V(-0.5 * log_d[i])) + 1.0;
      inverse_d[i] = 1.0 / frame.d[i];
      const V whole = power[i] * power[i], slope = t * whole * root[i] * root[i];
      by_a[i] = rest * whole;
      by_c[i] = slope * scale;
      by_t[i] = whole * log_d[i];
      by_trace[i] = slope * (1. / 3) * scale * frame.d[i];
    }
    for (int c = 3; c < 6; ++c) {
      const int i = kSymRow[c], j = kSymCol[c];
      const V delta = 0.5 * (log_d[i] - log_d[j]), common = power[i] * power[j] / lane_sinhc(delta);
      by_a[c] = common * rest * lane_sinhc(V(rest * delta));
      by_c[c] = common * root[i] * root[j] * scale * t * lane_sinhc(V(t * delta));
    }
  }
  /// d(A #_t C̄) in the frame from dA and dC in the frame and dt.
  [[gnu::always_inline]] void apply(const V* a, const V* c, const V& dt, V* out) const {
    const V trace = c[0] * inverse_d[0] + c[1] * inverse_d[1] + c[2] * inverse_d[2];  // of C⁻¹ dC
    for (int i = 0; i < 3; ++i) out[i] = by_a[i] * a[i] + by_c[i] * c[i] - by_trace[i] * trace + by_t[i] * dt;
    for (int i = 3; i < 6; ++i) out[i] = by_a[i] * a[i] + by_c[i] * c[i];
  }
  /// The transpose: derivatives by the entries of dA and dC in the frame, and, returned, by t.
  V transpose(const V* bar, V* a_bar, V* c_bar) const {
    const V trace_bar = -(by_trace[0] * bar[0] + by_trace[1] * bar[1] + by_trace[2] * bar[2]);
    for (int i = 0; i < 6; ++i) {
      a_bar[i] = by_a[i] * bar[i];
      c_bar[i] = by_c[i] * bar[i];
    }
    for (int i = 0; i < 3; ++i) c_bar[i] += inverse_d[i] * trace_bar;
    return by_t[0] * bar[0] + by_t[1] * bar[1] + by_t[2] * bar[2];
  }
};

/// (A #_t C̄) − I from A − I and C − I, C̄ = C/(det C)^(1/3).
template <class V>
void isochoric_mean(const V* a, const V* c, const V& t, V* out) {
  CommonFrame<V> frame;
  V strain[6], eigenvalues[3], x[3][3], grown[3];
  frame.begin(a, c, strain);
  eigen_sym3_packed(strain, eigenvalues, frame.q);
  frame.finish(eigenvalues);
  frame.columns(x);
  const V shift = lane_log1p(det_minus_one(c)) * (-1. / 3);
  for (int i = 0; i < 3; ++i) grown[i] = lane_expm1(V(t * (frame.log_d[i] + shift)));
  compose(x, grown, out);
  for (int i = 0; i < 6; ++i) out[i] += a[i];
}

}  // namespace RHYTID_ISA
}  // namespace rhytid
