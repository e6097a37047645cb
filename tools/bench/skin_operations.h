// What skin's kernels compute, counted; and the same law one point at a time in plain numbers.
//
// The count does not depend on the instruction set: the law and the kinematics run once per point with a number that counts
// its own additions, subtractions, multiplications, divisions and square roots as one each, and a logarithm or an
// exponential as one too (which take some twenty). Sums over nodes and the dense products of the Hessian are counted by
// their sizes, without padding, one direction at a time where the kernels sum so (packed_sums.h, product_hessian.h); a
// symmetric block by its upper half. So it is a lower bound of what is executed.
#pragma once

#include "sim/terms/element_view.h"
#include "sim/terms/skin_law.h"

namespace rhytid::tools {

struct SkinOperations {
  double residual = 0, hessian = 0;  ///< floating-point operations per quadrature point
};
/// Mean over the points of one element; `prepared` as the kernels take it.
SkinOperations count_skin_operations(const SkinLaw& law, const ElementView& view, const double* u,
                                     const double* prepared);

/// PointKernel without packs: energy with forces added to f [n][3], and the matrix [3n][3n] by dual numbers, over all nodes
/// at once.
double skin_residual_by_points(const SkinLaw& law, const ElementView& view, const double* u,
                               const double* prepared, double* f);
void skin_hessian_by_points(const SkinLaw& law, const ElementView& view, const double* u,
                            const double* prepared, double* dense);

}  // namespace rhytid::tools
