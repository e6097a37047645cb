// Ligaments, contact, friction and IMLS bone as one would write them at first, with Eigen: what the kernels of
// sim/terms and sim/surface are measured against; nothing else uses it. Laws, units and symbols: sim/terms/ligament_law.h,
// contact_law.h, sim/surface/imls.h.
#pragma once

#include <functional>
#include <memory>

#include "sim/surface/implicit_shape.h"
#include "sim/terms/element_view.h"

namespace rhytid::tools {

/// Energy per area at a point with displacement u; traction ∂Ψ/∂u and, unless null, tangent.
struct PointResponse {
  double energy = 0;
  Vec3 traction = Vec3::Zero();
  Mat3 tangent = Mat3::Zero();
};
/// Law at point q of an element.
using PlainSurfaceLaw = std::function<PointResponse(const ElementView&, int q, const Vec3& u)>;

PlainSurfaceLaw plain_ligament();
/// Sphere of radius `radius`, upright; θ and rest as ContactLaw has them.
PlainSurfaceLaw plain_sphere_contact(double radius, double onset);
/// θ, rest and `prepared` [nq][7] as FrictionLaw has them, the body at rest; quintic mollifier.
PlainSurfaceLaw plain_friction(double slip_speed, const double* prepared);

/// Energy of an element, mJ; adds forces to f [n][3].
double plain_surface_residual(const PlainSurfaceLaw& law, const ElementView& view, const double* u,
                              double* f);
/// Element matrix [3n][3n].
void plain_surface_hessian(const PlainSurfaceLaw& law, const ElementView& view, const double* u,
                           double* dense);

/// IMLS gap, gradient and Hessian, smooth kernel: samples in reach found in a tree, then sums over them.
class PlainImls {
 public:
  /// points and unit normals [n][3], which must outlive it.
  PlainImls(const MatrixX3& points, const MatrixX3& normals, double support);
  ~PlainImls();
  GapJet evaluate(const Vec3& x) const;

 private:
  struct Tree;
  const MatrixX3 &points_, &normals_;
  double support_;
  std::unique_ptr<const Tree> tree_;
};

}  // namespace rhytid::tools
