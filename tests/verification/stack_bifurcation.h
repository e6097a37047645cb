// When a compressed stack of layers wrinkles, by linearised bifurcation that shares nothing with the
// simulator: the stack is compressed by ε along x and held along y; on that state a wave
//
//   δu_x = U(z) sin kx,   δu_z = W(z) cos kx
//
// is in equilibrium when its second variation vanishes. Waves are exact along x; through the thickness U, W
// and the base state are polynomials of given orders on given elements: many fine ones are the exact answer,
// those of a discretisation are what that discretisation must find when it resolves x.
//
// Energy μ/C (e^(C q) − 1) + K/2 (J − 1)² in principal stretches λ_i, with e = dev ln λ and q = e·e:
//
//   τ_i = λ_i ψ_i = 2 μ e^(Cq) e_i + K J (J − 1),   ∂τ_i/∂ln λ_j = 2 μ e^(Cq) (δ_ij − 1/3 + 2 C e_i e_j) + K
//   (2J² − J) ∂²ψ/∂F_iiF_jj = ψ_ij,  ∂²ψ/∂F_ij² = (λ_iψ_i − λ_jψ_j)/(λ_i² − λ_j²),  ∂²ψ/∂F_ij∂F_ji = (λ_jψ_i
//   − λ_iψ_j)/(λ_i² − λ_j²)
#pragma once

#include <Eigen/Cholesky>
#include <algorithm>
#include <cmath>
#include <utility>
#include <vector>

#include "sim/core/types.h"

namespace rhytid::test {

struct StackLayer {
  double thickness, youngs_modulus, poissons_ratio = 0.49, stiffening = 1;
};

/// Through the thickness, from the base up: element k spans `layers` material layers (one, or all of a
/// composite) and is of order `order`; `points` Gauss points in each layer of it.
struct StackElement {
  int layers, order, points;
  double fraction = 1;  ///< of its layer, when a layer has several elements
};

struct Onset {
  double strain, wavelength;
};

/// Where the parabola through y at −1, 0, 1 has its vertex (kept within ±1), and its value there.
inline std::pair<double, double> vertex(double before, double middle, double after) {
  const double second = before - 2 * middle + after,
               at = std::max(-1.0, std::min(1.0, 0.5 * (before - after) / second));
  return {at, middle + 0.5 * (after - before) * at + 0.5 * second * at * at};
}

class StackBifurcation {
 public:
  StackBifurcation(std::vector<StackLayer> layers, const std::vector<StackElement>& elements, bool sliding)
      : layers_(std::move(layers)), sliding_(sliding) {
    place(elements);
  }

  /// Is the compressed stack stable against waves of this length?
  bool stable(double strain, double wavelength) const;
  /// The strain at which waves of this length appear, looked for outward from `near` and not beyond 0.6.
  double strain_at(double wavelength, double near) const;
  /// The first wave of all.
  Onset onset(double shortest, double longest) const;

 private:
  /// One quadrature point: weight, and the shapes of its element with their slopes.
  struct Point {
    double weight;
    int layer, first;
    VectorXd shape, slope;
  };
  struct Moduli {
    double traction, xxxx, xxzz, zzzz, xzxz, xzzx, zxzx;
  };
  void place(const std::vector<StackElement>& elements);
  Moduli moduli(const StackLayer& layer, double stretch_x, double stretch_z) const;
  VectorXd base(double strain) const;

  std::vector<StackLayer> layers_;
  bool sliding_;
  std::vector<Point> points_;
  int nodes_ = 0;
};

namespace stack_detail {

/// Gauss points on [−1, 1] by Newton's method on Legendre's polynomial.
inline std::vector<std::pair<double, double>> gauss(int n) {
  std::vector<std::pair<double, double>> rule;
  for (int k = 0; k < n; ++k) {
    double x = std::cos(3.14159265358979323846 * (k + 0.75) / (n + 0.5)), slope = 0;
    for (int it = 0; it < 50; ++it) {
      double p0 = 1, p1 = x;
      for (int j = 2; j <= n; ++j) p0 = std::exchange(p1, ((2 * j - 1) * x * p1 - (j - 1) * p0) / j);
      slope = n == 1 ? 1 : n * (x * p1 - p0) / (x * x - 1);
      x -= p1 / slope;
    }
    rule.emplace_back(x, 2 / ((1 - x * x) * slope * slope));
  }
  return rule;
}

/// Lagrange's polynomials on Chebyshev's points of [−1, 1] and their slopes.
inline void lagrange(int order, double x, VectorXd& value, VectorXd& slope) {
  const int n = order + 1;
  VectorXd at(n);
  for (int i = 0; i < n; ++i) at[i] = -std::cos(3.14159265358979323846 * i / order);
  value = slope = VectorXd::Zero(n);
  for (int i = 0; i < n; ++i) {
    double scale = 1;
    for (int j = 0; j < n; ++j)
      if (j != i) scale /= at[i] - at[j];
    value[i] = scale;
    for (int j = 0; j < n; ++j)
      if (j != i) value[i] *= x - at[j];
    for (int skip = 0; skip < n; ++skip) {
      if (skip == i) continue;
      double product = scale;
      for (int j = 0; j < n; ++j)
        if (j != i && j != skip) product *= x - at[j];
      slope[i] += product;
    }
  }
}

}  // namespace stack_detail

inline void StackBifurcation::place(const std::vector<StackElement>& elements) {
  int layer = 0;
  double used = 0;  // fraction of the current layer that is filled
  for (const StackElement& e : elements) {
    double height = 0;
    for (int k = 0; k < e.layers; ++k)
      height += layers_[layer + k].thickness * (e.layers == 1 ? e.fraction : 1);
    double below = 0;
    for (int k = 0; k < e.layers; ++k) {
      const double slab = layers_[layer + k].thickness * (e.layers == 1 ? e.fraction : 1);
      for (const auto& [x, w] : stack_detail::gauss(e.points)) {
        Point p;
        p.weight = 0.5 * w * slab;
        p.layer = layer + k;
        p.first = nodes_;
        stack_detail::lagrange(e.order, 2 * (below + 0.5 * (1 + x) * slab) / height - 1, p.shape, p.slope);
        p.slope *= 2 / height;
        points_.push_back(std::move(p));
      }
      below += slab;
    }
    nodes_ += e.order;
    used += e.fraction;
    if (e.layers > 1 || used > 1 - 1e-9) {
      layer += e.layers;
      used = 0;
    }
  }
  ++nodes_;
}

inline StackBifurcation::Moduli StackBifurcation::moduli(const StackLayer& m, double a, double c) const {
  const double mu = m.youngs_modulus / (2 * (1 + m.poissons_ratio)),
               bulk = m.youngs_modulus / (3 * (1 - 2 * m.poissons_ratio));
  const double stretch[3] = {a, 1, c}, volume = a * c;
  double e[3], q = 0, tau[3], rate[3][3];
  for (int i = 0; i < 3; ++i) e[i] = std::log(stretch[i]) - std::log(volume) / 3, q += e[i] * e[i];
  const double fung = 2 * mu * std::exp(m.stiffening * q);
  for (int i = 0; i < 3; ++i) {
    tau[i] = fung * e[i] + bulk * volume * (volume - 1);
    for (int j = 0; j < 3; ++j)
      rate[i][j] =
          fung * ((i == j) - 1. / 3 + 2 * m.stiffening * e[i] * e[j]) + bulk * volume * (2 * volume - 1);
  }
  const auto second = [&](int i, int j) {
    return (rate[i][j] - (i == j ? tau[i] : 0)) / (stretch[i] * stretch[j]);
  };
  const double px = tau[0] / a, pz = tau[2] / c, gap = a * a - c * c;
  return {pz,
          second(0, 0),
          second(0, 2),
          second(2, 2),
          (tau[0] - tau[2]) / gap,
          (c * px - a * pz) / gap,
          (tau[0] - tau[2]) / gap};
}

/// Heights of the nodes above rest in the flat compressed state, by Newton's method; node 0 is held.
inline VectorXd StackBifurcation::base(double strain) const {
  VectorXd w = VectorXd::Zero(nodes_);
  for (int it = 0; it < 30; ++it) {
    VectorXd force = VectorXd::Zero(nodes_);
    MatrixXd stiffness = MatrixXd::Zero(nodes_, nodes_);
    for (const Point& p : points_) {
      const Eigen::Index n = p.slope.size();
      const Moduli m = moduli(layers_[p.layer], 1 - strain, 1 + p.slope.dot(w.segment(p.first, n)));
      force.segment(p.first, n) += p.weight * m.traction * p.slope;
      stiffness.block(p.first, p.first, n, n) += p.weight * m.zzzz * p.slope * p.slope.transpose();
    }
    const VectorXd step =
        stiffness.bottomRightCorner(nodes_ - 1, nodes_ - 1).llt().solve(force.tail(nodes_ - 1));
    w.tail(nodes_ - 1) -= step;
    if (step.norm() < 1e-14) break;
  }
  return w;
}

inline bool StackBifurcation::stable(double strain, double wavelength) const {
  const VectorXd w = base(strain);
  const double k = 2 * 3.14159265358979323846 / wavelength;
  MatrixXd h = MatrixXd::Zero(2 * nodes_, 2 * nodes_);  // U, then W
  for (const Point& p : points_) {
    const Eigen::Index n = p.slope.size();
    const Moduli m = moduli(layers_[p.layer], 1 - strain, 1 + p.slope.dot(w.segment(p.first, n)));
    const MatrixXd vv = p.weight * p.shape * p.shape.transpose(),
                   vs = p.weight * p.shape * p.slope.transpose(),
                   ss = p.weight * p.slope * p.slope.transpose();
    h.block(p.first, p.first, n, n) += m.xxxx * k * k * vv + m.xzxz * ss;
    h.block(nodes_ + p.first, nodes_ + p.first, n, n) += m.zzzz * ss + m.zxzx * k * k * vv;
    const MatrixXd uw = k * (m.xxzz * vs - m.xzzx * vs.transpose());
    h.block(p.first, nodes_ + p.first, n, n) += uw;
    h.block(nodes_ + p.first, p.first, n, n) += uw.transpose();
  }
  h.row(nodes_).setZero(), h.col(nodes_).setZero(), h(nodes_, nodes_) = 1;
  if (!sliding_) h.row(0).setZero(), h.col(0).setZero(), h(0, 0) = 1;
  return h.llt().info() == Eigen::Success;
}

inline double StackBifurcation::strain_at(double wavelength, double near) const {
  double low = near, high = near;
  while (!stable(low, wavelength)) high = low, low /= 1.2;
  while (stable(high, wavelength))
    if (low = high, high *= 1.2; high > 0.6) return high;
  while (high - low > 1e-7 * low) (stable(0.5 * (low + high), wavelength) ? low : high) = 0.5 * (low + high);
  return 0.5 * (low + high);
}

inline Onset StackBifurcation::onset(double shortest, double longest) const {
  Onset best{1, shortest};
  double near = 0.02;
  for (double l = shortest; l <= longest; l *= 1.15)
    if (near = strain_at(l, near); near < best.strain) best = {near, l};
  // Parabolas in the logarithm of the length, each about the least so far.
  for (double ratio = 1.1; ratio > 1.005; ratio = 1 + (ratio - 1) / 2) {
    const double shorter = strain_at(best.wavelength / ratio, best.strain),
                 longer = strain_at(best.wavelength * ratio, best.strain);
    best.wavelength *= std::pow(ratio, vertex(shorter, best.strain, longer).first);
    best.strain = strain_at(best.wavelength, best.strain);
  }
  return best;
}

}  // namespace rhytid::test
