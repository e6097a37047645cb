// A square block of packs, rows for columns.
//
// Tests    tests/sim/terms/term_kernels_test.cpp
#pragma once

#include "sim/math/lanes.h"

namespace rhytid {
inline namespace RHYTID_ISA {

/// m[i] lane k ↔ m[k] lane i.
[[gnu::always_inline]] inline void transpose(Lanes (&m)[kLanes]) {
#if defined(__AVX512F__) && defined(__AVX512DQ__)
  __m512d pair[8];
  for (int k = 0; k < 8; k += 2) {
    pair[k] = _mm512_unpacklo_pd(m[k], m[k + 1]);
    pair[k + 1] = _mm512_unpackhi_pd(m[k], m[k + 1]);
  }
  for (int odd = 0; odd < 2; ++odd) {
    const __m512d low_even = _mm512_shuffle_f64x2(pair[odd], pair[2 + odd], 0x88),
                  low_odd = _mm512_shuffle_f64x2(pair[odd], pair[2 + odd], 0xdd),
                  high_even = _mm512_shuffle_f64x2(pair[4 + odd], pair[6 + odd], 0x88),
                  high_odd = _mm512_shuffle_f64x2(pair[4 + odd], pair[6 + odd], 0xdd);
    m[odd] = _mm512_shuffle_f64x2(low_even, high_even, 0x88);
    m[2 + odd] = _mm512_shuffle_f64x2(low_odd, high_odd, 0x88);
    m[4 + odd] = _mm512_shuffle_f64x2(low_even, high_even, 0xdd);
    m[6 + odd] = _mm512_shuffle_f64x2(low_odd, high_odd, 0xdd);
  }
#elif defined(__AVX__)
  const __m256d ab_even = _mm256_unpacklo_pd(m[0], m[1]), ab_odd = _mm256_unpackhi_pd(m[0], m[1]),
                cd_even = _mm256_unpacklo_pd(m[2], m[3]), cd_odd = _mm256_unpackhi_pd(m[2], m[3]);
  m[0] = _mm256_permute2f128_pd(ab_even, cd_even, 0x20);
  m[1] = _mm256_permute2f128_pd(ab_odd, cd_odd, 0x20);
  m[2] = _mm256_permute2f128_pd(ab_even, cd_even, 0x31);
  m[3] = _mm256_permute2f128_pd(ab_odd, cd_odd, 0x31);
#else
  static_assert(kLanes == 2);
  const Lanes a = m[0], b = m[1];
  m[0] = Lanes{a[0], b[0]};
  m[1] = Lanes{a[1], b[1]};
#endif
}

}  // namespace RHYTID_ISA
}  // namespace rhytid
