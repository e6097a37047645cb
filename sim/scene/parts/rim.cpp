#include "sim/scene/parts/rim.h"

#include <Eigen/Geometry>

namespace rhytid {

std::vector<int> rim_corners(const SkinMesh& mesh) {
  std::vector<int> corners;
  for (std::size_t r = 0; r < mesh.rim_columns.size(); ++r)
    if (mesh.rim_turns[r] > kCornerTurn) corners.push_back(mesh.rim_columns[r]);
  return corners;
}

Constraints rim_constraints(const SkinMesh& mesh, RimCondition condition) {
  Constraints c;
  std::vector<int> rim_index(mesh.num_columns, -1);
  if (condition != RimCondition::free)
    for (std::size_t r = 0; r < mesh.rim_columns.size(); ++r)
      rim_index[mesh.rim_columns[r]] = static_cast<int>(r);
  c.block.assign(mesh.num_nodes(), -1);
  for (int column = 0; column < mesh.num_columns; ++column) {
    const int rim = rim_index[column];
    if (rim >= 0 && condition == RimCondition::clamped) continue;
    int frame = -1;
    if (rim >= 0) {
      // Sliding: the wall of the rim only moves within itself. First axis = outward conormal, fixed. At a
      // corner the mean conormal is the diagonal: held alone it would let the corner slip out of both walls,
      // so the second in-plane axis is fixed as well.
      const Vec3 m = mesh.rim_directions.row(rim).transpose().normalized();
      Vec3 n = mesh.column_normals.row(column).transpose();
      n = (n - n.dot(m) * m).normalized();
      Mat3 axes;
      axes << m, n.cross(m), n;
      frame = static_cast<int>(c.frames.size());
      c.frames.push_back(axes);
    }
    for (int level = 0; level < mesh.num_levels; ++level) {
      const int block = static_cast<int>(c.block_nodes.size());
      c.block[mesh.node(column, level)] = block;
      c.block_nodes.push_back(mesh.node(column, level));
      c.frame_of_block.push_back(frame);
      if (frame >= 0) c.fixed_unknowns.push_back(3 * block);
      if (frame >= 0 && mesh.rim_turns[rim] > kCornerTurn) c.fixed_unknowns.push_back(3 * block + 1);
    }
  }
  return c;
}

}  // namespace rhytid
