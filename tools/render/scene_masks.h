// What a scene says about footage of it: where the skin is and where the finger covers it.
#pragma once

#include <opencv2/core.hpp>

#include "tools/render/finger.h"
#include "tools/render/moving_surface.h"

namespace rhytid::tools {

/// CV_8U mask of the resting patch in the picture, 255 = skin, drawn in by `inset_px` from its outline so
/// that windows around its points hold no background.
cv::Mat patch_mask(const MovingSurface& surface, const fitting::Camera& camera, int inset_px);

/// CV_8U mask of the scene's fingers at a time (s), 255 = covered, grown by `margin_px`.
cv::Mat finger_mask(const Scene& scene, double time, const Vec3& direction, const fitting::Camera& camera,
                    double margin_px);

}  // namespace rhytid::tools
