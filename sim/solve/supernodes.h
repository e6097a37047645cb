// The supernodes of a Cholesky factor as CHOLMOD lays them out: consecutive columns that share their rows, each
// supernode a dense block by columns [height][width] whose first `width` rows are its own columns (of the upper
// triangle there nothing is read).
//
// Internal to sim/solve.
#pragma once

#include <cholmod.h>

#include <algorithm>
#include <cstddef>
#include <vector>

namespace rhytid {

/// A view of a supernodal factor with 32-bit indices, which must outlive it.
class Supernodes {
 public:
  explicit Supernodes(const cholmod_factor& factor)
      : factor_(&factor),
        super_(static_cast<const int*>(factor.super)),
        row_start_(static_cast<const int*>(factor.pi)),
        value_start_(static_cast<const int*>(factor.px)),
        rows_(static_cast<const int*>(factor.s)) {}

  int count() const { return static_cast<int>(factor_->nsuper); }
  int size() const { return static_cast<int>(factor_->n); }  ///< of the matrix
  int first(int s) const { return super_[s]; }               ///< column; [0, count()], the last one is size()
  int width(int s) const { return super_[s + 1] - super_[s]; }
  int height(int s) const { return row_start_[s + 1] - row_start_[s]; }
  /// [height] ascending; the first `width` are the supernode's columns.
  const int* rows(int s) const { return rows_ + row_start_[s]; }
  /// [size()] the supernode of every column.
  std::vector<int> of_columns() const {
    std::vector<int> super_of(static_cast<std::size_t>(size()));
    for (int s = 0; s < count(); ++s) std::fill_n(super_of.begin() + first(s), width(s), s);
    return super_of;
  }
  /// [count()] the parent of every supernode in the elimination tree, that of the first row below its columns; -1
  /// for roots. Parents follow children.
  std::vector<int> parents() const {
    const std::vector<int> super_of = of_columns();
    std::vector<int> parent(static_cast<std::size_t>(count()), -1);
    for (int s = 0; s < count(); ++s)
      if (height(s) > width(s)) parent[s] = super_of[rows(s)[width(s)]];
    return parent;
  }
  /// Values, or room for them; floats lie in the first half of the storage of doubles.
  template <class Real>
  Real* block(int s) const {
    return static_cast<Real*>(factor_->x) + value_start_[s];
  }

 private:
  const cholmod_factor* factor_;
  const int *super_, *row_start_, *value_start_, *rows_;
};

}  // namespace rhytid
