// A film on a soft layer between two planes of symmetry half a wave apart, one cell wide, held along y: flat
// states under compression, and how they end.
#pragma once

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <vector>

#include "loaded_problem.h"
#include "stack_bifurcation.h"

namespace rhytid::test {

struct Stack {
  double soft, film, ratio;
  bool sliding;
};

/// How both sides discretise the thickness. order 0: stacked, `soft_elements` of order q under a film of
/// order 2.
struct Scheme {
  const char* name;
  int composite_order, soft_order, soft_elements;
  RuleKind rule = RuleKind::full;  ///< or product
};

inline std::vector<StackLayer> layers_of(const Stack& s) {
  return {{s.soft, 0.02}, {s.film, 0.02 * s.ratio}};
}

/// Fine enough to be exact: see WavesThatAreKnown.
inline std::vector<StackElement> fine_elements() {
  return {{1, 6, 7, 0.35}, {1, 6, 7, 0.3}, {1, 6, 7, 0.2}, {1, 6, 7, 0.15}, {1, 6, 7}};
}

/// The same polynomials and Gauss points as the simulator's elements.
inline std::vector<StackElement> elements_of(const Scheme& s) {
  const int more = s.rule == RuleKind::full ? 1 : 0;
  if (s.composite_order > 0) return {{2, s.composite_order, s.composite_order + more}};
  std::vector<StackElement> e(static_cast<std::size_t>(s.soft_elements),
                              {1, s.soft_order, s.soft_order + more, 1.0 / s.soft_elements});
  e.push_back({1, 2, 2 + more});
  return e;
}

/// Half a wave of the simulator's elements.
class Strip {
 public:
  Strip(const Stack& stack, const Scheme& scheme, double wavelength)
      : model_(scene(stack, scheme, wavelength / 2)),
        native_(model_.native()),
        rest_(model_.model().rest_state()),
        step_(model_.model(), native_, {0, 0, 1}, rest_),
        factor_(step_.pattern()),
        matrix_(step_.pattern()) {
    const MatrixX3& x = model_.model().mesh.rest;
    for (int i = 0; i < model_.model().num_nodes(); ++i) {
      const bool base = i % model_.model().mesh.num_levels == 0;
      const bool end = std::fabs(std::fabs(x(i, 0)) - wavelength / 4) < 1e-9 * wavelength;
      in_plane_.insert(in_plane_.end(), {3 * i, 3 * i + 1});
      held_.push_back(3 * i + 1);
      if (base) in_plane_.push_back(3 * i + 2), held_.push_back(3 * i + 2);
      if (end || (base && !stack.sliding)) held_.push_back(3 * i);
    }
  }

  /// The flat state under this compression: every node moved along x, heights in equilibrium.
  VectorXd flat(double strain) {
    VectorXd q = VectorXd::Zero(3 * model_.model().num_nodes());
    for (Eigen::Index i = 0; 3 * i < q.size(); ++i) q[3 * i] = -strain * model_.model().mesh.rest(i, 0);
    LoadedProblem heights(step_, in_plane_, VectorXd::Zero(q.size()));
    MinimiserOptions options;
    options.relative_tolerance = 1e-12;
    EXPECT_TRUE(minimise(heights, q, options, factor_, matrix_).converged());
    return q;
  }

  /// Is the flat state under this compression a minimum?
  bool stable(double strain) {
    const VectorXd q = flat(strain);
    LoadedProblem free(step_, held_, VectorXd::Zero(q.size()));
    VectorXd gradient(q.size());
    (void)free.energy(q, &gradient);
    EXPECT_LE(gradient.norm(), 1e-10 * step_.force_scale()) << "the flat state is in equilibrium";
    free.hessian(q, Curvature::raw, matrix_);
    return factor_.factorize(matrix_);
  }

  /// The strain of the onset, to 2e-4 of itself; within 1 % of `near`.
  double onset(double near) {
    double low = 0.99 * near, high = 1.01 * near;
    EXPECT_TRUE(stable(low)) << "already wrinkled at strain " << low;
    EXPECT_FALSE(stable(high)) << "still flat at strain " << high;
    while (high - low > 2e-4 * low) (stable(0.5 * (low + high)) ? low : high) = 0.5 * (low + high);
    return 0.5 * (low + high);
  }

  /// Minimises from q with only the ends, the base and y held.
  MinimiserReport minimise_from(VectorXd& q, const MinimiserOptions& options) {
    LoadedProblem free(step_, held_, VectorXd::Zero(q.size()));
    return minimise(free, q, options, factor_, matrix_);
  }

  /// Half the height from the lowest to the highest node of the outer face.
  double amplitude(const VectorXd& q) const {
    double low = 1e300, high = -1e300;
    const SkinMesh& mesh = model_.model().mesh;
    for (int c = 0; c < mesh.num_columns; ++c) {
      const double z = q[3 * mesh.node(c, mesh.num_levels - 1) + 2];
      low = std::min(low, z);
      high = std::max(high, z);
    }
    return 0.5 * (high - low);
  }

 private:
  static Scene scene(const Stack& stack, const Scheme& scheme, double length) {
    Scene s = slab_scene(length, 2, stack.soft, scheme.soft_elements, 4, scheme.soft_order);
    s.skin.surface.grid_size = {length, length / 2};
    s.skin.surface.grid_cells = {2, 1};
    s.skin.rule = scheme.rule;
    if (scheme.composite_order > 0) {
      s.skin.scheme = ThicknessScheme::composite;
      s.skin.composite_order = scheme.composite_order;
    }
    LayerScene film = s.skin.layers[0];
    film.name = "film";
    film.thickness = stack.film;
    film.elements = 1;
    film.order = 2;
    film.youngs_modulus *= stack.ratio;
    s.skin.layers.push_back(film);
    for (LayerScene& l : s.skin.layers) l.relaxing_fraction = 0;
    return s;
  }

  SceneModel model_;
  VectorXd native_;
  State rest_;
  StepProblem step_;
  CholeskyFactor factor_;
  BlockMatrix matrix_;
  std::vector<int> in_plane_, held_;
};

}  // namespace rhytid::test
