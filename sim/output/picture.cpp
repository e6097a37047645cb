#include "sim/output/picture.h"

#include <Eigen/Geometry>
#include <Eigen/LU>
#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>

#include "sim/core/error.h"
#include "sim/output/font.h"
#include "sim/output/raster.h"

namespace rhytid {

namespace {

/// Light from far away, in the world.
struct Lighting {
  Vec3 key, fill, up;  // unit, toward the light; up = mean normal, for the ambient hemisphere
  double key_gain;     // 1 / (flat surface's cosine), so that elevation does not darken the picture
};

Vec3 any_perpendicular(const Vec3& n) {
  return n.cross(Vec3::Unit(std::abs(n.x()) < 0.8 ? 0 : 1)).normalized();
}

Lighting raking_light(const PinholeCamera& camera, const Vec3& mean_normal, const PictureOptions& options) {
  constexpr double degree = std::numbers::pi / 180;
  const Vec3 right_of_picture = camera.R.row(0).transpose();
  Vec3 right = right_of_picture - right_of_picture.dot(mean_normal) * mean_normal;
  right = right.norm() > 1e-6 ? Vec3(right.normalized()) : any_perpendicular(mean_normal);
  const Vec3 ahead = mean_normal.cross(right);
  const auto direction = [&](double azimuth, double elevation) -> Vec3 {
    return std::cos(elevation) * (std::cos(azimuth) * right + std::sin(azimuth) * ahead) +
           std::sin(elevation) * mean_normal;
  };
  const double azimuth = options.light_azimuth_deg * degree, elevation = options.light_elevation_deg * degree;
  return {direction(azimuth, elevation), direction(azimuth + 2.4, 0.9), mean_normal,
          1 / std::max(0.2, std::sin(elevation))};
}

/// x^40 by squaring.
double highlight(double x) {
  const double x2 = x * x, x4 = x2 * x2, x8 = x4 * x4, x16 = x8 * x8;
  return x16 * x16 * x8;
}

/// Linear-light colour of a matt, slightly oily surface. `normal` faces the eye.
Vec3 shaded(const Vec3& albedo, const Vec3& normal, const Vec3& to_eye, const Lighting& light, double gloss) {
  const double key = std::max(0.0, normal.dot(light.key)) * light.key_gain;
  const double fill = std::max(0.0, normal.dot(light.fill));
  const double sky = 0.5 + 0.5 * normal.dot(light.up);
  const double diffuse = 0.60 * key + 0.12 * fill + 0.20 * sky;
  Vec3 lit = albedo * diffuse;
  if (gloss > 0)
    lit.array() += gloss * highlight(std::max(0.0, normal.dot((light.key + to_eye).normalized())));
  // Soft shoulder: bright slopes stay distinguishable instead of clipping.
  return lit.unaryExpr([](double c) { return c < 0.7 ? c : 0.7 + 0.3 * (1 - std::exp((0.7 - c) / 0.3)); });
}

Vec3 interpolated(const MatrixX3& values, const std::array<int, 3>& triangle,
                  const std::array<double, 3>& w) {
  return (w[0] * values.row(triangle[0]) + w[1] * values.row(triangle[1]) + w[2] * values.row(triangle[2]))
      .transpose();
}

Vec3 toward(const Vec3& normal, const Vec3& to_eye) {
  return normal.dot(to_eye) < 0 ? Vec3(-normal) : normal;
}

/// What the samples show of the skin; colours are linear light.
struct SurfacePainter {
  const SubdividedSurface& surface;
  const MatrixX3 normals;
  const PictureField* field;
  double minimum, maximum;
  Vec3 skin;

  Vec3 albedo(const std::array<int, 3>& triangle, const std::array<double, 3>& w) const {
    if (!field) return skin;
    const double value = w[0] * field->values[triangle[0]] + w[1] * field->values[triangle[1]] +
                         w[2] * field->values[triangle[2]];
    return linear_from_srgb(map_colour(field->map, (value - minimum) / (maximum - minimum)));
  }
};

std::array<double, 2> colour_range(const PictureField& field) {
  double low = std::numeric_limits<double>::infinity(), high = -low;
  for (const double value : field.values) {
    if (!std::isfinite(value)) continue;
    low = std::min(low, value);
    high = std::max(high, value);
  }
  if (low > high) low = high = 0;
  if (field.map == ColourMap::diverging) {
    high = std::max(std::abs(low), std::abs(high));
    low = -high;
  }
  low = field.minimum.value_or(low);
  high = field.maximum.value_or(high);
  // A constant field still needs a bar of some height.
  if (!(low < high)) {
    const double half = std::max(1e-12, 0.5 * std::abs(low));
    low -= half, high = low + 2 * half;
  }
  return {low, high};
}

Vec3 mean_normal_of(const SubdividedSurface& surface, const MatrixX3& positions) {
  Vec3 sum = Vec3::Zero();
  for (const auto& t : surface.triangles()) {
    const Vec3 a = positions.row(t[0]), b = positions.row(t[1]), c = positions.row(t[2]);
    sum += (b - a).cross(c - a);
  }
  return sum.norm() > 0 ? Vec3(sum.normalized()) : Vec3(Vec3::UnitZ());
}

struct Layout {
  int right, top;  // pixels kept free for the colour bar and the title
  double scale;    // font pixel
};

Layout layout_of(int width, int height, bool bar, bool title) {
  const double scale = std::max(1.0, std::min(width, height) / 400.0);
  return {bar ? static_cast<int>(62 * scale) : 0, title ? static_cast<int>(18 * scale) : 0, scale};
}

}  // namespace

PinholeCamera three_quarter_view(const MatrixX3& positions, const Vec3& mean_normal,
                                 const PictureOptions& options) {
  const Vec3 n = mean_normal.normalized();
  // Picture-up: the world's y for upright faces, turned into z-up for lying patches.
  const Vec3 up = options.up.value_or(std::abs(n.y()) < 0.8 && std::abs(n.z()) < 0.95 ? Vec3::UnitY() : n);
  Vec3 side = up.cross(n);
  side = side.norm() > 0.05 ? Vec3(side.normalized())
                            : (std::abs(n.x()) < 0.9 ? Vec3(Vec3::UnitX()) : Vec3(Vec3::UnitY()));
  const Vec3 front = n.cross(side).norm() > 0 ? Vec3(-n.cross(side).normalized()) : any_perpendicular(n);
  const bool lying = up.dot(n) > 0.8;
  const Vec3 to_eye = lying ? Vec3(0.75 * n + 0.85 * front + 0.35 * side) : Vec3(n + 0.45 * side + 0.2 * up);
  const Vec3 direction = options.view_direction.value_or(-to_eye);
  const Vec3 lower = positions.colwise().minCoeff(), upper = positions.colwise().maxCoeff();
  return frame_box(lower, upper, direction, up, options.width, options.height);
}

Image draw_surface(const SubdividedSurface& surface, const VectorXd& displacement,
                   const PictureOptions& options, const PictureField* field,
                   const std::vector<PictureSolid>& solids) {
  require(options.width >= 64 && options.height >= 64, "draw_surface: picture too small");
  require(!field || field->values.size() == surface.num_vertices(),
          "draw_surface: one field value per vertex");
  const MatrixX3 positions = surface.positions(displacement);
  const Vec3 mean_normal = mean_normal_of(surface, positions);

  PinholeCamera camera;
  Layout layout = layout_of(options.width, options.height, field, !options.title.empty());
  if (options.camera) {
    camera = *options.camera;
    layout = layout_of(camera.width, camera.height, field, !options.title.empty());
  } else {
    // Frame the surface in what title and colour bar leave free, then widen to the whole picture.
    PictureOptions inner = options;
    inner.width -= layout.right;
    inner.height -= layout.top;
    camera = three_quarter_view(positions, mean_normal, inner);
    camera.K(1, 2) += layout.top;
    camera.width = options.width;
    camera.height = options.height;
  }

  const Lighting light = raking_light(camera, mean_normal, options);
  const auto range = field ? colour_range(*field) : std::array<double, 2>{0, 1};
  const SurfacePainter painter{surface,  surface.smooth_normals(displacement), field, range[0],
                               range[1], linear_from_srgb(options.skin)};
  const RasterOptions raster{.samples = options.samples};
  const VisibilityBuffer seen = rasterise(camera, positions, surface.triangles(), raster);
  std::vector<VisibilityBuffer> glass;
  for (const PictureSolid& solid : solids) {
    RasterOptions front_only = raster;
    front_only.cull_back_faces = true;
    glass.push_back(rasterise(camera, solid.vertices, solid.triangles, front_only));
  }

  const Vec3 background = linear_from_srgb(options.background);
  const Mat3 pixel_to_ray = camera.R.transpose() * camera.K.inverse();
  const auto is_empty = [&](size_t at) {
    return seen.triangle[at] < 0 && std::all_of(glass.begin(), glass.end(), [at](const VisibilityBuffer& g) {
             return g.triangle[at] < 0;
           });
  };
  std::vector<Vec3> solid_colours;
  for (const PictureSolid& solid : solids) solid_colours.push_back(linear_from_srgb(solid.colour));
  const auto sample_colour = [&](int sx, int sy) -> Vec3 {
    const size_t at = seen.index(sx, sy);
    if (is_empty(at)) return background;
    const Vec2 pixel = seen.position(sx, sy);
    const Vec3 to_eye = -(pixel_to_ray * Vec3(pixel.x(), pixel.y(), 1)).normalized();
    Vec3 colour = background;
    if (seen.triangle[at] >= 0) {
      const auto& triangle = surface.triangles()[seen.triangle[at]];
      const auto w = seen.weights(at);
      const Vec3 normal = interpolated(painter.normals, triangle, w).normalized();
      const bool back = normal.dot(to_eye) < 0;
      const Vec3 albedo = painter.albedo(triangle, w) * (back ? 0.55 : 1.0);
      colour = shaded(albedo, toward(normal, to_eye), to_eye, light, field ? 0.0 : 0.06);
    }
    // Farthest glass first; glass behind the skin is hidden.
    std::vector<size_t> order;
    for (size_t g = 0; g < glass.size(); ++g) {
      if (glass[g].triangle[at] >= 0 && glass[g].depth[at] < seen.depth[at]) order.push_back(g);
    }
    std::stable_sort(order.begin(), order.end(),
                     [&](size_t a, size_t b) { return glass[a].depth[at] > glass[b].depth[at]; });
    for (const size_t g : order) {
      const auto& triangle = solids[g].triangles[glass[g].triangle[at]];
      const Vec3 normal =
          toward(interpolated(solids[g].normals, triangle, glass[g].weights(at)).normalized(), to_eye);
      const double away = 1 - std::clamp(normal.dot(to_eye), 0.0, 1.0), rim = away * away * away;
      const double opacity = solids[g].opacity + (1 - solids[g].opacity) * 0.8 * rim;
      const Vec3 lit = shaded(solid_colours[g], normal, to_eye, light, 0.5);
      colour = (1 - opacity) * colour + opacity * lit;
    }
    return colour;
  };

  Image image(camera.width, camera.height, 3);
  const int n = options.samples;
#pragma omp parallel for schedule(dynamic, 8)
  for (int y = 0; y < camera.height; ++y) {
    for (int x = 0; x < camera.width; ++x) {
      Vec3 sum = Vec3::Zero();
      for (int s = 0; s < n * n; ++s) sum += sample_colour(x * n + s % n, y * n + s / n);
      const Rgb colour = srgb_from_linear(sum / (n * n));
      std::uint8_t* p = image.pixel(x, y);
      p[0] = colour.r, p[1] = colour.g, p[2] = colour.b;
    }
  }

  const double scale = layout.scale;
  if (!options.title.empty())
    draw_text(image, 8 * scale, 7 * scale, options.title, 1.15 * scale, {40, 40, 44});
  if (field) {
    const int bar_width = static_cast<int>(9 * scale), left = camera.width - static_cast<int>(54 * scale);
    const int top = layout.top + static_cast<int>(34 * scale);
    draw_colour_bar(image, left, top, bar_width, camera.height - top - static_cast<int>(30 * scale),
                    field->map, range[0], range[1], field->label, scale);
  }
  return image;
}

}  // namespace rhytid
