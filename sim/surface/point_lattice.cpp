#include "sim/surface/point_lattice.h"

#include <algorithm>
#include <cmath>

#include "sim/core/work_count.h"

namespace rhytid {

namespace {
constexpr int kBits = 20;  // per axis of a cell's key
WorkCount lattices_made;
}  // namespace

long PointLattice::made() {
  return lattices_made;
}

std::size_t PointLattice::bytes() const {
  constexpr std::size_t kNode =
      sizeof(void*);  // each entry of the table is a node with a pointer to the next
  return points_.size() * sizeof(int) + runs_.size() * (sizeof(*runs_.begin()) + kNode) +
         runs_.bucket_count() * sizeof(void*);
}

PointLattice::PointLattice(const MatrixX3& points, double radius) {
  ++lattices_made;
  const Vec3 low = points.colwise().minCoeff(), high = points.colwise().maxCoeff();
  const double largest = std::max(low.cwiseAbs().maxCoeff(), high.cwiseAbs().maxCoeff());
  reach_ = radius + 1e-9 * (radius + largest);  // rounding of positions and of cell boundaries
  side_ = radius / 2;
  origin_ = low.array() - 2 * reach_;
  const Vec3 extent = (high - low).array() + 4 * reach_;
  if (!(extent.maxCoeff() / side_ < (1 << kBits) - 2)) return;
  usable_ = true;
  for (int axis = 0; axis < 3; ++axis) cells_[axis] = static_cast<std::int64_t>(extent[axis] / side_) + 1;

  for (Eigen::Index i = 0; i < points.rows(); ++i)
    for_cells_near(points.row(i).transpose(), [&](std::uint64_t cell) { ++runs_[cell].count; });
  std::size_t total = 0;
  for (auto& [cell, run] : runs_) {
    run.first = total;
    total += run.count;
    run.count = 0;
  }
  points_.resize(total);
  // In the order of the points, so that every list ascends.
  for (Eigen::Index i = 0; i < points.rows(); ++i)
    for_cells_near(points.row(i).transpose(), [&](std::uint64_t cell) {
      Run& run = runs_[cell];
      points_[run.first + run.count++] = static_cast<int>(i);
    });
}

std::uint64_t PointLattice::key(const Cell& cell) {
  return static_cast<std::uint64_t>((((cell[0] << kBits) | cell[1]) << kBits) | cell[2]);
}

template <class Visit>
void PointLattice::for_cells_near(const Vec3& point, Visit&& visit) const {
  Cell first, last;
  const Vec3 at = point - origin_;
  for (int axis = 0; axis < 3; ++axis) {
    first[axis] = static_cast<std::int64_t>(std::floor((at[axis] - reach_) / side_));
    last[axis] = static_cast<std::int64_t>(std::floor((at[axis] + reach_) / side_));
  }
  const auto distance_to = [&](std::int64_t cell, int axis) {
    return std::max({cell * side_ - at[axis], at[axis] - (cell + 1) * side_, 0.0});
  };
  Cell cell;
  for (cell[0] = first[0]; cell[0] <= last[0]; ++cell[0])
    for (cell[1] = first[1]; cell[1] <= last[1]; ++cell[1])
      for (cell[2] = first[2]; cell[2] <= last[2]; ++cell[2]) {
        const Vec3 d(distance_to(cell[0], 0), distance_to(cell[1], 1), distance_to(cell[2], 2));
        if (d.squaredNorm() <= reach_ * reach_) visit(key(cell));
      }
}

std::span<const int> PointLattice::near(const Vec3& x) const {
  Cell cell;
  for (int axis = 0; axis < 3; ++axis) {
    const double at = std::floor((x[axis] - origin_[axis]) / side_);
    if (!(at >= 0 && at < static_cast<double>(cells_[axis]))) return {};
    cell[axis] = static_cast<std::int64_t>(at);
  }
  const auto found = runs_.find(key(cell));
  if (found == runs_.end()) return {};
  return std::span(points_).subspan(found->second.first, found->second.count);
}

}  // namespace rhytid
