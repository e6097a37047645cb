// Points that were covered, or lost, and are seen again.
//
// Where the neighbours' motion says that the point should be, the picture is searched for the point's template, and what
// is found there for itself in the first frame:
//
//   template of the track ──▶ this frame: best correlation within the search, alignment, tests of a measurement
//   window found there ─────▶ first frame: best correlation within the search, alignment: back at the seed?
//
// The way back refuses texture that looks like the template among other texture that does, and a point whose skin has
// changed. A track goes on under its own number; in the frames between nothing was measured.
//
// Units  px.   Tests  tests/fitting/tracking/redetection_test.cpp
#pragma once

#include "fitting/tracking/follower.h"

namespace rhytid::fitting {

/// Looks for a lost follower around `expected` (position now and deformation since the first frame, as its neighbours
/// tell). Does not change the follower. `refusal` none when it was found and found back.
Measurement redetect(const Follower& follower, const PatchWarp& expected, const FrameView& view,
                     const TrackerOptions& options);

}  // namespace rhytid::fitting
