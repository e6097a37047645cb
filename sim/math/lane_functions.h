// Logarithms and exponentials for a double or a pack of them, without a call per lane.
//
//   lane_log1p      ln(1 + x)        1.7 ulp     2^k m = 1 + x, m in [√½, √2); the rounding of 1 + x corrected
//   lane_expm1      e^x − 1          2 ulp       x = k ln 2 + r
//   lane_sinhc      sinh(x)/x        3 ulp       series, or by lane_expm1 beyond 1
//   log_quotients   ln a − ln b and (ln a − ln b)/(a − b), a − b known to better than it could be formed; 5 ulp
//
// All are smooth through 0 and a = b: numbers near the rest state keep all their digits. NaN stays NaN.
//
// Tests    tests/sim/math/lane_functions_test.cpp (errors in ulps against long double)
#pragma once

#include <cmath>
#include <limits>

#include "sim/math/lanes.h"

namespace rhytid {
inline namespace RHYTID_ISA {

/// Entries first … first + count − 1 of c as a polynomial, given x, x², x⁴ ...
template <int first, int count, class V>
[[gnu::always_inline]] inline V partial_polynomial(const V* powers, const double* c) {
  if constexpr (count == 1) {
    return broadcast<V>(c[first]);
  } else if constexpr (count == 2) {
    return c[first] + c[first + 1] * powers[0];
  } else {
    constexpr int log2 = count > 8 ? 3 : count > 4 ? 2 : 1, half = 1 << log2;
    return partial_polynomial<first, half>(powers, c) +
           partial_polynomial<first + half, count - half>(powers, c) * powers[log2];
  }
}

/// c[0] + c[1] x + ..., halves side by side (Estrin's scheme): what counts is how long it takes, not how much.
template <class V, int count>
[[gnu::always_inline]] inline V lane_polynomial(const V& x, const double (&c)[count]) {
  static_assert(count <= 16);
  V powers[4] = {x};
  if constexpr (count > 2) powers[1] = x * x;
  if constexpr (count > 4) powers[2] = powers[1] * powers[1];
  if constexpr (count > 8) powers[3] = powers[2] * powers[2];
  return partial_polynomial<0, count>(powers, c);
}

/// Parts of the bits of a double.
struct DoubleBits {
  static constexpr unsigned long long one_exponent = 1ull << 52;    ///< 1 in the exponent
  static constexpr unsigned long long mantissa = one_exponent - 1;  ///< mask
  static constexpr unsigned long long one = 0x3ff0000000000000ull;  ///< of 1.0
  static constexpr unsigned long long integer =
      0x4330000000000000ull;  ///< of 2⁵²: adding n < 2⁵² to them adds n
  static constexpr double integer_value = 4503599627370496.0;
};

/// ln(1 + x): −∞ at −1, NaN below, ∞ at ∞.
template <class V>
V lane_log1p(const V& x) {
  using B = DoubleBits;
  const V w = x + 1.0;
  if (any_of(!(w > 0)) || any_of(w > std::numeric_limits<double>::max()))
    return map_lanes([](double a) { return std::log1p(a); }, x);
  const V back = w - 1.0, lost = (1.0 - (w - back)) + (x - back);  // 1 + x = w + lost
  constexpr unsigned long long root_half = 0x3fe6a09e667f3bcdull;
  const auto shifted = lane_bits(w) + (B::one - root_half);
  const V m = lane_from_bits((shifted & B::mantissa) + root_half);
  const V k = lane_from_bits((shifted >> 52) | B::integer) - (B::integer_value + 1023);
  const typename MaskOf<V>::type is_near = k == 0.0;
  const V f = select(is_near, x, m - 1.0), correction = select(is_near, broadcast<V>(0), lost / w);
  const V s = f / (f + 2.0), y = s * s, half_square = 0.5 * f * f;
  // 2 atanh(s) = f − (f²/2 − s (f²/2 + r)), r = 2 atanh(s)/s − 2: minimax for |s| ≤ 0.1716, error 1e-18
  constexpr double c[] = {2. / 3,
                          2 * 0.19999999999646603,
                          2 * 0.14285714381354733,
                          2 * 0.11111098418003659,
                          2 * 0.09091821836324158,
                          2 * 0.07656103662194594,
                          2 * 0.07406530960807016};
  const V r = y * lane_polynomial(y, c);
  constexpr double ln2_high = 0.6931471803691238, ln2_low = 1.9082149292705877e-10;
  return k * ln2_high + (f - (half_square - (s * (half_square + r) + (k * ln2_low + correction))));
}

/// e^x − 1.
template <class V>
[[gnu::always_inline]] inline V lane_expm1(const V& x) {
  using B = DoubleBits;
  constexpr double largest = 709.782712893384, magic = 6755399441055744.0;  // 1.5·2⁵²: rounds to an integer
  // Below −50 the result is −1.
  const V z = select(x > largest, broadcast<V>(largest), select(x < -50.0, broadcast<V>(-50.0), x));
  const V rounded = z * 1.4426950408889634 + magic, k = rounded - magic;
  const V r = (z - k * 0.6931471803691238) - k * 1.9082149292705877e-10;
  // (e^r − 1 − r)/r²: minimax for |r| ≤ ln 2/2, error 2e-19
  constexpr double c[] = {0.5,
                          0.1666666666666667,
                          0.04166666666666667,
                          0.008333333333326084,
                          0.0013888888888883711,
                          0.0001984126987500228,
                          2.480158732567746e-05,
                          2.755725517000089e-06,
                          2.755727347871858e-07,
                          2.5105312729622103e-08,
                          2.09147553258932e-09};
  const V grown = r + r * r * lane_polynomial(r, c);
  // 2^(k−1), so that k = 1024 does not overflow
  const V half = lane_from_bits((lane_bits(rounded) << 52) + (B::one - B::one_exponent));
  const V result = 2.0 * (half * grown + (half - 0.5));
  return select(x > largest, broadcast<V>(std::numeric_limits<double>::infinity()), result);
}

/// sinh(x)/x, even, ≥ 1; |x| < 709.
template <class V>
V lane_sinhc(const V& x) {
  const V square = x * x;
  // 1/(2k + 1)!; the first term left out is x²⁰/21!, 2e-20 at the switch.
  constexpr double c[] = {1.0,
                          1. / 6,
                          1. / 120,
                          1. / 5040,
                          1. / 362880,
                          1. / 39916800,
                          1. / 6227020800,
                          1. / 1307674368000,
                          1. / 355687428096000,
                          1. / 121645100408832000};
  const V near = lane_polynomial(square, c);
  const typename MaskOf<V>::type is_far = square > 1.0;
  if (!any_of(is_far)) return near;
  const V size = select(x < 0, -x, x), grown = lane_expm1(size);
  return select(is_far, 0.5 * (grown + grown / (grown + 1.0)) / size, near);
}

/// ln a − ln b and its quotient by a − b, for a, b > 0; `difference` = a − b. Smooth through a = b.
template <class V>
struct LogQuotients {
  V log, slope;
};
template <class V>
[[gnu::always_inline]] inline LogQuotients<V> log_quotients(const V& a, const V& b, const V& difference) {
  using B = DoubleBits;
  // a = 2^k t b with t in [0.66, 1.51], from the difference of bits, which is a piecewise linear logarithm.
  constexpr unsigned long long offset = 1ull << 62;  // 1024 in the exponent: no negative numbers
  const auto distance = lane_bits(a) - lane_bits(b) + (offset + B::one_exponent / 2);
  const auto exponent = distance & ~B::mantissa;
  const typename MaskOf<V>::type is_near = exponent == offset;  // k = 0
  const V k = lane_from_bits((distance >> 52) | B::integer) - (B::integer_value + 1024);
  const V near = lane_from_bits(lane_bits(b) + exponent - offset);  // 2^k b
  const V inverse_difference = 1.0 / difference;                    // infinite where it is not needed
  const V inverse = 1.0 / (a + near), s = select(is_near, difference, a - near) * inverse, y = s * s;
  // atanh(s)/s: minimax for |s| ≤ 0.2007, error 2e-19
  constexpr double c[] = {1.0,
                          0.3333333333333328,
                          0.20000000000035326,
                          0.1428571427673477,
                          0.11111112252974305,
                          0.09090827688281572,
                          0.07695705241546864,
                          0.06584554734295633,
                          0.06935383508033657};
  const V twice = 2.0 * lane_polynomial(y, c);
  LogQuotients<V> q;
  q.log = k * 0.6931471805599453 + s * twice;
  q.slope = select(is_near, twice * inverse, q.log * inverse_difference);
  return q;
}

}  // namespace RHYTID_ISA
}  // namespace rhytid
