// Rigid implicit surfaces that skin can touch: gap, gradient and Hessian at a point, in the shape's own
// frame.
#pragma once

#include <cstddef>

#include "sim/core/types.h"

namespace rhytid {

/// Second-order jet of the gap function g at a point x. g < 0 inside the rigid body.
struct GapJet {
  double gap = 0;                ///< mm
  Vec3 gradient = Vec3::Zero();  ///< ∂g/∂x, not necessarily of unit length (IMLS)
  Mat3 hessian = Mat3::Zero();   ///< ∂²g/∂x², 1/mm
  bool supported = true;         ///< false: outside the support of an IMLS surface; the other fields are zero
};

/// Derivatives of gap and gradient by the sizes of a shape that has three (ellipsoid: its semi-axes).
struct SizeDerivatives {
  Vec3 gap = Vec3::Zero();       ///< ∂g/∂size_k
  Mat3 gradient = Mat3::Zero();  ///< ∂²g/∂x_i ∂size_k, 1/mm
};

/// A rigid surface given by a gap function. Immutable, safe to share between threads.
class ImplicitShape {
 public:
  virtual ~ImplicitShape() = default;
  /// Jet at x (mm, in the shape's frame: the frame is moved by the collider that owns the shape).
  virtual GapJet evaluate(const Vec3& x) const = 0;
  /// ∂g/∂R for a shape whose size is one radius R; 0 for a shape without one. It does not depend on x, so
  /// ∂(∇g)/∂R = 0: changing the radius only offsets the level sets (sphere, capsule).
  virtual double gap_by_radius() const { return 0; }
  /// Jet at x of the same shape with other sizes (mm, > 0), and derivatives by them. Throws ContractError for
  /// a shape without sizes.
  virtual GapJet evaluate_sized(const Vec3& x, const Vec3& sizes, SizeDerivatives& by_size) const;
  /// For a point where evaluate() has no support: is it on the body's side, i.e. hopelessly deep? (The
  /// contact law makes such a trial state infeasible instead of letting the skin fall through.)
  virtual bool behind(const Vec3&) const { return false; }
  /// Entries of the neighbour lists that are kept for queries; 0 for a shape in closed form.
  virtual std::size_t num_neighbours() const { return 0; }
  /// Memory held besides the object itself, bytes; 0 for a shape in closed form.
  virtual std::size_t bytes() const { return 0; }
};

}  // namespace rhytid
