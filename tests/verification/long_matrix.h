// 3×3 matrices in 80 bits and their logarithm by square roots and a series: nothing in common with the
// simulator.
#pragma once

#include <array>
#include <cmath>

namespace rhytid::test::long_matrix {

using Real = long double;
using Matrix = std::array<std::array<Real, 3>, 3>;

inline Matrix identity() {
  return {{{1, 0, 0}, {0, 1, 0}, {0, 0, 1}}};
}
inline Matrix sum(const Matrix& a, Real s, const Matrix& b) {  // a + s b
  Matrix c = a;
  for (int i = 0; i < 3; ++i)
    for (int j = 0; j < 3; ++j) c[i][j] += s * b[i][j];
  return c;
}
inline Matrix scaled(const Matrix& a, Real s) {
  return sum(Matrix{}, s, a);
}
inline Matrix product(const Matrix& a, const Matrix& b) {
  Matrix c{};
  for (int i = 0; i < 3; ++i)
    for (int j = 0; j < 3; ++j)
      for (int k = 0; k < 3; ++k) c[i][j] += a[i][k] * b[k][j];
  return c;
}
inline Matrix transposed(const Matrix& a) {
  Matrix c{};
  for (int i = 0; i < 3; ++i)
    for (int j = 0; j < 3; ++j) c[i][j] = a[j][i];
  return c;
}
inline Real determinant(const Matrix& a) {
  return a[0][0] * (a[1][1] * a[2][2] - a[1][2] * a[2][1]) -
         a[0][1] * (a[1][0] * a[2][2] - a[1][2] * a[2][0]) +
         a[0][2] * (a[1][0] * a[2][1] - a[1][1] * a[2][0]);
}
inline Matrix inverse(const Matrix& a) {
  const Real d = determinant(a);
  Matrix c{};
  for (int i = 0; i < 3; ++i)
    for (int j = 0; j < 3; ++j) {
      const int r = (j + 1) % 3, s = (j + 2) % 3, p = (i + 1) % 3, q = (i + 2) % 3;
      c[i][j] = (a[r][p] * a[s][q] - a[r][q] * a[s][p]) / d;
    }
  return c;
}
/// Square root of a matrix with positive eigenvalues (Denman-Beavers).
inline Matrix root(const Matrix& a) {
  Matrix y = a, z = identity();
  for (int k = 0; k < 12; ++k) {
    const Matrix next = scaled(sum(y, 1, inverse(z)), 0.5L);
    z = scaled(sum(z, 1, inverse(y)), 0.5L);
    y = next;
  }
  return y;
}
/// ln A = 2^s ln A^(1/2^s); the last by the series 2 (Z + Z³/3 + ...), Z = (A − I)(A + I)⁻¹.
inline Matrix logarithm(Matrix a) {
  constexpr int halvings = 3;
  for (int k = 0; k < halvings; ++k) a = root(a);
  const Matrix z = product(sum(a, -1, identity()), inverse(sum(a, 1, identity()))), z2 = product(z, z);
  Matrix power = z, result = z;
  for (int n = 3; n < 40; n += 2) {
    power = product(power, z2);
    result = sum(result, 1.0L / n, power);
  }
  return scaled(result, 2 * (1 << halvings));
}
inline Real trace(const Matrix& a) {
  return a[0][0] + a[1][1] + a[2][2];
}

}  // namespace rhytid::test::long_matrix
