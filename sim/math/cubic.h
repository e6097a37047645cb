// How far a deformation gradient can go along a direction before its determinant reaches zero.
#pragma once

#include <algorithm>
#include <cmath>
#include <limits>

namespace rhytid {

/// Coefficients c of det(F + s D) = c0 + c1 s + c2 s² + c3 s³; F, D row-major 3×3.
inline void determinant_along(const double* f, const double* d, double* c) {
  const auto det = [](const double* a, const double* b, const double* e) {  // rows a, b, e
    return a[0] * (b[1] * e[2] - b[2] * e[1]) - a[1] * (b[0] * e[2] - b[2] * e[0]) +
           a[2] * (b[0] * e[1] - b[1] * e[0]);
  };
  c[0] = det(f, f + 3, f + 6);
  c[1] = det(d, f + 3, f + 6) + det(f, d + 3, f + 6) + det(f, f + 3, d + 6);
  c[2] = det(d, d + 3, f + 6) + det(d, f + 3, d + 6) + det(f, d + 3, d + 6);
  c[3] = det(d, d + 3, d + 6);
}

/// Smallest root of the cubic in (0, 1], +inf when it stays positive there. c[0] > 0 expected (0 is returned
/// otherwise).
inline double first_root_in_unit(const double* c) {
  const double none = std::numeric_limits<double>::infinity();
  if (!(c[0] > 0)) return 0;
  if (c[0] + std::min(0.0, c[1]) + std::min(0.0, c[2]) + std::min(0.0, c[3]) > 0) return none;
  const auto value = [c](double s) { return c[0] + s * (c[1] + s * (c[2] + s * c[3])); };
  // Between the extrema the cubic is monotonic: bisect in the first interval that ends at or below zero.
  double ends[4] = {1, 1, 1, 1};
  int count = 0;
  const double a = 3 * c[3], b = 2 * c[2];
  if (std::fabs(a) > 1e-300) {
    const double disc = b * b - 4 * a * c[1];
    if (disc >= 0) {
      const double q = -0.5 * (b + std::copysign(std::sqrt(disc), b));
      double r[2] = {q / a, q != 0 ? c[1] / q : 0};
      if (r[0] > r[1]) std::swap(r[0], r[1]);
      for (double s : r)
        if (s > 0 && s < 1) ends[count++] = s;
    }
  } else if (b != 0) {
    const double s = -c[1] / b;
    if (s > 0 && s < 1) ends[count++] = s;
  }
  ends[count++] = 1;
  double lo = 0;
  for (int k = 0; k < count; ++k) {
    double hi = ends[k];
    if (value(hi) > 0) {
      lo = hi;
      continue;
    }
    for (int it = 0; it < 60; ++it) {
      const double mid = 0.5 * (lo + hi);
      (value(mid) > 0 ? lo : hi) = mid;
    }
    return hi;
  }
  return none;
}

}  // namespace rhytid
