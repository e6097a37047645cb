// The volume mesh for ParaView and VTK: Lagrange wedges (cell type 73) that carry the exact basis of the
// simulation, and a PVD file that strings the frames into a time series.
//
// VTK needs the per-cell array HigherOrderDegrees = (p, p, q), because the number of points of a wedge with
// p ≠ q does not tell its orders. Proof: tests/sim/output/test_vtu.cpp reads the files back with VTK.
#pragma once

#include <string>
#include <vector>

#include "sim/core/types.h"
#include "sim/mesh/skin_mesh.h"

namespace rhytid {

/// A named array over nodes, cells or surface vertices: whole tuples of `components`.
struct OutputField {
  std::string name;            ///< put the unit into it: "displacement_mm"
  int components = 1;          ///< 1 scalar, 3 vector, 6 symmetric tensor, ...
  std::vector<double> values;  ///< [number of points or cells][components]
};

struct VtuOptions {
  double time = 0;       ///< s, written as TimeValue
  bool deformed = true;  ///< points are rest + displacement; else rest (for ParaView's Warp By Vector)
  std::vector<OutputField> point_fields;  ///< [num_nodes][components] each
  std::vector<OutputField> cell_fields;   ///< [num_elements][components] each, element order of SkinMesh
};

/// Writes one frame. `displacement` is [num_nodes · 3] in mm (empty = zero). Besides the fields given, the
/// file has point data `displacement_mm`, `level` (0 = inner surface), cell data `element_layer` and
/// `material_layer` (of a composite element: −1). Throws ContractError on sizes that do not fit and
/// InputError naming the path.
void write_vtu(const std::string& path, const SkinMesh& mesh, const VectorXd& displacement,
               const VtuOptions& options = {});

/// For each point of a VTK Lagrange wedge of degrees (p, p, q) its node j·(q+1)+k in the simulation's order.
std::vector<int> vtk_wedge_order(int p, int q);

struct PvdEntry {
  double time;       ///< s
  std::string file;  ///< relative to the PVD file
};

/// Writes the time series. Cheap enough to rewrite after every frame. Throws InputError naming the path.
void write_pvd(const std::string& path, const std::vector<PvdEntry>& entries);

}  // namespace rhytid
