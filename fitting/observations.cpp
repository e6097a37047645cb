#include "fitting/observations.h"

#include <Eigen/LU>
#include <algorithm>
#include <array>
#include <charconv>
#include <cmath>
#include <fstream>
#include <map>
#include <string_view>
#include <tuple>
#include <utility>

#include "sim/core/error.h"
#include "sim/output/atomic_file.h"

namespace rhytid::fitting {
namespace {

constexpr std::array<std::string_view, 11> kColumns = {"frame",   "time_s", "track_id", "camera",
                                                       "x_px",    "y_px",   "sxx_px2",  "sxy_px2",
                                                       "syy_px2", "corr",   "status"};
enum Column { frame, time_s, track_id, camera, x_px, y_px, sxx, sxy, syy, corr, status };

constexpr std::string_view kRenewed = "renewed";  ///< for the status of an observation that is ok

std::string header() {
  std::string line;
  for (std::string_view name : kColumns) line += (line.empty() ? "" : ",") + std::string(name);
  return line;
}

/// One row under reading; knows where it is for messages.
class Row {
 public:
  Row(const std::string& path, int line_number, std::string_view line)
      : path_(path), line_number_(line_number) {
    std::size_t begin = 0;
    for (;;) {
      const std::size_t end = line.find(',', begin);
      fields_.push_back(line.substr(begin, end == std::string_view::npos ? end : end - begin));
      starts_.push_back(begin);
      if (end == std::string_view::npos) break;
      begin = end + 1;
    }
    if (fields_.size() != kColumns.size())
      throw InputError(path_ + ":" + std::to_string(line_number_) + ":1",
                       std::to_string(fields_.size()) + " fields",
                       std::to_string(kColumns.size()) + " fields");
  }

  std::string_view text(int column) const { return fields_[column]; }

  [[noreturn]] void refuse(int column, const std::string& expected) const {
    throw InputError(path_ + ":" + std::to_string(line_number_) + ":" + std::to_string(starts_[column] + 1),
                     std::string(kColumns[column]) + " '" + std::string(fields_[column]) + "'", expected);
  }

  double number(int column) const {
    const std::string_view field = fields_[column];
    double value = 0;
    const auto [end, error] = std::from_chars(field.data(), field.data() + field.size(), value);
    if (error != std::errc() || end != field.data() + field.size() || !std::isfinite(value))
      refuse(column, "a finite number");
    return value;
  }

  int index(int column) const {
    const std::string_view field = fields_[column];
    int value = 0;
    const auto [end, error] = std::from_chars(field.data(), field.data() + field.size(), value);
    if (error != std::errc() || end != field.data() + field.size() || value < 0)
      refuse(column, "a whole number, 0 or more");
    return value;
  }

 private:
  std::string path_;
  int line_number_;
  std::vector<std::string_view> fields_;
  std::vector<std::size_t> starts_;
};

TrackStatus read_status(const Row& row) {
  for (TrackStatus s : {TrackStatus::ok, TrackStatus::occluded, TrackStatus::lost, TrackStatus::outside})
    if (row.text(status) == to_string(s)) return s;
  if (row.text(status) == kRenewed) return TrackStatus::ok;
  row.refuse(status, "ok, renewed, occluded, lost or outside");
}

Observation read_observation(const Row& row) {
  Observation o;
  o.frame = row.index(frame);
  o.time_s = row.number(time_s);
  o.status = read_status(row);
  o.renewed = row.text(status) == kRenewed;
  if (o.status != TrackStatus::ok) {
    for (int column = x_px; column <= corr; ++column)
      if (!row.text(column).empty()) row.refuse(column, "an empty field (status is not ok)");
    return o;
  }
  o.pixel = {row.number(x_px), row.number(y_px)};
  o.covariance << row.number(sxx), row.number(sxy), row.number(sxy), row.number(syy);
  if (!(o.covariance(0, 0) > 0)) row.refuse(sxx, "a positive variance");
  if (!(o.covariance(1, 1) > 0)) row.refuse(syy, "a positive variance");
  if (!(o.covariance.determinant() > 0)) row.refuse(sxy, "a covariance below sqrt(sxx syy) in size");
  o.correlation = row.number(corr);
  if (!(std::abs(o.correlation) <= 1)) row.refuse(corr, "a correlation from -1 to 1");
  return o;
}

void append(std::string* line, double value) {
  char buffer[32];
  const auto [end, error] = std::to_chars(buffer, buffer + sizeof buffer, value);  // shortest exact form
  (void)error;
  line->append(buffer, end);
}

}  // namespace

const char* to_string(TrackStatus status) {
  switch (status) {
    case TrackStatus::ok:
      return "ok";
    case TrackStatus::occluded:
      return "occluded";
    case TrackStatus::lost:
      return "lost";
    case TrackStatus::outside:
      return "outside";
  }
  throw ContractError("unknown TrackStatus");
}

const Observation* Track::at(int frame_index) const {
  const auto it = std::lower_bound(observations.begin(), observations.end(), frame_index,
                                   [](const Observation& o, int f) { return o.frame < f; });
  return it != observations.end() && it->frame == frame_index ? &*it : nullptr;
}

std::vector<Eigen::Matrix2d> Track::shared_covariances() const {
  std::vector<Eigen::Matrix2d> list;
  Eigen::Matrix2d shared = Eigen::Matrix2d::Zero();
  const Observation* last = nullptr;
  for (const Observation& o : observations) {
    if (o.status == TrackStatus::ok) {
      if (last == nullptr) shared = o.covariance;
      if (last != nullptr && o.renewed) shared += last->covariance;
      last = &o;
    }
    list.push_back(shared);
  }
  return list;
}

const Track* TrackSet::find(const std::string& camera_name, int id) const {
  for (const Track& track : tracks)
    if (track.id == id && track.camera == camera_name) return &track;
  return nullptr;
}

TrackSet read_tracks(const std::string& path) {
  std::ifstream file(path, std::ios::binary);
  if (!file) throw InputError(path, "no readable file", "a tracks CSV");
  const auto chomp = [](std::string* line) {
    if (!line->empty() && line->back() == '\r') line->pop_back();
  };
  std::string line;
  std::getline(file, line);
  chomp(&line);
  if (line != header())
    throw InputError(path + ":1:1", "header '" + line.substr(0, 120) + "'", "'" + header() + "'");

  // Ordered containers make the result independent of the order of the rows.
  std::map<std::pair<std::string, int>, std::map<int, std::pair<Observation, int>>> by_track;
  for (int number = 2; std::getline(file, line); ++number) {
    chomp(&line);
    if (line.empty()) continue;
    const Row row(path, number, line);
    if (row.text(camera).empty()) row.refuse(camera, "a camera name");
    const Observation o = read_observation(row);
    auto& frames = by_track[{std::string(row.text(camera)), row.index(track_id)}];
    const auto [it, is_new] = frames.emplace(o.frame, std::make_pair(o, number));
    if (!is_new)
      row.refuse(frame, "one row per frame, track and camera (already on line " +
                            std::to_string(it->second.second) + ")");
  }
  TrackSet set;
  for (const auto& [key, frames] : by_track) {
    Track track{key.second, key.first, {}};
    bool is_begun = false;
    for (const auto& [index, entry] : frames) {
      const auto& [o, number] = entry;
      if (o.renewed && !is_begun)
        throw InputError(path + ":" + std::to_string(number),
                         "status 'renewed' in a track's first observation", "an ok one before it");
      is_begun = is_begun || o.status == TrackStatus::ok;
      track.observations.push_back(o);
    }
    set.tracks.push_back(std::move(track));
  }
  return set;
}

void write_tracks(const TrackSet& set, const std::string& path) {
  struct Entry {
    const Track* track;
    const Observation* observation;
  };
  std::vector<Entry> rows;
  for (const Track& track : set.tracks) {
    require(track.camera.find_first_of(",\r\n") == std::string::npos && !track.camera.empty(),
            "write_tracks: a camera name is empty or has a comma");
    for (const Observation& o : track.observations) rows.push_back({&track, &o});
  }
  std::stable_sort(rows.begin(), rows.end(), [](const Entry& a, const Entry& b) {
    return std::tie(a.observation->frame, a.track->camera, a.track->id) <
           std::tie(b.observation->frame, b.track->camera, b.track->id);
  });

  AtomicFile file(path);
  std::string line = header() + "\n";
  for (const auto& [track, o] : rows) {
    file.write(line);
    line = std::to_string(o->frame) + ",";
    append(&line, o->time_s);
    line += "," + std::to_string(track->id) + "," + track->camera;
    if (o->status == TrackStatus::ok) {
      for (double value : {o->pixel.x(), o->pixel.y(), o->covariance(0, 0), o->covariance(0, 1),
                           o->covariance(1, 1), o->correlation}) {
        require(std::isfinite(value), "write_tracks: an ok observation is not finite");
        line += ",";
        append(&line, value);
      }
    } else {
      line += ",,,,,,";
    }
    line += "," + (o->renewed ? std::string(kRenewed) : to_string(o->status)) + "\n";
  }
  file.write(line);
  file.commit();
}

}  // namespace rhytid::fitting
