#include "adjoint/checkpoint_schedule.h"

#include <algorithm>
#include <limits>

#include "sim/core/error.h"

namespace rhytid::adjoint {
namespace {

/// N(s, r), or the largest number when it exceeds `enough`.
long reached(long s, long r, long enough) {
  if (r < 0) return -1;
  double product = 1;  // C(s + r + 1, r), exact below 2^53
  for (long k = 1; k <= r; ++k) {
    product = product * static_cast<double>(s + 1 + k) / static_cast<double>(k);
    if (product - 1 > static_cast<double>(enough)) return std::numeric_limits<long>::max();
  }
  return static_cast<long>(product + 0.5) - 1;
}

}  // namespace

long checkpoint_distance(long n, long s) {
  require(n >= 1 && s >= 0, "checkpoint_distance: n >= 1 and s >= 0");
  if (n == 1 || s == 0) return n;
  long r = 1;
  while (reached(s, r, n) < n) ++r;
  // As far as the slots left behind allow: n − m ≤ N(s − 1, r), but not so near that a round is wasted.
  const long beyond = reached(s - 1, r, n);
  return std::clamp(std::max(beyond >= n ? 0 : n - beyond, reached(s, r - 2, n) + 1), 1L, n - 1);
}

long checkpoint_advances(long n, long s) {
  long total = 0;
  // The upper part by recursion (no deeper than s), the lower part by the loop.
  while (n > 0) {
    if (s == 0) return total + n * (n + 1) / 2;
    const long m = checkpoint_distance(n, s);
    total += m + (m < n ? checkpoint_advances(n - m, s - 1) : 0);
    n = m - 1;
  }
  return total;
}

}  // namespace rhytid::adjoint
