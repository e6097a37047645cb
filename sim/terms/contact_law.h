// Penalty contact of a surface point with a rigid implicit shape, and the friction lagged from it; per area.
//
//   contact   Ψ = κ φ(d), d = g₀ + ΔR − g(Rᵀ(x − c)):  d³/(3ε) below ε, ε²/3 + ε(d−ε) + (d−ε)² above
//             (C², κ d² for ε → 0)
//   friction  Ψ = μ f_n D(|u_T|; ε_v dt), u_T = (I − n nᵀ)(x − x_b), x_b = c + R R_oldᵀ (x_old − c_old):
//   where
//             the body, moving and turning, has carried the place that x lay on; f_n, n from the last
//             converged step or pass (sim/time/simulate.h), or extrapolated (extrapolated_friction_law.h)
//             quintic   D = δ⁶/ε⁵ − 3δ⁵/ε⁴ + 5δ⁴/(2ε³) | δ − ε/2
//             quadratic D = δ²/ε − δ³/(3ε²) | δ − ε/3   (IPC)
//
// The shape gives value, gradient and Hessian of its gap in plain numbers; other scalars are lifted through
// them, so a new shape needs nothing here. `inflation` ΔR [mm] is the amount by which the radius differs from
// the shape's own.
//
// Source   the publication, "Contact", "Friction"; deviations: κ in MPa/mm, C² onset, rest gap g₀ subtracted on the
//          base, friction on the displacement of the step (the velocity form as printed is 1/dt too strong).
// Units    κ [MPa/mm], ε [mm], f_n [MPa], x = X + u, c [mm], ε_v [mm/s].
// Shapes   contact θ = κ, inflation, c [3], q [4]; friction θ = κ, inflation, μ, c [3], c_old [3], q [4],
//          q_old [4]; of an ellipsoid then its semi-axes [3]; lag = f_n, n [3]; rest = X [3], g₀. R from the
//          quaternion q (body_frame.h).
// Smooth   contact C² (ε > 0) or C¹; friction C² (quintic) or C¹ (quadratic).
// Tests    tests/sim/terms/law_edges_test.cpp, law_properties_test.cpp, rotating_contact_test.cpp
#pragma once

#include <array>
#include <cmath>
#include <limits>

#include "sim/math/dual.h"
#include "sim/surface/implicit_shape.h"
#include "sim/terms/body_frame.h"

namespace rhytid {
inline namespace RHYTID_ISA {

/// A shape's gap at a point, in plain numbers.
struct GapAt {
  Vec3 x;  ///< in the shape's axes, where it was asked
  GapJet jet;
  SizeDerivatives by_size;  ///< only of a shape that has sizes
  bool inside;              ///< unsupported only: behind the nearest sample, i.e. hopelessly deep
};

/// Gap at X + u of a shape at c with orientation q; `size` [sizes]: of a shape that has three.
template <int sizes, class T>
GapAt gap_at(const ImplicitShape& shape, const T* u, const double* rest, const T* c, const T* q,
             const T* size) {
  double turn[4], world[3], local[3];
  for (int i = 0; i < 4; ++i) turn[i] = value_of(q[i]);
  for (int i = 0; i < 3; ++i) world[i] = value_of(u[i]) + rest[i] - value_of(c[i]);
  Rotation<double>(turn).to_local(world, local);
  GapAt at;
  at.x = Vec3(local[0], local[1], local[2]);
  if constexpr (sizes > 0)
    at.jet =
        shape.evaluate_sized(at.x, Vec3(value_of(size[0]), value_of(size[1]), value_of(size[2])), at.by_size);
  else
    at.jet = shape.evaluate(at.x);
  at.inside = !at.jet.supported && shape.behind(at.x);
  return at;
}

/// Gap and gradient (in world axes) for any scalar, through the shape's second-order jet.
template <class T>
struct LiftedGap {
  T gap;
  T gradient[3];
};

/// The same point as `at` with the derivatives of u, c, q and size.
template <int sizes, class T>
LiftedGap<T> lift_gap(const GapAt& at, const T* u, const double* rest, const T* c, const T* q,
                      const T* size) {
  const Rotation<T> rotation(q);
  const T world[3] = {u[0] + rest[0] - c[0], u[1] + rest[1] - c[1], u[2] + rest[2] - c[2]};
  T x[3], gradient[3];
  rotation.to_local(world, x);
  LiftedGap<T> r;
  const GapJet& jet = at.jet;
  const T dx[3] = {x[0] - at.x[0], x[1] - at.x[1], x[2] - at.x[2]};
  r.gap = T(jet.gap) + dx[0] * jet.gradient[0] + dx[1] * jet.gradient[1] + dx[2] * jet.gradient[2];
  for (int i = 0; i < 3; ++i)
    gradient[i] = T(jet.gradient[i]) + dx[0] * jet.hessian(i, 0) + dx[1] * jet.hessian(i, 1) +
                  dx[2] * jet.hessian(i, 2);
  for (int k = 0; k < sizes; ++k) {
    const T change = size[k] - value_of(size[k]);
    r.gap += change * at.by_size.gap[k];
    for (int i = 0; i < 3; ++i) gradient[i] += change * at.by_size.gradient(i, k);
  }
  rotation.to_world(gradient, r.gradient);
  return r;
}

/// Whether a point touches: the depth ΔR + g₀ − gap is positive. Asked in plain numbers, before any derivative is
/// computed, since most points do not.
inline bool touches(const GapAt& at, double inflation, double rest_gap) {
  return at.jet.supported && inflation + rest_gap - at.jet.gap > 0;
}

/// `sizes` 0: the shape is what it is. 3: its sizes are the last parameters.
template <int sizes>
struct SizedContactLaw {
  static constexpr int ne = 3, ns = 0, np = 0, ntheta = 9 + sizes, nrest = 4;
  static constexpr const char* name = "contact";
  const ImplicitShape* shape = nullptr;
  double onset = 1e-3;  ///< ε, mm; 0 = C¹ penalty as printed

  /// κ φ(d) and its derivative by d, for depth d > 0.
  template <class T>
  static T penalty(const T& kappa, const T& depth, double onset, T& slope) {
    if (value_of(depth) < onset) {
      slope = kappa * depth * depth * (1.0 / onset);
      return slope * depth * (1. / 3);
    }
    const T over = depth - onset;
    slope = kappa * (2.0 * over + onset);
    return kappa * (onset * onset / 3 + onset * over + over * over);
  }

  template <class T>
  void prepare(const T*, const T*, const T*, const double*, double, T*) const {}

  template <class T>
  T stress(const T* u, const T*, const T* theta, const double* rest, double, T* traction) const {
    for (int i = 0; i < 3; ++i) traction[i] = T(0.0);
    const GapAt at = gap_at<sizes>(*shape, u, rest, theta + 2, theta + 5, theta + 9);
    if (!at.jet.supported) return T(at.inside ? std::numeric_limits<double>::infinity() : 0.0);
    if (!touches(at, value_of(theta[1]), rest[3])) return T(0.0);
    const LiftedGap<T> g = lift_gap<sizes>(at, u, rest, theta + 2, theta + 5, theta + 9);
    const T depth = theta[1] + rest[3] - g.gap;
    T slope;
    const T energy = penalty(theta[0], depth, onset, slope);
    for (int i = 0; i < 3; ++i) traction[i] = -slope * g.gradient[i];
    return energy;
  }

  template <class T>
  void update(const T*, const T*, const T*, const double*, double, T*) const {}

  /// Work of the moving body on the skin, per area: the mean of ∂Ψ/∂(c, q) at both ends of the step times
  /// their change.
  double body_work(const double* u_old, const double* u, const double*, const double* theta_old,
                   const double* theta, const double* rest, double dt) const {
    Dual<1> at_old[ntheta], at_new[ntheta], x_old[3], x[3], unused[3];
    bool moves = false;
    for (int k = 0; k < ntheta; ++k) {
      at_old[k] = theta_old[k];
      at_new[k] = theta[k];
      at_old[k].d[0] = at_new[k].d[0] = theta[k] - theta_old[k];
      moves = moves || theta[k] != theta_old[k];
    }
    if (!moves) return 0;
    for (int i = 0; i < 3; ++i) {
      x_old[i] = u_old[i];
      x[i] = u[i];
    }
    return 0.5 * (this->template stress<Dual<1>>(x_old, nullptr, at_old, rest, dt, unused).d[0] +
                  this->template stress<Dual<1>>(x, nullptr, at_new, rest, dt, unused).d[0]);
  }

  static constexpr std::array<const char*, 3> regime_names = {"apart", "onset", "pressed"};
  signed char regime(const double* u, const double*, const double* theta, const double* rest, double) const {
    const GapAt at = gap_at<sizes>(*shape, u, rest, theta + 2, theta + 5, theta + 9);
    if (!touches(at, theta[1], rest[3])) return 0;
    return theta[1] + rest[3] - at.jet.gap < onset ? 1 : 2;
  }
};

using ContactLaw = SizedContactLaw<0>;
using EllipsoidContactLaw = SizedContactLaw<3>;

enum class Mollifier { quintic, quadratic };

template <int sizes>
struct SizedFrictionLaw {
  static constexpr int ne = 3, ns = 4, np = 7, ntheta = 17 + sizes, nrest = 4;
  static constexpr const char* name = "friction";
  const ImplicitShape* shape = nullptr;
  double onset = 1e-3;    ///< mm, as in the contact it belongs to
  double slip_speed = 1;  ///< ε_v, mm/s
  Mollifier mollifier = Mollifier::quintic;

  /// D(δ; ε) and D'(δ)/δ from s = δ².
  template <class T>
  T mollify(const T& s, double eps, T& quotient) const {
    if (value_of(s) < eps * eps) {
      const T delta = sqrt_flat(s);
      const double e = 1 / eps;
      if (mollifier == Mollifier::quintic) {
        quotient = (e * e * e) * (s * 10.0 + s * delta * (-15.0 * e) + s * s * (6.0 * e * e));
        return (e * e * e) * s * s * (2.5 - 3.0 * e * delta + (e * e) * s);
      }
      quotient = 2.0 * e - (e * e) * delta;
      return s * (e - delta * (e * e / 3));
    }
    const T delta = sqrt_flat(s);
    quotient = 1.0 / delta;
    return delta - (mollifier == Mollifier::quintic ? eps / 2 : eps / 3);
  }

  template <class T>
  void prepare(const T* u_old, const T* lag, const T*, const double*, double, T* prepared) const {
    for (int i = 0; i < 4; ++i) prepared[i] = lag[i];
    for (int i = 0; i < 3; ++i) prepared[4 + i] = u_old[i];
  }

  /// u_T; returns |u_T|².
  template <class T>
  static T slip_of(const T* u, const T* prepared, const T* theta, const double* rest, T* slip) {
    const T *n = prepared + 1, *u_old = prepared + 4, *c = theta + 3, *c_old = theta + 6;
    T from_centre[3], carried[3];
    for (int i = 0; i < 3; ++i) from_centre[i] = u_old[i] + rest[i] - c_old[i];
    carried_by_turn(theta + 9, theta + 13, from_centre, carried);
    for (int i = 0; i < 3; ++i) slip[i] = u[i] - u_old[i] - (c[i] - c_old[i]) - carried[i];
    const T along = slip[0] * n[0] + slip[1] * n[1] + slip[2] * n[2];
    for (int i = 0; i < 3; ++i) slip[i] -= along * n[i];
    return slip[0] * slip[0] + slip[1] * slip[1] + slip[2] * slip[2];
  }

  template <class T>
  T stress(const T* u, const T* prepared, const T* theta, const double* rest, double dt, T* traction) const {
    const T& pressure = prepared[0];
    for (int i = 0; i < 3; ++i) traction[i] = T(0.0);
    if (!(value_of(pressure) > 0)) return T(0.0);
    T slip[3], quotient;
    const T s = slip_of(u, prepared, theta, rest, slip);
    const T strength = theta[2] * pressure;
    const T energy = strength * mollify(s, slip_speed * dt, quotient);
    const T f = strength * quotient;
    // ∂s/∂u = 2 (I − n nᵀ) slip = 2 slip, since slip is already tangential and n is a unit vector
    for (int i = 0; i < 3; ++i) traction[i] = f * slip[i];
    return energy;
  }

  /// False without pressure: the traction is zero there, with all its derivatives.
  bool acts(const double*, const double* prepared, const double*, const double*) const {
    return prepared[0] > 0;
  }

  /// Contact pressure −∂Ψ/∂g (left alone where the point does not touch) and unit normal, into lag [4]. False, and
  /// nothing written, where the gap has no gradient: at the centre of a sphere, which has no friction hence.
  template <class T>
  bool lag_of(const LiftedGap<T>& g, const T* theta, const double* rest, T* lag) const {
    using std::sqrt;
    const T length =
        sqrt(g.gradient[0] * g.gradient[0] + g.gradient[1] * g.gradient[1] + g.gradient[2] * g.gradient[2]);
    if (!(value_of(length) > 0)) return false;
    const T depth = theta[1] + rest[3] - g.gap;
    if (value_of(depth) > 0) {
      T slope;
      (void)ContactLaw::penalty(theta[0], depth, onset, slope);
      lag[0] = slope * length;
    }
    for (int i = 0; i < 3; ++i) lag[1 + i] = g.gradient[i] / length;
    return true;
  }

  /// The lag of the next step: pressure and unit normal at the converged position.
  template <class T>
  void update(const T* u, const T*, const T* theta, const double* rest, double, T* lag) const {
    for (int i = 0; i < 4; ++i) lag[i] = T(i == 3 ? 1.0 : 0.0);
    const GapAt at = gap_at<sizes>(*shape, u, rest, theta + 3, theta + 9, theta + 17);
    if (!touches(at, value_of(theta[1]), rest[3])) return;
    (void)lag_of(lift_gap<sizes>(at, u, rest, theta + 3, theta + 9, theta + 17), theta, rest, lag);
  }

  /// False apart from the shape, where the lag is that of a point that does not touch.
  bool remembers(const double* u, const double* theta, const double* rest) const {
    return touches(gap_at<sizes>(*shape, u, rest, theta + 3, theta + 9, theta + 17), theta[1], rest[3]);
  }

  /// So that a step may be solved again with its own (sim/time/step_passes.h).
  static constexpr bool history_is_lag = true;
  static constexpr std::array<const char*, 0> stored_names{};
  template <class T>
  void stored(const T*, const T*, const T*, const double*, T*) const {}
  /// Traction times slip, per area; never negative.
  double dissipated(const double*, const double*, const double* u, const double* prepared, const double*,
                    const double* theta, const double* rest, double dt) const {
    double slip[3], traction[3];
    (void)slip_of(u, prepared, theta, rest, slip);
    (void)stress<double>(u, prepared, theta, rest, dt, traction);
    return traction[0] * slip[0] + traction[1] * slip[1] + traction[2] * slip[2];
  }
  /// Traction on the skin times the motion of the body's surface, which is Δu less the slip.
  double body_work(const double* u_old, const double* u, const double* prepared, const double*,
                   const double* theta, const double* rest, double dt) const {
    double traction[3], work = dissipated(nullptr, nullptr, u, prepared, nullptr, theta, rest, dt);
    (void)stress<double>(u, prepared, theta, rest, dt, traction);
    for (int i = 0; i < 3; ++i) work -= traction[i] * (u[i] - u_old[i]);
    return work;
  }

  static constexpr std::array<const char*, 3> regime_names = {"unloaded", "stick", "slip"};
  signed char regime(const double* u, const double* prepared, const double* theta, const double* rest,
                     double dt) const {
    if (!(prepared[0] > 0)) return 0;
    double slip[3];
    const double eps = slip_speed * dt;
    return slip_of(u, prepared, theta, rest, slip) < eps * eps ? 1 : 2;
  }
};

using FrictionLaw = SizedFrictionLaw<0>;
using EllipsoidFrictionLaw = SizedFrictionLaw<3>;

}  // namespace RHYTID_ISA
}  // namespace rhytid
