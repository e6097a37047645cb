// How the Maxwell damper is advanced over a step: three numbers of r = dt/τ, α = e^(−r).
//
//   before the step   C^v ← C^v #_pre C̄_old        (relaxation toward the previous configuration)
//   during it         energy  weight · ψ_m(trial)
//   after it          C^v ← C^v #_post C̄
//
//   exponential    β = (1−α)/r:  pre 1 − α/β, weight β, post 1 − β   second order, exact at constant rate
//   (default) literal        pre 0, weight α, post 1 − α                       first order, as printed in the
//   publication strang         pre 1 − √α, weight √α, post 1 − √α                second order backward_euler
//   pre 0, weight 1/(1+r), post r/(1+r)               first order
//
// Source   paper.tex "Viscous Time Integration"; DESIGN section 2.
// Tests    tests/sim/terms/skin_law_test.cpp (DamperOrder)
#pragma once

#include <cmath>

#include "sim/math/dual.h"
#include "sim/scene/damper_scheme.h"

namespace rhytid {
inline namespace RHYTID_ISA {

template <class T>
struct Damper {
  T pre, weight, post;
};

/// The three numbers for relaxation time tau [s] and step dt [s].
template <class T>
Damper<T> damper(DamperScheme scheme, const T& tau, double dt) {
  using std::exp;
  using std::expm1;
  const T r = dt / tau;
  switch (scheme) {
    case DamperScheme::exponential: {
      // β = −expm1(−r)/r; 1 − β and 1 − α/β by series where they would cancel.
      if (value_of(r) < 0.02) {
        const T half = r * 0.5;
        const T post = half * (1.0 - r / 3.0 * (1.0 - r / 4.0 * (1.0 - r / 5.0 * (1.0 - r / 6.0))));
        const T beta = 1.0 - post;
        return {1.0 - (1.0 + expm1(-r)) / beta, beta, post};
      }
      const T beta = -expm1(-r) / r;
      return {1.0 - exp(-r) / beta, beta, 1.0 - beta};
    }
    case DamperScheme::literal:
      return {T(0.0), exp(-r), -expm1(-r)};
    case DamperScheme::strang: {
      const T half = -expm1(-0.5 * r);
      return {half, 1.0 - half, half};
    }
    case DamperScheme::backward_euler:
      return {T(0.0), 1.0 / (1.0 + r), r / (1.0 + r)};
    case DamperScheme::none:
      break;
  }
  return {T(0.0), T(1.0), T(0.0)};
}

}  // namespace RHYTID_ISA
}  // namespace rhytid
