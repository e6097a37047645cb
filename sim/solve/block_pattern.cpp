#include <algorithm>
#include <limits>
#include <memory>

#include "sim/core/error.h"
#include "sim/solve/block_matrix.h"
#include "sim/solve/block_pattern_impl.h"
#include "sim/solve/cholmod_session.h"

namespace rhytid {

namespace {

// AMD gave less fill than METIS on meshes below this size; above it both are tried and the sparser factor is
// kept.
constexpr int kTryMetisFromBlocks = 40000;

/// Fill-reducing, postordered sequence of the graph whose lower triangle is given by columns: place → vertex.
std::vector<int> fill_reducing_order(int n, const std::vector<int>& column_start,
                                     const std::vector<int>& rows) {
  CholmodSession session;
  const SingleThreadScope single_thread;
  session->nmethods = n >= kTryMetisFromBlocks ? 2 : 1;
  session->method[0].ordering = CHOLMOD_AMD;
  session->method[1].ordering = CHOLMOD_METIS;
  session->postorder = 1;
  session->supernodal = CHOLMOD_SIMPLICIAL;  // only the order is wanted

  cholmod_sparse graph =
      lower_pattern(static_cast<std::size_t>(n), rows.size(), column_start.data(), rows.data());
  const auto release = [&](cholmod_factor* factor) { cholmod_free_factor(&factor, &session); };
  const std::unique_ptr<cholmod_factor, decltype(release)> factor(cholmod_analyze(&graph, &session), release);
  throw_on_cholmod_error(*&session);
  const int* order = static_cast<const int*>(factor->Perm);
  return {order, order + n};
}

}  // namespace

void BlockPattern::Impl::check_cliques() const {
  std::vector<int> last_seen(num_blocks, -1);
  for (int c = 0; c < static_cast<int>(cliques.size()); ++c) {
    for (const int b : cliques[c]) {
      require(b >= -1 && b < num_blocks, "BlockPattern: a clique names a block outside 0..num_blocks-1");
      if (b < 0) continue;
      require(last_seen[b] != c, "BlockPattern: a clique names the same block twice");
      last_seen[b] = c;
    }
  }
}

BlockPattern::Impl::Incidence BlockPattern::Impl::incidence() const {
  Incidence result;
  result.start.assign(num_blocks + 1, 0);
  for (const auto& clique : cliques)
    for (const int b : clique)
      if (b >= 0) ++result.start[b + 1];
  for (int b = 0; b < num_blocks; ++b) result.start[b + 1] += result.start[b];
  result.entries.resize(result.start[num_blocks]);
  std::vector<std::int64_t> next(result.start.begin(), result.start.end() - 1);
  for (int c = 0; c < static_cast<int>(cliques.size()); ++c)
    for (int a = 0; a < static_cast<int>(cliques[c].size()); ++a)
      if (const int b = cliques[c][a]; b >= 0) result.entries[next[b]++] = {c, a};
  return result;
}

void BlockPattern::Impl::order_blocks(const Incidence& incidence) {
  std::vector<int> start{0}, rows, last_seen(num_blocks, -1);
  start.reserve(num_blocks + 1);
  for (int j = 0; j < num_blocks; ++j) {
    const std::size_t begin = rows.size();
    rows.push_back(j);
    for (std::int64_t e = incidence.start[j]; e < incidence.start[j + 1]; ++e) {
      for (const int i : cliques[incidence.entries[e].first]) {
        if (i <= j || last_seen[i] == j) continue;
        last_seen[i] = j;
        rows.push_back(i);
      }
    }
    std::sort(rows.begin() + begin, rows.end());
    // The scalar triangle has less than 9 entries per block and must be addressable with 32 bits.
    if (rows.size() > std::numeric_limits<int>::max() / 9)
      throw std::length_error("the Hessian is too large for 32-bit indices: use a coarser mesh");
    start.push_back(static_cast<int>(rows.size()));
  }
  block_at = fill_reducing_order(num_blocks, start, rows);
  position.resize(num_blocks);
  for (int k = 0; k < num_blocks; ++k) position[block_at[k]] = k;
}

void BlockPattern::Impl::build_columns(const Incidence& incidence) {
  clique_place_start = clique_pair_start = {0};
  for (const auto& clique : cliques) {
    const std::int64_t m = static_cast<std::int64_t>(clique.size());
    for (const int b : clique) clique_places.push_back(b < 0 ? -1 : position[b]);
    clique_place_start.push_back(clique_place_start.back() + m);
    clique_pair_start.push_back(clique_pair_start.back() + m * (m + 1) / 2);
  }
  clique_pairs.assign(clique_pair_start.back(), -1);

  block_row_start = {0};
  std::vector<int> last_seen(num_blocks, -1), index_in_column(num_blocks);
  int next_value = 0;
  for (int column = 0; column < num_blocks; ++column) {
    const std::int64_t first = incidence.start[block_at[column]],
                       last = incidence.start[block_at[column] + 1];
    const std::size_t begin = block_rows.size();
    block_rows.push_back(column);
    for (std::int64_t e = first; e < last; ++e) {
      const int c = incidence.entries[e].first;
      for (std::int64_t p = clique_place_start[c]; p < clique_place_start[c + 1]; ++p) {
        const int row = clique_places[p];
        if (row <= column || last_seen[row] == column) continue;
        last_seen[row] = column;
        block_rows.push_back(row);
      }
    }
    std::sort(block_rows.begin() + begin, block_rows.end());
    const int count = static_cast<int>(block_rows.size() - begin);
    for (int k = 0; k < count; ++k) index_in_column[block_rows[begin + k]] = k;
    block_row_start.push_back(static_cast<int>(block_rows.size()));
    value_start.push_back(next_value);
    column_length.push_back(3 * count);
    next_value += 9 * count - 3;

    for (std::int64_t e = first; e < last; ++e) {
      const auto [c, local] = incidence.entries[e];
      const int* places = clique_places.data() + clique_place_start[c];
      const int m = static_cast<int>(cliques[c].size());
      for (int other = 0; other < m; ++other) {
        if (places[other] < column) continue;  // the pair belongs to the other node's column, or is dropped
        const std::int64_t a = std::max(local, other), b = std::min(local, other);
        clique_pairs[clique_pair_start[c] + a * (a + 1) / 2 + b] =
            value_start[column] + 3 * index_in_column[places[other]];
      }
    }
  }
}

void BlockPattern::Impl::build_scalar_columns() {
  left_start.assign(num_blocks + 1, 0);
  for (int column = 0; column < num_blocks; ++column)
    for (int e = block_row_start[column] + 1; e < block_row_start[column + 1]; ++e)
      ++left_start[block_rows[e] + 1];
  for (int row = 0; row < num_blocks; ++row) left_start[row + 1] += left_start[row];
  left_column.resize(left_start[num_blocks]);
  left_value.resize(left_start[num_blocks]);
  std::vector<int> next(left_start.begin(), left_start.end() - 1);
  scalar_column_start = {0};
  for (int column = 0; column < num_blocks; ++column) {
    const int begin = block_row_start[column], end = block_row_start[column + 1];
    for (int e = begin + 1; e < end; ++e) {
      const int slot = next[block_rows[e]]++;
      left_column[slot] = column;
      left_value[slot] = value_start[column] + 3 * (e - begin);
    }
    for (int c = 0; c < 3; ++c) {
      for (int e = begin; e < end; ++e)
        for (int r = e == begin ? c : 0; r < 3; ++r) scalar_rows.push_back(3 * block_rows[e] + r);
      scalar_column_start.push_back(static_cast<int>(scalar_rows.size()));
    }
  }
}

BlockPattern::BlockPattern(int num_blocks, std::vector<std::vector<int>> cliques)
    : impl_(std::make_unique<Impl>()) {
  require(num_blocks >= 1, "BlockPattern: there must be at least one block");
  impl_->num_blocks = num_blocks;
  impl_->cliques = std::move(cliques);
  impl_->check_cliques();
  const Impl::Incidence incidence = impl_->incidence();
  impl_->order_blocks(incidence);
  impl_->build_columns(incidence);
  impl_->build_scalar_columns();
}

BlockPattern::~BlockPattern() = default;
int BlockPattern::num_blocks() const {
  return impl_->num_blocks;
}
int BlockPattern::num_cliques() const {
  return static_cast<int>(impl_->cliques.size());
}
std::span<const int> BlockPattern::clique(int c) const {
  return impl_->cliques.at(c);
}
std::size_t BlockPattern::num_entries() const {
  return impl_->scalar_rows.size();
}

}  // namespace rhytid
