// Skin ligament: zero-length exponential spring from the inner surface to its anchor on the bone, per area.
//
//   Ψ = k/b (e^(b s) − 1),   s = √(d² + ε²) − ε,   d = |u|,   traction = k e^(b s) u / √(d² + ε²)
//
// Source   paper.tex "Ligaments"; deviation: the printed law is the limit ε → 0, whose force is k at zero
// displacement
//          (a cusp no gradient method can stop on); ε is a length, reported. Beyond b s = 50 the exponential
//          is continued by its tangent, so that trial steps stay finite.
// Units    k [MPa], b [1/mm], ε [mm], u [mm]; Ψ [mJ/mm²].     Shapes  e = u [3], θ = k, ε, b.
// Smooth   analytic below b s = 50, C¹ in the force there.
// Tests    tests/sim/terms/law_edges_test.cpp, law_properties_test.cpp
#pragma once

#include "sim/math/dual.h"

namespace rhytid {
inline namespace RHYTID_ISA {

struct LigamentLaw {
  static constexpr int ne = 3, ns = 0, np = 0, ntheta = 3, nrest = 0;
  static constexpr const char* name = "ligaments";
  static constexpr double z_linear = 50;  ///< b s beyond which e^z is continued linearly

  template <class T>
  void prepare(const T*, const T*, const T*, const double*, double, T*) const {}

  template <class T>
  T stress(const T* u, const T*, const T* theta, const double*, double, T* traction) const {
    using std::exp;
    using std::expm1;
    using std::sqrt;
    const T &k = theta[0], &eps = theta[1], &b = theta[2];
    const T d2 = u[0] * u[0] + u[1] * u[1] + u[2] * u[2];
    const T r = sqrt(d2 + eps * eps);
    const T s = d2 / (r + eps);
    const T z = b * s;
    T e, phi;  // e^z and (e^z − 1)/z, both continued
    if (value_of(z) > z_linear) {
      const double top = std::exp(z_linear);
      const T over = z - z_linear;
      e = top * (1.0 + over);
      phi = (top - 1.0 + top * (over + 0.5 * over * over)) / z;
    } else {
      e = exp(z);
      if (std::fabs(value_of(z)) < 1e-3) {
        phi = 1.0 + z / 2.0 * (1.0 + z / 3.0 * (1.0 + z / 4.0 * (1.0 + z / 5.0)));
      } else {
        phi = expm1(z) / z;
      }
    }
    const T f = k * e / r;
    for (int i = 0; i < 3; ++i) traction[i] = f * u[i];
    return k * s * phi;
  }

  template <class T>
  void update(const T*, const T*, const T*, const double*, double, T*) const {}
};

}  // namespace RHYTID_ISA
}  // namespace rhytid
