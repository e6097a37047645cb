// One step of a model under dead loads with chosen displacement components prescribed: what the verification
// problems need and scenes have no use for.
#pragma once

#include <utility>
#include <vector>

#include "sim/scene/scene_model.h"
#include "sim/solve/minimise.h"
#include "sim/time/model.h"

namespace rhytid::test {

/// A slab 2 × side along x and y, one material layer, no features; edit before building.
inline Scene slab_scene(double side, int cells, double thickness, int elements, int order,
                        int thickness_order) {
  Scene s;
  s.name = s.file = "verification";
  s.skin.surface.grid_size = {side, side};
  s.skin.surface.grid_cells = {cells, cells};
  s.skin.order = order;
  s.skin.rim = RimCondition::free;
  LayerScene layer;
  layer.name = "slab";
  layer.thickness = thickness;
  layer.elements = elements;
  layer.order = thickness_order;
  layer.youngs_modulus = 0.02;
  s.skin.layers = {layer};
  return s;
}

/// W(u) − load·u with some components of u held at their starting values. The model must have no constraints
/// of its own (rim free), so that unknowns are the displacement components in node order.
class LoadedProblem final : public Objective {
 public:
  LoadedProblem(StepProblem& step, std::vector<int> held, VectorXd load)
      : step_(step), held_(std::move(held)), load_(std::move(load)) {}
  const BlockPattern& pattern() const override { return step_.pattern(); }
  double energy(const VectorXd& q, VectorXd* gradient) override {
    const double e = step_.energy(q, gradient) - load_.dot(q);
    if (gradient) {
      *gradient -= load_;
      for (int i : held_) (*gradient)[i] = 0;
    }
    return e;
  }
  double force_scale() const override { return step_.force_scale(); }
  void hessian(const VectorXd& q, Curvature curvature, BlockMatrix& out) override {
    step_.hessian(q, curvature, out);
    for (int i : held_) out.fix(i);
  }
  double largest_feasible_step(const VectorXd& q, const VectorXd& d) override {
    return step_.largest_feasible_step(q, d);
  }
  /// Solves from q (in/out).
  [[nodiscard]] MinimiserReport solve(VectorXd& q, double relative_tolerance = 1e-12) {
    CholeskyFactor factor(pattern());
    BlockMatrix matrix(pattern());
    MinimiserOptions options;
    options.relative_tolerance = relative_tolerance;
    options.absolute_tolerance = 1e-16;
    options.polish = true;
    return minimise(*this, q, options, factor, matrix);
  }

 private:
  StepProblem& step_;
  std::vector<int> held_;
  VectorXd load_;
};

}  // namespace rhytid::test
