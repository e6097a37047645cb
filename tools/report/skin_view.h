// How a report looks at the skin: from the camera's side and with its up, so that maps and footage lie alike.
#pragma once

#include <optional>

#include "fitting/cameras.h"
#include "sim/output/camera.h"
#include "sim/output/surface_tessellation.h"

namespace rhytid::tools {

/// Sub-triangles a face edge is cut into for smooth pictures of a mesh of this size.
int picture_subdivision(const SkinMesh& mesh);

/// A camera that frames the whole rest surface, `reserved_right` px of the picture kept free. It looks as
/// `camera` does, or at three quarters without one.
PinholeCamera skin_view(const SubdividedSurface& surface, const std::optional<fitting::Camera>& camera,
                        int width, int height, int reserved_right);

/// The footage's own camera without distortion, scaled to `width` pixels.
PinholeCamera footage_view(const fitting::Camera& camera, int width);

}  // namespace rhytid::tools
