// The loop over a term's elements that every kernel call shares: view the element, gather its nodal values,
// call, and, where the result is a nodal vector, add it up.
//
// Elements run in parallel and write only what is theirs; sums are taken afterwards by one thread in element
// order, so that no result depends on the number of threads.
#pragma once

#include <array>
#include <cstring>
#include <utility>

#include "sim/core/parallel.h"
#include "sim/terms/term.h"

namespace rhytid {

/// Nodal values of one element, [n][3], on the stack.
using NodalValues = std::array<double, std::size_t{3} * kMaxElementNodes>;

/// One element of a group as a kernel sees it.
struct TermElement {
  const TermGroup& group;
  int index;          ///< in the group
  std::size_t point;  ///< of its first point within the term: where per-point arrays begin
  ElementView view;

  /// Nodal values, [n][width], of a field [num_nodes][width].
  void gather(const double* field, int width, double* local) const {
    const int* nodes = group.nodes.data() + static_cast<std::size_t>(index) * group.num_nodes;
    for (int i = 0; i < group.num_nodes; ++i)
      std::memcpy(local + static_cast<std::size_t>(i) * width,
                  field + static_cast<std::size_t>(nodes[i]) * width, sizeof(double) * width);
  }
  NodalValues gather(const VectorXd& field) const {
    NodalValues local;  // not set to zero: only what belongs to the element's nodes is read
    gather(field.data(), 3, local.data());
    return local;
  }
};

/// Element `index` of group `g`. `theta` as in TermStepData: one row of parameters, or one per point.
inline TermElement term_element(const KernelTable& kernels, const TermGroup& g, int index, double dt,
                                const std::vector<double>& theta) {
  const auto e = static_cast<std::size_t>(index), nq = static_cast<std::size_t>(g.num_points);
  const bool per_point = theta.size() > static_cast<std::size_t>(kernels.ntheta);
  return {
      g,
      index,
      static_cast<std::size_t>(g.first_point) + e * nq,
      {g.num_nodes, g.padded_nodes, g.num_points, g.padded_rows, g.node_by_row.data(), g.rows_by_node.data(),
       g.inverse_jacobian.empty() ? nullptr : g.inverse_jacobian.data() + e * nq * 9,
       g.weight.data() + e * nq, kernels.nrest ? g.rest.data() + e * nq * kernels.nrest : nullptr,
       theta.data() + (per_point ? e * nq * kernels.ntheta : 0), per_point ? kernels.ntheta : 0, dt,
       g.product.view()}};
}

/// Calls visit(TermElement) for elements first..first+count−1 of group `gi` of a term, in parallel.
template <class Visit>
void for_elements(const Term& term, std::size_t gi, const StepInfo& step, const TermStepData& data, int first,
                  int count, Visit&& visit) {
  const TermGroup& g = term.groups()[gi];
  parallel_for(count, [&](std::int64_t k) {
    visit(term_element(term.kernels(), g, first + static_cast<int>(k), step.dt(), data.theta[gi]));
  });
}

/// The same for all elements of the group.
template <class Visit>
void for_elements(const Term& term, std::size_t gi, const StepInfo& step, const TermStepData& data,
                  Visit&& visit) {
  for_elements(term, gi, step, data, 0, term.groups()[gi].num_elements, visit);
}

/// The same for all elements of all groups.
template <class Visit>
void for_elements(const Term& term, const StepInfo& step, const TermStepData& data, Visit&& visit) {
  for (std::size_t gi = 0; gi < term.groups().size(); ++gi) for_elements(term, gi, step, data, visit);
}

/// A nodal vector per element of a group, [num_elements][n][width], zero at first. Their memory is kept by the thread for
/// the next ones: fresh pages cost as much as the elements.
class ElementVectors {
 public:
  ElementVectors(const TermGroup& group, int width)
      : group_(&group),
        width_(width),
        stride_(static_cast<std::size_t>(group.num_nodes) * width),
        values_(std::move(kept())) {
    values_.assign(stride_ * group.num_elements, 0.0);
  }
  ~ElementVectors() { kept() = std::move(values_); }
  ElementVectors(const ElementVectors&) = delete;
  ElementVectors& operator=(const ElementVectors&) = delete;
  double* of(const TermElement& element) { return values_.data() + stride_ * element.index; }
  /// Adds all elements to a field [num_nodes][width], in element order.
  void add_to(double* field) const {
    add(field, [](double x) { return x; });
  }
  /// The same with absolute values.
  void add_absolute_to(double* field) const {
    add(field, [](double x) { return std::fabs(x); });
  }

 private:
  template <class Map>
  void add(double* field, Map&& map) const {
    const double* local = values_.data();
    for (const int node : group_->nodes) {
      double* to = field + static_cast<std::size_t>(node) * width_;
      for (int k = 0; k < width_; ++k) to[k] += map(local[k]);
      local += width_;
    }
  }
  static std::vector<double>& kept() {
    thread_local std::vector<double> values;
    return values;
  }
  const TermGroup* group_;
  int width_;
  std::size_t stride_;
  std::vector<double> values_;
};

}  // namespace rhytid
