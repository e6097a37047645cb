// The deviator of ln A for a 3×3 matrix A with positive eigenvalues, as a polynomial in the deviator D of A:
// no eigenvectors, and for A = B⁻¹C with B, C symmetric no symmetric form either.
//
//   dev ln A = a₁ D + a₂ (D² − ⅔ J₂ I),   D = A − c I,  c = tr A/3,  J₂ = ½ tr D²,  J₃ = det D
//   a₂ = f[x₀,x₁,x₂],  a₁ = f[x₀,x₁] + x₂ a₂      divided differences of f(x) = ln(c + x)
//
// x₀ = ±2 √(J₂/3) cos(φ/3), cos φ = |J₃|/2 (3/J₂)^{3/2}, is the eigenvalue of D that lies by itself; x₁, x₂ may meet.
// They are known to √ε then, but they are the roots of a polynomial that is off by ε, and that is what
// interpolation feels. cos(φ/3) by Newton's method without trigonometric functions.
//
// Errors are a few ε of the largest eigenvalue: right to rounding of the natural scale for spreads of
// eigenvalues up to some tens. `ordinary` is false beyond a hundred (ratios of stretches 10 : 1), and where a number
// is NaN or an eigenvalue is not positive; eigenvectors are the way then (spectral3.h).
//
// Units    dimensionless
// Smooth   analytic in A; exact zero at multiples of I.
// Tests    tests/sim/math/log_deviator_test.cpp (accuracy table)
#pragma once

#include "sim/math/lane_functions.h"

namespace rhytid {
inline namespace RHYTID_ISA {

template <class V>
struct LogDeviator {
  V a1, a2;                           ///< coefficients above
  V third_trace;                      ///< ⅔ J₂
  V square;                           ///< Σ e_i², e_i the eigenvalues of dev ½ ln A
  typename MaskOf<V>::type ordinary;  ///< else the rest means nothing
};

/// From c, J₂, J₃ of A. V is double or a pack.
template <class V>
[[gnu::always_inline]] inline LogDeviator<V> log_deviator(const V& c, const V& j2, const V& j3) {
  constexpr double tiny = 1e-50, root3 = 1.7320508075688772;
  const V square = select(j2 < 0, broadcast<V>(0), j2 * (1. / 3)), p = lane_sqrt(square);  // NaN stays
  const V safe = select(square > tiny * tiny, square, broadcast<V>(tiny * tiny));
  const V sign = select(j3 < 0, broadcast<V>(-1), broadcast<V>(1));
  const V quotient = j3 * j3 / (4.0 * safe * safe * safe);  // cos² φ
  const V cosine2 = select(quotient < 1.0, quotient, broadcast<V>(1)), r = lane_sqrt(cosine2);
  // x = cos(φ/3) solves (4x² − 3) x = r; v → 1/(12x² − 3), the inverse slope. Fits on [0, 1] to 2e-9 and 7e-8.
  constexpr double cosine_fit[] = {0.8660254055995652,     0.16666637114449867,   -0.04810444145293348,
                                   0.024604296792329106,   -0.015107275161216753, 0.009383330570705109,
                                   -0.0049296911724297475, 0.0017648568731168984, -0.0003028542014508627};
  constexpr double slope_fit[] = {0.16666665539061973,  -0.09622320759133414,  0.0740236418506993,
                                  -0.06182075434029657, 0.05178503788418599,   -0.039226688637698834,
                                  0.023228797531703326, -0.008916746400167387, 0.0015943812592586026};
  V x = lane_polynomial(r, cosine_fit), v = lane_polynomial(r, slope_fit);
  x -= v * (x * (4.0 * x * x - 3.0) - r);
  const V rest = 1.0 - v * (12.0 * x * x - 3.0);
  v += v * (rest + rest * rest);
  // sin(φ/3) = sin φ/(4x² − 1), well defined where the two other roots meet.
  const V sine = 3.0 * v * lane_sqrt(1.0 - cosine2);
  const V along = p * x, across = root3 * p * sine, outer = along + across;
  const V l0 = c + sign * (2.0 * along), l1 = c - sign * (along - across), l2 = c - sign * outer;
  const V wide = 3.0 * along + across;  // |x₀ − x₂|
  const V inverse_wide = 1.0 / select(wide > tiny, wide, broadcast<V>(tiny));
  const LogQuotients<V> q01 = log_quotients(l0, l1, V(sign * (3.0 * along - across)));
  const LogQuotients<V> q12 = log_quotients(l1, l2, V(sign * (2.0 * across)));
  const V second = (q01.slope - q12.slope) * inverse_wide;
  LogDeviator<V> d;
  d.a1 = q01.slope - second * outer;
  d.a2 = sign * second;
  d.third_trace = 2.0 * square;
  d.square = (q01.log * (q01.log + q12.log) + q12.log * q12.log) * (1. / 6);
  constexpr double spread = 100;
  d.ordinary = (l0 * spread > l2) & (l2 * spread > l0) & (l0 > 0) & (l2 > 0);
  return d;
}

}  // namespace RHYTID_ISA
}  // namespace rhytid
