// Footage of a moving skin: textured, lit from the side, with the finger, its shadow, and camera noise.
//
//   colour = albedo · (ambient · occlusion + key · shadow · wrapped cosine) + a weak gloss,
// summed in linear light over the samples of a pixel and over the pictures of an exposure (exposure.h), encoded as
// sRGB, then noise of the given deviation in grey levels. Everything random is a hash of seed, frame and place, so that
// a frame is the same bits whatever the number of threads.
#pragma once

#include <vector>

#include "fitting/cameras.h"
#include "fitting/case.h"
#include "sim/output/image.h"
#include "sim/output/raster.h"
#include "sim/scene/scene.h"
#include "tools/render/finger.h"
#include "tools/render/moving_surface.h"
#include "tools/render/skin_texture.h"

namespace rhytid::tools {

/// Subdivision of the faces so that sub-triangles are about `edge_px` long in the picture; 1..48.
int subdivision_for(const MovingSurface& surface, const fitting::Camera& camera, double edge_px);

/// What reaches the sensor: sRGB grey levels of 255 before noise and rounding, [height · width][3].
struct PictureLevels {
  int width = 0, height = 0;
  std::vector<double> values;
};

/// The picture that a sensor with noise of this standard deviation, in grey levels, makes of them. The noise
/// belongs to `seed` and `frame`: SkinRenderer::render(frame) is this of its levels with the case's seed.
Image sensor_picture(const PictureLevels& levels, int frame, double noise, unsigned seed);

class SkinRenderer {
 public:
  /// All four must outlive the renderer; `tessellation` is the surface's own, `scene` gives the colliders.
  SkinRenderer(const MovingSurface& surface, const SubdividedSurface& tessellation, const Scene& scene,
               const fitting::Camera& camera, const fitting::RenderCase& options);

  /// The picture at the end of a frame of the surface, RGB.
  Image render(int frame) const;
  /// The same before the sensor, so that a frame is drawn once for many draws of noise.
  PictureLevels levels(int frame) const;
  /// The mean light of `count` frames of the surface from `first` on, as an open shutter adds it up (exposure.h).
  PictureLevels exposed_levels(int first, int count) const;

 private:
  struct Lit;
  /// Linear light of a frame, 1 = white; may be more. [height · width · 3]
  std::vector<double> light(int frame) const;
  VisibilityBuffer visibility(const MatrixX3& positions) const;
  Vec3 sample(const Lit& lit, size_t index, const Vec2& pixel) const;
  Vec3 skin_colour(const Lit& lit, size_t index) const;
  Vec3 finger_colour(const Lit& lit, std::size_t finger, const Vec3& point) const;
  Vec3 background(const Vec2& pixel) const;
  Vec3 shaded(const Vec3& albedo, const Vec3& point, const Vec3& normal, double ambient_occlusion,
              double shadow, double gloss) const;
  Vec2 normalised(const Vec2& pixel, size_t index) const;

  const MovingSurface& surface_;
  const SubdividedSurface& tessellation_;
  const Scene& scene_;
  const fitting::Camera& camera_;
  fitting::RenderCase options_;
  SkinTexture texture_, finger_texture_;
  MatrixX3 rest_;
  std::vector<std::vector<Vec3>> dots_;  ///< by finger, in its axes
  Vec3 up_, light_, finger_direction_, eye_;
  std::vector<Vec2> undistorted_;  ///< per sample, only for a camera with distortion
};

}  // namespace rhytid::tools
