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
  constexpr int width = kLanes;
  // Copies, not casts: rows are only aligned to 8 bytes, and GCC drops a lowered alignment of a vector type
  // in deduction.
  const auto load = [](const double* p, Lanes& v) { std::memcpy(&v, p, sizeof v); };
  const auto store = [](double* p, const Lanes& v) { std::memcpy(p, &v, sizeof v); };
  constexpr int tile = 2 * width;
  for (int i = 0; i < n8; i += 4)
    for (int j = upper ? i / tile * tile : 0; j < n8; j += tile) {
      double* row[4];
      for (int r = 0; r < 4; ++r) row[r] = c + static_cast<std::size_t>(i + r) * n8 + j;
      Lanes s00, s01, s10, s11, s20, s21, s30, s31, b0, b1;
      load(row[0], s00), load(row[0] + width, s01), load(row[1], s10), load(row[1] + width, s11);
      load(row[2], s20), load(row[2] + width, s21), load(row[3], s30), load(row[3] + width, s31);
      for (int k = 0; k < rows; ++k) {
        load(b + static_cast<std::size_t>(k) * n8 + j, b0);
        load(b + static_cast<std::size_t>(k) * n8 + j + width, b1);
        const double* ak = a + static_cast<std::size_t>(k) * n8 + i;
        s00 += ak[0] * b0, s01 += ak[0] * b1;
        s10 += ak[1] * b0, s11 += ak[1] * b1;
        s20 += ak[2] * b0, s21 += ak[2] * b1;
        s30 += ak[3] * b0, s31 += ak[3] * b1;
      }
      store(row[0], s00), store(row[0] + width, s01), store(row[1], s10), store(row[1] + width, s11);
      store(row[2], s20), store(row[2] + width, s21), store(row[3], s30), store(row[3] + width, s31);
    }
}

}  // namespace RHYTID_ISA
}  // namespace rhytid
