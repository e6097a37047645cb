// What a camera saw of material points: tracks, and their CSV file.
//
// File: one row per track, frame and camera; header exactly
//   frame,time_s,track_id,camera,x_px,y_px,sxx_px2,sxy_px2,syy_px2,corr,status
// status ok or renewed: all numbers present and finite, covariance positive definite, −1 <= corr <= 1;
// renewed is ok in all else, and the first of those that are measured against a new template (below). any
// other status: the six number columns x_px ... corr are empty, because nothing was measured. Numbers are
// written so that reading gives back the same bits.
//
// What the covariances contain. The first ok observation of a track says which material point it is, and its
// error o is shared by all later ones; e_f is what observation f errs by itself:
//   pixel_f = projection of the point in frame f + o + e_f,   o ~ N(0, covariance of the first),
//                                                             e_f ~ N(0, covariance of f), independent
// So a displacement since the first observation has the sum of both covariances, and one between two later
// frames f and g that of f and g. Independent errors in all frames are the case where the first is like the
// others. The tracker puts the noise of the template into the first observation, since it is common to all
// frames.
//
// A renewed template is cut where the last ok observation before it was, so that the error of that one, g,
// stays in all that follow: from there on pixel_f has o' ~ N(0, covariance of g) besides, once per renewal.
// Tests: tests/fitting/observations_test.cpp
#pragma once

#include <string>
#include <vector>

#include "sim/core/types.h"

namespace rhytid::fitting {

enum class TrackStatus {
  ok,        ///< measured
  occluded,  ///< covered by the occluder mask
  lost,      ///< an acceptance test failed (see TrackerReport for the counts by reason)
  outside,   ///< left the image
};

/// "ok", "occluded", "lost", "outside".
const char* to_string(TrackStatus status);

/// One track in one frame.
struct Observation {
  int frame = 0;      ///< index in the footage, from 0
  double time_s = 0;  ///< s
  TrackStatus status = TrackStatus::lost;
  Vec2 pixel = Vec2::Zero();  ///< position, px; meaningful only when ok
  /// Of the observation's own error, or, in the first, of what is common to the track; px²; only when ok.
  Eigen::Matrix2d covariance = Eigen::Matrix2d::Identity();
  double correlation = 0;  ///< zero-mean normalised correlation with the track's template; only when ok
  bool renewed = false;    ///< the first against a template cut at the last ok one before; only when ok
};

/// One material point followed by one camera; observations by increasing frame.
struct Track {
  int id = 0;
  std::string camera = "camera";
  std::vector<Observation> observations;

  /// The observation of `frame`, or nullptr.
  const Observation* at(int frame) const;
  /// Per observation the covariance of what it shares with others, px²: that of the first ok one and of every
  /// renewal up to it. Zero before the first.
  std::vector<Eigen::Matrix2d> shared_covariances() const;
};

/// Tracks by increasing (camera, id).
struct TrackSet {
  std::vector<Track> tracks;

  /// The track of `id` seen by `camera`, or nullptr.
  const Track* find(const std::string& camera, int id) const;
};

/// Reads the CSV described above; rows may come in any order. Throws InputError "file:line:column: got value,
/// expected ..." on a wrong header, a missing or non-finite number, a covariance that is not positive
/// definite, an unknown status, or a second row for the same (camera, track, frame).
TrackSet read_tracks(const std::string& path);

/// Writes all rows ordered by (frame, camera, track) under a temporary name that is renamed when complete.
/// Throws InputError when the file cannot be written; ContractError when an ok observation is not finite.
void write_tracks(const TrackSet& set, const std::string& path);

}  // namespace rhytid::fitting
