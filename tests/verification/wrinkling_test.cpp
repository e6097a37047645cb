// When a film on a soft layer wrinkles (B10, numerics-notes 0.1): the compressive strain at which the
// assembled raw Hessian of a strip of real elements stops being positive definite, and at which wavelength,
// against the linearised bifurcation of stack_bifurcation.h.
//
// The strip is half a wave long between planes of symmetry, one cell wide, held along y. Its flat state is a
// minimum as long as no wave grows, so the strain at which the certificate of the minimiser turns is the
// onset.
#include <gtest/gtest.h>

#include <cmath>
#include <cstdio>
#include <string>

#include "loaded_problem.h"
#include "stack_bifurcation.h"

namespace rhytid::test {
namespace {

struct Stack {
  double soft, film, ratio;
  bool sliding;
};

/// How both sides discretise the thickness. order 0: stacked, `soft_elements` of order q under a film of
/// order 2.
struct Scheme {
  const char* name;
  int composite_order, soft_order, soft_elements;
};

std::vector<StackLayer> layers_of(const Stack& s) {
  return {{s.soft, 0.02}, {s.film, 0.02 * s.ratio}};
}

/// Fine enough to be exact: see WavesThatAreKnown.
std::vector<StackElement> fine_elements() {
  return {{1, 6, 7, 0.35}, {1, 6, 7, 0.3}, {1, 6, 7, 0.2}, {1, 6, 7, 0.15}, {1, 6, 7}};
}

/// The same polynomials and Gauss points as the simulator's elements.
std::vector<StackElement> elements_of(const Scheme& s) {
  if (s.composite_order > 0) return {{2, s.composite_order, s.composite_order + 1}};
  std::vector<StackElement> e(static_cast<std::size_t>(s.soft_elements),
                              {1, s.soft_order, s.soft_order + 1, 1.0 / s.soft_elements});
  e.push_back({1, 2, 3});
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

  /// Is the flat state under this compression a minimum?
  bool stable(double strain) {
    VectorXd q = VectorXd::Zero(3 * model_.model().num_nodes());
    for (Eigen::Index i = 0; 3 * i < q.size(); ++i) q[3 * i] = -strain * model_.model().mesh.rest(i, 0);
    LoadedProblem flat(step_, in_plane_, VectorXd::Zero(q.size()));
    MinimiserOptions options;
    options.relative_tolerance = 1e-12;
    EXPECT_TRUE(minimise(flat, q, options, factor_, matrix_).converged());
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

 private:
  static Scene scene(const Stack& stack, const Scheme& scheme, double length) {
    Scene s = slab_scene(length, 2, stack.soft, scheme.soft_elements, 4, scheme.soft_order);
    s.skin.surface.grid_size = {length, length / 2};
    s.skin.surface.grid_cells = {2, 1};
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

// The reference against what is known of it: a film on a half space, thin-film theory ε = ¼ (3
// E_s/E_f)^(2/3), λ = 2π h (E_f/3E_s)^(1/3) to its own accuracy, and exact figures of numerics-notes for
// finite layers.
TEST(Wrinkling, TheReferenceKnowsFilmsOnHalfSpaces) {
  std::printf("film of 1 on a half space: strain, wavelength (thin-film theory)\n");
  for (const auto& [ratio, strain, wavelength] :
       {std::tuple{100.0, 0.02375, 21.11}, {200.0, 0.015051, 26.17}, {1000.0, 0.005185, 43.97}}) {
    const StackBifurcation deep(
        {{80, 0.02}, {1, 0.02 * ratio}},
        {{1, 9, 10, 0.6}, {1, 9, 10, 0.25}, {1, 9, 10, 0.1}, {1, 9, 10, 0.05}, {1, 6, 7}}, false);
    const Onset o = deep.onset(0.8 * wavelength, 1.25 * wavelength);
    const double theory = 0.25 * std::pow(3 / ratio, 2. / 3),
                 length = 2 * 3.14159265358979 * std::cbrt(ratio / 3);
    std::printf("  %4.0f:1  %.4f %% (%.4f %%), %.3f (%.3f)\n", ratio, 100 * o.strain, 100 * theory,
                o.wavelength, length);
    EXPECT_NEAR(o.strain, strain, 1.5e-3 * strain);
    EXPECT_NEAR(o.wavelength, wavelength, 5e-3 * wavelength);
    EXPECT_NEAR(o.strain, theory, 0.02 * theory);
    EXPECT_NEAR(o.wavelength, length, 0.05 * length);
  }
  for (const auto& [height, strain, wavelength] :
       {std::tuple{5.0, 0.02215, 16.80}, {10.0, 0.01649, 21.94}, {20.0, 0.01510, 25.80}}) {
    const Onset o =
        StackBifurcation(layers_of({height, 1, 200, false}), fine_elements(), false).onset(12, 35);
    EXPECT_NEAR(o.strain, strain, 1.5e-3 * strain);
    EXPECT_NEAR(o.wavelength, wavelength, 2e-3 * wavelength);
  }
}

TEST(Wrinkling, StripsOfElementsWrinkleAsTheirPolynomialsMust) {
  const Scheme schemes[] = {{"composite 2", 2, 2, 1}, {"composite 3", 3, 2, 1}, {"composite 4", 4, 2, 1},
                            {"stacked 2|2", 0, 2, 1}, {"stacked 3|2", 0, 3, 1}, {"stacked 2,2|2", 0, 2, 2}};
  for (const Stack& stack : {Stack{10, 1, 200, false}, Stack{20, 1, 200, true}}) {
    const Onset exact = StackBifurcation(layers_of(stack), fine_elements(), stack.sliding).onset(15, 40);
    std::printf("film 1 on %g, 200:1, %s base: exact %.4f %%, %.2f\n", stack.soft,
                stack.sliding ? "sliding" : "bonded", 100 * exact.strain, exact.wavelength);
    for (const Scheme& scheme : schemes) {
      const StackBifurcation polynomials(layers_of(stack), elements_of(scheme), stack.sliding);
      const Onset own = polynomials.onset(15, 90);
      const double found = Strip(stack, scheme, own.wavelength).onset(own.strain);
      std::printf("  %-14s %.4f %%: %+.3f %% of its polynomials' (%.2f), %+.1f %% / %+.1f %% of exact\n",
                  scheme.name, 100 * found, 100 * (found / own.strain - 1), own.wavelength,
                  100 * (found / exact.strain - 1), 100 * (own.wavelength / exact.wavelength - 1));
      EXPECT_NEAR(found, own.strain, 5e-4 * own.strain) << scheme.name;
      // Shorter and longer waves come later, when theory says.
      for (const double ratio : {1 / 1.2, 1.2}) {
        const double later = polynomials.strain_at(ratio * own.wavelength, own.strain);
        EXPECT_GT(later, 1.005 * own.strain);
        Strip strip(stack, scheme, ratio * own.wavelength);
        EXPECT_TRUE(strip.stable((1 - 1e-3) * later)) << scheme.name << ' ' << ratio;
        EXPECT_FALSE(strip.stable((1 + 1e-3) * later)) << scheme.name << ' ' << ratio;
      }
    }
  }
}

}  // namespace
}  // namespace rhytid::test
