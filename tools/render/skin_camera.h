// The camera of rendered footage: automatic framing, and the way from a calibrated camera to the rasteriser.
#pragma once

#include "fitting/cameras.h"
#include "sim/output/camera.h"
#include "tools/render/moving_surface.h"

namespace rhytid::tools {

/// A camera that frames the resting patch from `tilt` (rad) off its mean normal, the grid's y (or the
/// direction closest to it) up in the picture. Throws ContractError on sizes that are not positive.
fitting::Camera automatic_camera(const MovingSurface& surface, int width, int height, double tilt);

/// The camera without its distortion.
PinholeCamera pinhole(const fitting::Camera& camera);

bool has_distortion(const fitting::Camera& camera);

}  // namespace rhytid::tools
