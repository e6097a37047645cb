// Friction with a lag that is carried on to the end of the step: pressure and normal as they would be there if they
// went on changing as they did over the step before, instead of as they were at its start.
//
//   rates         ṗ = (p_n − p_{n−1}) / dt_n,  ṅ = (n_n − n_{n−1}) / dt_n              kept with p_n, n_n
//   pressure      f_n = p_n + dt ṗ  rising,  p_n² / (p_n − dt ṗ)  falling
//   direction     n = (n_n + dt ṅ) / |n_n + dt ṅ|
//
// dt is the step's own length, so that steps of different lengths (halved ones) need nothing more. The pressure that
// falls agrees with the line to second order, and joins it C¹; it is never negative and has no corner where the line
// would reach zero, since 1/p goes on instead. |n_n + dt ṅ| ≥ 1, so that the direction is always defined. The lag is
// then off by O(dt²) instead of O(dt), where pressure and normal are smooth in time.
//
// Where there is no place before, rates are zero and the lag is that of FrictionLaw: in the first step of a run (frame 0
// is no equilibrium of what touches there already) and where the shape has no gradient (the centre of a sphere). A
// settling step is so long that its rates are nothing. A point that begins to touch has had a normal before, and the
// pressure 0: both go on, so that the lag is a continuous function of the positions before. That is why normals are kept
// of points that do not touch.
//
// Source   own; the step's equations are those of the publication's friction with another f_n and n.
// Units    p [MPa], ṗ [MPa/s], n [1], ṅ [1/s], dt [s].
// Shapes   as FrictionLaw; history = p, n [3], ṗ, ṅ [3] (n = 0: none); prepared = FrictionLaw's, then p, n [3].
// Smooth   as FrictionLaw; f_n is C¹ in p and ṗ.
// Tests    tests/sim/terms/extrapolated_lag_test.cpp, law_properties_test.cpp, term_kernels_test.cpp,
//          tests/adjoint/sweeps_test.cpp, tests/verification/friction_test.cpp
#pragma once

#include <cmath>

#include "sim/terms/contact_law.h"

namespace rhytid {
inline namespace RHYTID_ISA {

/// The same parameters, forces and energies as SizedFrictionLaw; other history.
template <int sizes>
struct SizedExtrapolatedFrictionLaw : SizedFrictionLaw<sizes> {
  using Base = SizedFrictionLaw<sizes>;
  static constexpr int ns = 8, np = Base::np + 4;
  /// The rates are no lag: a step cannot be solved again with its own.
  static constexpr bool history_is_lag = false;

  template <class T>
  void prepare(const T* u_old, const T* history, const T* theta, const double* rest, double dt,
               T* prepared) const {
    using std::sqrt;
    T lag[4];
    lag[0] = pressure_ahead(history[0], dt * history[4]);
    for (int i = 1; i < 4; ++i) lag[i] = history[i] + dt * history[4 + i];
    const T square = lag[1] * lag[1] + lag[2] * lag[2] + lag[3] * lag[3];
    if (value_of(square) > 0) {
      const T length = sqrt(square);
      for (int i = 1; i < 4; ++i) lag[i] = lag[i] / length;
    }
    Base::template prepare<T>(u_old, lag, theta, rest, dt, prepared);
    for (int i = 0; i < 4; ++i) prepared[Base::np + i] = history[i];
  }

  /// f_n from the pressure and its change over the step at the rate before.
  template <class T>
  static T pressure_ahead(const T& pressure, const T& change) {
    if (!(value_of(pressure) > 0)) return T(0.0);
    if (value_of(change) >= 0) return pressure + change;
    return pressure * pressure / (pressure - change);
  }

  template <class T>
  void update(const T* u, const T* prepared, const T* theta, const double* rest, double dt,
              T* history) const {
    using std::sqrt;
    for (int i = 0; i < ns; ++i) history[i] = T(0.0);
    const GapAt at = gap_at<sizes>(*this->shape, u, rest, theta + 3, theta + 9, theta + 17);
    if (!at.jet.supported) return;
    const LiftedGap<T> g = lift_gap<sizes>(at, u, rest, theta + 3, theta + 9, theta + 17);
    if (!this->template lag_of<T>(g, theta, rest, history)) return;
    const T* before = prepared + Base::np;
    if (value_of(before[1]) == 0 && value_of(before[2]) == 0 && value_of(before[3]) == 0) return;
    for (int i = 0; i < 4; ++i) history[4 + i] = (history[i] - before[i]) * (1 / dt);
  }

  /// Normals are kept of points that do not touch, too: false only where the shape has no support.
  bool remembers(const double* u, const double* theta, const double* rest) const {
    return gap_at<sizes>(*this->shape, u, rest, theta + 3, theta + 9, theta + 17).jet.supported;
  }
};

using ExtrapolatedFrictionLaw = SizedExtrapolatedFrictionLaw<0>;
using ExtrapolatedEllipsoidFrictionLaw = SizedExtrapolatedFrictionLaw<3>;

}  // namespace RHYTID_ISA
}  // namespace rhytid
