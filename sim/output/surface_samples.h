// Points of the outer skin at equal spacing along a line or on a grid, followed through a run: what wrinkles
// are measured on (wrinkles.h).
#pragma once

#include <vector>

#include "sim/mesh/skin_mesh.h"

namespace rhytid {

/// A straight line in space, mm; its points are moved to the nearest ones of the outer surface at rest.
struct SampleLine {
  Vec3 from = Vec3::Zero(), to = Vec3::Zero();
};

/// A rectangle in space, mm; likewise.
struct SampleWindow {
  Vec3 centre = Vec3::Zero();
  Vec3 along = Vec3::UnitX();                    ///< direction of the first axis; any length but zero
  Vec3 normal = Vec3::UnitZ();                   ///< need not be at right angles to it
  Eigen::Vector2d size = Eigen::Vector2d(1, 1);  ///< along the first axis and across it
};

class SurfaceSamples {
 public:
  /// `count` ≥ 3 points from end to end. A point is beside the surface when the nearest place of the surface
  /// is not below or above it.
  SurfaceSamples(const SkinMesh& mesh, const SampleLine& line, int count);
  /// Points `spacing` (mm) apart, as many as fit the size.
  SurfaceSamples(const SkinMesh& mesh, const SampleWindow& window, double spacing);

  int rows() const { return rows_; }        ///< along the line or the first axis
  int columns() const { return columns_; }  ///< 1 for a line
  /// Mean distance between neighbours on the surface at rest, mm.
  double spacing() const { return spacing_; }
  /// Number of points that lie beside the surface.
  int missing() const { return missing_; }
  /// Where a point is: natural coordinates u, v on a face of the outer surface; face −1 beside it.
  struct Place {
    int face = -1;
    double u = 0, v = 0;
  };
  /// Of all points, the first axis fastest.
  const std::vector<Place>& places() const { return places_; }
  /// Displacement along the smoothed rest normals, mm, [rows][columns]; NaN beside the surface.
  /// `displacement` [num_nodes·3].
  MatrixXd heights(const VectorXd& displacement) const;
  /// The transpose: adds Σ weights · ∂heights/∂u to u_bar [num_nodes·3]; points beside the surface have none.
  void add_transpose(const MatrixXd& weights, VectorXd& u_bar) const;

 private:
  void place(const SkinMesh& mesh, const std::vector<Vec3>& wanted, double nominal_spacing);

  int rows_ = 0, columns_ = 0, missing_ = 0;
  double spacing_ = 0;
  /// Height of point i = Σ_k weight_k N_i · u(node_k); no nodes: beside the surface.
  struct Point {
    std::vector<int> nodes;
    std::vector<double> weights;
    Vec3 normal;
  };
  std::vector<Point> points_;
  std::vector<Place> places_;
};

}  // namespace rhytid
