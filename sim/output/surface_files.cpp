#include "sim/output/surface_files.h"

#include <cstdint>

#include "sim/core/error.h"
#include "sim/output/atomic_file.h"
#include "sim/output/text.h"
#include "sim/output/vtk_xml.h"

namespace rhytid {

void write_vtp(const std::string& path, const MatrixX3& vertices,
               const std::vector<std::array<int, 3>>& triangles,
               const std::vector<OutputField>& vertex_fields, double time) {
  for (const OutputField& field : vertex_fields) {
    require(field.components > 0 &&
                field.values.size() == static_cast<size_t>(vertices.rows()) * field.components,
            "write_vtp: a field's size does not fit the vertices");
  }
  std::vector<std::int64_t> connectivity, offsets;
  for (const auto& triangle : triangles) {
    for (const int vertex : triangle) {
      require(vertex >= 0 && vertex < vertices.rows(), "write_vtp: triangle names a missing vertex");
      connectivity.push_back(vertex);
    }
    offsets.push_back(static_cast<std::int64_t>(connectivity.size()));
  }
  VtkXml xml("PolyData");
  xml.time_value(time);
  xml.open("Piece", "NumberOfPoints=\"" + std::to_string(vertices.rows()) +
                        "\" NumberOfVerts=\"0\" NumberOfLines=\"0\" NumberOfStrips=\"0\" NumberOfPolys=\"" +
                        std::to_string(triangles.size()) + "\"");
  xml.open("PointData");
  for (const OutputField& field : vertex_fields) xml.array(field.name, field.components, field.values);
  xml.close();
  xml.open("Points");
  xml.array("Points", 3, std::vector<double>(vertices.data(), vertices.data() + vertices.size()));
  xml.close();
  xml.open("Polys");
  xml.array("connectivity", 1, connectivity);
  xml.array("offsets", 1, offsets);
  xml.close();
  write_file(path, xml.finish());
}

void write_obj(const std::string& path, const MatrixX3& vertices,
               const std::vector<std::array<int, 3>>& triangles, const MatrixX3& normals) {
  require(normals.rows() == 0 || normals.rows() == vertices.rows(),
          "write_obj: one normal per vertex or none");
  std::string text = "# triangles of a skin surface, mm\n";
  const auto add_rows = [&text](const char* tag, const MatrixX3& rows) {
    for (Eigen::Index i = 0; i < rows.rows(); ++i) {
      text += tag;
      for (int k = 0; k < 3; ++k) text += ' ' + exact_text(rows(i, k));
      text += '\n';
    }
  };
  add_rows("v", vertices);
  add_rows("vn", normals);
  for (const auto& triangle : triangles) {
    text += 'f';
    for (const int vertex : triangle) {
      const std::string number = std::to_string(vertex + 1);
      text += ' ' + number + (normals.rows() > 0 ? "//" + number : "");
    }
    text += '\n';
  }
  write_file(path, text);
}

}  // namespace rhytid
