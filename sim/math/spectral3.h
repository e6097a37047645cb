// Eigenvalues, eigenvectors and divided differences of symmetric 3×3 matrices for a double or a pack of them.
//
//   eigen_sym3_packed  cyclic Jacobi without branches; lanes that have converged are rotated by exact identities
//   log_difference     (ln a − ln b)/(a − b) = 2 atanh(z)/z / (a + b), z = (a − b)/(a + b); smooth through a = b
//
// Shapes   matrices as in sym3.h
// Units    dimensionless
// Tests    tests/sim/math/spectral3_test.cpp
#pragma once

#include "sim/math/lanes.h"
#include "sim/math/sym3.h"

namespace rhytid {
inline namespace RHYTID_ISA {

/// One matrix on its way to diagonal form.
template <class V>
struct JacobiState {
  V m[3], off[3];  ///< off[k]: the entry that does not touch k
  V q[3][3];

  explicit JacobiState(const V* a) : m{a[0], a[1], a[2]}, off{a[5], a[4], a[3]} {
    for (int i = 0; i < 3; ++i)
      for (int j = 0; j < 3; ++j) q[i][j] = broadcast<V>(i == j);
  }
  void put(V* eigenvalues, V (*vectors)[3]) const {
    for (int i = 0; i < 3; ++i) {
      eigenvalues[i] = m[i];
      for (int j = 0; j < 3; ++j) vectors[i][j] = q[i][j];
    }
  }
  typename MaskOf<V>::type unfinished() const {
    const V rest = off[0] * off[0] + off[1] * off[1] + off[2] * off[2];
    const V diagonal = m[0] * m[0] + m[1] * m[1] + m[2] * m[2];
    return rest > 1e-34 * diagonal;  // not for NaN
  }
  /// Makes the entry zero that does not touch k.
  [[gnu::always_inline]] void rotate(int k) {
    const int p = k == 0 ? 1 : 0, r = k == 2 ? 1 : 2;
    // t = tan of the rotation: the smaller root of t² + 2θt − 1, θ = d/(2 m_pr), without the quotient.
    const V d = m[r] - m[p], twice = off[k] + off[k];
    const V root = lane_sqrt(d * d + twice * twice);
    const V denominator = d + select(d < 0, -root, root);
    const V t = select(denominator != 0, twice / denominator, broadcast<V>(0));
    const V c = 1.0 / lane_sqrt(t * t + 1.0), s = t * c, shift = t * off[k];
    m[p] -= shift;
    m[r] += shift;
    off[k] = broadcast<V>(0);
    // m_kp is the entry that touches neither r: off[r]; m_kr is off[p].
    const V kp = off[r], kr = off[p];
    off[r] = c * kp - s * kr;
    off[p] = s * kp + c * kr;
    for (int i = 0; i < 3; ++i) {
      const V qp = q[i][p], qr = q[i][r];
      q[i][p] = c * qp - s * qr;
      q[i][r] = s * qp + c * qr;
    }
  }
};

constexpr int kJacobiSweeps = 12;  // 5 suffice for ordinary matrices; graded ones take a few more

/// As eigen_sym3, for V = double or Lanes.
template <class V>
void eigen_sym3_packed(const V* a, V* eigenvalues, V (*q)[3]) {
  JacobiState<V> s(a);
  for (int sweep = 0; sweep < kJacobiSweeps && any_of(s.unfinished()); ++sweep)
    for (int k = 2; k >= 0; --k) s.rotate(k);
  s.put(eigenvalues, q);
}

/// Two matrices at once, neither of which waits for the other.
template <class V>
void eigen_sym3_packed(const V* a, V* eigenvalues_a, V (*q_a)[3], const V* b, V* eigenvalues_b, V (*q_b)[3]) {
  JacobiState<V> s(a), t(b);
  for (int sweep = 0; sweep < kJacobiSweeps && any_of(s.unfinished() | t.unfinished()); ++sweep)
    for (int k = 2; k >= 0; --k) {
      s.rotate(k);
      t.rotate(k);
    }
  s.put(eigenvalues_a, q_a);
  t.put(eigenvalues_b, q_b);
}

/// (ln a − ln b)/(a − b) for a, b > 0, given also their logarithms.
template <class V>
V log_difference(const V& a, const V& b, const V& log_a, const V& log_b) {
  const V sum = a + b, difference = a - b, z = difference / sum, s = z * z;
  // 2 atanh(z)/z = 2 (1 + s/3 + s²/5 + ...); the first term left out is s¹⁰/21, 5e-20 at the switch.
  V series = broadcast<V>(1. / 19);
  for (int k = 17; k >= 1; k -= 2) series = series * s + 1. / k;
  return select(s < 0.016, 2.0 * series / sum, (log_a - log_b) / difference);
}

}  // namespace RHYTID_ISA
}  // namespace rhytid
