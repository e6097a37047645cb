#include "tools/render/skin_renderer.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>

#include "fitting/raycast.h"
#include "sim/core/error.h"
#include "sim/core/parallel.h"
#include "tools/render/skin_camera.h"

namespace rhytid::tools {
namespace {

double smoothstep(double low, double high, double x) {
  const double t = std::clamp((x - low) / (high - low), 0.0, 1.0);
  return t * t * (3 - 2 * t);
}

/// Share of the key light that a finger lets through to x: a penumbra that widens with the distance.
double shadow_of(const Finger& finger, const Vec3& x, const Vec3& light) {
  const Vec3 axis = finger.end - finger.tip, offset = x - finger.tip;
  const double b = light.dot(axis), c = axis.squaredNorm(), d = light.dot(offset), e = axis.dot(offset);
  const double denominator = c - b * b;
  double t = denominator > 1e-9 * c ? std::clamp((e - b * d) / denominator, 0.0, 1.0) : 0;
  const double s = std::max(0.0, light.dot(finger.tip + t * axis - x));
  t = std::clamp((offset + s * light).dot(axis) / c, 0.0, 1.0);
  const double distance = (x + s * light - finger.tip - t * axis).norm(), soft = 0.4 + 0.25 * s;
  return smoothstep(finger.radius - soft, finger.radius + soft, distance);
}

/// Share of the sky that a sphere around the nearest point of the finger's axis leaves to x with normal n.
double openness(const Finger& finger, const Vec3& x, const Vec3& n) {
  const Vec3 d = finger.axis_point(x) - x;
  const double distance = std::max(d.norm(), finger.radius);
  const double covered = std::max(0.0, n.dot(d) / distance) * std::pow(finger.radius / distance, 2);
  return 1 - 0.85 * std::min(1.0, covered);
}

double srgb_level(double linear) {
  const double x = std::clamp(linear, 0.0, 1.0);
  return 255 * (x <= 0.0031308 ? 12.92 * x : 1.055 * std::pow(x, 1 / 2.4) - 0.055);
}

/// A standard normal number that belongs to (frame, x, y).
double normal_number(int frame, int x, int y, std::uint32_t seed) {
  const std::uint32_t a = mixed_hash(static_cast<std::uint32_t>(x), static_cast<std::uint32_t>(y),
                                     static_cast<std::uint32_t>(frame), seed),
                      b = mixed_hash(a, 1, 2, seed ^ 0x5bd1e995u);
  const double u = (a + 0.5) / 4294967296.0, v = (b + 0.5) / 4294967296.0;
  return std::sqrt(-2 * std::log(u)) * std::cos(2 * std::numbers::pi * v);
}

/// Size in mm of one sample on the patch, seen at its middle.
double footprint(const MovingSurface& surface, const fitting::Camera& camera, int supersampling) {
  const Vec3 middle = surface.mesh.rest.colwise().mean().transpose();
  const double depth = (camera.rotation * middle + camera.translation).z();
  if (!(depth > 0))
    throw InputError("camera '" + camera.name + "'", "the skin behind it", "a camera that sees the skin");
  return depth / camera.intrinsics(0, 0) / supersampling;
}

}  // namespace

Image sensor_picture(const PictureLevels& levels, int frame, double noise, unsigned seed) {
  Image image(levels.width, levels.height, 3);
  parallel_for(levels.height, [&](std::int64_t row) {
    const int y = static_cast<int>(row);
    for (int x = 0; x < levels.width; ++x) {
      const double shift = noise > 0 ? noise * normal_number(frame, x, y, seed) : 0;
      const double* pixel = &levels.values[3 * static_cast<size_t>(row * levels.width + x)];
      for (int c = 0; c < 3; ++c)
        image.pixel(x, y)[c] =
            static_cast<std::uint8_t>(std::lround(std::clamp(pixel[c] + shift, 0.0, 255.0)));
    }
  });
  return image;
}

struct SkinRenderer::Lit {
  MatrixX3 positions, normals;
  std::vector<Finger> fingers;
  std::vector<std::array<double, 4>> finger_boxes;  ///< px: x0, y0, x1, y1
  VisibilityBuffer buffer;
};

int subdivision_for(const MovingSurface& surface, const fitting::Camera& camera, double edge_px) {
  double sum = 0;
  for (int face = 0; face < surface.mesh.num_faces; ++face)
    sum += (surface.rest({face, 1, 0}) - surface.rest({face, 0, 0})).norm();
  const double edge = sum / surface.mesh.num_faces;
  return std::clamp(static_cast<int>(std::ceil(edge / footprint(surface, camera, 1) / edge_px)), 1, 48);
}

SkinRenderer::SkinRenderer(const MovingSurface& surface, const SubdividedSurface& tessellation,
                           const Scene& scene, const fitting::Camera& camera,
                           const fitting::RenderCase& options)
    : surface_(surface),
      tessellation_(tessellation),
      scene_(scene),
      camera_(camera),
      options_(options),
      texture_(options.texture_scale, footprint(surface, camera, options.supersampling), options.seed),
      finger_texture_(0.3, footprint(surface, camera, options.supersampling), options.seed + 1),
      rest_(tessellation.positions({})),
      up_(surface.mean_normal()),
      finger_direction_(finger_direction(up_, camera)),
      eye_(camera.centre()) {
  // Raking light from the upper left of the picture, 40° above the skin: wrinkles stand out.
  const Vec3 left = -camera.rotation.row(0).transpose(), top = -camera.rotation.row(1).transpose();
  Vec3 across = 0.85 * left + 0.53 * top;
  across = (across - across.dot(up_) * up_).normalized();
  const double elevation = 40 * std::numbers::pi / 180;
  if (options.finger_dots > 0)
    for (const Finger& finger : fingers_at(scene, 0, finger_direction_))
      dots_.push_back(finger_dots(finger, camera, options.finger_dots));
  light_ = std::cos(elevation) * across + std::sin(elevation) * up_;
  if (!has_distortion(camera)) return;
  const int n = options.supersampling;
  undistorted_.resize(static_cast<size_t>(camera.width) * n * camera.height * n);
  parallel_for(static_cast<std::int64_t>(camera.height) * n, [&](std::int64_t sy) {
    for (int sx = 0; sx < camera.width * n; ++sx) {
      Vec2& out = undistorted_[static_cast<size_t>(sy) * camera.width * n + static_cast<size_t>(sx)];
      try {
        out = camera.undistorted({(sx + 0.5) / n - 0.5, (static_cast<double>(sy) + 0.5) / n - 0.5});
      } catch (const InputError&) {  // beyond the fold of the distortion: nothing is seen there
        out.setConstant(std::numeric_limits<double>::quiet_NaN());
      }
    }
  });
}

Vec2 SkinRenderer::normalised(const Vec2& pixel, size_t index) const {
  if (!undistorted_.empty()) return undistorted_[index];
  const Mat3& K = camera_.intrinsics;
  const double y = (pixel.y() - K(1, 2)) / K(1, 1);
  return {(pixel.x() - K(0, 2) - K(0, 1) * y) / K(0, 0), y};
}

VisibilityBuffer SkinRenderer::visibility(const MatrixX3& positions) const {
  const int n = options_.supersampling;
  if (undistorted_.empty())
    return rasterise(pinhole(camera_), positions, tessellation_.triangles(),
                     {.samples = n, .cull_back_faces = true});
  // A bent image of straight edges cannot be scan-converted: cast a ray for each sample.
  VisibilityBuffer buffer;
  buffer.width = camera_.width, buffer.height = camera_.height, buffer.samples = n;
  buffer.triangle.assign(undistorted_.size(), -1);
  buffer.barycentric.assign(undistorted_.size(), {0, 0});
  buffer.depth.assign(undistorted_.size(), std::numeric_limits<float>::infinity());
  const fitting::RayCaster caster(positions, tessellation_.triangles());
  parallel_for(buffer.sample_rows(), [&](std::int64_t sy) {
    for (int sx = 0; sx < buffer.sample_columns(); ++sx) {
      const size_t at = buffer.index(sx, static_cast<int>(sy));
      const Vec2& xy = undistorted_[at];
      if (!xy.allFinite()) continue;
      const Vec3 toward = camera_.rotation.transpose() * Vec3(xy.x(), xy.y(), 1);
      const auto hit = caster.cast({eye_, toward.normalized()});
      if (!hit || !hit->front_facing) continue;
      buffer.triangle[at] = hit->triangle;
      buffer.barycentric[at] = {static_cast<float>(hit->barycentric[1]),
                                static_cast<float>(hit->barycentric[2])};
      buffer.depth[at] = static_cast<float>(hit->distance / toward.norm());
    }
  });
  return buffer;
}

Vec3 SkinRenderer::shaded(const Vec3& albedo, const Vec3& point, const Vec3& normal, double ambient_occlusion,
                          double shadow, double gloss) const {
  // Light that enters the skin comes out a little further on: the terminator is wrapped by a quarter.
  const double cosine = std::max(0.0, (normal.dot(light_) + 0.25) / 1.25);
  const double sky = 0.7 + 0.3 * normal.dot(up_);
  const Vec3 toward_eye = (eye_ - point).normalized(), half = (toward_eye + light_).normalized();
  const double highlight = gloss * shadow * std::pow(std::max(0.0, normal.dot(half)), 28);
  const Vec3 key(1.02, 0.98, 0.90), fill(0.36, 0.38, 0.42);
  const Vec3 irradiance = key * (cosine * shadow) + fill * (sky * ambient_occlusion);
  return albedo.cwiseProduct(irradiance) + Vec3::Constant(highlight);
}

Vec3 SkinRenderer::skin_colour(const Lit& lit, size_t index) const {
  const auto& corners = tessellation_.triangles()[static_cast<size_t>(lit.buffer.triangle[index])];
  const auto w = lit.buffer.weights(index);
  Vec3 X = Vec3::Zero(), x = Vec3::Zero(), normal = Vec3::Zero();
  for (size_t i = 0; i < 3; ++i) {
    X += w[i] * rest_.row(corners[i]).transpose();
    x += w[i] * lit.positions.row(corners[i]).transpose();
    normal += w[i] * lit.normals.row(corners[i]).transpose();
  }
  normal.normalize();
  double open = 1, shadow = 1;
  for (const Finger& finger : lit.fingers) {
    open *= openness(finger, x, normal);
    shadow *= shadow_of(finger, x, light_);
  }
  return shaded(texture_.albedo(X), x, normal, open, shadow, 0.035);
}

Vec3 SkinRenderer::finger_colour(const Lit& lit, std::size_t index, const Vec3& point) const {
  const Finger& finger = lit.fingers[index];
  const Vec3 normal = (point - finger.axis_point(point)).normalized(),
             place = finger.rotation.transpose() * (point - finger.tip);
  Vec3 albedo = finger_texture_.albedo(place, false).cwiseProduct(Vec3(1.10, 0.84, 0.80));
  if (!dots_.empty())
    for (const Vec3& dot : dots_[index]) {
      const double radius = dot_radius(finger);
      albedo *= 0.1 + 0.9 * smoothstep(0.85 * radius, 1.15 * radius, (place - dot).norm());
    }
  // The under side sees skin, not sky.
  const double open = 0.35 + 0.65 * smoothstep(-0.9, 0.6, normal.dot(up_));
  return shaded(albedo, point, normal, open, smoothstep(-0.5, 0.2, normal.dot(light_)), 0.06);
}

Vec3 SkinRenderer::background(const Vec2& pixel) const {
  // A dark cloth with soft folds and no corners.
  const double x = pixel.x() / camera_.width - 0.5, y = pixel.y() / camera_.height - 0.5;
  const double folds = 0.12 * gradient_noise(Vec3(2.2 * x + y, 1.3 * y, 0.5), options_.seed + 5u);
  return Vec3(0.030, 0.052, 0.058) * (1 + folds - 0.6 * (x * x + y * y));
}

Vec3 SkinRenderer::sample(const Lit& lit, size_t index, const Vec2& pixel) const {
  const double skin_depth = lit.buffer.depth[index];
  std::size_t nearest = lit.fingers.size();
  double depth = skin_depth;
  Vec3 toward;
  for (size_t i = 0; i < lit.fingers.size(); ++i) {
    const auto& box = lit.finger_boxes[i];
    if (pixel.x() < box[0] || pixel.y() < box[1] || pixel.x() > box[2] || pixel.y() > box[3]) continue;
    const Vec2 xy = normalised(pixel, index);
    toward = camera_.rotation.transpose() * Vec3(xy.x(), xy.y(), 1);
    const auto s = lit.fingers[i].hit(eye_, toward);
    if (!s || *s >= depth) continue;
    depth = *s, nearest = i;
  }
  if (nearest < lit.fingers.size()) return finger_colour(lit, nearest, eye_ + depth * toward);
  return lit.buffer.triangle[index] >= 0 ? skin_colour(lit, index) : background(pixel);
}

Image SkinRenderer::render(int frame) const {
  return sensor_picture(levels(frame), frame, options_.noise, options_.seed);
}

PictureLevels SkinRenderer::levels(int frame) const {
  return exposed_levels(frame, 1);
}

PictureLevels SkinRenderer::exposed_levels(int first, int count) const {
  require(count >= 1, "SkinRenderer: no frame");
  std::vector<double> sum = light(first);
  for (int k = 1; k < count; ++k) {
    const std::vector<double> other = light(first + k);
    for (size_t i = 0; i < sum.size(); ++i) sum[i] += other[i];
  }
  for (double& value : sum) value = srgb_level(value / count);
  return {camera_.width, camera_.height, std::move(sum)};
}

std::vector<double> SkinRenderer::light(int frame) const {
  require(frame >= 0 && frame < surface_.frames(), "SkinRenderer: frame out of range");
  const VectorXd& u = surface_.displacements[static_cast<size_t>(frame)];
  Lit lit;
  lit.positions = tessellation_.positions(u);
  lit.normals = tessellation_.smooth_normals(u);
  if (options_.finger)
    lit.fingers = fingers_at(scene_, surface_.times[static_cast<size_t>(frame)], finger_direction_);
  for (const Finger& finger : lit.fingers) {
    std::array<double, 4> box{1e9, 1e9, -1e9, -1e9};
    const auto outline = finger_outline(finger, camera_, 2);
    for (const cv::Point2f& p : outline) {
      box[0] = std::min<double>(box[0], p.x), box[1] = std::min<double>(box[1], p.y);
      box[2] = std::max<double>(box[2], p.x), box[3] = std::max<double>(box[3], p.y);
    }
    if (outline.empty() || !undistorted_.empty()) box = {-1e9, -1e9, 1e9, 1e9};
    lit.finger_boxes.push_back(box);
  }
  lit.buffer = visibility(lit.positions);

  const int n = options_.supersampling;
  std::vector<double> picture(3 * static_cast<size_t>(camera_.width) * static_cast<size_t>(camera_.height));
  parallel_for(camera_.height, [&](std::int64_t row) {
    const int y = static_cast<int>(row);
    for (int x = 0; x < camera_.width; ++x) {
      Vec3 sum = Vec3::Zero();
      for (int sy = y * n; sy < (y + 1) * n; ++sy)
        for (int sx = x * n; sx < (x + 1) * n; ++sx)
          sum += sample(lit, lit.buffer.index(sx, sy), lit.buffer.position(sx, sy));
      double* pixel = &picture[3 * static_cast<size_t>(row * camera_.width + x)];
      for (int c = 0; c < 3; ++c) pixel[c] = sum[c] / (n * n);
    }
  });
  return picture;
}

}  // namespace rhytid::tools
