#include <gtest/gtest.h>
#include <omp.h>

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <numbers>
#include <random>

#include "sim/core/error.h"
#include "sim/output/picture.h"
#include "sim/output/raster.h"

namespace rhytid {
namespace {

PinholeCamera plain_camera(int width, int height, double focal) {
  PinholeCamera camera;
  camera.K << focal, 0, 0.5 * (width - 1), 0, focal, 0.5 * (height - 1), 0, 0, 1;
  camera.width = width;
  camera.height = height;
  return camera;
}

size_t covered(const VisibilityBuffer& buffer) {
  return static_cast<size_t>(
      std::count_if(buffer.triangle.begin(), buffer.triangle.end(), [](int t) { return t >= 0; }));
}

/// An nx × ny grid of a plane, two triangles a cell, randomly jittered inside.
void jittered_grid(int n, MatrixX3& positions, std::vector<std::array<int, 3>>& triangles, unsigned seed) {
  std::mt19937 random(seed);
  std::uniform_real_distribution<double> jitter(-0.3, 0.3);
  positions.resize((n + 1) * (n + 1), 3);
  for (int j = 0; j <= n; ++j) {
    for (int i = 0; i <= n; ++i) {
      const bool rim = i == 0 || j == 0 || i == n || j == n;
      positions.row(j * (n + 1) + i) << -1 + 2 * (i + (rim ? 0 : jitter(random))) / n,
          -1 + 2 * (j + (rim ? 0 : jitter(random))) / n, 5 + (rim ? 0 : jitter(random));
    }
  }
  triangles.clear();
  for (int j = 0; j < n; ++j) {
    for (int i = 0; i < n; ++i) {
      const int a = j * (n + 1) + i, b = a + 1, c = a + n + 1, d = c + 1;
      triangles.push_back({a, c, b});
      triangles.push_back({b, c, d});
    }
  }
}

TEST(Rasterise, CoverageConvergesToTheProjectedArea) {
  const PinholeCamera camera = plain_camera(100, 80, 90);
  MatrixX3 x(3, 3);
  x << -1, -0.7, 4, 1.3, -0.2, 6, 0.1, 0.9, 5;
  std::array<Vec3, 3> p;
  for (int i = 0; i < 3; ++i) p[i] = camera.project(x.row(i).transpose());
  const double area =
      0.5 * std::abs((p[1] - p[0]).x() * (p[2] - p[0]).y() - (p[1] - p[0]).y() * (p[2] - p[0]).x());
  const double perimeter =
      (p[1] - p[0]).head<2>().norm() + (p[2] - p[1]).head<2>().norm() + (p[0] - p[2]).head<2>().norm();
  for (const int samples : {1, 4, 16}) {
    const VisibilityBuffer buffer = rasterise(camera, x, {{0, 1, 2}}, {.samples = samples});
    const double measured = double(covered(buffer)) / (samples * samples);
    // Samples that can be miscounted lie within half a sample diagonal of the outline.
    EXPECT_NEAR(measured, area, 0.25 * perimeter / samples) << samples;
    EXPECT_GT(measured, 0.9 * area);
  }
}

TEST(Rasterise, BarycentricsAndDepthArePerspectiveCorrect) {
  PinholeCamera camera = plain_camera(160, 120, 140);
  camera.R = Eigen::AngleAxisd(0.4, Vec3(1, 2, 3).normalized()).toRotationMatrix();
  camera.t << 0.3, -0.2, 6;
  camera.K(0, 1) = 3;  // a skewed pixel grid must not matter
  MatrixX3 x(3, 3);
  x << -1.5, -0.7, -2, 1.3, -0.4, 2.5, 0.1, 1.4, 0.3;
  const VisibilityBuffer buffer = rasterise(camera, x, {{0, 1, 2}}, {.samples = 2});
  const Vec3 normal = Vec3(x.row(1) - x.row(0)).cross(Vec3(x.row(2) - x.row(0)));
  size_t checked = 0;
  for (int sy = 0; sy < buffer.sample_rows(); ++sy) {
    for (int sx = 0; sx < buffer.sample_columns(); ++sx) {
      const size_t at = buffer.index(sx, sy);
      if (buffer.triangle[at] < 0) continue;
      // Independent: intersect the pixel's ray with the plane.
      const Vec2 pixel = buffer.position(sx, sy);
      const Vec3 eye = camera.centre(), ray = camera.ray(pixel.x(), pixel.y());
      const Vec3 hit = eye + normal.dot(Vec3(x.row(0)) - eye) / normal.dot(ray) * ray;
      const auto w = buffer.weights(at);
      const Vec3 point = (w[0] * x.row(0) + w[1] * x.row(1) + w[2] * x.row(2)).transpose();
      ASSERT_NEAR((point - hit).norm(), 0, 2e-6);
      ASSERT_NEAR(buffer.depth[at], camera.to_camera(hit).z(), 2e-6);
      ++checked;
    }
  }
  EXPECT_GT(checked, 500u);
}

TEST(Rasterise, SharedEdgesAreCoveredExactlyOnce) {
  const PinholeCamera camera = plain_camera(101, 101, 200);
  MatrixX3 x;
  std::vector<std::array<int, 3>> triangles;
  for (const unsigned seed : {1u, 2u, 3u}) {
    jittered_grid(9, x, triangles, seed);
    if (seed == 3) x.col(2).setConstant(5);
    std::vector<int> hits(101 * 101, 0);
    for (const auto& triangle : triangles) {
      const VisibilityBuffer one = rasterise(camera, x, {triangle});
      for (size_t k = 0; k < hits.size(); ++k) hits[k] += one.triangle[k] >= 0;
    }
    // Inside the square rim (pixel 10 .. 90 at depth 5) every pixel exactly once.
    for (int j = 12; j < 89; ++j) {
      for (int i = 12; i < 89; ++i) ASSERT_EQ(hits[j * 101 + i], 1) << i << ' ' << j << " seed " << seed;
    }
  }
}

TEST(Rasterise, SamplesExactlyOnEdgesBelongToOneTriangle) {
  // A square of pixel-aligned corners cut along its diagonal, in both vertex orders: many samples lie on e =
  // 0.
  PinholeCamera camera = plain_camera(21, 21, 1);
  camera.K(0, 2) = camera.K(1, 2) = 0;
  MatrixX3 x(4, 3);
  x << 4, 4, 1, 16, 4, 1, 16, 16, 1, 4, 16, 1;
  for (const std::array<int, 3>& first : {std::array{0, 1, 2}, {2, 1, 0}}) {
    for (const std::array<int, 3>& second : {std::array{0, 2, 3}, {3, 2, 0}}) {
      const size_t a = covered(rasterise(camera, x, {first})), b = covered(rasterise(camera, x, {second}));
      EXPECT_EQ(a + b, 12u * 12u);
      EXPECT_EQ(covered(rasterise(camera, x, {first, second})), 12u * 12u);
    }
  }
}

TEST(Rasterise, NearerSurfaceWinsAndCullingDropsBacks) {
  const PinholeCamera camera = plain_camera(40, 40, 40);
  MatrixX3 x(6, 3);
  x << -2, -2, 5, 2, -2, 5, 0, 2, 5, -2, -2, 4, 0, 2, 4, 2, -2, 4;
  const std::vector<std::array<int, 3>> both = {{0, 1, 2}, {3, 4, 5}};
  const VisibilityBuffer seen = rasterise(camera, x, both);
  EXPECT_EQ(seen.triangle[seen.index(20, 20)], 1);
  EXPECT_FLOAT_EQ(seen.depth[seen.index(20, 20)], 4);
  // (3, 4, 5) runs counter-clockwise for the viewer (y is down), (0, 1, 2) clockwise.
  const VisibilityBuffer culled = rasterise(camera, x, both, {.cull_back_faces = true});
  EXPECT_EQ(culled.triangle[culled.index(20, 20)], 1);
  EXPECT_EQ(covered(rasterise(camera, x, {{0, 1, 2}}, {.cull_back_faces = true})), 0u);
  const Vec3 normal = Vec3(x.row(4) - x.row(3)).cross(Vec3(x.row(5) - x.row(3)));
  EXPECT_LT(normal.z(), 0) << "the kept one faces the camera";
}

TEST(Rasterise, TrianglesThatPassBehindTheCameraNeedNoClipping) {
  // A floor y = 1 that reaches behind the camera: every pixel below the horizon sees it.
  const PinholeCamera camera = plain_camera(60, 60, 50);
  MatrixX3 x(4, 3);
  x << -1e4, 1, -1e4, 1e4, 1, -1e4, 1e4, 1, 1e4, -1e4, 1, 1e4;
  const VisibilityBuffer buffer = rasterise(camera, x, {{0, 1, 2}, {0, 2, 3}});
  for (int j = 0; j < 60; ++j) {
    const double slope = (j - 29.5) / 50;
    for (int i = 0; i < 60; ++i) {
      const size_t at = buffer.index(i, j);
      ASSERT_EQ(buffer.triangle[at] >= 0, slope > 0) << i << ' ' << j;
      if (slope > 0) {
        ASSERT_NEAR(buffer.depth[at], 1 / slope, 1e-5 / slope);
      }
    }
  }
}

TEST(Rasterise, BandsEqualTheWholeAndThreadsDoNotMatter) {
  const PinholeCamera camera = plain_camera(90, 70, 150);
  MatrixX3 x;
  std::vector<std::array<int, 3>> triangles;
  jittered_grid(12, x, triangles, 5);
  omp_set_num_threads(1);
  const VisibilityBuffer whole = rasterise(camera, x, triangles, {.samples = 3});
  omp_set_num_threads(4);
  const VisibilityBuffer again = rasterise(camera, x, triangles, {.samples = 3});
  EXPECT_EQ(whole.triangle, again.triangle);
  EXPECT_EQ(whole.depth, again.depth);
  EXPECT_EQ(whole.barycentric, again.barycentric);
  const VisibilityBuffer band =
      rasterise(camera, x, triangles, {.samples = 3, .row_begin = 20, .row_end = 41});
  EXPECT_EQ(band.height, 21);
  for (int sy = 0; sy < band.sample_rows(); ++sy) {
    for (int sx = 0; sx < band.sample_columns(); ++sx) {
      const size_t a = band.index(sx, sy), b = whole.index(sx, sy + 60);
      ASSERT_EQ(band.triangle[a], whole.triangle[b]);
      ASSERT_EQ(band.depth[a], whole.depth[b]);
      ASSERT_EQ(band.position(sx, sy), whole.position(sx, sy + 60));
    }
  }
}

TEST(Rasterise, RefusesBadInputAndSkipsNonFiniteCorners) {
  const PinholeCamera camera = plain_camera(10, 10, 10);
  MatrixX3 x(3, 3);
  x << -1, -1, 3, 1, -1, 3, 0, 1, std::nan("");
  EXPECT_EQ(covered(rasterise(camera, x, {{0, 1, 2}})), 0u);
  EXPECT_THROW(rasterise(camera, x, {{0, 1, 3}}), ContractError);
  EXPECT_THROW(rasterise(camera, x, {}, {.samples = 0}), ContractError);
  EXPECT_THROW(rasterise(camera, x, {}, {.row_begin = 5, .row_end = 11}), ContractError);
}

TEST(CapsuleSolid, IsClosedOutwardAndHasTheRightVolume) {
  const double r = 2, length = 3;
  const PictureSolid solid = capsule_solid({1, 1, 1}, Vec3(1, 1, 1) + length * Vec3(2, 1, 2) / 3, r);
  double volume = 0;
  for (const auto& t : solid.triangles) {
    const Vec3 a = solid.vertices.row(t[0]), b = solid.vertices.row(t[1]), c = solid.vertices.row(t[2]);
    volume += a.dot(b.cross(c)) / 6;
  }
  const double exact = std::numbers::pi * r * r * (length + 4 * r / 3);
  EXPECT_NEAR(volume, exact, 0.01 * exact);
  EXPECT_LT(volume, exact);
}

}  // namespace
}  // namespace rhytid
