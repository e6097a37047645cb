#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <cstdio>
#include <limits>
#include <numbers>

#include "sim/core/error.h"
#include "sim/mesh/columns.h"
#include "sim/mesh/skin_mesh.h"

namespace rhytid {
namespace {

std::string format(const char* pattern, double value) {
  char text[96];
  std::snprintf(text, sizeof text, pattern, value);
  return text;
}

void check_options(const ExtrusionOptions& options) {
  require(options.order >= 1 && options.order <= 4, "extrude: the order must be 1..4");
  require(!options.layers.empty(), "extrude: at least one layer is needed");
  require(options.bend_radius >= 0, "extrude: the bend radius must not be negative");
  for (const ExtrusionLayer& layer : options.layers) {
    require(layer.thickness > 0, "extrude: layer thickness must be positive");
    require(layer.elements >= 1, "extrude: a layer needs at least one element");
    require(layer.order >= 1 && layer.order <= 4, "extrude: the thickness order must be 1..4");
    require(layer.by_vertex.size() == 0 || layer.by_vertex.minCoeff() > 0,
            "extrude: layer thickness must be positive at every vertex");
  }
  require(options.composite_order >= 1 && options.composite_order <= 4,
          "extrude: the composite order must be 1..4");
}

double total_thickness(const ExtrusionOptions& options);

/// The slabs of a composite are the same everywhere: a thickness per vertex has to scale all layers alike.
void check_ratios(const TriangleSurface& surface, const ExtrusionOptions& options) {
  const auto at = [](const ExtrusionLayer& layer, Eigen::Index vertex) {
    return layer.by_vertex.size() > 0 ? layer.by_vertex[vertex] : layer.thickness;
  };
  const double mean = total_thickness(options);
  for (Eigen::Index vertex = 0; vertex < surface.vertices.rows(); ++vertex) {
    double total = 0;
    for (const ExtrusionLayer& layer : options.layers) total += at(layer, vertex);
    for (const ExtrusionLayer& layer : options.layers)
      if (std::abs(at(layer, vertex) / total - layer.thickness / mean) > 1e-6)
        throw InputError(
            surface.origin + ": vertex " + std::to_string(surface.file_vertex(static_cast<int>(vertex))),
            "layers of a composite whose thicknesses do not keep their ratio",
            "a thickness_map for every layer, all in one ratio, or the stacked scheme");
  }
}

double total_thickness(const ExtrusionOptions& options) {
  double total = 0;
  for (const ExtrusionLayer& layer : options.layers) total += layer.thickness;
  return total;
}

void check_bend(const TriangleSurface& surface, const ExtrusionOptions& options) {
  const double radius = options.bend_radius, half_width = surface.vertices.col(0).cwiseAbs().maxCoeff();
  if (surface.vertices.col(2).cwiseAbs().maxCoeff() > 1e-9 * radius)
    throw InputError(surface.origin + ": bend_radius needs a flat surface in the plane z = 0");
  if (half_width >= std::numbers::pi * radius)
    throw InputError(surface.origin + ": bend_radius " + format("%g mm", radius) +
                     " rolls the surface over itself (" + "|x| reaches " + format("%g mm", half_width) +
                     "), expected a radius above " + format("%.4g mm", half_width / std::numbers::pi));
}

// Fills the element layers; returns the height of each level above the inner surface at every column, mm,
// [level][column]. `thickness` [layer][column].
std::vector<VectorXd> stack_layers(const ExtrusionOptions& options, const std::vector<VectorXd>& thickness,
                                   SkinMesh& mesh) {
  std::vector<VectorXd> heights{VectorXd::Zero(thickness[0].size())};
  const auto add_sheet = [&](const VectorXd& sheet, int order, std::vector<MaterialSlab> slabs) {
    const VectorXd base = heights.back();
    mesh.element_layers.push_back({static_cast<int>(heights.size()) - 1, order, std::move(slabs)});
    for (int k = 1; k <= order; ++k) heights.emplace_back(base + sheet * k / order);
  };
  if (options.composite) {
    const double total = total_thickness(options);
    std::vector<MaterialSlab> slabs;
    double below = 0;
    for (int material = 0; material < static_cast<int>(options.layers.size()); ++material) {
      const double begin = slabs.empty() ? -1 : slabs.back().w_end;
      below += options.layers[material].thickness;
      slabs.push_back({material, begin, 2 * below / total - 1});
    }
    slabs.back().w_end = 1;
    VectorXd sheet = thickness[0];
    for (std::size_t layer = 1; layer < thickness.size(); ++layer) sheet += thickness[layer];
    add_sheet(sheet, options.composite_order, slabs);
  } else {
    for (int material = 0; material < static_cast<int>(options.layers.size()); ++material) {
      const ExtrusionLayer& layer = options.layers[material];
      for (int element = 0; element < layer.elements; ++element)
        add_sheet(thickness[material] / layer.elements, layer.order, {{material, -1, 1}});
    }
  }
  return heights;
}

// Along a column direction the extruded surface is x(u,v) + h n(u,v), so the Jacobian determinant at height h
// from the given surface is the quadratic D(h) = (x_u + h n_u) × (x_v + h n_v) · n. Its sign decides folding
// for every element order through the thickness alike, as heights are linear in w.
struct HeightQuadratic {
  double c0, c1, c2;
  HeightQuadratic(const Vec3& x_u, const Vec3& x_v, const Vec3& n_u, const Vec3& n_v, const Vec3& n)
      : c0(x_u.cross(x_v).dot(n)), c1((x_u.cross(n_v) + n_u.cross(x_v)).dot(n)), c2(n_u.cross(n_v).dot(n)) {}

  // Smallest t ≥ 0 with D(direction · t) ≤ 0; infinite when there is none.
  double first_fold(double direction) const {
    if (c0 <= 0) return 0;
    const double a = c2, b = c1 * direction;
    // c0 + b t + a t²; 2 c0 / (−b + √(b² − 4 a c0)) is the smallest positive root when there is one.
    const double discriminant = b * b - 4 * a * c0;
    if (discriminant < 0) return std::numeric_limits<double>::infinity();
    const double denominator = -b + std::sqrt(discriminant);
    return denominator > 0 ? 2 * c0 / denominator : std::numeric_limits<double>::infinity();
  }
};

void refuse_folds(const TriangleSurface& surface, const TriangleBasis& basis, const Columns& columns,
                  const VectorXd& thickness, const ExtrusionOptions& options) {
  const int nodes = basis.num_nodes();
  const double direction = options.surface_is_outer ? -1 : 1;
  // Where the thickness h varies, x_u gains h_u n, which drops out of D: the local height still decides.
  std::vector<double> d_du(nodes), d_dv(nodes);
  std::vector<int> folded;
  double shallowest = std::numeric_limits<double>::infinity();
  for (int face = 0; face < static_cast<int>(surface.faces.size()); ++face) {
    double depth = std::numeric_limits<double>::infinity();
    bool folds = false;
    for (int node = 0; node < nodes; ++node) {
      basis.evaluate(basis.nodes()[node][0], basis.nodes()[node][1], nullptr, d_du.data(), d_dv.data());
      Vec3 x_u = Vec3::Zero(), x_v = Vec3::Zero(), n_u = Vec3::Zero(), n_v = Vec3::Zero();
      for (int j = 0; j < nodes; ++j) {
        const int column = columns.face_columns[face * nodes + j];
        x_u += d_du[j] * columns.positions.row(column).transpose();
        x_v += d_dv[j] * columns.positions.row(column).transpose();
        n_u += d_du[j] * columns.normals.row(column).transpose();
        n_v += d_dv[j] * columns.normals.row(column).transpose();
      }
      const int column = columns.face_columns[face * nodes + node];
      const Vec3 n = columns.normals.row(column);
      const double here = HeightQuadratic(x_u, x_v, n_u, n_v, n).first_fold(direction);
      folds = folds || here <= thickness[column];
      depth = std::min(depth, here);
    }
    if (folds) folded.push_back(face);
    shallowest = std::min(shallowest, depth);
  }
  if (folded.empty()) return;
  std::string faces;
  for (std::size_t i = 0; i < std::min<std::size_t>(folded.size(), 5); ++i)
    faces += (i ? ", " : "") + std::to_string(surface.file_face(folded[i]));
  if (folded.size() > 5) faces += ", ...";
  throw InputError(surface.origin + ": extruding " + format("%.4g mm ", thickness.maxCoeff()) +
                   (options.surface_is_outer ? "inwards" : "outwards") + " folds " +
                   std::to_string(folded.size()) + " of " + std::to_string(surface.faces.size()) +
                   " faces (" + faces + "), the first at a depth of " + format("%.4g mm", shallowest) +
                   (shallowest > 0 ? format(" (thickness to curvature radius %.3g, expected below 1)",
                                            thickness.maxCoeff() / shallowest)
                                   : std::string(" (the smoothed normal leaves the front of the face)")) +
                   "; use a thinner skin, a smoother or coarser surface, or other normal_smoothing");
}

}  // namespace

SkinMesh extrude(const TriangleSurface& surface, const ExtrusionOptions& options) {
  check_options(options);
  validate_surface(surface);
  if (options.bend_radius > 0) check_bend(surface, options);
  const TriangleBasis basis(options.order);
  Columns columns = make_columns(surface, SurfaceEdges(surface.faces), basis,
                                 vertex_normals(surface, options.normal_smoothing), options.bend_radius);
  std::vector<VectorXd> thickness;  // [layer][column]
  VectorXd total = VectorXd::Zero(columns.positions.rows());
  for (const ExtrusionLayer& layer : options.layers) {
    require(layer.by_vertex.size() == 0 || layer.by_vertex.size() == surface.vertices.rows(),
            "extrude: a thickness per vertex needs one for every vertex");
  }
  if (options.composite && options.layers.size() > 1) check_ratios(surface, options);
  for (const ExtrusionLayer& layer : options.layers) {
    thickness.push_back(layer.by_vertex.size() > 0
                            ? interpolate_vertices(surface, columns.face_columns, basis, layer.by_vertex)
                            : VectorXd::Constant(columns.positions.rows(), layer.thickness));
    total += thickness.back();
  }
  refuse_folds(surface, basis, columns, total, options);

  SkinMesh mesh;
  mesh.order = options.order;
  mesh.num_faces = static_cast<int>(surface.faces.size());
  mesh.num_columns = static_cast<int>(columns.positions.rows());
  mesh.face_columns = std::move(columns.face_columns);
  const std::vector<VectorXd> heights = stack_layers(options, thickness, mesh);
  mesh.num_levels = static_cast<int>(heights.size());
  const long unknowns = 3L * mesh.num_columns * mesh.num_levels;
  if (unknowns > std::numeric_limits<int>::max())
    throw InputError(surface.origin, std::to_string(unknowns) + " components of displacement",
                     "at most " + std::to_string(std::numeric_limits<int>::max()));
  mesh.rest.resize(mesh.num_nodes(), 3);
  for (int column = 0; column < mesh.num_columns; ++column) {
    const double given = options.surface_is_outer ? heights.back()[column] : 0;
    for (int level = 0; level < mesh.num_levels; ++level)
      mesh.rest.row(mesh.node(column, level)) =
          columns.positions.row(column) + (heights[level][column] - given) * columns.normals.row(column);
  }
  mesh.column_normals = std::move(columns.normals);
  mesh.rim_columns = std::move(columns.rim);
  mesh.rim_directions = std::move(columns.rim_directions);
  mesh.rim_turns = std::move(columns.rim_turns);
  mesh.surface = surface;
  for (int vertex = 0; vertex < surface.vertices.rows(); ++vertex) {
    mesh.vertex_columns.push_back(vertex);
    mesh.surface.vertices.row(vertex) = columns.positions.row(vertex);
  }
  return mesh;
}

}  // namespace rhytid
