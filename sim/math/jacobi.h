// Positive semi-definite part of small symmetric matrices, by cyclic Jacobi: of one, or of a pack of them, one per
// lane. Eigen-free.
//
// Tests    tests/sim/math/sym3_test.cpp
#pragma once

#include "sim/math/isa.h"
#include "sim/math/lanes.h"

namespace rhytid {
inline namespace RHYTID_ISA {

/// Where a + shift·I has a Cholesky factor. Of a only i ≤ j is read.
template <int N, class V>
typename MaskOf<V>::type positive_definite(const V (*a)[N], V shift) {
  V l[N][N], inverse[N];
  typename MaskOf<V>::type is = shift == shift;
  for (int j = 0; j < N; ++j) {
    V d = a[j][j] + shift;
    for (int k = 0; k < j; ++k) d -= l[j][k] * l[j][k];
    is = is & (d > 0.0);
    if (!any_of(is)) return is;
    inverse[j] = 1.0 / lane_sqrt(d);
    for (int i = j + 1; i < N; ++i) {
      V s = a[j][i];
      for (int k = 0; k < j; ++k) s -= l[i][k] * l[j][k];
      l[i][j] = s * inverse[j];
    }
  }
  return is;
}

/// The rotation by (c, s) of the pair x, y.
template <class V>
inline void rotate(V c, V s, V& x, V& y) {
  const V old = x;
  x = c * x - s * y;
  y = s * old + c * y;
}

/// Eigenvalues on the diagonal of m, of which only i ≤ j is read and kept, and eigenvectors in the columns of q.
template <int N, class V>
void diagonalise(V (*m)[N], V (*q)[N]) {
  constexpr int kMostSweeps = 50;
  constexpr double kRelativeSquare = 1e-30;  // of what is off the diagonal
  const V zero = {}, one = broadcast<V>(1);
  for (int i = 0; i < N; ++i)
    for (int j = 0; j < N; ++j) q[i][j] = i == j ? one : zero;
  for (int sweep = 0; sweep < kMostSweeps; ++sweep) {
    V off = {}, diagonal = {};
    for (int i = 0; i < N; ++i) {
      diagonal += m[i][i] * m[i][i];
      for (int j = i + 1; j < N; ++j) off += m[i][j] * m[i][j];
    }
    if (!any_of(off > kRelativeSquare * (diagonal + 2.0 * off))) return;
    for (int p = 0; p < N - 1; ++p)
      for (int r = p + 1; r < N; ++r) {
        // tan of the angle, the smaller one; a pair without coupling stays as it is.
        const V coupling = m[p][r], half = 0.5 * (m[r][r] - m[p][p]);
        const V magnitude = select(half < 0.0, -half, half);
        const V hypotenuse = magnitude + lane_sqrt(half * half + coupling * coupling);
        const V t = select(hypotenuse > 0.0, select(half < 0.0, -coupling, coupling) / hypotenuse, zero);
        const V c = 1.0 / lane_sqrt(t * t + 1.0), s = t * c;
        m[p][p] -= t * coupling;
        m[r][r] += t * coupling;
        m[p][r] = zero;
        for (int k = 0; k < p; ++k) rotate(c, s, m[k][p], m[k][r]);
        for (int k = p + 1; k < r; ++k) rotate(c, s, m[p][k], m[k][r]);
        for (int k = r + 1; k < N; ++k) rotate(c, s, m[p][k], m[r][k]);
        for (int k = 0; k < N; ++k) rotate(c, s, q[k][p], q[k][r]);
      }
  }
}

/// Replaces symmetric matrices by the nearest positive semi-definite ones (Frobenius): negative eigenvalues to zero.
/// Unchanged, both halves, where one is already positive semi-definite to 1e-12 of its trace norm. Of a only i ≤ j
/// is read.
template <int N, class V>
void project_psd(V (*a)[N]) {
  const V zero = {};
  V scale = {};
  for (int i = 0; i < N; ++i) scale += select(a[i][i] < 0.0, -a[i][i], a[i][i]);
  const auto keep = positive_definite<N, V>(a, 1e-12 * scale);
  if (!any_of(!keep)) return;
  V m[N][N], q[N][N];
  for (int i = 0; i < N; ++i)
    for (int j = i; j < N; ++j) m[i][j] = a[i][j];
  diagonalise<N, V>(m, q);
  for (int k = 0; k < N; ++k) {
    // The column times the root of its eigenvalue.
    const V root = lane_sqrt(select(m[k][k] > 0.0, m[k][k], zero));
    for (int i = 0; i < N; ++i) q[i][k] *= root;
  }
  for (int i = 0; i < N; ++i)
    for (int j = i; j < N; ++j) {
      V sum = {};
      for (int k = 0; k < N; ++k) sum += q[i][k] * q[j][k];
      a[i][j] = select(keep, a[i][j], sum);
      if (j > i) a[j][i] = select(keep, a[j][i], sum);
    }
}

}  // namespace RHYTID_ISA
}  // namespace rhytid
