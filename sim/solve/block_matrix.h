// Symmetric sparse matrix of 3×3 node blocks, assembled from dense cliques (elements) straight into the
// fill-reduced order that the factorisation wants, so that nothing is permuted per factorisation.
#pragma once

#include <memory>
#include <optional>
#include <span>
#include <vector>

#include "sim/core/types.h"

namespace rhytid {

/// The sparsity of a mesh problem: which block rows couple (cliques), the fill-reducing order of the blocks
/// (AMD; on large meshes the better of AMD and METIS), and where each clique's entries go. Immutable.
class BlockPattern {
 public:
  /// cliques[c] lists the distinct block indices (0..num_blocks−1) that clique c couples. A block index of −1
  /// means "not an unknown": its rows and columns are dropped on assembly.
  BlockPattern(int num_blocks, std::vector<std::vector<int>> cliques);
  ~BlockPattern();
  int num_blocks() const;
  int num_unknowns() const { return 3 * num_blocks(); }
  int num_cliques() const;
  std::span<const int> clique(int c) const;
  /// Stored scalars of the lower triangle.
  std::size_t num_entries() const;

  struct Impl;
  const Impl& impl() const { return *impl_; }

 private:
  std::unique_ptr<Impl> impl_;
};

/// Values over a BlockPattern (which must outlive it).
class BlockMatrix {
 public:
  explicit BlockMatrix(const BlockPattern& pattern);
  void set_zero();
  /// Adds a clique's dense symmetric matrix, [3m][3m] row-major, m = clique size, node-major xyz. Only the
  /// lower triangle is read. Not thread-safe; called in a fixed order so that sums are deterministic.
  void add(int clique, const double* dense);
  /// Turns unknown i (unpermuted index) into an identity row and column: entries zero, diagonal 1.
  void fix(int unknown);
  /// y = A x, both in the unpermuted order.
  VectorXd multiply(const VectorXd& x) const;
  double diagonal_max() const;
  const BlockPattern& pattern() const { return *pattern_; }
  std::span<double> values() { return values_; }
  std::span<const double> values() const { return values_; }

 private:
  const BlockPattern* pattern_;
  std::vector<double> values_;
};

/// Of a factor's numbers. Those in single precision solve to some seven digits less the decimal logarithm of the
/// condition number: a preconditioner, no certificate.
enum class Precision { full, single };

/// Supernodal Cholesky over OpenBLAS: CHOLMOD analyses once per object, whose pattern must outlive it; numbers and
/// solves are our own, on num_threads() threads with the same bits for any number of them
/// (supernodal_cholesky.h, supernodal_solve.h). Throws std::bad_alloc or std::length_error when the factor does not fit.
class CholeskyFactor {
 public:
  explicit CholeskyFactor(const BlockPattern& pattern);
  ~CholeskyFactor();
  CholeskyFactor(CholeskyFactor&&) noexcept;
  /// Factorises A + shift·I. False when not positive definite (in single precision: as far as that sees) or not
  /// finite (the factor is then unusable).
  [[nodiscard]] bool factorize(const BlockMatrix& matrix, double shift = 0,
                               Precision precision = Precision::full);
  bool usable() const;
  Precision precision() const;  ///< of the last factorisation
  /// Solves A X = B for [num_unknowns][k] right-hand sides, unpermuted order; by several threads at once if need be.
  MatrixXd solve(const MatrixXd& rhs) const;
  /// The same with one step of iterative refinement against `matrix`, which must be the matrix factorised.
  MatrixXd solve(const BlockMatrix& matrix, const MatrixXd& rhs) const;
  /// The solution of A x = b by conjugate gradients with this factor as preconditioner, to |b − A x| ≤ 2 tolerance
  /// |b|; `matrix` must be the matrix factorised (without shift). Nothing when that takes more than
  /// `max_iterations` or meets a direction of negative curvature.
  std::optional<VectorXd> solve_iteratively(const BlockMatrix& matrix, const VectorXd& rhs, double tolerance,
                                            int max_iterations) const;
  /// Smallest and largest diagonal of L², a cheap measure of how near to singular A is.
  double smallest_pivot() const;
  double largest_pivot() const;
  std::size_t factor_entries() const;  ///< nnz(L) stored
  double factor_flops() const;         ///< floating-point operations of one factorisation, by the analysis

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace rhytid
