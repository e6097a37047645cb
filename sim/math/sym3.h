// Symmetric 3×3 matrices and their matrix functions log(I+Y) and (I+Y)^t − I.
//
// Stored as 6 numbers in the order xx yy zz xy xz yz. Matrices near the identity are stored as Y = A − I, so
// that small strains keep all their digits. Matrix functions are differentiated by divided differences in the
// sinh-quotient form (no difference of nearly equal numbers, no derivative of an eigenvector):
//
//   log:  f[a,b] = e^(−m) δ / sinh δ,     power t:  f[a,b] = e^((t−1)m) sinh(tδ) / sinh δ,
//   m, δ  mean and half difference of ln a and ln b.
//
// Source   Daleckii-Krein
// Units    dimensionless
// Smooth   analytic for I + Y positive definite
// Tests    tests/sim/math/sym3_test.cpp
#pragma once

#include <cmath>

#include "sim/math/dual.h"

namespace rhytid {
inline namespace RHYTID_ISA {

/// Entry (i, j) of the 6-number storage.
inline constexpr int kSym[3][3] = {{0, 3, 4}, {3, 1, 5}, {4, 5, 2}};
/// Row and column of storage entry c.
inline constexpr int kSymRow[6] = {0, 1, 2, 0, 0, 1};
inline constexpr int kSymCol[6] = {0, 1, 2, 1, 2, 2};

/// C = I + Y: det C − 1 without cancellation: tr Y + (sum of 2×2 minors of Y) + det Y.
template <class T>
T det_minus_one(const T* y) {
  const T minors = y[0] * y[1] + y[0] * y[2] + y[1] * y[2] - y[3] * y[3] - y[4] * y[4] - y[5] * y[5];
  const T det = y[0] * (y[1] * y[2] - y[5] * y[5]) - y[3] * (y[3] * y[2] - y[5] * y[4]) +
                y[4] * (y[3] * y[5] - y[1] * y[4]);
  return y[0] + y[1] + y[2] + minors + det;
}

/// Inverse of I + Y by cofactors.
template <class T>
void inverse_one_plus(const T* y, T* inverse) {
  const T a = y[0] + 1.0, b = y[1] + 1.0, c = y[2] + 1.0;
  const T c0 = b * c - y[5] * y[5], c3 = y[4] * y[5] - y[3] * c, c4 = y[3] * y[5] - y[4] * b;
  const T r = 1.0 / (a * c0 + y[3] * c3 + y[4] * c4);
  inverse[0] = c0 * r;
  inverse[1] = (a * c - y[4] * y[4]) * r;
  inverse[2] = (a * b - y[3] * y[3]) * r;
  inverse[3] = c3 * r;
  inverse[4] = c4 * r;
  inverse[5] = (y[3] * y[4] - a * y[5]) * r;
}

/// Lower Cholesky factor of I + Y: l = {l00, l11, l22, l10, l20, l21}. NaN when not positive definite. `root`
/// is the square root of a T, for packs of numbers that have no sqrt().
template <class T, class Root>
void cholesky_one_plus(const T* y, T* l, const Root& root) {
  l[0] = root(y[0] + 1.0);
  const T r0 = 1.0 / l[0];
  l[3] = y[3] * r0;
  l[4] = y[4] * r0;
  l[1] = root(y[1] + 1.0 - l[3] * l[3]);
  l[5] = (y[5] - l[4] * l[3]) / l[1];
  l[2] = root(y[2] + 1.0 - l[4] * l[4] - l[5] * l[5]);
}
template <class T>
void cholesky_one_plus(const T* y, T* l) {
  using std::sqrt;
  cholesky_one_plus(y, l, [](const T& a) { return T(sqrt(a)); });
}

/// Inverse of a lower triangular factor, same storage.
template <class T>
void invert_lower(const T* l, T* m) {
  m[0] = 1.0 / l[0];
  m[1] = 1.0 / l[1];
  m[2] = 1.0 / l[2];
  m[3] = -l[3] * m[0] * m[1];
  m[5] = -l[5] * m[1] * m[2];
  m[4] = -(l[4] * m[0] + l[5] * m[3]) * m[2];
}

/// B = L A Lᵀ with L lower triangular (storage as in cholesky_one_plus), A and B symmetric.
template <class T>
void congruence_lower(const T* l, const T* a, T* b) {
  // L·A
  const T r00 = l[0] * a[0], r10 = l[3] * a[0] + l[1] * a[3], r11 = l[3] * a[3] + l[1] * a[1];
  const T r20 = l[4] * a[0] + l[5] * a[3] + l[2] * a[4], r21 = l[4] * a[3] + l[5] * a[1] + l[2] * a[5];
  const T r22 = l[4] * a[4] + l[5] * a[5] + l[2] * a[2];
  b[0] = r00 * l[0];
  b[3] = r10 * l[0];
  b[1] = r10 * l[3] + r11 * l[1];
  b[4] = r20 * l[0];
  b[5] = r20 * l[3] + r21 * l[1];
  b[2] = r20 * l[4] + r21 * l[5] + r22 * l[2];
}

/// Eigenvalues and orthonormal eigenvectors (columns of q, row-major) of a symmetric matrix by cyclic Jacobi:
/// backward stable to a few ulp also at repeated eigenvalues, where closed forms lose half the digits.
inline void eigen_sym3(const double* a, double* eigenvalues, double (*q)[3]) {
  double m[3][3];
  for (int i = 0; i < 3; ++i)
    for (int j = 0; j < 3; ++j) m[i][j] = a[kSym[i][j]], q[i][j] = i == j;
  for (int sweep = 0; sweep < 30; ++sweep) {
    const double off = m[0][1] * m[0][1] + m[0][2] * m[0][2] + m[1][2] * m[1][2];
    const double diagonal = m[0][0] * m[0][0] + m[1][1] * m[1][1] + m[2][2] * m[2][2];
    if (!(off > 1e-34 * diagonal)) break;  // also leaves on NaN
    for (int p = 0; p < 2; ++p)
      for (int r = p + 1; r < 3; ++r) {
        const double apr = m[p][r];
        if (apr == 0) continue;
        const double theta = (m[r][r] - m[p][p]) / (2 * apr);
        const double t = (theta >= 0 ? 1 : -1) / (std::fabs(theta) + std::sqrt(theta * theta + 1));
        const double c = 1 / std::sqrt(t * t + 1), s = t * c;
        m[p][p] -= t * apr;
        m[r][r] += t * apr;
        m[p][r] = m[r][p] = 0;
        const int k = 3 - p - r;
        const double mkp = m[k][p], mkr = m[k][r];
        m[k][p] = m[p][k] = c * mkp - s * mkr;
        m[k][r] = m[r][k] = s * mkp + c * mkr;
        for (int i = 0; i < 3; ++i) {
          const double qp = q[i][p], qr = q[i][r];
          q[i][p] = c * qp - s * qr;
          q[i][r] = s * qp + c * qr;
        }
      }
  }
  for (int i = 0; i < 3; ++i) eigenvalues[i] = m[i][i];
}

/// sinh(z)/z, even, ≥ 1.
inline double sinhc(double z) {
  const double s = z * z;
  if (s < 1e-2) return 1 + s / 6 * (1 + s / 20 * (1 + s / 42 * (1 + s / 72)));
  return std::sinh(z) / z;
}

/// Spectral data of I + Y that both matrix functions need: eigenvectors and logarithms of the eigenvalues.
struct Spectrum {
  double q[3][3];
  double log_eigenvalue[3];
};
inline void spectrum_one_plus(const double* y, Spectrum& s) {
  double e[3];
  eigen_sym3(y, e, s.q);
  for (int i = 0; i < 3; ++i) s.log_eigenvalue[i] = std::log1p(e[i]);
}

/// Σ_i g_i q_i q_iᵀ, q_i the columns of q. V is double or a pack.
template <class V>
void compose(const V (*q)[3], const V* g, V* out) {
  for (int c = 0; c < 6; ++c) {
    const int i = kSymRow[c], j = kSymCol[c];
    out[c] = g[0] * q[i][0] * q[j][0] + g[1] * q[i][1] * q[j][1] + g[2] * q[i][2] * q[j][2];
  }
}

/// First `count` rows of the matrix that takes dY to the frame of the columns of q:
/// (Qᵀ dY Q)_c = Σ_e rotate[c][e] dY_e, in symmetric storage. V is double or a pack.
template <class V>
void rotation_of_symmetric(const V (*q)[3], V (*rotate)[6], int count = 6) {
  for (int c = 0; c < count; ++c) {
    const int i = kSymRow[c], j = kSymCol[c];
    for (int e = 0; e < 6; ++e) {
      const int k = kSymRow[e], l = kSymCol[e];
      rotate[c][e] = q[k][i] * q[l][j];
      if (e >= 3) rotate[c][e] += q[l][i] * q[k][j];
    }
  }
}

/// d out = Q (f ∘ (Qᵀ dY Q)) Qᵀ for N directions at once; f holds the divided differences in symmetric
/// storage.
template <int N>
void frechet(const Spectrum& s, const double* f, const Dual<N>* y, Dual<N>* out) {
  double rotate[6][6];  // its transpose (with weights) rotates back
  rotation_of_symmetric(s.q, rotate);
  double m[6][N];
  for (int c = 0; c < 6; ++c) {
    for (int n = 0; n < N; ++n) m[c][n] = 0;
    for (int e = 0; e < 6; ++e)
      for (int n = 0; n < N; ++n) m[c][n] += rotate[c][e] * y[e].d[n];
    for (int n = 0; n < N; ++n) m[c][n] *= f[c];
  }
  for (int c = 0; c < 6; ++c) {
    const int i = kSymRow[c], j = kSymCol[c];
    for (int n = 0; n < N; ++n) out[c].d[n] = 0;
    for (int e = 0; e < 6; ++e) {
      const int k = kSymRow[e], l = kSymCol[e];
      const double r = e < 3 ? s.q[i][k] * s.q[j][k] : s.q[i][k] * s.q[j][l] + s.q[i][l] * s.q[j][k];
      for (int n = 0; n < N; ++n) out[c].d[n] += r * m[e][n];
    }
  }
}

/// out = log(I + Y).
inline void log_one_plus(const double* y, double* out) {
  Spectrum s;
  spectrum_one_plus(y, s);
  compose(s.q, s.log_eigenvalue, out);
}
template <int N>
void log_one_plus(const Dual<N>* y, Dual<N>* out) {
  double y0[6], value[6], f[6];
  for (int c = 0; c < 6; ++c) y0[c] = y[c].v;
  Spectrum s;
  spectrum_one_plus(y0, s);
  compose(s.q, s.log_eigenvalue, value);
  for (int c = 0; c < 6; ++c) {
    const double a = s.log_eigenvalue[kSymRow[c]], b = s.log_eigenvalue[kSymCol[c]];
    f[c] = std::exp(-0.5 * (a + b)) / sinhc(0.5 * (a - b));
  }
  frechet(s, f, y, out);
  for (int c = 0; c < 6; ++c) out[c].v = value[c];
}

/// out = (I + Y)^t − I.
inline void power_one_plus(const double* y, double t, double* out) {
  Spectrum s;
  spectrum_one_plus(y, s);
  double g[3];
  for (int i = 0; i < 3; ++i) g[i] = std::expm1(t * s.log_eigenvalue[i]);
  compose(s.q, g, out);
}
template <int N>
void power_one_plus(const Dual<N>* y, const Dual<N>& t, Dual<N>* out) {
  double y0[6], g[3], value[6], by_t[6], f[6];
  for (int c = 0; c < 6; ++c) y0[c] = y[c].v;
  Spectrum s;
  spectrum_one_plus(y0, s);
  for (int i = 0; i < 3; ++i) g[i] = std::expm1(t.v * s.log_eigenvalue[i]);
  compose(s.q, g, value);
  for (int i = 0; i < 3; ++i) g[i] = (g[i] + 1) * s.log_eigenvalue[i];  // d(a^t)/dt = a^t ln a
  compose(s.q, g, by_t);
  for (int c = 0; c < 6; ++c) {
    const double a = s.log_eigenvalue[kSymRow[c]], b = s.log_eigenvalue[kSymCol[c]], delta = 0.5 * (a - b);
    f[c] = t.v * std::exp(0.5 * (t.v - 1) * (a + b)) * sinhc(t.v * delta) / sinhc(delta);
  }
  frechet(s, f, y, out);
  for (int c = 0; c < 6; ++c) {
    out[c].v = value[c];
    for (int n = 0; n < N; ++n) out[c].d[n] += by_t[c] * t.d[n];
  }
}

/// Weighted geometric mean of two symmetric positive definite matrices stored as A − I and B − I:
/// (A #_t B) − I with A #_t B = L (L⁻¹ B L⁻ᵀ)^t Lᵀ, A = L Lᵀ.
template <class T>
void geometric_mean(const T* a, const T* b, const T& t, T* out) {
  T l[6], m[6], difference[6], z[6], power[6];
  cholesky_one_plus(a, l);
  invert_lower(l, m);
  for (int c = 0; c < 6; ++c) difference[c] = b[c] - a[c];
  congruence_lower(m, difference, z);  // L⁻¹ B L⁻ᵀ − I
  power_one_plus(z, t, power);
  congruence_lower(l, power, out);
  for (int c = 0; c < 6; ++c) out[c] += a[c];
}

}  // namespace RHYTID_ISA
}  // namespace rhytid
