#include "sim/scene/parts/rim.h"

#include <Eigen/Geometry>

#include "sim/core/error.h"

namespace rhytid {

std::vector<int> rim_corners(const SkinMesh& mesh) {
  std::vector<int> corners;
  for (std::size_t r = 0; r < mesh.rim_columns.size(); ++r)
    if (mesh.rim_turns[r] > kCornerTurn) corners.push_back(mesh.rim_columns[r]);
  return corners;
}

namespace {

/// Columns of each held part, ascending.
std::vector<int> columns_in(const SkinMesh& mesh, const SkinScene& skin, const HeldScene& held) {
  std::vector<int> columns;
  const int level = skin.surface.is_outer ? mesh.num_levels - 1 : 0;
  // Coordinates of nodes carry rounding: a box that ends at them holds them.
  const Vec3 room = Vec3::Constant(1e-9 * mesh.rest.cwiseAbs().maxCoeff());
  for (int column = 0; column < mesh.num_columns; ++column) {
    Vec3 x = mesh.rest.row(mesh.node(column, level)).transpose();
    if (mesh.imperfection.size() > 0) x -= mesh.imperfection[column] * mesh.column_normals.row(column);
    if (((x - held.low + room).array() >= 0).all() && ((held.high - x + room).array() >= 0).all())
      columns.push_back(column);
  }
  return columns;
}

/// Whether a column is fixed by a held part; adds the moved parts.
std::vector<bool> held_columns(const SkinMesh& mesh, const SkinScene& skin, const std::string& file,
                               std::vector<MovedNodes>& moved) {
  std::vector<bool> is_held(mesh.num_columns, false);
  for (const HeldScene& held : skin.held) {
    const std::string at = file + ": /skin/held/" + held.name;
    const std::vector<int> columns = columns_in(mesh, skin, held);
    if (columns.empty()) throw InputError(at + "/box", "a box without nodes", "one that holds some");
    std::vector<int> nodes;
    for (const int column : columns) {
      if (is_held[column])
        throw InputError(at + "/box", "nodes that another held part has", "parts without common nodes");
      is_held[column] = true;
      for (int level = 0; level < mesh.num_levels; ++level) nodes.push_back(mesh.node(column, level));
    }
    if (held.path.empty()) continue;
    std::vector<double> times;
    std::vector<Vec3> displacements;
    for (const HeldKnot& knot : held.path) {
      times.push_back(knot.time);
      displacements.push_back(knot.displacement);
    }
    moved.push_back({std::move(nodes), KnotPath(std::move(times)), std::move(displacements)});
  }
  return is_held;
}

}  // namespace

Constraints skin_constraints(const SkinMesh& mesh, const SkinScene& skin, const std::string& file) {
  const RimCondition condition = skin.rim;
  Constraints c;
  const std::vector<bool> is_held = held_columns(mesh, skin, file, c.moved);
  std::vector<int> rim_index(mesh.num_columns, -1);
  if (condition != RimCondition::free)
    for (std::size_t r = 0; r < mesh.rim_columns.size(); ++r)
      rim_index[mesh.rim_columns[r]] = static_cast<int>(r);
  c.block.assign(mesh.num_nodes(), -1);
  for (int column = 0; column < mesh.num_columns; ++column) {
    const int rim = rim_index[column];
    if (is_held[column] || (rim >= 0 && condition == RimCondition::clamped)) continue;
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
  if (c.block_nodes.empty())
    throw InputError(file + (skin.held.empty() ? ": /skin/rim" : ": /skin/held"),
                     "no node that is free to move",
                     "a skin with nodes off the rim and off held parts; a higher order or more cells");
  return c;
}

}  // namespace rhytid
