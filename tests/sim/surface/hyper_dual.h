// Numbers f + f₁ε₁ + f₂ε₂ + f₁₂ε₁ε₂ with ε₁² = ε₂² = 0: exact first and second derivatives, for checking the
// hand-written ones against nothing but the printed formula.
#pragma once

#include <cmath>

#include "sim/core/types.h"

namespace rhytid::testing {

struct HyperDual {
  double f = 0, f1 = 0, f2 = 0, f12 = 0;
  HyperDual() = default;
  HyperDual(double value) : f(value) {}
  HyperDual(double value, double d1, double d2, double d12) : f(value), f1(d1), f2(d2), f12(d12) {}
};

/// h(a) from h, h', h'' at a.f.
inline HyperDual chain(const HyperDual& a, double h, double dh, double ddh) {
  return {h, dh * a.f1, dh * a.f2, dh * a.f12 + ddh * a.f1 * a.f2};
}
inline HyperDual operator+(const HyperDual& a, const HyperDual& b) {
  return {a.f + b.f, a.f1 + b.f1, a.f2 + b.f2, a.f12 + b.f12};
}
inline HyperDual operator-(const HyperDual& a, const HyperDual& b) {
  return {a.f - b.f, a.f1 - b.f1, a.f2 - b.f2, a.f12 - b.f12};
}
inline HyperDual operator*(const HyperDual& a, const HyperDual& b) {
  return {a.f * b.f, a.f1 * b.f + a.f * b.f1, a.f2 * b.f + a.f * b.f2,
          a.f12 * b.f + a.f1 * b.f2 + a.f2 * b.f1 + a.f * b.f12};
}
inline HyperDual operator/(const HyperDual& a, const HyperDual& b) {
  const double i = 1 / b.f;
  return a * chain(b, i, -i * i, 2 * i * i * i);
}
inline HyperDual sqrt(const HyperDual& a) {
  const double r = std::sqrt(a.f);
  return chain(a, r, 0.5 / r, -0.25 / (r * a.f));
}

struct ExactJet {
  double value = 0;
  Vec3 gradient = Vec3::Zero();
  Mat3 hessian = Mat3::Zero();
};

/// Value, gradient and Hessian of f(const HyperDual (&x)[3]) at x.
template <class F>
ExactJet exact_jet(const Vec3& x, const F& f) {
  ExactJet jet;
  for (int i = 0; i < 3; ++i)
    for (int j = 0; j < 3; ++j) {
      HyperDual v[3];
      for (int k = 0; k < 3; ++k) v[k] = HyperDual(x[k], k == i ? 1 : 0, k == j ? 1 : 0, 0);
      const HyperDual y = f(v);
      jet.value = y.f;
      jet.gradient[i] = y.f1;
      jet.hessian(i, j) = y.f12;
    }
  return jet;
}

}  // namespace rhytid::testing
