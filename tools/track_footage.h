// The stage between footage and fit: follows skin points and writes what `rhytid track` writes. Used by the
// verbs track and fit. Tests: tests/tools/twin_footage_test.cpp, tests/tools/fitting_verbs.sh
#pragma once

#include <iosfwd>
#include <nlohmann/json.hpp>
#include <optional>
#include <string>

#include "fitting/cameras.h"
#include "fitting/case.h"
#include "fitting/tracking/tracker.h"
#include "tools/exit_code.h"
#include "tools/progress.h"

namespace rhytid::tools {

struct TrackJob {
  fitting::FrameSourceOptions footage;
  fitting::TrackerOptions options;
  std::optional<fitting::Camera> camera;  ///< none: no check of the picture's size, no truth
  fitting::FitCase noise;                 ///< how a fit would weigh the tracks
  std::string truth_motion;               ///< of the footage, when `render` made it; else empty
  std::string camera_digest;              ///< of the camera's file; empty: none
  std::string masks_digest;               ///< of what the scene masks in all frames; empty: nothing
  nlohmann::json of_case;                 ///< track_settings as the case alone has them; null without one
  bool is_other_video = false;            ///< not the case's footage
  bool there_and_back = false;            ///< also follow the points back to the first frame
};

/// Of footage without a case: `track` is all there is to say.
TrackJob track_job(const std::string& video, const fitting::TrackCase& track);

/// What decides the tracks beside the footage, by name; for tracks_record.
nlohmann::json track_settings(const TrackJob& job);

/// What a case says about its tracks: footage, seeds, the skin's silhouette, the finger's mask. `video` in
/// place of the case's footage unless empty; `asked` in place of its /track, when the command line has a say.
/// The truth is that of the footage in `folder` which `render` wrote, and of no other video. Throws
/// InputError.
TrackJob track_job(const fitting::Case& c, const std::string& folder, const std::string& video,
                   Progress& progress, const std::optional<fitting::TrackCase>& asked = {});

/// Tracks and writes tracks.csv, track.json, overlay.mp4 (or .avi) and overlay.png into `folder`; a summary
/// on `out`. What track.json says is of the tracks beside it whenever the writing is cut off. ok or
/// interrupted. `threads` is for OpenCV. Throws InputError.
ExitCode track_footage(const TrackJob& job, const std::string& folder, int threads, Progress& progress,
                       std::ostream& out);

}  // namespace rhytid::tools
