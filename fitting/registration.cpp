#include "fitting/registration.h"

#include <Eigen/LU>
#include <algorithm>
#include <cmath>
#include <limits>
#include <optional>

#include "fitting/attachment.h"
#include "sim/core/error.h"
#include "sim/mesh/surface_edges.h"
#include "sim/output/surface_tessellation.h"

namespace rhytid::fitting {
namespace {

/// Cuts each face edge into this many pieces for the ray cast; Newton makes up for the flatness.
constexpr int kSubdivision = 6;
/// Newton stops when the projection is this close to the pixel, px.
constexpr double kPixelTolerance = 1e-10;
/// Natural coordinates may leave the face by round-off; they are then put back onto its edge.
constexpr double kFaceTolerance = 1e-9;

std::vector<std::array<int, 3>> corner_columns(const SkinMesh& mesh) {
  std::vector<std::array<int, 3>> corners(mesh.num_faces);
  for (int f = 0; f < mesh.num_faces; ++f)
    for (int k = 0; k < 3; ++k) corners[f][k] = mesh.face_columns[f * mesh.nodes_per_face() + k];
  return corners;
}

/// The exact outer surface at rest with its tangents, and the faces around a face.
class OuterSurface {
 public:
  explicit OuterSurface(const SkinMesh& mesh) : mesh_(mesh), basis_(mesh.order) {
    const auto corners = corner_columns(mesh);
    const SurfaceEdges topology(corners);
    faces_of_column_.resize(mesh.num_columns);
    for (int f = 0; f < mesh.num_faces; ++f)
      for (const int c : corners[f]) faces_of_column_[c].push_back(f);
    for (const SurfaceEdge& edge : topology.edges)
      if (edge.sides.size() == 1) add_rim_edge(edge.sides.front() / 3, edge.sides.front() % 3);
  }

  struct Jet {
    Vec3 x, x_u, x_v;
  };
  Jet at(int face, double u, double v) const {
    const int n = mesh_.nodes_per_face();
    std::vector<double> values(n), d_du(n), d_dv(n);
    basis_.evaluate(u, v, values.data(), d_du.data(), d_dv.data());
    const std::vector<int> nodes = mesh_.outer_nodes(face);
    Jet jet{Vec3::Zero(), Vec3::Zero(), Vec3::Zero()};
    for (int a = 0; a < n; ++a) {
      const Vec3 X = mesh_.rest.row(nodes[a]).transpose();
      jet.x += values[a] * X;
      jet.x_u += d_du[a] * X;
      jet.x_v += d_dv[a] * X;
    }
    return jet;
  }

  /// The face itself first, then all faces that share a corner with it.
  std::vector<int> neighbourhood(int face) const {
    std::vector<int> faces = {face};
    for (int k = 0; k < 3; ++k)
      for (const int f : faces_of_column_[mesh_.face_columns[face * mesh_.nodes_per_face() + k]])
        if (std::find(faces.begin(), faces.end(), f) == faces.end()) faces.push_back(f);
    return faces;
  }

  double rim_distance(const Vec3& x) const {
    double least = std::numeric_limits<double>::infinity();
    for (const auto& [a, b] : rim_) {
      const Vec3 along = b - a;
      const double s = std::clamp((x - a).dot(along) / along.squaredNorm(), 0.0, 1.0);
      least = std::min(least, (x - a - s * along).norm());
    }
    return least;
  }

 private:
  void add_rim_edge(int face, int side) {
    static constexpr double corner_u[] = {0, 1, 0}, corner_v[] = {0, 0, 1};
    const int next = (side + 1) % 3, pieces = 2 * mesh_.order;
    Vec3 before = at(face, corner_u[side], corner_v[side]).x;
    for (int i = 1; i <= pieces; ++i) {
      const double s = static_cast<double>(i) / pieces;
      const Vec3 x = at(face, (1 - s) * corner_u[side] + s * corner_u[next],
                        (1 - s) * corner_v[side] + s * corner_v[next])
                         .x;
      rim_.emplace_back(before, x);
      before = x;
    }
  }

  const SkinMesh& mesh_;
  TriangleBasis basis_;
  std::vector<std::vector<int>> faces_of_column_;
  std::vector<std::pair<Vec3, Vec3>> rim_;  ///< straight pieces of the outer surface's boundary
};

/// Newton in one face; nothing when it leads out of the face.
std::optional<adjoint::MaterialPoint> refine_in_face(const OuterSurface& surface, const Camera& camera,
                                                     const Vec2& pixel, int face, double u, double v) {
  for (int iteration = 0; iteration < 30; ++iteration) {
    const OuterSurface::Jet jet = surface.at(face, u, v);
    const Vec2 miss = camera.project(jet.x) - pixel;
    if (!miss.allFinite()) return std::nullopt;
    if (miss.norm() < kPixelTolerance * std::max(1.0, pixel.norm())) {
      if (u < -kFaceTolerance || v < -kFaceTolerance || u + v > 1 + kFaceTolerance) return std::nullopt;
      u = std::max(u, 0.0);
      v = std::max(v, 0.0);
      const double over = std::max(1.0, u + v);
      return adjoint::MaterialPoint{face, u / over, v / over, true};
    }
    Eigen::Matrix<double, 3, 2> tangents;
    tangents << jet.x_u, jet.x_v;
    const Eigen::Matrix2d jacobian = camera.projection_jacobian(jet.x) * tangents;
    const Vec2 step = jacobian.fullPivLu().solve(miss);
    if (!step.allFinite() || std::max(std::fabs(u), std::fabs(v)) > 3) return std::nullopt;
    u -= step[0];
    v -= step[1];
  }
  return std::nullopt;
}

/// Refines from a guess in `face`. Where the guess is near an edge the point may lie in a neighbour.
std::optional<adjoint::MaterialPoint> refine(const OuterSurface& surface, const Camera& camera,
                                             const Vec2& pixel, int face, double u, double v) {
  for (const int candidate : surface.neighbourhood(face)) {
    const bool is_first = candidate == face;
    auto point =
        refine_in_face(surface, camera, pixel, candidate, is_first ? u : 1. / 3, is_first ? v : 1. / 3);
    if (point) return point;
  }
  return std::nullopt;
}

}  // namespace

Registration register_tracks(const TrackSet& tracks, const Camera& camera, const SkinMesh& mesh,
                             double rim_margin) {
  require(rim_margin >= 0, "register_tracks: rim_margin must not be negative");
  const SubdividedSurface flat(mesh, SurfaceSide::outer, kSubdivision);
  const RayCaster caster(flat.positions(VectorXd()), flat.triangles());
  const AttachmentResult attached = attach_tracks(tracks, camera, caster, 0);
  const OuterSurface surface(mesh);

  Registration result;
  RegistrationReport& report = result.report;
  report.not_seen = attached.report.not_seen;
  report.missed_mesh = attached.report.missed_mesh;
  report.back_side = attached.report.back_side;
  for (const Attachment& a : attached.attachments) {
    double u = 0, v = 0;
    for (int k = 0; k < 3; ++k) {
      const SubdividedSurface::Vertex& vertex = flat.vertices()[flat.triangles()[a.triangle][k]];
      u += a.barycentric[k] * vertex.u;
      v += a.barycentric[k] * vertex.v;
    }
    const Vec2 pixel = tracks.tracks[a.track].at(0)->pixel;
    const auto point = refine(surface, camera, pixel, flat.face_of_triangle(a.triangle), u, v);
    if (!point) {
      ++report.not_refined;
    } else if (surface.rim_distance(surface.at(point->face, point->u, point->v).x) < rim_margin) {
      ++report.near_rim;
    } else {
      ++report.registered;
      result.tracks.push_back({a.track, *point});
    }
  }
  return result;
}

}  // namespace rhytid::fitting
