// Implicit moving least squares: a smooth gap function from points with unit normals (the skull).
//
//   g(x) = Σ θᵢ sᵢ / Σ θᵢ,   sᵢ = nᵢ·(x − pᵢ),   θᵢ = θ(|x − pᵢ|),   support |x − pᵢ| < h
//   ∇g   = Σ (θᵢ nᵢ + (sᵢ − g) ∇θᵢ) / W,   W = Σ θᵢ
//   ∇²g  = [Σ (∇θᵢ nᵢᵀ + nᵢ ∇θᵢᵀ + (sᵢ − g) ∇²θᵢ) − ∇W ∇gᵀ − ∇g ∇Wᵀ] / W
//
// Kernels  smooth   θ = (1 − d²/h²)⁴, worked in d²: C³, also at the points
//          literal  θ = (1 − d_ε/h)⁴, d_ε = √(d² + ε²): the printed kernel, whose cone at d = 0 (a jump of ∇g
//          at
//                   every point, where the rest nodes sit) is rounded over ε
// Facts    a plane is reproduced exactly. On a sphere g is offset by about c h²/R (c = .083 smooth, .054
//          literal), so contact subtracts the rest gap. |∇g| ≠ 1 away from the surface. Where no point is in
//          reach g does not exist: GapJet::supported is false, and the caller decides.
// Source   the publication, "Skull", eq. of g_skull and θ.
// Tests    tests/sim/surface/imls_test.cpp
#pragma once

#include <memory>
#include <span>
#include <vector>

#include "sim/surface/implicit_shape.h"

namespace rhytid {

class PointLattice;

enum class ImlsKernel { smooth, literal };

struct ImlsOptions {
  double support = 0;  ///< h, mm; 0 = three median point spacings
  ImlsKernel kernel = ImlsKernel::smooth;
  double literal_epsilon = 0;  ///< ε of the literal kernel, mm; 0 = 1e-3 h
  /// Neighbour lists are made once for all queries (PointLattice). Without, every query searches a tree: the
  /// same bits, slower.
  bool cached_neighbours = true;
};

/// How much of the jet to compute; what is left out stays zero. The parts that are computed have the same
/// bits for every order.
enum class JetOrder { gap, gradient, hessian };

class ImlsSurface final : public ImplicitShape {
 public:
  /// points [n][3] mm, normals [n][3] of any length > 0 (stored normalised). Throws ContractError when there
  /// is no point, sizes differ, something is not finite, a normal is zero, or the support is not positive.
  ImlsSurface(const MatrixX3& points, const MatrixX3& normals, const ImlsOptions& options = {});
  ~ImlsSurface() override;

  GapJet evaluate(const Vec3& x) const override { return evaluate(x, JetOrder::hessian); }
  GapJet evaluate(const Vec3& x, JetOrder order) const;
  /// True when x lies below the tangent plane of the nearest point.
  bool behind(const Vec3& x) const override;

  std::size_t num_neighbours() const override;
  /// Samples, tree (estimated) and neighbour lists.
  std::size_t bytes() const override;

  double support() const { return support_; }
  int num_points() const { return static_cast<int>(samples_.size()); }

 private:
  struct Sample {
    Vec3 point;
    Vec3 normal;
  };
  class Tree;

  std::vector<Sample> samples_;
  double support_ = 0;
  double epsilon_ = 0;
  ImlsKernel kernel_ = ImlsKernel::smooth;
  std::unique_ptr<const Tree> tree_;
  std::unique_ptr<const PointLattice> lattice_;  // null: search the tree

  void search(const Vec3& x, double radius, std::vector<int>* found) const;
  GapJet sum(const Vec3& x, std::span<const int> candidates, JetOrder order) const;
};

/// Three times the median distance from a point to its nearest distinct neighbour, mm. points [n][3].
/// Throws ContractError when there are not two distinct points.
double default_imls_support(const MatrixX3& points);

}  // namespace rhytid
