// The element kernels of one law as plain function pointers, so that the same law compiled for several
// instruction sets can be chosen at run time and terms need not be templates.
#pragma once

#include "sim/terms/element_view.h"
#include "sim/terms/term_energies.h"

namespace rhytid {

/// Sizes of a law and its kernels; `law` arguments point to the law's own struct (plain data).
struct KernelTable {
  const char* name;
  int ne, ns, np, ntheta, nrest, rows;
  void (*prepare)(const void* law, const ElementView&, const double* u_old, const double* s_old,
                  double* prepared);
  double (*energy)(const void* law, const ElementView&, const double* u, const double* prepared, double* f);
  bool (*hessian)(const void* law, const ElementView&, const double* u, const double* prepared,
                  bool projected, double* work, double* dense);
  void (*update)(const void* law, const ElementView&, const double* u, const double* prepared, double* s_new);
  void (*tangent)(const void* law, const ElementView&, const double* u, const double* u_old,
                  const double* s_old, const double* prepared, const double* du, const double* du_old,
                  const double* ds_old, const double* dtheta, double* df, double* ds_new);
  void (*adjoint_update)(const void* law, const ElementView&, const double* u, const double* prepared,
                         const double* s_bar, double* u_bar);
  void (*adjoint_step)(const void* law, const ElementView&, const double* u, const double* u_old,
                       const double* s_old, const double* prepared, const double* adj, const double* s_bar,
                       double* u_old_bar, double* s_old_bar, double* theta_bar);
  /// Laws made of smooth pieces only (contact, friction): which piece each point is on, [num_points], and the
  /// pieces' names; null and 0 for a law that is smooth everywhere.
  void (*regime)(const void* law, const ElementView&, const double* u, const double* prepared,
                 signed char* out) = nullptr;
  int num_regimes = 0;
  const char* const* regime_names = nullptr;
  /// Adds the energies of an element over a converged step; `theta_old` and its stride as in the view.
  void (*account)(const void* law, const ElementView&, const double* theta_old, const double* u_old,
                  const double* s_old, const double* u, const double* prepared, const double* s_new,
                  TermEnergies* sum) = nullptr;
  /// Stored energy of an element and its derivatives (PointKernel::stored).
  double (*stored)(const void* law, const ElementView&, const double* u, const double* s, double* u_bar,
                   double* s_bar, double* theta_bar) = nullptr;
  /// True when det F certainly stays above 0 at every point on the way from u to u + d, by a bound that small steps
  /// keep; prisms only, null for the others.
  bool (*moves_freely)(const ElementView&, const double* u, const double* d) = nullptr;
  int num_stored = 0;
  const char* const* stored_names = nullptr;
  /// The history is nothing but what lags behind the step, so that a step may be solved again with its own
  /// (friction; sim/time/step_passes.h).
  bool history_is_lag = false;
};

/// Prism kernels of viscoelastic and elastic skin for the best instruction set of this machine.
const KernelTable& skin_kernels();
const KernelTable& elastic_skin_kernels();
/// The same for PreStretchedLaw of those laws.
const KernelTable& pre_stretched_skin_kernels();
const KernelTable& pre_stretched_elastic_skin_kernels();
/// Prism kernels of the volumetric term alone.
const KernelTable& volume_kernels();
/// Name of the instruction set those use: "avx512", "avx2" or "baseline".
const char* skin_kernel_isa();
const KernelTable& ligament_kernels();
const KernelTable& fung_ligament_kernels();
const KernelTable& contact_kernels();
const KernelTable& friction_kernels();
/// The same for EllipsoidContactLaw and EllipsoidFrictionLaw.
const KernelTable& ellipsoid_contact_kernels();
const KernelTable& ellipsoid_friction_kernels();
/// The same for ExtrapolatedFrictionLaw and ExtrapolatedEllipsoidFrictionLaw.
const KernelTable& extrapolated_friction_kernels();
const KernelTable& extrapolated_ellipsoid_friction_kernels();

}  // namespace rhytid
