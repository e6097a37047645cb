// How the Maxwell damper is advanced over a step: three numbers of r = dt/τ, α = e^(−r).
//
//   before the step   C^v ← C^v #_pre C̄_old        (relaxation toward the previous configuration)
//   during it         energy  weight · ψ_m(trial)
//   after it          C^v ← C^v #_post C̄
//
//   scheme          pre        weight   post
//   exponential     1 − α/β    β        1 − β     default: second order, exact at constant rate; β = (1−α)/r
//   literal         0          α        1 − α     first order, as printed in the publication
//   strang          1 − √α     √α       1 − √α    second order
//   backward_euler  0          1/(1+r)  r/(1+r)   first order
//
// Source   the publication, "Viscous Time Integration" (`literal`); the others: sim/terms/README.md.
// Tests    tests/sim/terms/skin_law_test.cpp (DamperOrder), law_edges_test.cpp (DamperNumbers)
#pragma once

#include <cmath>

#include "sim/math/reverse.h"
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
      // β = −expm1(−r)/r. For small r, 1 − β by its series and 1 − α/β = r − (1 − β)/β, since α = 1 − r β:
      // all digits are kept down to r = 0 (the first term left out is r⁸/9!, 7e-20 at the switch).
      if (value_of(r) < 0.02) {
        T series = 1.0 - r / 8.0;
        for (int k = 7; k >= 3; --k) series = 1.0 - r * (1.0 / k) * series;
        const T post = r * 0.5 * series, beta = 1.0 - post;
        return {r - post / beta, beta, post};
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

/// The same, recorded: three functions of τ.
template <class V>
Damper<Reverse<V>> damper(DamperScheme scheme, const Reverse<V>& tau, double dt) {
  const auto number = [&](auto member, bool slope) {
    return map_lanes(
        [&](double at) {
          const Dual<1> d = damper(scheme, Dual<1>::variable(at, 0), dt).*member;
          return slope ? d.d[0] : d.v;
        },
        tau.v);
  };
  const auto recorded = [&](auto member) {
    return Reverse<V>::unary(tau, number(member, false), number(member, true));
  };
  using D = Damper<Dual<1>>;
  return {recorded(&D::pre), recorded(&D::weight), recorded(&D::post)};
}

}  // namespace RHYTID_ISA
}  // namespace rhytid
