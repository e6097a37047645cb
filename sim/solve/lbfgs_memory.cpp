#include "sim/solve/lbfgs_memory.h"

#include <utility>
#include <vector>

namespace rhytid {

void LbfgsMemory::add(VectorXd s, VectorXd y) {
  const double sy = s.dot(y);
  // Negated so that NaN and zero steps are skipped as well.
  if (!(sy > 0 && sy >= 1e-12 * s.norm() * y.norm())) return;
  if (static_cast<int>(pairs_.size()) == capacity_) pairs_.pop_front();
  pairs_.push_back({std::move(s), std::move(y), 1 / sy});
}

VectorXd LbfgsMemory::descent_direction(const VectorXd& gradient, const CholeskyFactor& initial) const {
  VectorXd v = -gradient;
  std::vector<double> alpha(pairs_.size());
  for (std::size_t i = pairs_.size(); i-- > 0;) {
    alpha[i] = pairs_[i].inverse_sy * pairs_[i].s.dot(v);
    v -= alpha[i] * pairs_[i].y;
  }
  v = initial.solve(v);
  for (std::size_t i = 0; i < pairs_.size(); ++i)
    v += (alpha[i] - pairs_[i].inverse_sy * pairs_[i].y.dot(v)) * pairs_[i].s;
  return v;
}

}  // namespace rhytid
