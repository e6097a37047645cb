// Solves with a supernodal Cholesky factor L in double or single precision, on several threads with the same bits for
// any number of them.
//
//   L y = b     supernodes ascending: y_J = L_JJ⁻¹ b_J, then b_rows −= L_rows,J y_J
//   Lᵀ x = y    descending:           x_J = L_JJ⁻ᵀ (y_J − L_rows,Jᵀ x_rows)
//
// Subtrees of the elimination tree are independent of each other, but for what they subtract from the columns above
// them: each of those that hold a small share of the factor is a piece of work for whichever thread is free, and
// keeps what it subtracts from above, which is summed in the order of the pieces. The supernodes above the pieces are
// done in order by panels; large panels are cut into blocks of rows (of columns on the way back), whose sizes do
// not depend on the number of threads.
//
// Internal to sim/solve.   Tests   tests/sim/solve/block_matrix_test.cpp, solve_threads_test.cpp
#pragma once

#include <cstddef>
#include <vector>

#include "sim/solve/supernodes.h"

namespace rhytid {

/// How the work of a solve is divided: found once, from the structure alone.
class SupernodalSolve {
 public:
  explicit SupernodalSolve(const Supernodes& supernodes);

  /// x [size][columns] by columns, in the factor's order: L Lᵀ X = B, B overwritten. Real is that of the factor's
  /// numbers. The BLAS must be on one thread per call and, with several `threads`, safe to call from several at
  /// once. Several columns at once read the factor once; their bits differ from those of one at a time.
  template <class Real>
  void solve(Real* x, int columns, int threads) const;

  /// Subtrees that threads work on independently; for tests and benchmarks.
  int num_pieces() const { return static_cast<int>(pieces_.size()); }

 private:
  /// A subtree: supernodes [first, root].
  struct Piece {
    int first, root;
    std::size_t outside_start;  ///< of what it subtracts from above, in rows
  };
  /// Columns [first, last) of a supernode above the pieces.
  struct Panel {
    int super, first, last;
    bool split;  ///< large enough for several threads
  };
  template <class Real>
  struct Work;

  int left(int s) const { return supernodes_.height(s) - supernodes_.width(s); }
  void find_pieces();
  void find_panels();
  template <class Real>
  void forward(const Piece& piece, Work<Real>& work, int thread) const;
  template <class Real>
  void backward(const Piece& piece, Work<Real>& work, int thread) const;
  template <class Real>
  void solve_top(Work<Real>& work, int thread) const;

  Supernodes supernodes_;
  std::vector<Piece> pieces_;
  std::vector<Panel> panels_;     ///< above the pieces, ascending
  std::vector<int> inside_;       ///< [supernodes] rows below the own columns that belong to the same piece
  std::vector<int> place_start_;  ///< [supernodes + 1] into places_
  std::vector<int> places_;       ///< rows outside the piece → their place below its root
  std::size_t outside_rows_ = 0;  ///< of all pieces
  int largest_height_ = 0;
  double entries_ = 0;  ///< of the factor
};

}  // namespace rhytid
