// What BlockPattern computes once: internal to sim/solve.
#pragma once

#include <cstdint>
#include <vector>

#include "sim/solve/block_matrix.h"

namespace rhytid {

/// Blocks are renumbered: position[b] is the place of block b in the fill-reducing, postordered sequence;
/// unknown 3b + r becomes 3 position[b] + r. The scalar lower triangle is stored by columns. The three scalar
/// columns of a block column share their block rows I₀ < I₁ < ... (I₀ the diagonal), and column c lacks the
/// first c entries (they are above the diagonal), so with L = 3·(number of block rows) the entry (row r of
/// the k-th block, column c) is at   start + 3k + r + δ_c,   δ = (0, L − 1, 2L − 3):
///
///     column 0: L entries | column 1: L − 1 entries | column 2: L − 2 entries
struct BlockPattern::Impl {
  int num_blocks = 0;
  std::vector<int> position;  ///< [num_blocks] block → place
  std::vector<int> block_at;  ///< [num_blocks] place → block

  // Block columns of the lower triangle, by place.
  std::vector<int> block_row_start;  ///< [num_blocks + 1] into block_rows
  std::vector<int> block_rows;       ///< places ≥ the column's, ascending
  std::vector<int> value_start;      ///< [num_blocks] position in the values of the column's entry (0, 0)
  std::vector<int> column_length;    ///< [num_blocks] L

  // Block rows strictly left of the diagonal: which columns, and the position of their entry (0, 0).
  std::vector<int> left_start, left_column, left_value;

  // Scalar compressed columns, as CHOLMOD reads them.
  std::vector<int> scalar_column_start, scalar_rows;

  // Cliques: places of the nodes (−1 dropped), and for each local pair (a ≥ b) the position of entry (0, 0).
  std::vector<std::vector<int>> cliques;
  std::vector<std::int64_t> clique_place_start, clique_pair_start;  ///< [cliques + 1]
  std::vector<int> clique_places, clique_pairs;

  void check_cliques() const;
  /// The cliques of each block: start[b]..start[b+1] into (clique, local index) pairs.
  struct Incidence {
    std::vector<std::int64_t> start;
    std::vector<std::pair<int, int>> entries;
  };
  Incidence incidence() const;
  void order_blocks(const Incidence& incidence);
  void build_columns(const Incidence& incidence);
  void build_scalar_columns();
};

}  // namespace rhytid
