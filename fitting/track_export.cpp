#include "fitting/track_export.h"

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <filesystem>
#include <limits>
#include <map>

#include "sim/core/error.h"
#include "sim/output/atomic_file.h"
#include "sim/output/text.h"

namespace rhytid::fitting {
namespace {

std::string in(const std::string& folder, const std::string& name) {
  return (std::filesystem::path(folder) / name).string();
}

double deviation(const Eigen::Matrix2d& covariance) {
  return std::sqrt(0.5 * covariance.trace());
}

/// Numbers and commas, without the last comma.
std::string joined(std::initializer_list<double> values) {
  std::string line;
  for (const double value : values) line += (line.empty() ? "" : ",") + exact_text(value);
  return line;
}

std::string plain_table(const TrackSet& set) {
  std::string text = "frame,track,camera,time_s,x,y,sigma,corr,status\n";
  for (const Track& track : set.tracks)
    for (const Observation& o : track.observations) {
      text += std::to_string(o.frame) + "," + std::to_string(track.id) + "," + track.camera + "," +
              exact_text(o.time_s) + ",";
      text += o.status == TrackStatus::ok ? joined({o.pixel.x(), o.pixel.y(), deviation(o.covariance)}) +
                                                "," + (o.correlation != 0 ? exact_text(o.correlation) : "")
                                          : ",,,";
      text += std::string(",") + to_string(o.status) + "\n";
    }
  return text;
}

/// Tracks without correlations have 0 there; as a ZNCC or GAMMA it would say that nothing matched.
bool have_correlations(const TrackSet& set) {
  for (const Track& track : set.tracks)
    for (const Observation& o : track.observations)
      if (o.status == TrackStatus::ok && o.frame != track.observations.front().frame && o.correlation == 0)
        return false;
  return true;
}

std::string dice_row(const Track& track, const Observation& o, bool has_gamma) {
  const Observation& first = track.observations.front();
  const bool is_ok = o.status == TrackStatus::ok;
  const Vec2 moved = is_ok ? Vec2(o.pixel - first.pixel) : Vec2::Zero();
  std::string line = std::to_string(track.id) + "," +
                     joined({first.pixel.x(), first.pixel.y(), moved.x(), moved.y(),
                             is_ok ? deviation(first.covariance + o.covariance) : -1});
  if (has_gamma) line += "," + joined({is_ok ? 2 * (1 - o.correlation) : -1});
  return line + (is_ok ? ",0\n" : ",8\n");
}

/// Without ZNCC a point that is lost has no displacement.
std::string opencorr_row(const Track& track, const Observation& o, bool has_zncc) {
  const Observation& first = track.observations.front();
  const bool is_ok = o.status == TrackStatus::ok;
  const double nothing = has_zncc ? 0 : std::numeric_limits<double>::quiet_NaN();
  const Vec2 moved = is_ok ? Vec2(o.pixel - first.pixel) : Vec2(nothing, nothing);
  std::string line = joined({first.pixel.x(), first.pixel.y(), moved.x(), moved.y(), moved.x(), moved.y()});
  if (has_zncc) line += "," + joined({is_ok ? o.correlation : -1});
  return line + ",0,0,0,0,0,0,0,0,\n";
}

/// `reference`: the frame of the tracks that displacements count from.
std::string header(TrackFormat format, int reference, bool has_correlations) {
  if (format == TrackFormat::opencorr)
    return std::string("x,y,u,v,u0,v0,") + (has_correlations ? "ZNCC," : "") +
           "iteration,convergence,feature,exx,eyy,exy,subset_rx,subset_ry,\n";
  return "***\n*** Displacements since frame " + std::to_string(reference) +
         " of the tracks, here frame 0, written by rhytid convert\n"
         "*** Incremental correlation: false\n"
         "*** Coordinates given with (0,0) as upper left corner of image, x positive right, y positive down\n"
         "***\nSUBSET_ID,COORDINATE_X,COORDINATE_Y,DISPLACEMENT_X,DISPLACEMENT_Y,SIGMA," +
         (has_correlations ? "GAMMA," : "") + "STATUS_FLAG\n";
}

void write_tables(const TrackSet& set, TrackFormat format, const std::string& folder,
                  TrackExportReport* report) {
  int first_frame = 0;
  bool is_any = false;
  for (const Track& track : set.tracks) {
    if (track.camera != set.tracks.front().camera)
      throw InputError("tracks", "more than one camera: " + set.tracks.front().camera + ", " + track.camera,
                       "tracks of one camera for tables of displacements");
    if (track.observations.empty()) continue;
    const int begin = track.observations.front().frame;
    first_frame = is_any ? std::min(first_frame, begin) : begin;
    is_any = true;
  }
  report->reference_frame = first_frame;
  const bool has_correlations = have_correlations(set);
  std::map<int, std::string> frames;
  for (const Track& track : set.tracks) {
    const bool is_referred = !track.observations.empty() && track.observations.front().frame == first_frame &&
                             track.observations.front().status == TrackStatus::ok;
    if (!is_referred) {
      ++report->without_reference;
      continue;
    }
    ++report->tracks;
    for (const Observation& o : track.observations) {
      if (o.frame == first_frame) continue;
      std::string& text = frames[o.frame - first_frame];
      if (text.empty()) text = header(format, first_frame, has_correlations);
      text += format == TrackFormat::dice ? dice_row(track, o, has_correlations)
                                          : opencorr_row(track, o, has_correlations);
    }
  }
  for (const auto& [frame, text] : frames) {
    char name[48];
    std::snprintf(name, sizeof name,
                  format == TrackFormat::dice ? "DICe_solution_%04d.txt" : "opencorr_%04d.csv", frame);
    write_file(in(folder, name), text);
    report->files.push_back(in(folder, name));
  }
}

}  // namespace

TrackExportReport export_tracks(const TrackSet& set, TrackFormat format, const std::string& folder) {
  TrackExportReport report;
  if (format != TrackFormat::rhytid)
    for (const Track& track : set.tracks)
      for (const Observation& o : track.observations) report.renewed += o.renewed;
  if (format == TrackFormat::rhytid || format == TrackFormat::csv) {
    report.files = {in(folder, format == TrackFormat::rhytid ? "tracks.csv" : "tracks_plain.csv")};
    report.tracks = static_cast<int>(set.tracks.size());
    if (format == TrackFormat::rhytid)
      write_tracks(set, report.files.front());
    else
      write_file(report.files.front(), plain_table(set));
  } else {
    write_tables(set, format, folder, &report);
  }
  return report;
}

}  // namespace rhytid::fitting
