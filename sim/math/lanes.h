// A pack of doubles, one lane per material point, and the few functions that generic code needs for a double
// and for a pack alike. Eigen-free: compiled once per instruction set.
//
// Tests    tests/sim/math/lane_functions_test.cpp, tests/sim/terms/skin_response_test.cpp
#pragma once

#include <cmath>
#include <cstring>
#include <type_traits>
#include <utility>

#ifdef __AVX__
#include <immintrin.h>
#elif defined(__SSE2__)
#include <emmintrin.h>
#endif

#include "sim/math/isa.h"

namespace rhytid {
inline namespace RHYTID_ISA {

#if defined(__AVX512F__) && defined(__AVX512DQ__)
inline constexpr int kLanes = 8;
#elif defined(__AVX__)
inline constexpr int kLanes = 4;
#else
inline constexpr int kLanes = 2;
#endif
typedef double Lanes __attribute__((vector_size(8 * kLanes)));
typedef long long LaneMask __attribute__((vector_size(8 * kLanes)));
typedef unsigned long long LaneBits __attribute__((vector_size(8 * kLanes)));

/// What comparing two V gives.
template <class V>
struct MaskOf {
  using type = bool;
};
template <>
struct MaskOf<Lanes> {
  using type = LaneMask;
};

/// a where the condition holds, else b.
inline double select(bool condition, double a, double b) {
  return condition ? a : b;
}
inline Lanes select(LaneMask condition, Lanes a, Lanes b) {
  return condition ? a : b;
}

inline bool any_of(bool condition) {
  return condition;
}
inline bool any_of(LaneMask condition) {
#if defined(__AVX512F__) && defined(__AVX512DQ__)
  return _mm512_movepi64_mask(reinterpret_cast<__m512i>(condition)) != 0;
#elif defined(__AVX__)
  return _mm256_movemask_pd(reinterpret_cast<__m256d>(condition)) != 0;
#elif defined(__SSE2__)
  return _mm_movemask_pd(reinterpret_cast<__m128d>(condition)) != 0;
#else
  bool any = false;
  for (int k = 0; k < kLanes; ++k) any = any || condition[k];
  return any;
#endif
}

/// The same number in every lane.
template <class V>
V broadcast(double value) {
  if constexpr (std::is_same_v<V, Lanes>)
    return value - V{};  // unlike + V{}, which changes −0, no operation
  else
    return V{} + value;
}

inline double lane_sqrt(double a) {
  return std::sqrt(a);
}
inline Lanes lane_sqrt(Lanes a) {
#if defined(__AVX512F__) && defined(__AVX512DQ__)
  return _mm512_sqrt_pd(a);
#elif defined(__AVX__)
  return _mm256_sqrt_pd(a);
#elif defined(__SSE2__)
  return _mm_sqrt_pd(a);
#else
  Lanes r;
  for (int k = 0; k < kLanes; ++k) r[k] = std::sqrt(a[k]);
  return r;
#endif
}

/// The bits of doubles as numbers, and back.
inline unsigned long long lane_bits(double a) {
  unsigned long long bits;
  std::memcpy(&bits, &a, sizeof bits);
  return bits;
}
inline double lane_from_bits(unsigned long long bits) {
  double a;
  std::memcpy(&a, &bits, sizeof a);
  return a;
}
inline LaneBits lane_bits(Lanes a) {
  return reinterpret_cast<LaneBits>(a);
}
inline Lanes lane_from_bits(LaneBits bits) {
  return reinterpret_cast<Lanes>(bits);
}

/// f(0), f(1) ... f(count − 1), the argument a constant: unlike a loop it keeps arrays of packs in registers.
template <int count, class F>
[[gnu::always_inline]] inline void unroll(F&& f) {
  [&]<int... k>(std::integer_sequence<int, k...>) __attribute__((always_inline)) {
    (f(std::integral_constant<int, k>{}), ...);
  }
  (std::make_integer_sequence<int, count>{});
}

/// A function of one number, lane by lane: for what has no vector form, or needs none.
template <class F>
double map_lanes(F f, double a) {
  return f(a);
}
template <class F>
Lanes map_lanes(F f, Lanes a) {
  Lanes r;
  for (int k = 0; k < kLanes; ++k) r[k] = f(a[k]);
  return r;
}

}  // namespace RHYTID_ISA
}  // namespace rhytid
