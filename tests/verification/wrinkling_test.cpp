// When a film on a soft layer wrinkles (B10): the compressive strain at which the
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

#include "film_strip.h"
#include "sim/scene/load.h"
#include "tests/support/paths.h"

namespace rhytid::test {
namespace {

// The reference against what is known of it: a film on a half space, thin-film theory ε = ¼ (3
// E_s/E_f)^(2/3), λ = 2π h (E_f/3E_s)^(1/3) to its own accuracy, and exact figures computed apart for
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

// The layers of data/scenes/sheet_drag, polynomials alone: that the simulator's elements wrinkle as theirs do
// is the next test's. Two quadratic elements, a thin one next to the film, are better than one cubic for one
// node more through the thickness.
TEST(Wrinkling, WhatTheReferenceSceneGives) {
  const std::vector<StackLayer> layers = layers_of({25, 1.5, 200, false});  // in tenths of a millimetre
  const Scene scene = load_scene(source_dir() + "/data/scenes/sheet_drag/scene.json");
  ASSERT_EQ(scene.skin.layers.size(), 2u);
  EXPECT_NEAR(scene.skin.layers[0].thickness, 2.5, 1e-12);
  EXPECT_NEAR(scene.skin.layers[1].thickness, 0.15, 1e-12);
  EXPECT_NEAR(scene.skin.layers[1].youngs_modulus / scene.skin.layers[0].youngs_modulus, 200, 1e-9);
  struct Row {
    const char* name;
    std::vector<StackElement> elements;
    double bonded, sliding;  // how much later than exact
  };
  const Row rows[] = {{"2 | 2", {{1, 2, 3}, {1, 2, 3}}, 0.2047, 0.1115},
                      {"3 | 2", {{1, 3, 4}, {1, 2, 3}}, 0.0354, 0.0414},
                      {"4 | 2", {{1, 4, 5}, {1, 2, 3}}, 0.0105, 0.0072},
                      {"2 + 2 | 2, even", {{1, 2, 3, 0.5}, {1, 2, 3, 0.5}, {1, 2, 3}}, 0.0476, 0.0474},
                      {"2 + 2 | 2, 0.8 and 0.2", {{1, 2, 3, 0.8}, {1, 2, 3, 0.2}, {1, 2, 3}}, 0.0070, 0.0076},
                      {"3 + 3 | 2, even", {{1, 3, 4, 0.5}, {1, 3, 4, 0.5}, {1, 2, 3}}, 0.0064, 0.0058},
                      {"2 | 2, default rule", {{1, 2, 2}, {1, 2, 2}}, -0.0060, -0.0065},
                      {"3 | 2, default rule", {{1, 3, 3}, {1, 2, 2}}, 0.0073, 0.0002}};
  for (const bool sliding : {false, true}) {
    const Onset exact = StackBifurcation(layers, fine_elements(), sliding).onset(25, 60);
    std::printf("soft 2.5 mm, film 0.15 mm, 200:1, %s base: exact %.4f %%, %.3f mm\n",
                sliding ? "sliding" : "bonded", 100 * exact.strain, 0.1 * exact.wavelength);
    for (const Row& row : rows) {
      const Onset o = StackBifurcation(layers, row.elements, sliding).onset(20, 60);
      std::printf("  %-24s %+.2f %% / %+.1f %% of exact\n", row.name, 100 * (o.strain / exact.strain - 1),
                  100 * (o.wavelength / exact.wavelength - 1));
      EXPECT_NEAR(o.strain / exact.strain - 1, sliding ? row.sliding : row.bonded, 5e-4) << row.name;
    }
  }
}

/// What a scheme must find: its strain and wavelength over the exact ones, and its own as computed apart from
/// this project with exact waves along x (strain in %, wavelength in films; 0 where none was).
struct Expected {
  Scheme scheme;
  double strain_ratio[2], wavelength_ratio[2];  // bonded, sliding
  double strain_apart[2], wavelength_apart[2];
};

// Two judges. The polynomials of stack_bifurcation.h, to the bracket: a strip that misses them has wrong elements.
// And the distance from the exact onset, as tests/verification/README.md prints it: it fails when either the
// elements or the polynomials change, also together.
TEST(Wrinkling, StripsOfElementsWrinkleAsTheirPolynomialsMust) {
  const Expected table[] = {
      {{"composite 2", 2, 2, 1}, {5.385, 3.548}, {1.442, 3.067}, {8.94, 5.31}, {31.7, 80.1}},
      {{"composite 3", 3, 2, 1}, {1.170, 1.711}, {1.198, 1.841}, {1.93, 0}, {26.3, 0}},
      {{"composite 4", 4, 2, 1}, {1.134, 1.217}, {1.099, 1.243}, {1.87, 0}, {24.1, 0}},
      {{"stacked 2|2", 0, 2, 1}, {1.263, 1.141}, {0.829, 0.966}, {2.08, 0}, {18.2, 0}},
      {{"stacked 3|2", 0, 3, 1}, {1.010, 1.059}, {1.005, 1.015}, {0, 0}, {0, 0}},
      {{"stacked 2,2|2", 0, 2, 2}, {1.028, 1.066}, {0.990, 1.010}, {1.70, 1.606}, {21.7, 26.35}}};
  const double exact_strain[] = {0.01650, 0.01507}, exact_wavelength[] = {21.94, 26.09};
  int base = 0;
  for (const Stack& stack : {Stack{10, 1, 200, false}, Stack{20, 1, 200, true}}) {
    const Onset exact = StackBifurcation(layers_of(stack), fine_elements(), stack.sliding).onset(15, 40);
    EXPECT_NEAR(exact.strain, exact_strain[base], 1.5e-3 * exact_strain[base]);
    EXPECT_NEAR(exact.wavelength, exact_wavelength[base], 2e-3 * exact_wavelength[base]);
    std::printf("film 1 on %g, 200:1, %s base: exact %.4f %%, %.2f\n", stack.soft,
                stack.sliding ? "sliding" : "bonded", 100 * exact.strain, exact.wavelength);
    for (const Expected& row : table) {
      const Scheme& scheme = row.scheme;
      const StackBifurcation polynomials(layers_of(stack), elements_of(scheme), stack.sliding);
      const Onset own = polynomials.onset(15, 90);
      const double found = Strip(stack, scheme, own.wavelength).onset(own.strain);
      std::printf("  %-14s %.4f %%: %+.3f %% of its polynomials' (%.2f), %+.1f %% / %+.1f %% of exact\n",
                  scheme.name, 100 * found, 100 * (found / own.strain - 1), own.wavelength,
                  100 * (found / exact.strain - 1), 100 * (own.wavelength / exact.wavelength - 1));
      EXPECT_NEAR(found, own.strain, 5e-4 * own.strain) << scheme.name;
      EXPECT_NEAR(found / exact.strain, row.strain_ratio[base], 2e-3 * row.strain_ratio[base]) << scheme.name;
      EXPECT_NEAR(own.wavelength / exact.wavelength, row.wavelength_ratio[base],
                  5e-3 * row.wavelength_ratio[base])
          << scheme.name;
      if (row.strain_apart[base] > 0) {
        EXPECT_NEAR(100 * found, row.strain_apart[base], 0.01 * row.strain_apart[base]) << scheme.name;
        EXPECT_NEAR(own.wavelength, row.wavelength_apart[base], 0.01 * row.wavelength_apart[base])
            << scheme.name;
      }
      // Shorter and longer waves come later, when theory says.
      for (const double ratio : {1 / 1.2, 1.2}) {
        const double later = polynomials.strain_at(ratio * own.wavelength, own.strain);
        EXPECT_GT(later, 1.005 * own.strain);
        Strip strip(stack, scheme, ratio * own.wavelength);
        EXPECT_TRUE(strip.stable((1 - 1e-3) * later)) << scheme.name << ' ' << ratio;
        EXPECT_FALSE(strip.stable((1 + 1e-3) * later)) << scheme.name << ' ' << ratio;
      }
    }
    ++base;
  }
}

// The default rule has q points through a layer where the energy asks for q + 1: waves come a little earlier
// than those polynomials say, by what the same Gauss points say of the exact waves.
TEST(Wrinkling, TheDefaultRuleIsNearerToExactThanTheFullOne) {
  struct Row {
    Scheme scheme;
    double error[2];  // of the strain: bonded, sliding
  };
  const Row rows[] = {{{"stacked 2|2", 0, 2, 1, RuleKind::product}, {-0.0279, -0.0178}},
                      {{"composite 3", 3, 2, 1, RuleKind::product}, {0.1668, 0.6561}},
                      {{"composite 4", 4, 2, 1, RuleKind::product}, {0.1331, 0.2122}},
                      {{"stacked 3|2", 0, 3, 1, RuleKind::product}, {0.0047, -0.0005}},
                      {{"stacked 2,2|2", 0, 2, 2, RuleKind::product}, {0.0000, 0.0009}}};
  for (const Stack& stack : {Stack{10, 1, 200, false}, Stack{20, 1, 200, true}}) {
    const Onset exact = StackBifurcation(layers_of(stack), fine_elements(), stack.sliding).onset(15, 40);
    std::printf("film 1 on %g, 200:1, %s base: strain / wavelength of exact\n", stack.soft,
                stack.sliding ? "sliding" : "bonded");
    for (const Row& row : rows) {
      const Scheme& scheme = row.scheme;
      Scheme full = scheme;
      full.rule = RuleKind::full;
      const Onset own = StackBifurcation(layers_of(stack), elements_of(scheme), stack.sliding).onset(15, 90);
      const Onset late = StackBifurcation(layers_of(stack), elements_of(full), stack.sliding).onset(15, 90);
      const double found = Strip(stack, scheme, own.wavelength).onset(own.strain);
      const double error = found / exact.strain - 1, error_of_full = late.strain / exact.strain - 1;
      std::printf("  %-14s %+.2f %% / %+.2f %%; full rule %+.2f %% / %+.2f %%\n", scheme.name, 100 * error,
                  100 * (own.wavelength / exact.wavelength - 1), 100 * error_of_full,
                  100 * (late.wavelength / exact.wavelength - 1));
      EXPECT_NEAR(found, own.strain, 5e-4 * own.strain) << scheme.name;
      EXPECT_LT(std::fabs(error), std::fabs(error_of_full)) << scheme.name;
      EXPECT_NEAR(error, row.error[stack.sliding], 2e-3 * (1 + std::fabs(row.error[stack.sliding])))
          << scheme.name;
    }
  }
}

}  // namespace
}  // namespace rhytid::test
