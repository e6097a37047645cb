// What a step prepares and the new history of a prism in packs of points: what PointKernel's versions do one point at a
// time.
//
// A law supplies     num_history_constants, history_constants(θ, dt, c)   numbers of the step
//                    has_lookback()                                  else prepare copies the history
//                    prepare_history(y_old, history, c, prepared), update_history(y, prepared, c, history)
//
// Shapes   as in point_kernel.h.
// Tests    tests/sim/terms/tangent_kernel_test.cpp, term_kernels_test.cpp
#pragma once

#include "sim/terms/packed_sums.h"

namespace rhytid {
inline namespace RHYTID_ISA {

/// History of a law on prisms, [nq][6] before and after; pointers and shapes as in PointKernel.
template <class Law, class Kin>
struct PackedHistory {
  static constexpr int ne = Law::ne, nz = Kin::nz, ns = Law::ns;
  static_assert(ne == 6 && nz == 9 && Law::np == ns, "prisms only");

  static void prepare(const Law& law, const ElementView& v, const double* u_old, const double* s_old,
                      double* prepared) {
    if (!law.has_lookback()) {
      std::memcpy(prepared, s_old, sizeof(double) * static_cast<std::size_t>(v.num_points) * ns);
      return;
    }
    advance(
        law, v, u_old, s_old, prepared,
        [&](const Lanes* y, const Lanes* history, const Lanes* constants, Lanes* out)
            __attribute__((always_inline)) { law.prepare_history(y, history, constants, out); });
  }
  static void update(const Law& law, const ElementView& v, const double* u, const double* prepared,
                     double* s_new) {
    advance(
        law, v, u, prepared, s_new,
        [&](const Lanes* y, const Lanes* history, const Lanes* constants, Lanes* out)
            __attribute__((always_inline)) { law.update_history(y, history, constants, out); });
  }

 private:
  template <class F>
  static void advance(const Law& law, const ElementView& v, const double* u, const double* from, double* to,
                      F&& f) {
    alignas(8 * kLanes) double natural[nz][kMaxPacked];
    PackedSums sums(v);
    sums.gather(u, natural);
    const auto constants = [&](const double* theta, double* c) { law.history_constants(theta, v.dt, c); };
    using Parameters = PackedParameters<Law::ntheta, Law::num_history_constants>;
    Parameters shared(v, constants);
    for (int first = 0; first < v.num_points; first += kLanes) {
      const int* const points = sums.points() + first;
      Lanes local[nz], jacobian[9], h[nz], y[ne], s[ns], out[ns];
      load_points<9>(v.inverse_jacobian, points, jacobian);
      load_points<ns>(from, points, s);
      for (int i = 0; i < nz; ++i) local[i] = load_lanes(natural[i] + first);
      Kin::to_point(local, jacobian, h);
      Kin::strain(h, y);
      if (v.theta_stride != 0) shared = Parameters(v, points, constants);
      f(y, s, shared.constants, out);
      store_points<ns>(out, points, v.num_points - first < kLanes ? v.num_points - first : kLanes, to);
    }
  }
};

}  // namespace RHYTID_ISA
}  // namespace rhytid
