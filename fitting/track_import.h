// Tracks of other programs, as ours. What is recognised, by the names of the columns:
//
//   opencorr  x y u v ... ZNCC ...                      one file a frame, displacements since the reference
//   dice      COORDINATE_X COORDINATE_Y DISPLACEMENT_X DISPLACEMENT_Y [SIGMA GAMMA STATUS_FLAG SUBSET_ID]
//             one file a frame; with a column FRAME one file a subset
//   csv       frame track x y [sigma] [time_s] [camera] [corr] [status]     positions, one file for all
//   rhytid    tracks.csv (observations.h)
//
// Coordinates of all: px, the centre of the first pixel at (0, 0), as ours.
//
// Displacements. The reference is frame 0, where a point is at its coordinates. What the programs of digital
// image correlation call sigma is the deviation of a displacement, with the noise of both pictures in it
// (DICe: √(2 η² / Σ(∂I)²)), and so is --sigma; observations.h wants it in two parts: C_0 = ½ min_f sigma_f²
// is what a track's frames err alike (the subset of the reference), C_f = sigma_f² − C_0 what frame f errs by
// itself. The sigma of a csv is that of a position, the first one's that which all frames err alike.
//
// A point whose correlation failed is lost there: a DICe STATUS_FLAG other than success, SIGMA, MATCH or GAMMA
// below 0, a number that is not finite, a correlation (ZNCC; 1 − GAMMA/2) above 1 or below min_correlation.
// Where a source says none, corr is 0. The status of a csv is ok, lost, occluded or outside, or nothing. DICe's STATUS_FLAG 26 renews the subset: what follows is renewed in the sense of
// observations.h.
// Tests: tests/fitting/track_import_test.cpp
#pragma once

#include <map>
#include <optional>
#include <string>
#include <vector>

#include "fitting/observations.h"

namespace rhytid::fitting {

enum class TrackFormat { rhytid, opencorr, dice, csv };

/// "rhytid", "opencorr", "dice", "csv".
const char* to_string(TrackFormat format);

/// The format of a file by the names of its columns. Throws InputError when it is none of these.
TrackFormat recognise_tracks(const std::string& path);

struct TrackImportOptions {
  std::optional<TrackFormat> format;  ///< none: recognised
  std::string camera = "camera";      ///< name, where the file has none
  double frame_rate = 0;              ///< Hz; 0: the file must have times
  std::optional<double> sigma;        ///< px per axis, of a displacement; in place of what files say
  double min_correlation = 0.6;       ///< below it a point is lost; as the tracker's
  /// Frame of the file with the lowest number in its name; default: that number, but at least 1. Refused where
  /// files say which frame they are of, or DICe's reference with itself is among them, which is frame 0.
  std::optional<int> first_frame;
};

struct TrackImportReport {
  TrackFormat format = TrackFormat::rhytid;
  int files = 0, tracks = 0;
  long observations = 0, ok = 0;     ///< of all tracks, the reference left out
  std::map<std::string, long> lost;  ///< how many by reason
  int never_seen = 0;                ///< points that failed in every frame; they are left out
  int first_frame = 0, last_frame = 0;
  std::vector<std::string> notes;  ///< sentences about what had to be decided
};

/// Reads the files as one set of tracks. Throws InputError "file:line:column: ..." on bad content, and when
/// neither the files nor the options say how sure a position is, or when a frame was.
TrackSet import_tracks(const std::vector<std::string>& files, const TrackImportOptions& options,
                       TrackImportReport* report);

}  // namespace rhytid::fitting
