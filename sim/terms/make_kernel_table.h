// The kernel table of a law: for the files that compile laws into kernels, and tests. Everybody else includes
// kernel_table.h, which knows none of the templates.
#pragma once

#include "sim/terms/kernel_table.h"
#include "sim/terms/point_kernel.h"

namespace rhytid {
inline namespace RHYTID_ISA {

/// The table of a law on a kinematics, for the instruction set of the including file.
template <class Law, class Kin>
constexpr KernelTable kernel_table() {
  using K = PointKernel<Law, Kin>;
  KernelTable table = {
      Law::name,
      Law::ne,
      Law::ns,
      Law::np,
      Law::ntheta,
      Law::nrest,
      Kin::rows,
      [](const void* l, const ElementView& v, const double* uo, const double* so, double* p) {
        K::prepare(*static_cast<const Law*>(l), v, uo, so, p);
      },
      [](const void* l, const ElementView& v, const double* u, const double* p, double* f) {
        return K::energy(*static_cast<const Law*>(l), v, u, p, f);
      },
      [](const void* l, const ElementView& v, const double* u, const double* p, bool projected, double* work,
         double* dense) { return K::hessian(*static_cast<const Law*>(l), v, u, p, projected, work, dense); },
      [](const void* l, const ElementView& v, const double* u, const double* p, double* s) {
        K::update(*static_cast<const Law*>(l), v, u, p, s);
      },
      [](const void* l, const ElementView& v, const double* u, const double* uo, const double* so,
         const double* p, const double* du, const double* duo, const double* dso, const double* dt,
         double* df,
         double* ds) { K::tangent(*static_cast<const Law*>(l), v, u, uo, so, p, du, duo, dso, dt, df, ds); },
      [](const void* l, const ElementView& v, const double* u, const double* p, const double* sb,
         double* ub) { K::adjoint_update(*static_cast<const Law*>(l), v, u, p, sb, ub); },
      [](const void* l, const ElementView& v, const double* u, const double* uo, const double* so,
         const double* p, const double* adj, const double* sb, double* uob, double* sob, double* tb) {
        K::adjoint_step(*static_cast<const Law*>(l), v, u, uo, so, p, adj, sb, uob, sob, tb);
      }};
  table.account = [](const void* l, const ElementView& v, const double* to, const double* uo,
                     const double* so, const double* u, const double* p, const double* s, TermEnergies* sum) {
    K::account(*static_cast<const Law*>(l), v, to, uo, so, u, p, s, *sum);
  };
  table.stored = [](const void* l, const ElementView& v, const double* u, const double* s, double* ub,
                    double* sb,
                    double* tb) { return K::stored(*static_cast<const Law*>(l), v, u, s, ub, sb, tb); };
  if constexpr (Kin::rows == 3)
    table.moves_freely = [](const ElementView& v, const double* u, const double* d) {
      return moves_freely(v, u, d);
    };
  table.num_stored = static_cast<int>(K::stored_names.size());
  table.stored_names = K::stored_names.data();
  if constexpr (requires { Law::history_is_lag; }) table.history_is_lag = Law::history_is_lag;
  if constexpr (K::has_regimes) {
    table.regime = [](const void* l, const ElementView& v, const double* u, const double* p,
                      signed char* out) { K::regime(*static_cast<const Law*>(l), v, u, p, out); };
    table.num_regimes = static_cast<int>(Law::regime_names.size());
    table.regime_names = Law::regime_names.data();
  }
  return table;
}

}  // namespace RHYTID_ISA

}  // namespace rhytid
