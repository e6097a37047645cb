// How the outer surface of a skin answers to parameters: its positions at every in-plane node, weighted by
// area so that figures do not depend on how fine the mesh is where.
//
//   mean over the surface   ⟨f⟩ = Σ_c a_c f_c / Σ_c a_c,   a_c: a third of the triangles around node c (P1
//                                                            refinement through the nodes, at rest)
//
// Units   mm.    Tests   tests/adjoint/surface_response_test.cpp
#pragma once

#include <optional>
#include <vector>

#include "adjoint/outputs.h"
#include "adjoint/sweeps.h"
#include "sim/mesh/skin_mesh.h"

namespace rhytid::adjoint {

/// Area (mm²) of the inner or outer surface that belongs to each column, at rest [num_columns].
VectorXd column_areas(const SkinMesh& mesh, bool outer);

/// Displacements [3·columns] of the outer nodes at every frame from `first_frame` on.
class OuterDisplacements final : public Output {
 public:
  explicit OuterDisplacements(const SkinMesh& mesh, int first_frame = 1);
  int size(int frame) const override { return frame >= first_frame_ ? 3 * num_columns_ : 0; }
  VectorXd values(int frame, const State& state) const override;
  MatrixXd tangent(int frame, const State& state, const MatrixXd& du, const MatrixXd& ds) const override;
  void adjoint(int frame, const State& state, const VectorXd& weights, VectorXd& u_bar,
               VectorXd& s_bar) const override;

 private:
  int num_columns_, num_levels_, first_frame_;
};

/// ⟨|u|²⟩ over the outer surface, mm²: one value per frame from `first_frame` on. (Its square root has no
/// derivative at rest.)
class MeanSquareDisplacement final : public Output {
 public:
  explicit MeanSquareDisplacement(const SkinMesh& mesh, int first_frame = 1);
  int size(int frame) const override { return frame >= first_frame_ ? 1 : 0; }
  VectorXd values(int frame, const State& state) const override;
  MatrixXd tangent(int frame, const State& state, const MatrixXd& du, const MatrixXd& ds) const override;
  void adjoint(int frame, const State& state, const VectorXd& weights, VectorXd& u_bar,
               VectorXd& s_bar) const override;

 private:
  VectorXd weights_;  ///< [columns], sum 1
  int num_levels_, first_frame_;
};

/// Tangents of OuterDisplacements along n directions, summed up.
struct SurfaceResponse {
  /// [n][n] upper triangular with RᵀR = Σ_frames ⟨duᵀ du⟩: the Jacobian of N tracks spread evenly over the
  /// surface, each with noise σ in every component and frame, has the singular values of √N/σ R. With a view
  /// only what is seen counts, here and nowhere else.
  MatrixXd root;
  VectorXd rms;           ///< [n] over surface and frames 1.., mm per unit of the direction
  VectorXd largest;       ///< [n] over nodes and frames, mm
  MatrixXd rms_of_frame;  ///< [frames][n], row 0 is frame 1
  MatrixXd last;          ///< [columns][n] |du| in the last frame
};

/// `tangent` is that of OuterDisplacements(mesh, 1). With `view`, what moves along it does not count for `root`
/// (a camera far away that looks along it); all other figures are those of the whole displacement.
SurfaceResponse surface_response(const SkinMesh& mesh, const TangentResult& tangent,
                                 const std::optional<Vec3>& view = std::nullopt);

/// Native direction that scales all energies together, Σ p ∂/∂p over all stiffnesses [native size]:
/// positions cannot tell it.
VectorXd gauge_direction(const Model& model);

/// Coordinates x with jacobian · x = gauge_direction, jacobian = ∂native/∂x; nothing when these parameters do
/// not span it.
std::optional<VectorXd> gauge_coordinates(const Model& model, const MatrixXd& jacobian);

}  // namespace rhytid::adjoint
