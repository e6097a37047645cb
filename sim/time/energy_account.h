// Where the energy of a step goes: stored, dissipated, done by bodies and by held rims, term by term.
//
//   ΔE = W + W_rim − D − N,     exact for every step to its residual (|R · Δu| at the free nodes)
//
//   E      stored in each term at the end of the step, a function of the state alone
//   W      done by the moving bodies on the skin.  Contact: mean of the forces at both ends times the motion.
//          Friction: traction of the step times the motion of the body's surface
//   W_rim  reaction times motion, summed over components that are not free
//   D      physical.  Friction: traction · slip.  Damper: what the Maxwell spring loses while it relaxes at
//          held strain, before and after the step (damper.h)
//   N      numerical, from the implicit rule: N = Σ_terms (R_k · Δu − ΔE_k − D_k + W_k).  For an elastic term
//          that is ∫ (∂E/∂u at the end − ∂E/∂u on the way) · du, the end force charged for the whole step.
//          O(dt) in sum, O(dt²) over all terms of an elastic scene; derived in sim/time/README.md
//
// Units   mJ.   Tests   tests/verification/energy_balance_test.cpp
#pragma once

#include <string>
#include <vector>

#include "sim/time/model.h"

namespace rhytid {

struct StoredPart {
  std::string name;   ///< "fung", "volumetric", "maxwell"; of other laws the law's own name
  double energy = 0;  ///< at the end of the step
};

struct TermAccount {
  std::string term;                ///< its name in the model
  std::vector<StoredPart> stored;  ///< empty for friction
  double stored_change = 0;        ///< over the step, all parts
  double work = 0;                 ///< by the term's body on the skin, in the step
  double dissipated = 0;           ///< physically, in the step
  double numerical = 0;            ///< by the implicit rule, in the step
};

struct EnergyAccount {
  std::vector<TermAccount> terms;  ///< in the order of the model
  double stored = 0;               ///< at the end of the step
  double stored_change = 0, work = 0, rim_work = 0, dissipated = 0, numerical = 0;  ///< in the step
  /// ΔE − W − W_rim + D + N: zero but for the residual of the step.
  double imbalance = 0;
};

/// The account of a converged step (its last pass) that ended at `end`.
EnergyAccount account_step(const StepProblem& problem, const State& end);

}  // namespace rhytid
