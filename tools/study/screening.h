// Where to evaluate a model to see which of its inputs matter over their whole range, and what the values
// say. Inputs are in [0, 1]; nothing here knows what they are.
//
// Morris (elementary effects)
//   trajectories of k + 1 points on p levels, each step moving one input by Δ = p/(2(p−1)):
//   effect_i = (f(x ± Δ e_i) − f(x))/±Δ;   μ = mean, μ* = mean of |effect|, σ = standard deviation
//   μ* large: the input matters; σ beside it: not linear, or together with others
//
// Sobol (variance shares), Latin hypercube samples A and B [N][k], AB_i = A with column i of B
//   S_i = ⟨f_B (f_ABi − f_A)⟩/V  first order,   T_i = ⟨(f_A − f_ABi)²⟩/(2V)  total
//
// Source   M. Morris, Technometrics 33 (1991); F. Campolongo et al., Env. Modelling & Software 22 (2007)
// (μ*);
//          A. Saltelli et al., Computer Physics Communications 181 (2010), eq. (b), and Jansen's (f) for T.
// Tests    tests/tools/screening_test.cpp
#pragma once

#include <vector>

#include "sim/core/types.h"

namespace rhytid::tools {

/// Points of all trajectories, one after the other, each with k + 1 rows.
struct MorrisDesign {
  MatrixXd points;         ///< [trajectories · (k+1)][k]
  std::vector<int> moved;  ///< [trajectories · k] which input each step moves
  double step = 0;         ///< Δ
};

/// The same seed gives the same design on every machine. Throws ContractError unless there are inputs and
/// trajectories, and an even number of levels.
MorrisDesign morris_design(int inputs, int trajectories, int levels, unsigned seed);

/// Effects of one input; NaN with too few (one for means, two for the deviation and the error).
struct MorrisEffect {
  double mean = 0, mean_absolute = 0, deviation = 0;
  double error = 0;  ///< standard error of mean_absolute
  int count = 0;     ///< effects that could be formed
};

/// Effects of every input on values at the design's points; a value that is not finite is one that is
/// missing.
std::vector<MorrisEffect> morris_effects(const MorrisDesign& design, const VectorXd& values);

/// A, B, AB_0, ..., AB_k−1, each with `samples` rows, for k inputs. Throws ContractError unless both are
/// positive.
MatrixXd sobol_design(int inputs, int samples, unsigned seed);

struct SobolIndex {
  double first = 0, total = 0;              ///< NaN when nothing varies
  double first_error = 0, total_error = 0;  ///< standard deviations over 200 resamples
  int count = 0;                            ///< samples with all three values
};

/// Indices of every input from values at the points of sobol_design; values that are not finite are missing.
std::vector<SobolIndex> sobol_indices(int inputs, int samples, const VectorXd& values, unsigned seed);

}  // namespace rhytid::tools
