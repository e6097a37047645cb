#include "sim/solve/supernodal_solve.h"

#include <omp.h>

#include <algorithm>
#include <atomic>
#include <vector>

#include "sim/core/error.h"
#include "sim/solve/blas.h"

namespace rhytid {

namespace {

// A piece holds at most this share of the factor's entries: several for every thread, and little left above them.
constexpr double kPieceShare = 1. / 24;
constexpr int kPanelWidth = 128;
// Panels with fewer entries below their triangle are not worth two meetings of the threads (a microsecond each).
constexpr std::ptrdiff_t kSplitFrom = 24'000;
// With fewer entries to multiply by, threads take as long to meet as they save.
constexpr double kThreadsFrom = 1.5e6;
constexpr int kRowsAtOnce = 192, kColumnsAtOnce = 32;

/// X := L⁻¹ X or L⁻ᵀ X for a triangle of n columns.
template <class Real>
void solve_triangle(const char* trans, int n, const Real* l, int ld, Real* x, int ldx, int columns) {
  const int step = 1;
  const Real one = 1;
  if (columns == 1)
    Blas<Real>::trsv("L", trans, "N", &n, l, &ld, x, &step);
  else
    Blas<Real>::trsm("L", "L", trans, "N", &n, &columns, &one, l, &ld, x, &ldx);
}

/// Y := alpha op(A) X + beta Y, A [m][n] as stored.
template <class Real>
void multiply(const char* trans, int m, int n, Real alpha, const Real* a, int lda, const Real* x, int ldx,
              Real beta, Real* y, int ldy, int columns) {
  const int step = 1;
  if (columns == 1) {
    Blas<Real>::gemv(trans, &m, &n, &alpha, a, &lda, x, &step, &beta, y, &step);
    return;
  }
  const bool transposed = *trans == 'T';
  Blas<Real>::gemm(trans, "N", transposed ? &n : &m, &columns, transposed ? &m : &n, &alpha, a, &lda, x, &ldx,
                   &beta, y, &ldy);
}

/// Where the threads of a team meet: everything written before is seen after.
class Meeting {
 public:
  /// Of the team that this is called in, by one of its threads, before the others meet.
  void begin(int threads) { threads_ = threads; }
  int threads() const { return threads_; }
  void wait() {
    if (threads_ == 1) return;
    const int round = round_.load(std::memory_order_relaxed);
    if (arrived_.fetch_add(1, std::memory_order_acq_rel) + 1 == threads_) {
      arrived_.store(0, std::memory_order_relaxed);
      // Sequentially consistent: notify_all() must not read that nobody waits before this is seen.
      round_.store(round + 1, std::memory_order_seq_cst);
      round_.notify_all();
      return;
    }
    // Mostly the others are a microsecond away; where they are not, the core may be theirs.
    for (int spin = 0; spin < 2000; ++spin) {
      if (round_.load(std::memory_order_acquire) != round) return;
#if defined(__x86_64__)
      __builtin_ia32_pause();
#endif
    }
    round_.wait(round, std::memory_order_acquire);
  }

 private:
  int threads_ = 1;
  std::atomic<int> arrived_{0}, round_{0};
};

}  // namespace

/// What the threads of one solve share.
template <class Real>
struct SupernodalSolve::Work {
  Real* x;
  int size, columns;
  Meeting meeting;
  std::atomic<int> next_forward{0}, next_backward{0};
  std::vector<Real> outside;                ///< of piece p from columns · outside_start on, by columns
  std::vector<std::vector<Real>> gathered;  ///< [threads][largest_height][columns]: rows of one supernode

  Work(Real* x_, int size_, int columns_, int threads, std::size_t outside_rows, int largest_height)
      : x(x_), size(size_), columns(columns_) {
    outside.assign(outside_rows * static_cast<std::size_t>(columns), Real(0));
    gathered.resize(static_cast<std::size_t>(threads));
    for (auto& own : gathered) own.resize(static_cast<std::size_t>(largest_height) * columns);
  }
  Real* column(int k) const { return x + static_cast<std::ptrdiff_t>(k) * size; }
};

SupernodalSolve::SupernodalSolve(const Supernodes& supernodes) : supernodes_(supernodes) {
  find_pieces();
  find_panels();
}

void SupernodalSolve::find_pieces() {
  const int n = supernodes_.count();
  const std::vector<int> parent = supernodes_.parents();
  std::vector<int> first(n), members(n, 1);
  std::vector<double> entries(n);
  double& total = entries_;
  for (int s = 0; s < n; ++s) {
    first[s] = s;
    entries[s] = static_cast<double>(supernodes_.width(s)) * supernodes_.height(s);
    total += entries[s];
    largest_height_ = std::max(largest_height_, supernodes_.height(s));
  }
  for (int s = 0; s < n; ++s) {
    if (parent[s] < 0) continue;
    entries[parent[s]] += entries[s];
    members[parent[s]] += members[s];
    first[parent[s]] = std::min(first[parent[s]], first[s]);
  }
  // Small enough, and in one run of supernodes, as in a postorder all subtrees are.
  const auto fits = [&](int s) {
    return entries[s] <= kPieceShare * total && s - first[s] + 1 == members[s];
  };
  inside_.assign(n, 0);
  place_start_.assign(1, 0);
  std::vector<int> piece_of(n, -1);
  for (int s = n - 1; s >= 0; --s) {
    if (piece_of[s] >= 0 || !fits(s)) continue;
    for (int member = first[s]; member <= s; ++member) piece_of[member] = static_cast<int>(pieces_.size());
    pieces_.push_back({first[s], s, 0});
  }
  std::reverse(pieces_.begin(), pieces_.end());
  for (int& p : piece_of)
    if (p >= 0) p = num_pieces() - 1 - p;
  for (Piece& piece : pieces_) {
    piece.outside_start = outside_rows_;
    outside_rows_ += static_cast<std::size_t>(left(piece.root));
  }
  for (int s = 0; s < n; ++s) {
    if (piece_of[s] >= 0) {
      const int root = pieces_[static_cast<std::size_t>(piece_of[s])].root,
                past = supernodes_.first(root + 1);
      const int* const below = supernodes_.rows(s) + supernodes_.width(s);
      const int* const end = below + left(s);
      const int* const outside = std::lower_bound(below, end, past);
      inside_[s] = static_cast<int>(outside - below);
      const int* const root_begin = supernodes_.rows(root) + supernodes_.width(root);
      const int* const root_end = root_begin + left(root);
      for (const int* row = outside; row != end; ++row) {
        const int* const found = std::lower_bound(root_begin, root_end, *row);
        require(found != root_end && *found == *row, "SupernodalSolve: not the structure of a factor");
        places_.push_back(static_cast<int>(found - root_begin));
      }
    }
    place_start_.push_back(static_cast<int>(places_.size()));
  }
}

void SupernodalSolve::find_panels() {
  std::vector<bool> in_piece(static_cast<std::size_t>(supernodes_.count()), false);
  for (const Piece& piece : pieces_)
    std::fill(in_piece.begin() + piece.first, in_piece.begin() + piece.root + 1, true);
  for (int s = 0; s < supernodes_.count(); ++s) {
    if (in_piece[static_cast<std::size_t>(s)]) continue;
    for (int first = 0; first < supernodes_.width(s); first += kPanelWidth) {
      const int last = std::min(first + kPanelWidth, supernodes_.width(s));
      const std::ptrdiff_t below = static_cast<std::ptrdiff_t>(supernodes_.height(s) - last) * (last - first);
      panels_.push_back({s, first, last, below >= kSplitFrom});
    }
  }
}

template <class Real>
void SupernodalSolve::forward(const Piece& piece, Work<Real>& work, int thread) const {
  Real* const product = work.gathered[static_cast<std::size_t>(thread)].data();
  const int columns = work.columns, outside_rows = left(piece.root);
  Real* const outside = work.outside.data() + piece.outside_start * static_cast<std::size_t>(columns);
  for (int s = piece.first; s <= piece.root; ++s) {
    const int height = supernodes_.height(s), width = supernodes_.width(s), below = left(s);
    const Real* const l = supernodes_.block<Real>(s);
    Real* const own = work.x + supernodes_.first(s);
    solve_triangle("N", width, l, height, own, work.size, columns);
    if (below == 0) continue;
    multiply("N", below, width, Real(1), l + width, height, own, work.size, Real(0), product, below, columns);
    const int* const row = supernodes_.rows(s) + width;
    const int* const place = places_.data() + place_start_[s];
    const int inside = inside_[s];
    for (int k = 0; k < columns; ++k) {
      const Real* const p = product + static_cast<std::ptrdiff_t>(k) * below;
      Real* const to = work.column(k);
      for (int i = 0; i < inside; ++i) to[row[i]] -= p[i];
      Real* const kept = outside + static_cast<std::ptrdiff_t>(k) * outside_rows;
      for (int i = inside; i < below; ++i) kept[place[i - inside]] += p[i];
    }
  }
}

template <class Real>
void SupernodalSolve::backward(const Piece& piece, Work<Real>& work, int thread) const {
  Real* const gathered = work.gathered[static_cast<std::size_t>(thread)].data();
  const int columns = work.columns;
  for (int s = piece.root; s >= piece.first; --s) {
    const int height = supernodes_.height(s), width = supernodes_.width(s), below = left(s);
    const Real* const l = supernodes_.block<Real>(s);
    Real* const own = work.x + supernodes_.first(s);
    if (below > 0) {
      const int* const row = supernodes_.rows(s) + width;
      for (int k = 0; k < columns; ++k) {
        Real* const to = gathered + static_cast<std::ptrdiff_t>(k) * below;
        const Real* const from = work.column(k);
        for (int i = 0; i < below; ++i) to[i] = from[row[i]];
      }
      multiply("T", below, width, Real(-1), l + width, height, gathered, below, Real(1), own, work.size,
               columns);
    }
    solve_triangle("T", width, l, height, own, work.size, columns);
  }
}

template <class Real>
void SupernodalSolve::solve_top(Work<Real>& work, int thread) const {
  Real* const buffer = work.gathered[static_cast<std::size_t>(thread)].data();
  const int columns = work.columns;
  // Blocks of a panel that several threads share are handed out in turn.
  const auto for_blocks = [&](const Panel& panel, int count, int at_once, auto&& call) {
    for (int block = panel.split ? thread : 0; block * at_once < count;
         block += panel.split ? work.meeting.threads() : 1)
      call(block * at_once, std::min(count, (block + 1) * at_once));
  };
  for (const Panel& panel : panels_) {
    const int s = panel.super, height = supernodes_.height(s), width = panel.last - panel.first;
    const Real* const l = supernodes_.block<Real>(s) + static_cast<std::ptrdiff_t>(panel.first) * height;
    Real* const own = work.x + supernodes_.first(s) + panel.first;
    if (thread == 0) solve_triangle("N", width, l + panel.first, height, own, work.size, columns);
    if (panel.split) work.meeting.wait();
    if (thread != 0 && !panel.split) continue;
    for_blocks(panel, height - panel.last, kRowsAtOnce, [&](int begin, int end) {
      const int rows = end - begin;
      multiply("N", rows, width, Real(1), l + panel.last + begin, height, own, work.size, Real(0), buffer,
               rows, columns);
      const int* const row = supernodes_.rows(s) + panel.last + begin;
      for (int k = 0; k < columns; ++k) {
        Real* const to = work.column(k);
        const Real* const p = buffer + static_cast<std::ptrdiff_t>(k) * rows;
        for (int i = 0; i < rows; ++i) to[row[i]] -= p[i];
      }
    });
    if (panel.split) work.meeting.wait();
  }
  for (auto p = panels_.rbegin(); p != panels_.rend(); ++p) {
    const Panel& panel = *p;
    if (panel.split) work.meeting.wait();
    const int s = panel.super, height = supernodes_.height(s), width = panel.last - panel.first;
    const int below = height - panel.last;
    const Real* const l = supernodes_.block<Real>(s) + static_cast<std::ptrdiff_t>(panel.first) * height;
    Real* const own = work.x + supernodes_.first(s) + panel.first;
    if (below > 0 && (thread == 0 || panel.split)) {
      const int* const row = supernodes_.rows(s) + panel.last;
      for (int k = 0; k < columns; ++k) {
        Real* const to = buffer + static_cast<std::ptrdiff_t>(k) * below;
        const Real* const from = work.column(k);
        for (int i = 0; i < below; ++i) to[i] = from[row[i]];
      }
      for_blocks(panel, width, kColumnsAtOnce, [&](int begin, int end) {
        multiply("T", below, end - begin, Real(-1),
                 l + static_cast<std::ptrdiff_t>(begin) * height + panel.last, height, buffer, below, Real(1),
                 own + begin, work.size, columns);
      });
    }
    if (panel.split) work.meeting.wait();
    if (thread == 0) solve_triangle("T", width, l + panel.first, height, own, work.size, columns);
  }
}

template <class Real>
void SupernodalSolve::solve(Real* x, int columns, int threads) const {
  if (columns == 0) return;
  if (entries_ * columns < kThreadsFrom) threads = 1;
  Work<Real> work(x, supernodes_.size(), columns, threads, outside_rows_, largest_height_);
#pragma omp parallel num_threads(threads)
  {
    // A team may be smaller than asked for (one, in a nested region), and its threads wait for each other.
#pragma omp single
    work.meeting.begin(omp_get_num_threads());
    const int thread = omp_get_thread_num(), pieces = num_pieces();
    for (int p = work.next_forward++; p < pieces; p = work.next_forward++)
      forward(pieces_[static_cast<std::size_t>(p)], work, thread);
    work.meeting.wait();
    if (thread == 0)
      for (const Piece& piece : pieces_) {
        const int root = piece.root, rows = left(root);
        const int* const row = supernodes_.rows(root) + supernodes_.width(root);
        const Real* sum = work.outside.data() + piece.outside_start * static_cast<std::size_t>(columns);
        for (int k = 0; k < columns; ++k, sum += rows)
          for (int i = 0; i < rows; ++i) work.column(k)[row[i]] -= sum[i];
      }
    solve_top(work, thread);
    work.meeting.wait();
    for (int p = work.next_backward++; p < pieces; p = work.next_backward++)
      backward(pieces_[static_cast<std::size_t>(pieces - 1 - p)], work, thread);
  }
}

template void SupernodalSolve::solve<double>(double*, int, int) const;
template void SupernodalSolve::solve<float>(float*, int, int) const;

}  // namespace rhytid
