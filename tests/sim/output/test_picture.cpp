#include <gtest/gtest.h>
#include <omp.h>

#include <algorithm>
#include <cmath>
#include <numbers>

#include "sim/core/error.h"
#include "sim/mesh/triangle_surface.h"
#include "sim/output/picture.h"

namespace rhytid {
namespace {

SkinMesh flat_patch() {
  ExtrusionOptions options;
  options.order = 3;
  options.layers = {{1.0, 1, 2}};
  return extrude(grid_surface(30, 20, 6, 4, GridPattern::union_jack), options);
}

/// Fine waves on the outer surface, amplitude in mm.
VectorXd waves(const SkinMesh& mesh, double amplitude) {
  VectorXd u = VectorXd::Zero(3 * mesh.num_nodes());
  for (int n = 0; n < mesh.num_nodes(); ++n) {
    u[3 * n + 2] = amplitude * std::sin(2 * std::numbers::pi * mesh.rest(n, 0) / 10);
  }
  return u;
}

double grey(const std::uint8_t* p) {
  return (p[0] + p[1] + p[2]) / 3.0;
}

/// Standard deviation of brightness in the middle of the picture.
double contrast(const Image& image) {
  double sum = 0, squares = 0;
  int count = 0;
  for (int y = image.height() * 2 / 5; y < image.height() * 3 / 5; ++y) {
    for (int x = image.width() * 2 / 5; x < image.width() * 3 / 5; ++x, ++count) {
      const double value = grey(image.pixel(x, y));
      sum += value, squares += value * value;
    }
  }
  return std::sqrt(std::max(0.0, squares / count - sum * sum / count / count));
}

TEST(Picture, RakingLightMakesShallowWavesVisible) {
  const SkinMesh mesh = flat_patch();
  const SubdividedSurface surface(mesh, SurfaceSide::outer, 6);
  PictureOptions options;
  options.width = 320, options.height = 240, options.samples = 2;
  const double flat = contrast(draw_surface(surface, {}, options));
  const double wavy = contrast(draw_surface(surface, waves(mesh, 0.2), options));
  EXPECT_LT(flat, 3);
  EXPECT_GT(wavy, 6);
  options.light_elevation_deg = 75;
  EXPECT_LT(contrast(draw_surface(surface, waves(mesh, 0.2), options)), 0.6 * wavy)
      << "raking light should win";
}

TEST(Picture, FillsTheFrameAndLeavesTheBackground) {
  const SkinMesh mesh = flat_patch();
  const SubdividedSurface surface(mesh, SurfaceSide::outer, 3);
  PictureOptions options;
  options.width = 300, options.height = 220, options.samples = 1;
  const Image image = draw_surface(surface, {}, options);
  int first = 300, last = -1, top = 220, bottom = -1;
  for (int y = 0; y < 220; ++y) {
    for (int x = 0; x < 300; ++x) {
      const auto* p = image.pixel(x, y);
      if (Rgb{p[0], p[1], p[2]} == options.background) continue;
      first = std::min(first, x), last = std::max(last, x), top = std::min(top, y),
      bottom = std::max(bottom, y);
    }
  }
  EXPECT_GE(first, 10);
  EXPECT_LE(last, 290);
  EXPECT_GE(top, 5);
  EXPECT_LE(bottom, 215);
  EXPECT_TRUE(last - first > 250 || bottom - top > 180) << "framing wastes the picture";
}

TEST(Picture, FieldColoursTitleBarAndSolidsAppear) {
  const SkinMesh mesh = flat_patch();
  const SubdividedSurface surface(mesh, SurfaceSide::outer, 3);
  PictureOptions options;
  options.width = 320, options.height = 240, options.samples = 2;
  options.title = "frame 3";
  PictureField field;
  field.label = "height [mm]";
  field.map = ColourMap::diverging;
  field.values = surface.positions({}).col(0);
  const Image image = draw_surface(surface, {}, options, &field);
  // Left of the patch is blue, right is red (seen from above with x to the right or to the left).
  int red = 0, blue = 0;
  for (int y = 0; y < 240; ++y) {
    for (int x = 0; x < 200; ++x) {
      const auto* p = image.pixel(x, y);
      red += p[0] > p[2] + 60;
      blue += p[2] > p[0] + 60;
    }
  }
  EXPECT_GT(red, 1000);
  EXPECT_GT(blue, 1000);
  int dark = 0;
  for (int y = 0; y < 14; ++y) {
    for (int x = 0; x < 100; ++x) dark += grey(image.pixel(x, y)) < 100;
  }
  EXPECT_GT(dark, 40) << "no title";

  const Image with_ball =
      draw_surface(surface, {}, options, &field, {capsule_solid({0, 0, 4}, {0, 0, 4}, 4)});
  const Image hidden =
      draw_surface(surface, {}, options, &field, {capsule_solid({0, 0, -60}, {0, 0, -60}, 1)});
  EXPECT_NE(with_ball.pixels(), image.pixels());
  EXPECT_EQ(hidden.pixels(), image.pixels()) << "a solid behind the skin must not show";

  field.values = VectorXd::Constant(surface.num_vertices(), 2.0);  // constant and NaN fields must not break
  field.values[0] = std::nan("");
  EXPECT_NO_THROW(draw_surface(surface, {}, options, &field));
  field.values.resize(3);
  EXPECT_THROW(draw_surface(surface, {}, options, &field), ContractError);
}

TEST(Picture, DoesNotDependOnTheNumberOfThreads) {
  const SkinMesh mesh = flat_patch();
  const SubdividedSurface surface(mesh, SurfaceSide::outer, 4);
  PictureOptions options;
  options.width = 200, options.height = 150;
  omp_set_num_threads(1);
  const Image one = draw_surface(surface, waves(mesh, 0.3), options);
  omp_set_num_threads(3);
  EXPECT_EQ(draw_surface(surface, waves(mesh, 0.3), options).pixels(), one.pixels());
}

}  // namespace
}  // namespace rhytid
