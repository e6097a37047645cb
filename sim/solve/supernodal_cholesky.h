// The numbers of a supernodal Cholesky factor in double or single precision, computed on several threads with
// the same bits for any number of them. CHOLMOD supplies the structure (supernodes, rows, storage).
//
//   panel P of supernode s: columns J of L, rows i ≥ J
//   L(i, P) = A(i, P) − Σ_d L(i, d) L(J, d)ᵀ − Σ_e L(i, e) L(J, e)ᵀ   d earlier supernodes, e earlier panels of s
//   then    L(J, P) by dense Cholesky, the rows below by a triangular solve
//
// Left-looking by panels: what a panel is computed from, and in which order, is fixed by the structure; threads
// only decide who computes it and when. Small subtrees of the elimination tree are one piece of work each, the
// panels above them one by one in order, waiting for what they need.
//
// Internal to sim/solve.   Tests   tests/sim/solve/block_matrix_test.cpp, solve_threads_test.cpp
#pragma once

#include <cstddef>
#include <vector>

#include "sim/solve/supernodes.h"

namespace rhytid {

/// The numeric phase for one factor: what is computed from what is found once.
class SupernodalCholesky {
 public:
  /// Of a factor with room for values.
  explicit SupernodalCholesky(const Supernodes& supernodes);

  /// Overwrites the factor's values with those of A + shift·I, A the lower triangle by columns in the factor's
  /// order. Real is double or float; floats take the first half of the same storage, which CHOLMOD must not read
  /// then. False when a pivot is not positive (the values are then meaningless); a NaN may pass. The BLAS must
  /// be on one thread per call, and, with several `threads`, safe to call from several at once.
  template <class Real>
  [[nodiscard]] bool factorize(const int* column_start, const int* rows, const double* values, double shift,
                               int threads);

  /// Calls visit(pivot) with every diagonal entry of L.
  template <class Real, class Visit>
  void for_diagonal(Visit&& visit) const {
    for (int s = 0; s < supernodes_.count(); ++s)
      for (int c = 0; c < width(s); ++c)
        visit(block<Real>(s)[static_cast<std::ptrdiff_t>(c) * (height(s) + 1)]);
  }

 private:
  struct Panel {
    int super, first, last;        ///< columns [first, last) of the supernode
    int source_begin, source_end;  ///< into sources_
  };
  /// An earlier supernode whose rows [row_begin, row_end) (of its list) are columns of the panel.
  struct Source {
    int super, row_begin, row_end;
  };
  template <class Real>
  struct Workspace;
  struct Matrix {
    const int* column_start;
    const int* rows;
    const double* values;
    double shift;
  };
  class Progress;

  int width(int s) const { return supernodes_.width(s); }
  int height(int s) const { return supernodes_.height(s); }
  const int* rows(int s) const { return supernodes_.rows(s); }
  template <class Real>
  Real* block(int s) const {
    return supernodes_.block<Real>(s);
  }
  void find_sources();
  void divide_work();
  template <class Real>
  bool compute(int panel, const Matrix& a, const Progress& progress, Workspace<Real>& work) const;
  template <class Real>
  void assemble(const Panel& panel, const Matrix& a, Workspace<Real>& work) const;
  template <class Real>
  void subtract_source(const Panel& panel, const Source& source, Workspace<Real>& work) const;

  Supernodes supernodes_;
  std::vector<Panel> panels_;      ///< by supernode and column
  std::vector<int> first_panel_;   ///< [num_super + 1]
  std::vector<Source> sources_;    ///< ascending by supernode within a panel
  std::vector<int> piece_start_;   ///< [pieces + 1] into piece_panels_
  std::vector<int> piece_panels_;  ///< pieces of work in the order in which they are begun
  std::size_t product_size_ = 0;   ///< largest update of a source
  int largest_height_ = 0;
};

}  // namespace rhytid
