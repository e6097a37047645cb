#include "sim/output/raster.h"

#include <Eigen/Geometry>
#include <Eigen/LU>
#include <algorithm>
#include <cmath>
#include <limits>

#include "sim/core/error.h"

namespace rhytid {

namespace {

/// One edge function e(x, y) = a x + b y + c in pixel coordinates and whether samples on e = 0 belong to it.
struct Edge {
  double a, b, c;
  bool owns_zero;
  bool inside(double e) const { return e > 0 || (e == 0 && owns_zero); }
};

struct Setup {
  std::int32_t triangle;
  std::array<Edge, 3> edges;               // positive inside
  double determinant;                      // > 0 after orientation
  int sx_begin, sx_end, sy_begin, sy_end;  // bounding box in samples, [begin, end)
};

bool lexicographically_less(const Vec3& a, const Vec3& b) {
  return std::lexicographical_compare(a.data(), a.data() + 3, b.data(), b.data() + 3);
}

/// Coefficients of (p × q)·K⁻¹(x, y, 1), computed in one fixed order of the end points, so that two triangles
/// that share an edge see exactly opposite numbers.
Vec3 edge_coefficients(const Vec3& p, const Vec3& q, const Mat3& inverse_k_transposed) {
  if (lexicographically_less(q, p)) return -edge_coefficients(q, p, inverse_k_transposed);
  return inverse_k_transposed * p.cross(q);
}

class SetupBuilder {
 public:
  SetupBuilder(const PinholeCamera& camera, const RasterOptions& options, int row_end)
      : camera_(camera),
        options_(options),
        row_end_(row_end),
        inverse_k_transposed_(camera.K.inverse().transpose()) {}

  /// False when the triangle cannot be seen.
  bool build(std::int32_t triangle, const std::array<Vec3, 3>& v, Setup& out) const {
    double nearest = std::numeric_limits<double>::infinity(), farthest = -nearest;
    for (const Vec3& corner : v) {
      if (!corner.allFinite()) return false;
      nearest = std::min(nearest, corner.z());
      farthest = std::max(farthest, corner.z());
    }
    if (farthest <= options_.near_depth) return false;
    double determinant = v[0].dot((v[1] - v[0]).cross(v[2] - v[0]));
    if (determinant == 0) return false;
    // In the y-down picture a triangle that is counter-clockwise seen from the camera has det < 0.
    const double sign = determinant > 0 ? 1 : -1;
    if (options_.cull_back_faces && sign > 0) return false;
    out.triangle = triangle;
    out.determinant = sign * determinant;
    for (int i = 0; i < 3; ++i) {
      const Vec3 e = sign * edge_coefficients(v[(i + 1) % 3], v[(i + 2) % 3], inverse_k_transposed_);
      // The half-plane rule: of an edge's two sides exactly one has (a > 0) or (a = 0 and b > 0) or ...
      const bool owns = e.x() > 0 || (e.x() == 0 && (e.y() > 0 || (e.y() == 0 && e.z() > 0)));
      out.edges[i] = {e.x(), e.y(), e.z(), owns};
    }
    return bound(v, nearest, out);
  }

 private:
  bool bound(const std::array<Vec3, 3>& v, double nearest, Setup& out) const {
    const int n = options_.samples;
    double x0 = -0.5, x1 = camera_.width - 0.5, y0 = options_.row_begin - 0.5, y1 = row_end_ - 0.5;
    if (nearest > options_.near_depth) {  // else the projection is unbounded: look everywhere
      double bx0 = x1, bx1 = x0, by0 = y1, by1 = y0;
      for (const Vec3& corner : v) {
        const Vec3 h = camera_.K * corner;
        bx0 = std::min(bx0, h.x() / h.z()), bx1 = std::max(bx1, h.x() / h.z());
        by0 = std::min(by0, h.y() / h.z()), by1 = std::max(by1, h.y() / h.z());
      }
      x0 = std::max(x0, bx0), x1 = std::min(x1, bx1), y0 = std::max(y0, by0), y1 = std::min(y1, by1);
    }
    if (!(x0 <= x1 && y0 <= y1)) return false;
    // Sample s sits at (s + ½)/n − ½ (+ row_begin); one spare sample on each side covers rounding.
    const auto first = [n](double p) { return static_cast<int>(std::floor((p + 0.5) * n - 0.5)) - 1; };
    const auto last = [n](double p) { return static_cast<int>(std::ceil((p + 0.5) * n - 0.5)) + 1; };
    out.sx_begin = std::max(0, first(x0));
    out.sx_end = std::min(camera_.width * n, last(x1) + 1);
    out.sy_begin = std::max(0, first(y0 - options_.row_begin));
    out.sy_end = std::min((row_end_ - options_.row_begin) * n, last(y1 - options_.row_begin) + 1);
    return out.sx_begin < out.sx_end && out.sy_begin < out.sy_end;
  }

  const PinholeCamera& camera_;
  const RasterOptions& options_;
  int row_end_;
  Mat3 inverse_k_transposed_;
};

void fill(const Setup& setup, double near_depth, int sy_begin, int sy_end, VisibilityBuffer& buffer) {
  for (int sy = std::max(sy_begin, setup.sy_begin); sy < std::min(sy_end, setup.sy_end); ++sy) {
    const double y = buffer.position(0, sy).y();
    for (int sx = setup.sx_begin; sx < setup.sx_end; ++sx) {
      const double x = (sx + 0.5) / buffer.samples - 0.5;
      std::array<double, 3> e;
      bool inside = true;
      for (int i = 0; i < 3 && inside; ++i) {
        const Edge& edge = setup.edges[i];
        e[i] = edge.a * x + edge.b * y + edge.c;
        inside = edge.inside(e[i]);
      }
      if (!inside) continue;
      const double sum = e[0] + e[1] + e[2], depth = setup.determinant / sum;
      if (!(sum > 0) || !(depth > near_depth)) continue;
      const size_t at = buffer.index(sx, sy);
      if (!(static_cast<float>(depth) < buffer.depth[at])) continue;
      buffer.depth[at] = static_cast<float>(depth);
      buffer.triangle[at] = setup.triangle;
      buffer.barycentric[at] = {static_cast<float>(e[1] / sum), static_cast<float>(e[2] / sum)};
    }
  }
}

}  // namespace

VisibilityBuffer rasterise(const PinholeCamera& camera, const MatrixX3& positions,
                           const std::vector<std::array<int, 3>>& triangles, const RasterOptions& options) {
  const int row_end = options.row_end < 0 ? camera.height : options.row_end;
  require(camera.width > 0 && camera.height > 0, "rasterise: picture sizes must be positive");
  require(options.samples >= 1 && options.samples <= 16, "rasterise: samples must be 1..16");
  require(options.row_begin >= 0 && options.row_begin < row_end && row_end <= camera.height,
          "rasterise: rows outside the picture");
  require(options.near_depth > 0, "rasterise: near_depth must be positive");

  VisibilityBuffer buffer;
  buffer.width = camera.width;
  buffer.height = row_end - options.row_begin;
  buffer.samples = options.samples;
  buffer.row_begin = options.row_begin;
  const size_t count = static_cast<size_t>(buffer.sample_columns()) * buffer.sample_rows();
  buffer.triangle.assign(count, -1);
  buffer.barycentric.assign(count, {0.0f, 0.0f});
  buffer.depth.assign(count, std::numeric_limits<float>::infinity());

  const SetupBuilder builder(camera, options, row_end);
  std::vector<Setup> setups;
  for (size_t t = 0; t < triangles.size(); ++t) {
    std::array<Vec3, 3> v;
    for (int i = 0; i < 3; ++i) {
      const int vertex = triangles[t][i];
      require(vertex >= 0 && vertex < positions.rows(), "rasterise: triangle names a missing vertex");
      v[i] = camera.to_camera(positions.row(vertex).transpose());
    }
    Setup setup;
    if (builder.build(static_cast<std::int32_t>(t), v, setup)) setups.push_back(setup);
  }

  // Bands of rows are independent, and inside a band triangles come in order: no race, one answer.
  constexpr int band_rows = 32;
  const int bands = (buffer.sample_rows() + band_rows - 1) / band_rows;
#pragma omp parallel for schedule(dynamic)
  for (int band = 0; band < bands; ++band) {
    const int begin = band * band_rows, end = std::min(begin + band_rows, buffer.sample_rows());
    for (const Setup& setup : setups) {
      if (setup.sy_end <= begin || setup.sy_begin >= end) continue;
      fill(setup, options.near_depth, begin, end, buffer);
    }
  }
  return buffer;
}

}  // namespace rhytid
