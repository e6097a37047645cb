#include "sim/element/basis.h"

#include "sim/core/error.h"

namespace rhytid {
namespace {

constexpr int max_order = 4;

// The factor L_n(x) = Π_{m<n} (x − m)/(n − m) of a Lagrange polynomial on the integer lattice, and its
// derivative, for n = 0..order: L_{n+1} = L_n · (x − n)/(n + 1) after rescaling the denominators, since
// Π_{m<n} (n − m) = n!.
void lattice_factors(int order, double x, double* value, double* slope) {
  value[0] = 1;
  slope[0] = 0;
  for (int n = 0; n < order; ++n) {
    value[n + 1] = value[n] * (x - n) / (n + 1);
    slope[n + 1] = (slope[n] * (x - n) + value[n]) / (n + 1);
  }
}

}  // namespace

TriangleBasis::TriangleBasis(int order) : order_(order) {
  require(order >= 1 && order <= max_order, "TriangleBasis: the order must be 1..4");
  const int p = order;
  lattice_ = {{0, 0}, {p, 0}, {0, p}};
  for (int m = 1; m < p; ++m) lattice_.push_back({m, 0});
  for (int m = 1; m < p; ++m) lattice_.push_back({p - m, m});
  for (int m = 1; m < p; ++m) lattice_.push_back({0, p - m});
  for (int j = 1; j < p; ++j)
    for (int i = 1; i + j < p; ++i) lattice_.push_back({i, j});

  int node_at[max_order + 1][max_order + 1] = {};
  for (int node = 0; node < static_cast<int>(lattice_.size()); ++node) {
    const auto [i, j] = lattice_[node];
    nodes_.push_back({static_cast<double>(i) / p, static_cast<double>(j) / p});
    node_at[i][j] = node;
  }
  for (int j = 0; j < p; ++j) {
    for (int i = 0; i + j < p; ++i) {
      subtriangles_.push_back({node_at[i][j], node_at[i + 1][j], node_at[i][j + 1]});
      if (i + j + 1 < p)
        subtriangles_.push_back({node_at[i + 1][j], node_at[i + 1][j + 1], node_at[i][j + 1]});
    }
  }
}

void TriangleBasis::evaluate(double u, double v, double* values, double* d_du, double* d_dv) const {
  // P_(i,j) = L_i(pu) L_j(pv) L_k(pt), with t = 1 − u − v and k = p − i − j.
  const double p = order_;
  double fu[max_order + 1], fv[max_order + 1], ft[max_order + 1];
  double gu[max_order + 1], gv[max_order + 1], gt[max_order + 1];
  lattice_factors(order_, p * u, fu, gu);
  lattice_factors(order_, p * v, fv, gv);
  lattice_factors(order_, p * (1 - u - v), ft, gt);
  for (int node = 0; node < num_nodes(); ++node) {
    const auto [i, j] = lattice_[node];
    const int k = order_ - i - j;
    if (values) values[node] = fu[i] * fv[j] * ft[k];
    if (d_du) d_du[node] = p * fv[j] * (gu[i] * ft[k] - fu[i] * gt[k]);
    if (d_dv) d_dv[node] = p * fu[i] * (gv[j] * ft[k] - fv[j] * gt[k]);
  }
}

LineBasis::LineBasis(int order) : order_(order) {
  require(order >= 1 && order <= max_order, "LineBasis: the order must be 1..4");
  for (int k = 0; k <= order; ++k) nodes_.push_back(static_cast<double>(2 * k - order) / order);
}

void LineBasis::evaluate(double w, double* values, double* d_dw) const {
  // T_k = L_k(q s) L_{q−k}(q (1 − s)), with s = (1 + w)/2.
  const double half = 0.5 * order_;
  double fa[max_order + 1], fb[max_order + 1], ga[max_order + 1], gb[max_order + 1];
  lattice_factors(order_, half * (1 + w), fa, ga);
  lattice_factors(order_, half * (1 - w), fb, gb);
  for (int k = 0; k <= order_; ++k) {
    if (values) values[k] = fa[k] * fb[order_ - k];
    if (d_dw) d_dw[k] = half * (ga[k] * fb[order_ - k] - fa[k] * gb[order_ - k]);
  }
}

}  // namespace rhytid
