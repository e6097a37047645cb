// --threads: one number for the loops of sim, for OpenMP and for OpenBLAS.
#pragma once

namespace rhytid::tools {

inline constexpr int max_threads = 1024;  ///< sanity bound of --threads

/// Cores this process may run on (affinity counted).
int available_threads();

/// Sets the three to n threads, n in 1..max_threads.
void use_threads(int n);

}  // namespace rhytid::tools
