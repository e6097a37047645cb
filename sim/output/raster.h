// A deterministic z-buffer rasteriser: which point of which triangle does each (sub)pixel see?
//
// Works in homogeneous coordinates, so nothing is clipped: with camera-space corners v_i and the ray r
// through the sample (r_z = 1), e_i = (v_j × v_k)·r; the ray hits when all e_i have the sign of det =
// v_0·(v_1 × v_2), at depth z = det / Σe with perspective-correct barycentrics e_i / Σe. Source   M. Olano
// and T. Greer, "Triangle scan conversion using 2D homogeneous coordinates", 1997.
#pragma once

#include <array>
#include <cstdint>
#include <vector>

#include "sim/output/camera.h"

namespace rhytid {

struct RasterOptions {
  int samples = 1;                  ///< n × n regular samples per pixel, 1..16
  double near_depth = 1e-3;         ///< nothing nearer than this is seen, mm
  bool cull_back_faces = false;     ///< drop triangles that are clockwise in the picture
  int row_begin = 0, row_end = -1;  ///< pixel rows to render (−1 = to the last), to bound memory
};

/// Per sample: the nearest triangle, its perspective-correct barycentrics and depth. 16 bytes a sample.
/// Sample (sx, sy) of the buffer lies at pixel coordinates ((sx + ½)/n − ½, row_begin + (sy + ½)/n − ½).
struct VisibilityBuffer {
  int width = 0, height = 0;                      ///< pixels (height = number of rendered rows)
  int samples = 1;                                ///< n
  int row_begin = 0;                              ///< first rendered pixel row
  std::vector<std::int32_t> triangle;             ///< −1 = nothing
  std::vector<std::array<float, 2>> barycentric;  ///< weights of corners 1 and 2
  std::vector<float> depth;                       ///< z in the camera, mm; +inf = nothing

  int sample_columns() const { return width * samples; }
  int sample_rows() const { return height * samples; }
  size_t index(int sx, int sy) const { return static_cast<size_t>(sy) * sample_columns() + sx; }
  /// Pixel coordinates of a sample.
  Vec2 position(int sx, int sy) const {
    // One division of an exact number: bands and whole pictures then agree to the bit.
    return {(sx + 0.5) / samples - 0.5, (row_begin * samples + sy + 0.5) / samples - 0.5};
  }
  /// Weights of the three corners at a sample that sees a triangle.
  std::array<double, 3> weights(size_t sample) const {
    const double b1 = barycentric[sample][0], b2 = barycentric[sample][1];
    return {1 - b1 - b2, b1, b2};
  }
};

/// Renders triangles. A sample on an edge shared by two triangles belongs to exactly one of them; at equal
/// depth the first triangle wins. The same bits for any number of threads. Triangles with non-finite corners
/// are not drawn. Throws ContractError on triangles that name missing vertices and on bad options.
VisibilityBuffer rasterise(const PinholeCamera& camera, const MatrixX3& positions,
                           const std::vector<std::array<int, 3>>& triangles,
                           const RasterOptions& options = {});

}  // namespace rhytid
