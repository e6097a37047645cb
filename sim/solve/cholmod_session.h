// RAII around CHOLMOD's common object and around the threads that its calls may use. Internal to sim/solve.
#pragma once

#include <cholmod.h>

#include <cstddef>

namespace rhytid {

/// Owns a cholmod_common: silent (no messages, no error handler), 32-bit indices. Not for use by two threads
/// at once.
class CholmodSession {
 public:
  CholmodSession() {
    cholmod_start(&common_);
    common_.print = 0;
    common_.error_handler = nullptr;
    common_.try_catch = 1;
  }
  ~CholmodSession() { cholmod_finish(&common_); }
  CholmodSession(const CholmodSession&) = delete;
  CholmodSession& operator=(const CholmodSession&) = delete;
  cholmod_common* operator&() { return &common_; }
  cholmod_common* operator->() { return &common_; }

 private:
  cholmod_common common_;
};

/// Whether several threads may call OpenBLAS at once: builds with threads of any kind lock what they share, the
/// sequential build does not.
bool blas_is_reentrant();

/// While one is alive anywhere in the process, OpenBLAS runs every call on the thread that makes it; the last to
/// go sets back what the first found.
class SingleThreadBlas {
 public:
  SingleThreadBlas();
  ~SingleThreadBlas();
  SingleThreadBlas(const SingleThreadBlas&) = delete;
  SingleThreadBlas& operator=(const SingleThreadBlas&) = delete;
};

/// While alive, this thread's calls into CHOLMOD and OpenBLAS run on this thread alone. CHOLMOD 3's OpenMP
/// regions carry a hard-coded num_threads(4), which the environment's thread count does not override; with no
/// active level allowed, the OpenMP runtime runs them on the calling thread.
class SingleThreadScope {
 public:
  SingleThreadScope();
  ~SingleThreadScope();
  SingleThreadScope(const SingleThreadScope&) = delete;
  SingleThreadScope& operator=(const SingleThreadScope&) = delete;

 private:
  SingleThreadBlas blas_;
  int active_levels_;
};

/// A view of the lower triangle of a symmetric pattern by columns, rows sorted: no values, owns nothing
/// (CHOLMOD's fields are not const, but it only reads them).
cholmod_sparse lower_pattern(std::size_t size, std::size_t num_entries, const int* column_start,
                             const int* rows);

/// Throws std::bad_alloc or std::length_error when CHOLMOD ran out of memory or of 32-bit indices, and
/// std::runtime_error on any other failure of status < 0. Warnings (not positive definite) pass.
void throw_on_cholmod_error(const cholmod_common& common);

}  // namespace rhytid
