// Our tracks as tables that other programs read; the formats are those of track_import.h.
// Tests: tests/fitting/track_import_test.cpp
#pragma once

#include <string>
#include <vector>

#include "fitting/track_import.h"

namespace rhytid::fitting {

struct TrackExportReport {
  std::vector<std::string> files;
  int tracks = 0;
  int without_reference = 0;  ///< not seen in the first frame: tables of displacements cannot hold them
  int renewed = 0;            ///< observations against a new template, which only tracks.csv can say
  int reference_frame = 0;    ///< of the tracks: frame 0 of tables of displacements
};

/// Writes tracks.csv, or tracks_plain.csv (csv), or one table per frame after the first: opencorr_N.csv,
/// DICe_solution_N.txt, with N the frame counted from the first, which is the reference. Covariances become one deviation, √(½ trace): of the displacement
/// since the first frame (DICe's SIGMA), or of the position (csv); OpenCorr has no place for it. A point that
/// is not ok has ZNCC −1, SIGMA −1 and STATUS_FLAG 8, or empty x and y. Tracks without correlations have no ZNCC
/// and no GAMMA; a point that is not ok then has no displacement (OpenCorr: nan). Numbers have all digits.
/// Every file is written under a temporary name first. Throws InputError when a file cannot be written, and
/// for tables of displacements when the tracks are of more than one camera.
TrackExportReport export_tracks(const TrackSet& set, TrackFormat format, const std::string& folder);

}  // namespace rhytid::fitting
