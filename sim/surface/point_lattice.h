// Neighbour lists of a cloud for every place at once: which points may lie within a fixed radius.
//
// Space is cut into cubic cells of half the radius; a cell's list holds every point within the radius of any
// place in the cell (distance to the cell's box, widened by more than rounding). So a list is exact for all
// displacements of a query, unlike a list per query point, which serves only as far as its margin; it holds
// about 1.6 times the points in reach. Cells that no point reaches are not stored: up to some 70 entries per
// point of the cloud.
#pragma once

#include <array>
#include <cstdint>
#include <span>
#include <unordered_map>
#include <vector>

#include "sim/core/types.h"

namespace rhytid {

class PointLattice {
 public:
  /// points [n][3] mm, finite; radius > 0 mm.
  PointLattice(const MatrixX3& points, double radius);
  /// Whether the cloud is not too large for the numbering of cells (2²⁰ cells along each axis). When false,
  /// near() must not be called.
  bool usable() const { return usable_; }
  /// Ascending indices of a superset of the points within the radius of x; empty where there are none, also
  /// for an x that is not finite. Safe from several threads.
  std::span<const int> near(const Vec3& x) const;
  /// Entries of all lists together.
  std::size_t num_entries() const { return points_.size(); }
  /// Memory of the lists and of the table of cells, bytes (the table's own overhead estimated).
  std::size_t bytes() const;
  /// Lattices made since the program began: work that only IMLS surfaces cause.
  static long made();

 private:
  using Cell = std::array<std::int64_t, 3>;
  struct Run {
    std::size_t first = 0, count = 0;
  };
  static std::uint64_t key(const Cell& cell);
  template <class Visit>
  void for_cells_near(const Vec3& point, Visit&& visit) const;

  Vec3 origin_ = Vec3::Zero();
  double side_ = 1, reach_ = 0;
  Cell cells_{};  // along each axis
  bool usable_ = false;
  std::unordered_map<std::uint64_t, Run> runs_;
  std::vector<int> points_;
};

}  // namespace rhytid
