// Energy, force and stiffness of viscoelastic skin as one would write them at first: element by element, point by
// point, 3×3 matrices of Eigen, its iterative eigensolver for the logarithms, a dense BᵀDB. What the kernels of
// sim/terms are measured against; nothing else uses it.
//
//   Ē = dev ½ log C,  X = L⁻¹ C L⁻ᵀ,  C^v = L Lᵀ      A = 2 μ∞ e^(C q) Ē + K (J − 1) J I + 2 w μ_m L⁻ᵀ Ē_e Lᵀ
//   P = F A C⁻¹,  f_i += w P ∇N_i                      K += w [Bᵀ D B + (∇N_iᵀ S ∇N_j) I],  D = ∂S/∂E by Daleckii-Krein
//
// Law, units and symbols: sim/terms/skin_law.h. The same numbers as the kernels to rounding, which the benchmark checks
// before it times them. Compiled once per instruction set like the kernels, with the compiler's usual optimisation.
#pragma once

#include "sim/terms/element_view.h"

namespace rhytid::tools {

struct PlainSkin {
  /// Energy of an element, mJ; adds forces to f [n][3], N. `damper_weight` is w; prepared [nq][6] is C^v − I.
  double (*residual)(double damper_weight, const ElementView&, const double* u, const double* prepared,
                     double* f);
  /// Element matrix [3n][3n], N/mm.
  void (*hessian)(double damper_weight, const ElementView&, const double* u, const double* prepared,
                  double* dense);
};

/// Those of instruction sets that this build lacks are declared only.
extern const PlainSkin plain_skin_baseline, plain_skin_avx2, plain_skin_avx512;

}  // namespace rhytid::tools
