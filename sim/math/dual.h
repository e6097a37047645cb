// Forward-mode dual numbers: value and N directional derivatives.
//
//   f(a + ε·a′) = f(a) + ε·f′(a) a′
//
// The one scalar type through which laws are differentiated (stress → tangent, law → parameter and history
// blocks). Eigen-free: included by files compiled for several instruction sets.
#pragma once

#include <cmath>

#include "sim/math/isa.h"

namespace rhytid {
inline namespace RHYTID_ISA {

/// (e^z − 1)/z, 1 at z = 0.
inline double relative_expm1(double z) {
  if (z > -0.1 && z < 0.1) {  // the first term left out is z¹¹/12!, 2e-20 at the switch
    double sum = 1;
    for (int k = 11; k >= 2; --k) sum = 1 + z / k * sum;
    return sum;
  }
  return std::expm1(z) / z;
}
/// Its derivative, Σ_k k z^(k−1)/(k+1)!.
inline double relative_expm1_slope(double z) {
  if (z > -0.1 && z < 0.1) {
    double sum = 0, factorial = 479001600;  // 12!
    for (int k = 11; k >= 1; --k) {
      sum = sum * z + k / factorial;
      factorial /= k + 1;
    }
    return sum;
  }
  return (std::exp(z) - std::expm1(z) / z) / z;
}

template <int N>
struct Dual {
  double v = 0;   ///< value
  double d[N]{};  ///< derivatives along N directions

  Dual() = default;
  Dual(double value) : v(value) {}  // NOLINT: a constant is a dual with zero derivatives

  /// The variable number k: derivative 1 along direction k.
  static Dual variable(double value, int k) {
    Dual r(value);
    r.d[k] = 1;
    return r;
  }

  Dual& operator+=(const Dual& b) {
    v += b.v;
    for (int k = 0; k < N; ++k) d[k] += b.d[k];
    return *this;
  }
  Dual& operator-=(const Dual& b) {
    v -= b.v;
    for (int k = 0; k < N; ++k) d[k] -= b.d[k];
    return *this;
  }
  Dual& operator*=(const Dual& b) { return *this = *this * b; }
  Dual& operator*=(double s) {
    v *= s;
    for (int k = 0; k < N; ++k) d[k] *= s;
    return *this;
  }

  friend Dual operator+(Dual a, const Dual& b) { return a += b; }
  friend Dual operator-(Dual a, const Dual& b) { return a -= b; }
  friend Dual operator+(Dual a, double b) {
    a.v += b;
    return a;
  }
  friend Dual operator+(double b, Dual a) {
    a.v += b;
    return a;
  }
  friend Dual operator-(Dual a, double b) {
    a.v -= b;
    return a;
  }
  friend Dual operator-(double a, const Dual& b) { return chain(b, a - b.v, -1.0); }
  friend Dual operator-(const Dual& a) { return chain(a, -a.v, -1.0); }
  friend Dual operator*(const Dual& a, const Dual& b) {
    Dual r;
    r.v = a.v * b.v;
    for (int k = 0; k < N; ++k) r.d[k] = a.v * b.d[k] + a.d[k] * b.v;
    return r;
  }
  friend Dual operator*(Dual a, double s) { return a *= s; }
  friend Dual operator*(double s, Dual a) { return a *= s; }
  friend Dual operator/(const Dual& a, const Dual& b) {
    const double inverse = 1.0 / b.v, q = a.v * inverse;
    Dual r;
    r.v = q;
    for (int k = 0; k < N; ++k) r.d[k] = (a.d[k] - q * b.d[k]) * inverse;
    return r;
  }
  friend Dual operator/(Dual a, double s) { return a *= 1.0 / s; }
  friend Dual operator/(double a, const Dual& b) { return chain(b, a / b.v, -a / (b.v * b.v)); }

  /// f(a) with f and f′ given: the one rule behind every function below.
  friend Dual chain(const Dual& a, double f, double df) {
    Dual r;
    r.v = f;
    for (int k = 0; k < N; ++k) r.d[k] = df * a.d[k];
    return r;
  }
  friend Dual exp(const Dual& a) {
    const double f = std::exp(a.v);
    return chain(a, f, f);
  }
  friend Dual expm1(const Dual& a) {
    const double f = std::expm1(a.v);
    return chain(a, f, f + 1);
  }
  friend Dual log1p(const Dual& a) { return chain(a, std::log1p(a.v), 1.0 / (1.0 + a.v)); }
  friend Dual log(const Dual& a) { return chain(a, std::log(a.v), 1.0 / a.v); }
  friend Dual relative_expm1(const Dual& a) {
    return chain(a, relative_expm1(a.v), relative_expm1_slope(a.v));
  }
  friend Dual sqrt(const Dual& a) {
    const double f = std::sqrt(a.v);
    return chain(a, f, 0.5 / f);
  }
};

/// The value of a scalar, whatever its type.
inline double value_of(double a) {
  return a;
}
template <int N>
double value_of(const Dual<N>& a) {
  return a.v;
}

/// Derivative-free zero of a function that is only ever multiplied by something that vanishes at least as
/// fast: √s with d√s := 0 at s = 0 (used for s·√s, whose derivative at 0 is 0).
inline double sqrt_flat(double s) {
  return std::sqrt(s);
}
template <int N>
Dual<N> sqrt_flat(const Dual<N>& s) {
  if (s.v <= 0) return Dual<N>(0.0);
  return sqrt(s);
}

}  // namespace RHYTID_ISA
}  // namespace rhytid
