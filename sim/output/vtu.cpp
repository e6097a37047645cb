#include "sim/output/vtu.h"

#include <cstdint>
#include <map>

#include "sim/core/error.h"
#include "sim/output/atomic_file.h"
#include "sim/output/text.h"
#include "sim/output/vtk_xml.h"

namespace rhytid {

namespace {

constexpr std::uint8_t vtk_lagrange_wedge = 73;

/// Lattice points of the open triangle edges 0→1, 1→2, 2→0 and of the open interior, in VTK's order, which
/// on the triangle is also ours.
struct TriangleLattice {
  std::array<std::vector<std::array<int, 2>>, 3> edges;
  std::vector<std::array<int, 2>> interior;

  explicit TriangleLattice(int p) {
    for (int i = 1; i < p; ++i) {
      edges[0].push_back({i, 0});
      edges[1].push_back({p - i, i});
      edges[2].push_back({0, p - i});
    }
    for (int j = 1; j < p; ++j) {
      for (int i = 1; i + j < p; ++i) interior.push_back({i, j});
    }
  }
};

/// The one material of a stacked element layer; −1 when several materials share it.
std::int32_t material_of(const ElementLayer& layer) {
  const bool single = layer.slabs.size() == 1;
  return single ? layer.slabs[0].material : -1;
}

void check_fields(const std::vector<OutputField>& fields, int count) {
  for (const OutputField& field : fields) {
    require(field.components > 0 && field.values.size() == static_cast<size_t>(count) * field.components,
            "write_vtu: a field's size does not fit the mesh");
  }
}

}  // namespace

std::vector<int> vtk_wedge_order(int p, int q) {
  const TriangleBasis triangle(p);
  std::map<std::array<int, 2>, int> node_at;
  for (int j = 0; j < triangle.num_nodes(); ++j) node_at[triangle.lattice()[j]] = j;
  const TriangleLattice lattice(p);
  const std::array<std::array<int, 2>, 3> corners = {{{0, 0}, {p, 0}, {0, p}}};

  std::vector<int> order;
  const auto add = [&](const std::array<int, 2>& ij, int k) {
    order.push_back(node_at.at(ij) * (q + 1) + k);
  };
  for (const int k : {0, q}) {
    for (const auto& corner : corners) add(corner, k);
  }
  for (const int k : {0, q}) {
    for (const auto& edge : lattice.edges) {
      for (const auto& ij : edge) add(ij, k);
    }
  }
  for (const auto& corner : corners) {
    for (int k = 1; k < q; ++k) add(corner, k);
  }
  for (const int k : {0, q}) {
    for (const auto& ij : lattice.interior) add(ij, k);
  }
  for (const auto& edge : lattice.edges) {
    for (int k = 1; k < q; ++k) {
      for (const auto& ij : edge) add(ij, k);
    }
  }
  for (int k = 1; k < q; ++k) {
    for (const auto& ij : lattice.interior) add(ij, k);
  }
  return order;
}

void write_vtu(const std::string& path, const SkinMesh& mesh, const VectorXd& displacement,
               const VtuOptions& options) {
  const int num_nodes = mesh.num_nodes(), num_elements = mesh.num_elements();
  require(mesh.rest.rows() == num_nodes, "write_vtu: rest positions do not fit the mesh");
  require(displacement.size() == 0 || displacement.size() == 3 * num_nodes,
          "write_vtu: displacement must have 3 entries per node");
  check_fields(options.point_fields, num_nodes);
  check_fields(options.cell_fields, num_elements);

  std::vector<double> points(mesh.rest.data(), mesh.rest.data() + mesh.rest.size());
  std::vector<double> moved(points.size(), 0.0);
  if (displacement.size() > 0) moved.assign(displacement.data(), displacement.data() + displacement.size());
  if (options.deformed) {
    for (size_t i = 0; i < points.size(); ++i) points[i] += moved[i];
  }
  std::vector<std::int32_t> level(static_cast<size_t>(num_nodes));
  for (int n = 0; n < num_nodes; ++n) level[n] = n % mesh.num_levels;

  std::vector<std::int64_t> connectivity, offsets;
  std::vector<std::int32_t> degrees, element_layer, material;
  for (size_t k = 0; k < mesh.element_layers.size(); ++k) {
    const ElementLayer& layer = mesh.element_layers[k];
    const std::vector<int> order = vtk_wedge_order(mesh.order, layer.order);
    for (int face = 0; face < mesh.num_faces; ++face) {
      const std::vector<int> nodes = mesh.element_nodes(static_cast<int>(k), face);
      for (const int local : order) connectivity.push_back(nodes[local]);
      offsets.push_back(static_cast<std::int64_t>(connectivity.size()));
      degrees.insert(degrees.end(), {mesh.order, mesh.order, layer.order});
      element_layer.push_back(static_cast<std::int32_t>(k));
      material.push_back(material_of(layer));
    }
  }

  VtkXml xml("UnstructuredGrid");
  xml.time_value(options.time);
  xml.open("Piece", "NumberOfPoints=\"" + std::to_string(num_nodes) + "\" NumberOfCells=\"" +
                        std::to_string(num_elements) + "\"");
  xml.open("PointData", "Vectors=\"displacement_mm\"");
  xml.array("displacement_mm", 3, moved);
  xml.array("level", 1, level);
  for (const OutputField& field : options.point_fields) xml.array(field.name, field.components, field.values);
  xml.close();
  xml.open("CellData", "HigherOrderDegrees=\"HigherOrderDegrees\"");
  xml.array("HigherOrderDegrees", 3, degrees);
  xml.array("element_layer", 1, element_layer);
  xml.array("material_layer", 1, material);
  for (const OutputField& field : options.cell_fields) xml.array(field.name, field.components, field.values);
  xml.close();
  xml.open("Points");
  xml.array("Points", 3, points);
  xml.close();
  xml.open("Cells");
  xml.array("connectivity", 1, connectivity);
  xml.array("offsets", 1, offsets);
  xml.array("types", 1, std::vector<std::uint8_t>(static_cast<size_t>(num_elements), vtk_lagrange_wedge));
  xml.close();
  write_file(path, xml.finish());
}

void write_pvd(const std::string& path, const std::vector<PvdEntry>& entries) {
  std::string text =
      "<?xml version=\"1.0\"?>\n<VTKFile type=\"Collection\" version=\"0.1\" byte_order=\"LittleEndian\">\n"
      "  <Collection>\n";
  for (const PvdEntry& entry : entries) {
    text += "    <DataSet timestep=\"" + exact_text(entry.time) + "\" group=\"\" part=\"0\" file=\"" +
            xml_escaped(entry.file) + "\"/>\n";
  }
  write_file(path, text + "  </Collection>\n</VTKFile>\n");
}

}  // namespace rhytid
