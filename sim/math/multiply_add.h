// The one dense product of the element Hessians: small, register-tiled, for the including file's instruction
// set.
#pragma once

#include <cstddef>
#include <cstring>

#include "sim/math/lanes.h"

namespace rhytid {
inline namespace RHYTID_ISA {

/// C[i][j] += Σ_k A[k][i] B[k][j], all rows padded to `n8` (multiple of 8); only columns j ≥ i (by tiles) are
/// formed when `upper` (symmetric blocks). Register tiles of 4 rows by two vectors.
inline void multiply_add(const double* a, const double* b, int rows, int n8, bool upper, double* c) {
  // Copies, not casts: rows are only aligned to 8 bytes, and GCC drops a lowered alignment of a vector type
  // in deduction.
  const auto load = [](const double* p, Lanes& v) { std::memcpy(&v, p, sizeof v); };
  const auto store = [](double* p, const Lanes& v) { std::memcpy(p, &v, sizeof v); };
  // Vectors of eight: one by one, since rows need not be a multiple of two.
  constexpr int height = 4, vectors = kLanes == 8 ? 1 : 2, tile = vectors * kLanes;
  static_assert(8 % tile == 0);
  for (int i = 0; i < n8; i += height)
    for (int j = upper ? i / tile * tile : 0; j < n8; j += tile) {
      double* const corner = c + static_cast<std::size_t>(i) * n8 + j;
      Lanes sum[height][vectors], right[vectors];
      for (int r = 0; r < height; ++r)
        for (int s = 0; s < vectors; ++s) load(corner + r * n8 + s * kLanes, sum[r][s]);
      for (int k = 0; k < rows; ++k) {
        for (int s = 0; s < vectors; ++s)
          load(b + static_cast<std::size_t>(k) * n8 + j + s * kLanes, right[s]);
        const double* ak = a + static_cast<std::size_t>(k) * n8 + i;
        for (int r = 0; r < height; ++r)
          for (int s = 0; s < vectors; ++s) sum[r][s] += ak[r] * right[s];
      }
      for (int r = 0; r < height; ++r)
        for (int s = 0; s < vectors; ++s) store(corner + r * n8 + s * kLanes, sum[r][s]);
    }
}

}  // namespace RHYTID_ISA
}  // namespace rhytid
