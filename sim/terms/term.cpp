#include "sim/terms/term.h"

#include <algorithm>

#include "sim/core/error.h"
#include "sim/terms/element_loop.h"

namespace rhytid {

namespace {

constexpr int round_up8(int n) {
  return (n + 7) / 8 * 8;
}

bool is_on_path(const ThetaSlot& slot) {
  return slot.kind == ThetaSlot::Kind::path_now || slot.kind == ThetaSlot::Kind::path_old;
}

/// The time at which a slot reads its path.
double path_time(const ThetaSlot& slot, const StepInfo& step, double ahead) {
  return (slot.kind == ThetaSlot::Kind::path_now ? step.t : step.t_old) + ahead;
}

}  // namespace

void Term::add_group(TermGroup g) {
  const int rows = kernels_->rows * g.num_points;
  require(static_cast<int>(g.theta.size()) == kernels_->ntheta, "Term: one slot per law parameter");
  require(static_cast<int>(g.node_by_row.size()) == rows * g.num_nodes, "Term: table size");
  require(rows <= 600, "Term: too many quadrature points in an element");
  require(g.num_nodes <= kMaxElementNodes, "Term: too many nodes in an element");
  g.padded_nodes = round_up8(g.num_nodes);
  g.padded_rows = round_up8(rows);
  std::vector<double> table(static_cast<std::size_t>(rows) * g.padded_nodes, 0.0);
  g.rows_by_node.assign(static_cast<std::size_t>(g.num_nodes) * g.padded_rows, 0.0);
  for (int r = 0; r < rows; ++r)
    for (int i = 0; i < g.num_nodes; ++i) {
      const double value = g.node_by_row[static_cast<std::size_t>(r) * g.num_nodes + i];
      table[static_cast<std::size_t>(r) * g.padded_nodes + i] = value;
      g.rows_by_node[static_cast<std::size_t>(i) * g.padded_rows + r] = value;
    }
  g.node_by_row = std::move(table);
  g.first_point = num_points_;
  num_points_ += g.num_elements * g.num_points;
  groups_.push_back(std::move(g));
}

std::size_t Term::bytes() const {
  const auto of = [](const auto& values) { return values.size() * sizeof(values[0]); };
  std::size_t sum = 0;
  for (const TermGroup& g : groups_)
    sum += of(g.nodes) + of(g.node_by_row) + of(g.rows_by_node) + of(g.inverse_jacobian) + of(g.weight) +
           of(g.rest) + of(g.field_columns) + of(g.field_weights) + of(g.cliques);
  return sum;
}

std::vector<std::vector<double>> Term::map_theta(const StepInfo& step, const VectorXd& native, double ahead,
                                                 double fixed_scale) const {
  const int nt = kernels_->ntheta;
  std::vector<std::vector<double>> result(groups_.size());
  for (std::size_t gi = 0; gi < groups_.size(); ++gi) {
    const TermGroup& g = groups_[gi];
    std::vector<double> row(nt, 0.0);
    int field_slot = -1;
    for (int s = 0; s < nt; ++s) {
      const ThetaSlot& slot = g.theta[s];
      switch (slot.kind) {
        case ThetaSlot::Kind::constant:
          row[s] = native[slot.offset];
          break;
        case ThetaSlot::Kind::field:
          field_slot = s;
          break;
        case ThetaSlot::Kind::path_now:
        case ThetaSlot::Kind::path_old:
          for (const KnotWeight& w : slot.path->weights(path_time(slot, step, ahead)))
            row[s] += w.weight * native[slot.offset + slot.stride * w.knot];
          break;
        case ThetaSlot::Kind::fixed:
          row[s] = fixed_scale * slot.value;
      }
    }
    if (field_slot < 0) {
      result[gi] = std::move(row);
      continue;
    }
    const std::size_t points = static_cast<std::size_t>(g.num_elements) * g.num_points;
    auto& theta = result[gi];
    theta.resize(points * nt);
    const int offset = g.theta[field_slot].offset;
    for (std::size_t q = 0; q < points; ++q) {
      std::copy(row.begin(), row.end(), theta.begin() + q * nt);
      double value = 0;
      for (int k = 0; k < 3; ++k)
        value += g.field_weights[3 * q + k] * native[offset + g.field_columns[3 * q + k]];
      theta[q * nt + field_slot] = value;
    }
  }
  return result;
}

std::vector<std::vector<double>> Term::path_rates(const StepInfo& step, const VectorXd& native) const {
  if (clock_ < 0) return {};
  std::vector<std::vector<double>> result;
  for (const TermGroup& g : groups_) {
    result.emplace_back(g.theta.size(), 0.0);
    for (std::size_t s = 0; s < g.theta.size(); ++s) {
      const ThetaSlot& slot = g.theta[s];
      if (!is_on_path(slot)) continue;
      for (const KnotWeight& w : slot.path->rates(path_time(slot, step, ahead(native))))
        result.back()[s] += w.weight * native[slot.offset + slot.stride * w.knot];
    }
  }
  return result;
}

std::vector<std::vector<double>> Term::load_theta_direction(const StepInfo& step, const TermStepData& data,
                                                            const VectorXd& dnative) const {
  std::vector<std::vector<double>> result = map_theta(step, dnative, data.ahead, 0);
  if (clock_ < 0 || dnative[clock_] == 0) return result;
  const std::size_t nt = static_cast<std::size_t>(kernels_->ntheta);
  for (std::size_t gi = 0; gi < groups_.size(); ++gi)
    for (std::size_t k = 0; k < result[gi].size(); ++k)
      result[gi][k] += data.rates[gi][k % nt] * dnative[clock_];
  return result;
}

void Term::add_theta_transpose(const StepInfo& step, const TermStepData& data,
                               const std::vector<double>& theta_bar, VectorXd& native_bar) const {
  const int nt = kernels_->ntheta;
  for (std::size_t gi = 0; gi < groups_.size(); ++gi) {
    const TermGroup& g = groups_[gi];
    const std::size_t points = static_cast<std::size_t>(g.num_elements) * g.num_points;
    const double* bar = theta_bar.data() + static_cast<std::size_t>(g.first_point) * nt;
    std::vector<double> sums(nt, 0.0);  // one pass: all slots of a point lie together
    for (std::size_t q = 0; q < points; ++q)
      for (int s = 0; s < nt; ++s) sums[s] += bar[q * nt + s];
    for (int s = 0; s < nt; ++s) {
      const ThetaSlot& slot = g.theta[s];
      if (slot.kind == ThetaSlot::Kind::field) {
        for (std::size_t q = 0; q < points; ++q)
          for (int k = 0; k < 3; ++k)
            native_bar[slot.offset + g.field_columns[3 * q + k]] +=
                g.field_weights[3 * q + k] * bar[q * nt + s];
        continue;
      }
      if (slot.kind == ThetaSlot::Kind::fixed) continue;
      const double sum = sums[s];
      if (slot.kind == ThetaSlot::Kind::constant) {
        native_bar[slot.offset] += sum;
      } else {
        for (const KnotWeight& w : slot.path->weights(path_time(slot, step, data.ahead)))
          native_bar[slot.offset + slot.stride * w.knot] += w.weight * sum;
        if (clock_ >= 0) native_bar[clock_] += data.rates[gi][static_cast<std::size_t>(s)] * sum;
      }
    }
  }
}

}  // namespace rhytid
