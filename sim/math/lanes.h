// A pack of doubles, one lane per material point, and the few functions that generic code needs for a double
// and for a pack alike. Eigen-free: compiled once per instruction set.
//
// Tests    tests/sim/math/spectral3_test.cpp
#pragma once

#include <cmath>
#include <cstring>

#include "sim/math/isa.h"

namespace rhytid {
inline namespace RHYTID_ISA {

#ifdef __AVX__
inline constexpr int kLanes = 4;
#else
inline constexpr int kLanes = 2;
#endif
typedef double Lanes __attribute__((vector_size(8 * kLanes)));
typedef long long LaneMask __attribute__((vector_size(8 * kLanes)));

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
  bool any = false;
  for (int k = 0; k < kLanes; ++k) any = any || condition[k];
  return any;
}

/// The same number in every lane.
template <class V>
V broadcast(double value) {
  return V{} + value;
}

inline double lane_sqrt(double a) {
  return std::sqrt(a);
}
inline Lanes lane_sqrt(Lanes a) {
  Lanes r;
  for (int k = 0; k < kLanes; ++k) r[k] = std::sqrt(a[k]);
  return r;
}

/// A function of one number, lane by lane (those of the C library have no vector form here).
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
