// Small test energies made of 6 × 6 pieces on pairs of neighbouring blocks of a chain.
#pragma once

#include <Eigen/Dense>
#include <Eigen/Eigenvalues>
#include <limits>
#include <vector>

#include "sim/solve/objective.h"

namespace rhytid {

using Vector6 = Eigen::Matrix<double, 6, 1>;
using Matrix6 = Eigen::Matrix<double, 6, 6>;

/// E(q) = Σ piece(q_i, q_{i+1}) over a chain; subclasses give the piece. Unknowns in `fixed` do not move.
class ChainObjective : public Objective {
 public:
  explicit ChainObjective(int num_blocks) : pattern_(num_blocks, pairs(num_blocks)) {}

  /// Value, gradient and Hessian of the piece at (q_i, q_{i+1}).
  virtual double piece(int i, const Vector6& x, Vector6& gradient, Matrix6& hessian) const = 0;

  const BlockPattern& pattern() const override { return pattern_; }
  double force_scale() const override { return scale; }
  double largest_feasible_step(const VectorXd&, const VectorXd&) override {
    return std::numeric_limits<double>::infinity();
  }
  double energy(const VectorXd& q, VectorXd* gradient) override {
    ++evaluations;
    double sum = offset;
    if (gradient) gradient->setZero();
    for (int i = 0; i + 1 < pattern_.num_blocks(); ++i) {
      Vector6 g;
      Matrix6 h;
      sum += piece(i, q.segment<6>(3 * i), g, h);
      if (gradient) gradient->segment<6>(3 * i) += g;
    }
    if (gradient)
      for (const int k : fixed) (*gradient)[k] = 0;
    return sum;
  }
  void hessian(const VectorXd& q, Curvature curvature, BlockMatrix& out) override {
    (curvature == Curvature::raw ? raw_hessians : projected_hessians)++;
    out.set_zero();
    for (int i = 0; i + 1 < pattern_.num_blocks(); ++i) {
      Vector6 g;
      Matrix6 h;
      piece(i, q.segment<6>(3 * i), g, h);
      if (curvature == Curvature::projected) {
        const Eigen::SelfAdjointEigenSolver<Matrix6> eigen(h);
        h = eigen.eigenvectors() * eigen.eigenvalues().cwiseMax(0).asDiagonal() *
            eigen.eigenvectors().transpose();
      }
      out.add(i, h.data());
    }
    for (const int k : fixed) out.fix(k);
  }

  std::vector<int> fixed;
  double scale = 1, offset = 0;
  int evaluations = 0, raw_hessians = 0, projected_hessians = 0;

 private:
  static std::vector<std::vector<int>> pairs(int n) {
    std::vector<std::vector<int>> result;
    for (int i = 0; i + 1 < n; ++i) result.push_back({i, i + 1});
    return result;
  }
  BlockPattern pattern_;
};

/// ½ xᵀ A x − bᵀ x with a fixed positive definite A, minimum A_total⁻¹ b_total.
class QuadraticChain : public ChainObjective {
 public:
  explicit QuadraticChain(int n) : ChainObjective(n) {
    srand(5);
    for (int i = 0; i + 1 < n; ++i) {
      const Matrix6 r = Matrix6::Random();
      a.push_back(r * r.transpose() + 0.1 * Matrix6::Identity());
      b.push_back(Vector6::Random());
    }
  }
  double piece(int i, const Vector6& x, Vector6& gradient, Matrix6& hessian) const override {
    hessian = a[i];
    gradient = a[i] * x - b[i];
    return 0.5 * x.dot(a[i] * x) - b[i].dot(x);
  }
  VectorXd solution() const {
    const int n = pattern().num_unknowns();
    MatrixXd full = MatrixXd::Zero(n, n);
    VectorXd right = VectorXd::Zero(n);
    for (std::size_t i = 0; i < a.size(); ++i) {
      full.block<6, 6>(3 * i, 3 * i) += a[i];
      right.segment<6>(3 * i) += b[i];
    }
    return full.ldlt().solve(right);
  }
  std::vector<Matrix6> a;
  std::vector<Vector6> b;
};

/// Rosenbrock's valley along the chain, components twisted: Σ_c 100 (y_d − x_c²)² + (1 − x_c)², d = c + 1
/// mod 3. Zero, its least value, where everything is 1.
class RosenbrockChain : public ChainObjective {
 public:
  using ChainObjective::ChainObjective;
  double piece(int, const Vector6& v, Vector6& gradient, Matrix6& hessian) const override {
    double sum = 0;
    gradient.setZero();
    hessian.setZero();
    for (int c = 0; c < 3; ++c) {
      const int d = 3 + (c + 1) % 3;
      const double x = v[c], gap = v[d] - x * x;
      sum += 100 * gap * gap + (1 - x) * (1 - x);
      gradient[c] += -400 * gap * x - 2 * (1 - x);
      gradient[d] += 200 * gap;
      hessian(c, c) += -400 * gap + 800 * x * x + 2;
      hessian(c, d) += -400 * x;
      hessian(d, c) += -400 * x;
      hessian(d, d) += 200;
    }
    return sum;
  }
};

/// Two wells per block in x, springs between neighbours: (x² − 1)²/4 + (y² + z²)/2 at the first block of the
/// pair, and stiffness/2 |difference|². Everything 0 is a saddle; the least value 0 is at x = 1 or x = −1
/// throughout, but for the last block, which has no well of its own and follows.
class DoubleWellChain : public ChainObjective {
 public:
  using ChainObjective::ChainObjective;
  double stiffness = 0.5;
  double piece(int, const Vector6& v, Vector6& gradient, Matrix6& hessian) const override {
    const double x = v[0], well = x * x - 1;
    const Vec3 difference = v.head<3>() - v.tail<3>();
    gradient << stiffness * difference, -stiffness * difference;
    gradient[0] += x * well;
    gradient[1] += v[1];
    gradient[2] += v[2];
    hessian.setZero();
    hessian.diagonal().setConstant(stiffness);
    for (int c = 0; c < 3; ++c) hessian(c, 3 + c) = hessian(3 + c, c) = -stiffness;
    hessian(0, 0) += 3 * x * x - 1;
    hessian(1, 1) += 1;
    hessian(2, 2) += 1;
    return well * well / 4 + 0.5 * (v[1] * v[1] + v[2] * v[2]) + 0.5 * stiffness * difference.squaredNorm();
  }
};

/// A film just past its onset: in x each block has stiffness 1 in one piece and −(1 + excess) in the other,
/// and a quartic: least at x = ±√excess. The projected Hessian drops the negative one and is 1/excess times
/// too stiff. The first block has no negative piece and stays at 0; hold the last, which has no other.
class JustBuckledChain : public ChainObjective {
 public:
  using ChainObjective::ChainObjective;
  double excess = 0.01;
  double piece(int, const Vector6& v, Vector6& gradient, Matrix6& hessian) const override {
    const double x = v[3], negative = -(1 + excess);
    gradient = v;
    gradient[3] = negative * x + x * x * x;
    hessian.setIdentity();
    hessian(3, 3) = negative + 3 * x * x;
    return 0.5 * v.squaredNorm() - 0.5 * x * x + 0.5 * negative * x * x + x * x * x * x / 4;
  }
};

/// Σ over the components of both blocks of x − log x, defined for x > 0 only, plus ½ |difference|². Minimum
/// at 1.
class BarrierChain : public ChainObjective {
 public:
  using ChainObjective::ChainObjective;
  bool knows_its_domain = true;
  double lowest_seen = std::numeric_limits<double>::infinity();
  double energy(const VectorXd& q, VectorXd* gradient) override {
    lowest_seen = std::min(lowest_seen, q.minCoeff());
    if (q.minCoeff() <= 0) return std::numeric_limits<double>::infinity();
    return ChainObjective::energy(q, gradient);
  }
  double largest_feasible_step(const VectorXd& q, const VectorXd& d) override {
    double s = std::numeric_limits<double>::infinity();
    if (knows_its_domain)
      for (int i = 0; i < q.size(); ++i)
        if (d[i] < 0) s = std::min(s, -q[i] / d[i]);
    return s;
  }
  double piece(int, const Vector6& v, Vector6& gradient, Matrix6& hessian) const override {
    const Vec3 difference = v.head<3>() - v.tail<3>();
    gradient << difference, -difference;
    gradient.array() += 1 - v.array().inverse();
    hessian.setZero();
    for (int c = 0; c < 3; ++c) hessian(c, 3 + c) = hessian(3 + c, c) = -1;
    hessian.diagonal() = 1 + v.array().square().inverse();
    return v.sum() - v.array().log().sum() + 0.5 * difference.squaredNorm();
  }
};

/// A quartic with a vanishing Hessian at its minimum 0.
class QuarticChain : public ChainObjective {
 public:
  using ChainObjective::ChainObjective;
  double piece(int, const Vector6& v, Vector6& gradient, Matrix6& hessian) const override {
    gradient = 4 * v.array().cube();
    hessian = (12 * v.array().square()).matrix().asDiagonal();
    return v.array().pow(4).sum();
  }
};

}  // namespace rhytid
