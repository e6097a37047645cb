// --threads: one number for the loops of sim, for OpenMP and for OpenBLAS; and what a thread does that waits.
#pragma once

namespace rhytid::tools {

inline constexpr int max_threads = 1024;  ///< sanity bound of --threads

/// Cores this process may run on (affinity counted).
int available_threads();

/// Sets the three to n threads, n in 1..max_threads.
void use_threads(int n);

/// Makes OpenMP threads that wait sleep instead of spin, so that programs side by side leave each other the
/// cores. The first line of main: libgomp reads OMP_WAIT_POLICY once, when it is loaded, hence before main,
/// so this sets the variable to passive and starts the program anew in the same process (execv of
/// /proc/self/exe). Loading the libraries a second time takes 6 ms of processor time for rhytid-forward, but
/// 180 ms for rhytid, whose 260 libraries come with OpenCV (measured on a busy machine); so only a call that
/// names a verb pays it. The process then takes its name back, which pgrep and top show (it would be "exe").
///
/// Returns, and all goes on with spinning threads, when OMP_WAIT_POLICY or GOMP_SPINCOUNT is set already (by
/// the user, who is then obeyed, or by this function, which so acts once at most), and when starting anew is
/// impossible: no /proc, or run through the dynamic loader (ld.so rhytid ...).
/// A tracer that does not follow exec (valgrind without --trace-children=yes) wants OMP_WAIT_POLICY set.
void let_waiting_threads_sleep(int argc, char** argv);

}  // namespace rhytid::tools
