#include "sim/solve/supernodal_cholesky.h"

#include <algorithm>
#include <atomic>
#include <exception>

#include "sim/core/parallel.h"
#include "sim/solve/blas.h"

namespace rhytid {

namespace {

constexpr int kPanelWidth = 128;
// Subtrees of at most this share of all floating-point operations are one piece of work.
constexpr double kPieceShare = 1. / 64;
// Updates of fewer columns are not worth the second call that leaves out their upper triangle.
constexpr int kTriangleFrom = 32;

}  // namespace

/// What a thread needs for itself.
template <class Real>
struct SupernodalCholesky::Workspace {
  std::vector<int> place;   ///< [size of the matrix] row → row of the panel's supernode
  std::vector<int> target;  ///< the same for the rows of a source
  std::vector<int> runs;    ///< where target jumps
  std::vector<Real> product;
};

/// Which panels are finished, and whether all went well so far.
class SupernodalCholesky::Progress {
 public:
  explicit Progress(std::size_t panels) : done_(panels) {}
  void wait_for(int panel) const {
    done_[static_cast<std::size_t>(panel)].wait(0, std::memory_order_acquire);
  }
  void finish(int panel) {
    // Sequentially consistent, not only a release: notify_all() wakes nobody when it reads that nobody waits, and
    // that read must not come before the store.
    done_[static_cast<std::size_t>(panel)].store(1, std::memory_order_seq_cst);
    done_[static_cast<std::size_t>(panel)].notify_all();
  }
  int next_piece() { return next_.fetch_add(1, std::memory_order_relaxed); }
  void fail() { failed_.store(true, std::memory_order_relaxed); }
  bool failed() const { return failed_.load(std::memory_order_relaxed); }

 private:
  std::vector<std::atomic<int>> done_;
  std::atomic<int> next_{0};
  std::atomic<bool> failed_{false};
};

SupernodalCholesky::SupernodalCholesky(const Supernodes& supernodes) : supernodes_(supernodes) {
  for (int s = 0; s < supernodes_.count(); ++s) {
    first_panel_.push_back(static_cast<int>(panels_.size()));
    for (int first = 0; first < width(s); first += kPanelWidth)
      panels_.push_back({s, first, std::min(first + kPanelWidth, width(s)), 0, 0});
    largest_height_ = std::max(largest_height_, height(s));
  }
  first_panel_.push_back(static_cast<int>(panels_.size()));
  find_sources();
  divide_work();
}

void SupernodalCholesky::find_sources() {
  const std::vector<int> super_of = supernodes_.of_columns();
  // Visits (panel, source) for all pairs, sources ascending.
  const auto for_pairs = [&](auto&& visit) {
    for (int d = 0; d < supernodes_.count(); ++d) {
      const int* row = rows(d);
      const int n = height(d);
      for (int k = width(d), end = k; k < n; k = end) {
        const int s = super_of[row[k]];
        const int panel = first_panel_[s] + (row[k] - supernodes_.first(s)) / kPanelWidth;
        const int past = supernodes_.first(s) + panels_[panel].last;
        for (end = k; end < n && row[end] < past;) ++end;
        visit(panel, Source{d, k, end});
      }
    }
  };
  for_pairs([&](int panel, const Source& source) {
    ++panels_[panel].source_end;
    product_size_ =
        std::max(product_size_, static_cast<std::size_t>(height(source.super) - source.row_begin) *
                                    static_cast<std::size_t>(source.row_end - source.row_begin));
  });
  int total = 0;
  for (Panel& panel : panels_) {
    const int count = panel.source_end;
    panel.source_begin = panel.source_end = total;
    total += count;
  }
  sources_.resize(static_cast<std::size_t>(total));
  for_pairs([&](int panel, const Source& source) { sources_[panels_[panel].source_end++] = source; });
}

void SupernodalCholesky::divide_work() {
  // Work of a supernode where it is a source or itself, summed over its subtree.
  std::vector<double> work(supernodes_.count(), 0.0);
  const std::vector<int> parent = supernodes_.parents();
  for (const Panel& panel : panels_)
    for (int k = panel.source_begin; k < panel.source_end; ++k) {
      const Source& source = sources_[k];
      work[panel.super] += 2. * width(source.super) * (source.row_end - source.row_begin) *
                           (height(source.super) - source.row_begin);
    }
  double total = 0;
  for (int s = 0; s < supernodes_.count(); ++s) {
    work[s] += static_cast<double>(width(s)) * width(s) * height(s);
    total += work[s];
  }
  for (int s = 0; s < supernodes_.count(); ++s)
    if (parent[s] >= 0) work[parent[s]] += work[s];

  // root[s]: the topmost supernode of the small subtree that s belongs to, -1 above them.
  std::vector<int> root(supernodes_.count(), -1);
  for (int s = supernodes_.count() - 1; s >= 0; --s) {
    if (work[s] > kPieceShare * total) continue;
    root[s] = parent[s] >= 0 && root[parent[s]] >= 0 ? root[parent[s]] : s;
  }
  piece_start_ = {0};
  const auto add = [&](int s) {
    for (int panel = first_panel_[s]; panel < first_panel_[s + 1]; ++panel) piece_panels_.push_back(panel);
  };
  const auto close = [&] { piece_start_.push_back(static_cast<int>(piece_panels_.size())); };
  std::vector<std::vector<int>> members(supernodes_.count());
  for (int s = 0; s < supernodes_.count(); ++s)
    if (root[s] >= 0) members[root[s]].push_back(s);
  for (int s = 0; s < supernodes_.count(); ++s) {
    if (members[s].empty()) continue;
    for (const int member : members[s]) add(member);
    close();
  }
  for (int s = 0; s < supernodes_.count(); ++s) {
    if (root[s] >= 0) continue;
    for (int panel = first_panel_[s]; panel < first_panel_[s + 1]; ++panel) {
      piece_panels_.push_back(panel);
      close();
    }
  }
}

template <class Real>
void SupernodalCholesky::assemble(const Panel& panel, const Matrix& a, Workspace<Real>& work) const {
  const int s = panel.super, n = height(s);
  Real* const x = block<Real>(s);
  const int* const row = rows(s);
  for (int i = panel.first; i < n; ++i) work.place[row[i]] = i;
  for (int c = panel.first; c < panel.last; ++c) {
    Real* const column = x + static_cast<std::ptrdiff_t>(c) * n;
    std::fill(column + panel.first, column + n, Real(0));
    const int j = supernodes_.first(s) + c;
    // The diagonal entry is the first of its column.
    for (int e = a.column_start[j]; e < a.column_start[j + 1]; ++e)
      column[work.place[a.rows[e]]] = static_cast<Real>(a.values[e]);
    column[c] = static_cast<Real>(a.values[a.column_start[j]] + a.shift);
  }
}

template <class Real>
void SupernodalCholesky::subtract_source(const Panel& panel, const Source& source,
                                         Workspace<Real>& work) const {
  const int d = source.super, k = width(d), ld = height(d);
  const int columns = source.row_end - source.row_begin, rows_left = ld - source.row_begin;
  const Real* const from = block<Real>(d) + source.row_begin;
  Real* const product = work.product.data();
  const Real one = 1, zero = 0;
  if (columns < kTriangleFrom) {
    Blas<Real>::gemm("N", "T", &rows_left, &columns, &k, &one, from, &ld, from, &ld, &zero, product,
                     &rows_left);
  } else {
    Blas<Real>::syrk("L", "N", &columns, &k, &one, from, &ld, &zero, product, &rows_left);
    const int below = rows_left - columns;
    if (below > 0)
      Blas<Real>::gemm("N", "T", &below, &columns, &k, &one, from + columns, &ld, from, &ld, &zero,
                       product + columns, &rows_left);
  }
  // Rows come in runs that also follow each other in the panel: at least the components of a node, mostly a
  // column of nodes through the skin and its neighbours.
  const int* const row = rows(d) + source.row_begin;
  int* const target = work.target.data();
  work.runs.clear();
  for (int i = 0; i < rows_left; ++i) {
    target[i] = work.place[row[i]];
    if (i == 0 || target[i] != target[i - 1] + 1) work.runs.push_back(i);
  }
  work.runs.push_back(rows_left);
  const int s = panel.super, n = height(s);
  Real* const x = block<Real>(s);
  std::size_t first_run = 0;  // with rows at or below the diagonal of column j
  for (int j = 0; j < columns; ++j) {
    Real* const column = x + static_cast<std::ptrdiff_t>(target[j]) * n;
    const Real* const p = product + static_cast<std::ptrdiff_t>(j) * rows_left;
    while (work.runs[first_run + 1] <= j) ++first_run;
    for (std::size_t r = first_run; r + 1 < work.runs.size(); ++r) {
      const int begin = std::max(work.runs[r], j), count = work.runs[r + 1] - begin;
      Real* const to = column + target[begin];
      const Real* const subtracted = p + begin;
      for (int i = 0; i < count; ++i) to[i] -= subtracted[i];
    }
  }
}

template <class Real>
bool SupernodalCholesky::compute(int index, const Matrix& a, const Progress& progress,
                                 Workspace<Real>& work) const {
  const Panel& panel = panels_[static_cast<std::size_t>(index)];
  const int s = panel.super, n = height(s), columns = panel.last - panel.first;
  assemble(panel, a, work);
  for (int k = panel.source_begin; k < panel.source_end; ++k) {
    progress.wait_for(first_panel_[sources_[k].super + 1] - 1);
    if (progress.failed()) return false;
    subtract_source(panel, sources_[k], work);
  }
  const auto at = [&](int i, int j) { return block<Real>(s) + static_cast<std::ptrdiff_t>(j) * n + i; };
  const Real one = 1, minus_one = -1;
  const int rows_left = n - panel.first, below = n - panel.last;
  for (int e = first_panel_[s]; e < index; ++e) {
    const int first = panels_[static_cast<std::size_t>(e)].first, k = kPanelWidth;
    progress.wait_for(e);
    if (progress.failed()) return false;
    Blas<Real>::gemm("N", "T", &rows_left, &columns, &k, &minus_one, at(panel.first, first), &n,
                     at(panel.first, first), &n, &one, at(panel.first, panel.first), &n);
  }
  int info = 0;
  Blas<Real>::potrf("L", &columns, at(panel.first, panel.first), &n, &info);
  if (info != 0) return false;
  if (below > 0)
    Blas<Real>::trsm("R", "L", "T", "N", &below, &columns, &one, at(panel.first, panel.first), &n,
                     at(panel.last, panel.first), &n);
  return true;
}

template <class Real>
bool SupernodalCholesky::factorize(const int* column_start, const int* rows, const double* values,
                                   double shift, int threads) {
  const Matrix a{column_start, rows, values, shift};
  Progress progress(panels_.size());
  const int pieces = static_cast<int>(piece_start_.size()) - 1;
  parallel_for(threads, [&](std::int64_t) {
    Workspace<Real> work;
    std::exception_ptr failure;
    for (int piece = progress.next_piece(); piece < pieces; piece = progress.next_piece())
      for (int k = piece_start_[piece]; k < piece_start_[piece + 1]; ++k) {
        const int panel = piece_panels_[k];
        // Whatever happens, a panel that was taken is finished, or those that wait for it would do so for ever.
        try {
          if (work.place.empty()) {
            work.place.resize(supernodes_.size());
            work.target.resize(static_cast<std::size_t>(largest_height_));
            work.product.resize(product_size_);
          }
          if (!progress.failed() && !compute(panel, a, progress, work)) progress.fail();
        } catch (...) {
          failure = std::current_exception();
          progress.fail();
        }
        progress.finish(panel);
      }
    if (failure) std::rethrow_exception(failure);
  });
  return !progress.failed();
}

template bool SupernodalCholesky::factorize<double>(const int*, const int*, const double*, double, int);
template bool SupernodalCholesky::factorize<float>(const int*, const int*, const double*, double, int);

}  // namespace rhytid
