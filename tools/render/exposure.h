// What the shutter sees while it is open: pictures between the frames of a moving surface.
//
// A frame of footage is the mean, in linear light, of n pictures in the middles of n equal parts of its exposure, whose middle
// is the frame's time: t + (e/R) ((k + 1/2)/n − 1/2), k = 0 .. n − 1, for a share e of the frame interval 1/R. Between frames
// the skin moves on a cubic through the four frames about it (Catmull and Rom), at rest before the first, straight on after
// the last; fingers follow their own path.
// Tests  tests/tools/exposure_test.cpp, tests/tools/twin_footage_test.cpp
#pragma once

#include "fitting/cameras.h"
#include "tools/render/moving_surface.h"

namespace rhytid::tools {

/// Displacement at `frame`, in frames, up to one beyond both ends. [num_columns · 3] mm
VectorXd displacement_between(const MovingSurface& surface, double frame);
/// Its time, s; beyond the ends as far as the interval beside. A surface of one frame stands still.
double time_between(const MovingSurface& surface, double frame);

/// So many pictures of an exposure that no column of the skin moves by more than a pixel from one to the next, at least 2 and at
/// most 64; 1 when `exposure` is 0.
int pictures_of_exposure(const MovingSurface& surface, const fitting::Camera& camera, double exposure);

/// The surface in the middles of the `pictures` parts of every frame's exposure: picture k of frame f is its frame
/// f · pictures + k.
MovingSurface exposed_surface(const MovingSurface& surface, double exposure, int pictures);

}  // namespace rhytid::tools
