#include "sim/terms/path.h"

#include <Eigen/LU>
#include <algorithm>
#include <cmath>

#include "sim/core/error.h"

namespace rhytid {
namespace {

/// M = curvature · x at the knots from continuity of x', and M = 0 (natural) or x' = 0 (clamped) at the ends.
///   x' at the left end of a piece   Δ/h − h (2 M_k + M_{k+1})/6,   at its right end   Δ/h + h (M_k + 2
///   M_{k+1})/6
MatrixXd spline_curvature(const std::vector<double>& t, bool clamped) {
  const int n = static_cast<int>(t.size());
  MatrixXd left = MatrixXd::Zero(n, n), right = MatrixXd::Zero(n, n);
  const auto add_slope = [&](int row, int k, bool at_left_end, double sign) {
    const double h = t[k + 1] - t[k];
    right(row, k + 1) -= sign / h;
    right(row, k) += sign / h;
    left(row, k) += sign * h * (at_left_end ? -2.0 : 1.0) / 6;
    left(row, k + 1) += sign * h * (at_left_end ? -1.0 : 2.0) / 6;
  };
  for (int k = 1; k + 1 < n; ++k) {
    add_slope(k, k - 1, false, 1);
    add_slope(k, k, true, -1);
  }
  if (clamped) {
    add_slope(0, 0, true, 1);
    add_slope(n - 1, n - 2, false, 1);
  } else {
    left(0, 0) = left(n - 1, n - 1) = 1;
  }
  return left.partialPivLu().solve(right);
}

}  // namespace

KnotPath::KnotPath(std::vector<double> times, PathKind kind) : times_(std::move(times)) {
  require(!times_.empty(), "KnotPath: at least one knot");
  for (std::size_t k = 1; k < times_.size(); ++k)
    require(times_[k] > times_[k - 1], "KnotPath: times must increase");
  if (kind == PathKind::linear || times_.size() < 2) return;
  require(times_.size() <= max_spline_knots, "KnotPath: too many knots for a spline");
  curvature_ = spline_curvature(times_, kind == PathKind::clamped_spline);
}

KnotPath::KnotPath(std::vector<double> times, std::vector<double> angles) : KnotPath(std::move(times)) {
  require(angles.size() + 1 == times_.size(), "KnotPath: one angle between neighbours");
  for (const double angle : angles) require(angle >= 0 && angle < 1.571, "KnotPath: angles in [0, π/2)");
  angles_ = std::move(angles);
}

std::vector<KnotWeight> KnotPath::weights(double t) const {
  const int n = static_cast<int>(times_.size());
  if (n == 1 || t <= times_.front()) return {{0, 1.0}};
  if (t >= times_.back()) return {{n - 1, 1.0}};
  const int hi = static_cast<int>(std::upper_bound(times_.begin(), times_.end(), t) - times_.begin());
  const int lo = hi - 1;
  const double h = times_[hi] - times_[lo], b = (t - times_[lo]) / h, a = 1 - b;
  if (curvature_.size() == 0) {
    // Below 1e-4 rad sin(x Ω)/sin Ω is x to 1e-9 Ω, and the division would lose digits.
    const double angle = angles_.empty() ? 0 : angles_[lo];
    if (angle < 1e-4) return {{lo, a}, {hi, b}};
    return {{lo, std::sin(a * angle) / std::sin(angle)}, {hi, std::sin(b * angle) / std::sin(angle)}};
  }
  std::vector<KnotWeight> result;
  for (int k = 0; k < n; ++k) {
    double w = ((a * a * a - a) * curvature_(lo, k) + (b * b * b - b) * curvature_(hi, k)) * h * h / 6;
    if (k == lo) w += a;
    if (k == hi) w += b;
    // Far knots matter by 0.27 to the power of their distance: below rounding they are left out.
    if (std::fabs(w) > 1e-18) result.push_back({k, w});
  }
  return result;
}

std::vector<KnotWeight> KnotPath::rates(double t, Side side) const {
  std::vector<KnotWeight> result;
  // A piece has the number of the knot it begins at; -1 is the rest before the first.
  const auto piece = [this](double time) {
    return static_cast<int>(std::upper_bound(times_.begin(), times_.end(), time) - times_.begin()) - 1;
  };
  const int before = piece(t - same_time), after = piece(t + same_time);
  if (side == Side::mean && before == after) {
    add_rates(after, t, 1, result);
  } else {
    const double share = side == Side::mean ? 0.5 : 1;
    if (side != Side::after) add_rates(before, t, share, result);
    if (side != Side::before) add_rates(after, t, share, result);
  }
  return result;
}

void KnotPath::add_rates(int lo, double t, double factor, std::vector<KnotWeight>& result) const {
  const int n = static_cast<int>(times_.size()), hi = lo + 1;
  if (lo < 0 || hi >= n) return;
  const double h = times_[hi] - times_[lo], b = (t - times_[lo]) / h, a = 1 - b;
  if (curvature_.size() == 0) {
    const double angle = angles_.empty() ? 0 : angles_[lo];
    double down = -1 / h, up = 1 / h;
    if (angle >= 1e-4) {
      down *= angle * std::cos(a * angle) / std::sin(angle);
      up *= angle * std::cos(b * angle) / std::sin(angle);
    }
    result.push_back({lo, factor * down});
    result.push_back({hi, factor * up});
    return;
  }
  for (int k = 0; k < n; ++k) {
    double w = ((1 - 3 * a * a) * curvature_(lo, k) + (3 * b * b - 1) * curvature_(hi, k)) * h / 6;
    if (k == lo) w -= 1 / h;
    if (k == hi) w += 1 / h;
    if (std::fabs(w) > 1e-18) result.push_back({k, factor * w});
  }
}

}  // namespace rhytid
