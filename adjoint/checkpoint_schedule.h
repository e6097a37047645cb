// Where to keep states when a run is walked from its last step to its first and not all of them fit: binomial
// checkpoints.
//
// States 0..n are wanted in the order n, n − 1, ..., 1; state 0 is at hand; a state comes from the one before
// by an advance. With s free slots: advance m, keep that state, walk down to it with s − 1 slots, let it go,
// and walk down from m − 1:
//   P(n, s) = min_m  m + P(n − m, s − 1) + P(m − 1, s),     P(n, 0) = n (n + 1)/2
// With r advances of any step at most, the walk reaches N(s, r) = C(s + r + 1, r) − 1 states; the m below has
// the least P for every n and s.
//
// Source   A. Griewank, A. Walther, Algorithm 799: revolve (2000); the recursion here counts a kept state as
//          free once it has been walked past.   Tests   tests/adjoint/checkpoints_test.cpp
#pragma once

namespace rhytid::adjoint {

/// Advances from the state at hand to the next one to keep; n when keeping one is of no use (n = 1, or s =
/// 0). n ≥ 1 states are wanted, s ≥ 0 slots are free. Throws ContractError otherwise.
long checkpoint_distance(long n, long s);

/// Advances that the whole walk takes.
long checkpoint_advances(long n, long s);

}  // namespace rhytid::adjoint
