// Positive semi-definite part of small symmetric matrices, by cyclic Jacobi. Eigen-free.
#pragma once

#include <cmath>

#include "sim/math/isa.h"

namespace rhytid {
inline namespace RHYTID_ISA {

/// True when a + shift·I has a Cholesky factor.
template <int N>
bool positive_definite(const double (*a)[N], double shift) {
  double l[N][N];
  for (int j = 0; j < N; ++j)
    for (int i = j; i < N; ++i) {
      double s = a[i][j] + (i == j ? shift : 0.0);
      for (int k = 0; k < j; ++k) s -= l[i][k] * l[j][k];
      if (i == j) {
        if (!(s > 0)) return false;
        l[j][j] = std::sqrt(s);
      } else {
        l[i][j] = s / l[j][j];
      }
    }
  return true;
}

/// Replaces a symmetric matrix by the nearest positive semi-definite one (Frobenius): negative eigenvalues to
/// zero. Unchanged when it is already positive semi-definite to 1e-12 of its trace norm.
template <int N>
void project_psd(double (*a)[N]) {
  double scale = 0;
  for (int i = 0; i < N; ++i) scale += std::fabs(a[i][i]);
  if (positive_definite<N>(a, 1e-12 * scale)) return;
  double m[N][N], q[N][N];
  for (int i = 0; i < N; ++i)
    for (int j = 0; j < N; ++j) m[i][j] = 0.5 * (a[i][j] + a[j][i]), q[i][j] = i == j;
  for (int sweep = 0; sweep < 50; ++sweep) {
    double off = 0, all = 0;
    for (int i = 0; i < N; ++i)
      for (int j = 0; j < N; ++j) {
        all += m[i][j] * m[i][j];
        if (i != j) off += m[i][j] * m[i][j];
      }
    if (!(off > 1e-30 * all)) break;
    for (int p = 0; p < N - 1; ++p)
      for (int r = p + 1; r < N; ++r) {
        if (m[p][r] == 0) continue;
        const double theta = (m[r][r] - m[p][p]) / (2 * m[p][r]);
        const double t = (theta >= 0 ? 1 : -1) / (std::fabs(theta) + std::sqrt(theta * theta + 1));
        const double c = 1 / std::sqrt(t * t + 1), s = t * c;
        for (int k = 0; k < N; ++k) {
          const double kp = m[k][p], kr = m[k][r];
          m[k][p] = c * kp - s * kr;
          m[k][r] = s * kp + c * kr;
        }
        for (int k = 0; k < N; ++k) {
          const double pk = m[p][k], rk = m[r][k];
          m[p][k] = c * pk - s * rk;
          m[r][k] = s * pk + c * rk;
        }
        for (int k = 0; k < N; ++k) {
          const double kp = q[k][p], kr = q[k][r];
          q[k][p] = c * kp - s * kr;
          q[k][r] = s * kp + c * kr;
        }
      }
  }
  for (int i = 0; i < N; ++i)
    for (int j = 0; j < N; ++j) a[i][j] = 0;
  for (int k = 0; k < N; ++k) {
    const double e = m[k][k];
    if (!(e > 0)) continue;
    for (int i = 0; i < N; ++i)
      for (int j = 0; j < N; ++j) a[i][j] += e * q[i][k] * q[j][k];
  }
}

}  // namespace RHYTID_ISA
}  // namespace rhytid
