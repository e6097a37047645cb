#include "fitting/track_import.h"

#include <algorithm>
#include <cctype>
#include <cmath>
#include <limits>
#include <unordered_map>
#include <utility>

#include "fitting/numbered_files.h"
#include "fitting/text_table.h"
#include "sim/core/error.h"
#include "sim/output/text.h"
#include "sim/scene/located_json.h"

namespace rhytid::fitting {
namespace {

/// A displacement since the reference as a file has it.
struct Row {
  int frame = 0;
  Vec2 displacement = Vec2::Zero();
  double sigma = 0;  ///< px, of the displacement; > 0 when ok
  double correlation = 0;
  bool is_ok = false, renews = false;
};

/// A point of a reference picture with its rows, by name.
struct Point {
  int id = 0;
  Vec2 reference = Vec2::Zero();
  std::string first_file;
  int last_file = -1;  ///< index of the file that named it last
  std::vector<Row> rows;
};

struct PlaceHash {
  std::size_t operator()(const std::pair<double, double>& p) const {
    return std::hash<double>()(p.first) * 1000003u ^ std::hash<double>()(p.second);
  }
};

/// DICe's Status_Flag: which say that the displacement was measured.
bool is_dice_success(int status) {
  return (status >= 0 && status <= 4) || status == 6 || status == 18 || status == 26;
}

constexpr int kDiceReset = 26;

/// What tracks.csv can hold.
bool is_camera_name(const std::string& name) {
  return !name.empty() && name.find_first_of(",\r\n") == std::string::npos;
}

constexpr const char* kCameraName = "a camera's name without commas and line ends";

/// Points by subset number, or by their coordinates in the reference, in the order of their appearance.
class PointSet {
 public:
  Point& at(const TextTable& table, int file, int id_column, const Vec2& reference, int x_column) {
    Point& point = id_column >= 0 ? by_id(table.index(id_column)) : by_place(reference);
    if (point.last_file < 0) {
      point.reference = reference;
      point.first_file = table.path();
    } else if (point.reference != reference) {
      table.refuse(x_column, "the coordinates that this point has in " + point.first_file +
                                 " (positions in the reference picture)");
    } else if (point.last_file == file) {
      table.refuse(x_column, "every point once in a file");
    }
    point.last_file = file;
    return point;
  }

  Point& by_id(int id) {
    const auto [it, is_new] = ids_.emplace(id, points_.size());
    if (is_new) points_.push_back({id, Vec2::Zero(), "", -1, {}});
    return points_[it->second];
  }

  std::vector<Point>& points() { return points_; }

 private:
  Point& by_place(const Vec2& p) {
    const auto [it, is_new] = places_.emplace(std::pair(p.x(), p.y()), points_.size());
    if (is_new) points_.push_back({static_cast<int>(points_.size()), Vec2::Zero(), "", -1, {}});
    return points_[it->second];
  }

  std::vector<Point> points_;
  std::unordered_map<int, std::size_t> ids_;
  std::unordered_map<std::pair<double, double>, std::size_t, PlaceHash> places_;
};

/// The text after "*** NAME:" among DICe's comments; empty when there is none.
std::string dice_fact(const TextTable& table, const std::string& name) {
  for (const std::string& line : table.comments()) {
    const std::size_t at = line.find(name + ":");
    if (at == std::string::npos) continue;
    std::string value = line.substr(at + name.size() + 1);
    const auto is_blank = [](char c) { return c == ' ' || c == '\t'; };
    value.erase(value.begin(), std::find_if_not(value.begin(), value.end(), is_blank));
    while (!value.empty() && is_blank(value.back())) value.pop_back();
    return value;
  }
  return {};
}

class Importer {
 public:
  Importer(const TrackImportOptions& options, TrackImportReport* report)
      : options_(options), report_(*report) {}

  TrackSet dice(const std::vector<std::string>& files) {
    const bool is_by_subset = TextTable(files.front()).find({"FRAME"}) >= 0;
    const std::vector<NumberedFile> numbered = number_files(files, report_.notes);
    // DICe numbers its files as the pictures; a file of the reference with itself is frame 0.
    std::optional<int> self;  // its number
    for (const NumberedFile& file : numbered) {
      const TextTable head(file.path);
      if (dice_fact(head, "Incremental correlation") == "true")
        throw InputError(file.path, "displacements from picture to picture (Incremental correlation: true)",
                         "displacements since the reference picture");
      const std::string reference = dice_fact(head, "Reference image");
      if (is_by_subset || reference.empty() || reference == "(from array)" ||
          reference != dice_fact(head, "Deformed image"))
        continue;
      if (self) throw InputError(file.path, "a second file of the reference with itself", "one");
      self = file.number;
      report_.notes.push_back(file.path + " is the reference with itself: frame 0");
    }
    if (is_by_subset) refuse_first_frame("the column FRAME says what frame it is");
    if (self) refuse_first_frame("the file of the reference with itself is frame 0");
    for (std::size_t i = 0; i < numbered.size(); ++i) {
      const NumberedFile& file = numbered[i];
      if (file.number == self) continue;
      const int frame = self ? file.number - *self : frame_of(file, numbered.front());
      if (!is_by_subset && frame < 0)
        throw InputError(file.path, "a number before that of the reference with itself",
                         "files of pictures behind the reference");
      read_dice(file.path, static_cast<int>(i), is_by_subset ? -1 : frame, is_by_subset ? file.number : -1);
    }
    return tracks();
  }

  TrackSet opencorr(const std::vector<std::string>& files) {
    if (!options_.sigma)
      throw InputError("--sigma", "nothing",
                       "how sure a displacement is, px per axis: OpenCorr's tables do not say");
    const std::vector<NumberedFile> numbered = number_files(files, report_.notes);
    for (std::size_t i = 0; i < numbered.size(); ++i)
      read_opencorr(numbered[i].path, static_cast<int>(i), frame_of(numbered[i], numbered.front()));
    return tracks();
  }

  TrackSet csv(const std::vector<std::string>& files) {
    if (files.size() != 1) throw InputError(files[1], "a second file", "one file with all frames of a csv");
    refuse_first_frame("the column frame says what frame it is");
    return read_csv(files.front());
  }

 private:
  /// Where no file says which one the reference is, the first one is not it.
  int frame_of(const NumberedFile& file, const NumberedFile& first) const {
    return file.number - first.number + options_.first_frame.value_or(std::max(first.number, 1));
  }

  void refuse_first_frame(const std::string& why) const {
    if (options_.first_frame)
      throw InputError("--first-frame", std::to_string(*options_.first_frame), "nothing: " + why);
  }

  void lose(const std::string& reason) { ++report_.lost[reason]; }

  /// Whether a correlation is good enough; counts the loss.
  bool accepts(double correlation) {
    if (correlation > 1 + 1e-6) {  // rounded
      lose("correlation above 1");
      return false;
    }
    if (correlation >= options_.min_correlation) return true;
    lose("correlation below " + short_text(options_.min_correlation));
    return false;
  }

  /// DICe's STATUS_FLAG; none when it is no number.
  static std::optional<int> dice_status(const TextTable& table, int column) {
    const double value = table.number(column);
    if (std::isnan(value)) return std::nullopt;
    if (!(std::abs(value) <= 1e6 && value == std::floor(value))) table.refuse(column, "a whole number");
    return static_cast<int>(value);
  }

  /// What a csv calls its points; nothing is ok.
  static TrackStatus csv_status(const TextTable& table, int column) {
    std::string word(table.text(column));
    std::transform(word.begin(), word.end(), word.begin(),
                   [](unsigned char c) { return static_cast<char>(std::tolower(c)); });
    if (word.empty()) return TrackStatus::ok;
    for (const TrackStatus status :
         {TrackStatus::ok, TrackStatus::occluded, TrackStatus::lost, TrackStatus::outside})
      if (word == to_string(status)) return status;
    table.refuse(column, "ok, lost, occluded, outside, or nothing, which is ok");
  }

  void read_dice(const std::string& path, int file, int frame, int subset) {
    TextTable table(path);
    const int x = table.column({"COORDINATE_X", "SUBSET_COORDINATES_X"});
    const int y = table.column({"COORDINATE_Y", "SUBSET_COORDINATES_Y"});
    const int u = table.column({"DISPLACEMENT_X", "SUBSET_DISPLACEMENT_X"});
    const int v = table.column({"DISPLACEMENT_Y", "SUBSET_DISPLACEMENT_Y"});
    const int sigma = table.find({"SIGMA"}), gamma = table.find({"GAMMA"}), match = table.find({"MATCH"});
    const int status = table.find({"STATUS_FLAG"}), id = table.find({"SUBSET_ID"});
    const int frame_column = subset < 0 ? -1 : table.column({"FRAME"});
    if (subset < 0 && table.find({"FRAME"}) >= 0)
      throw InputError(path, "a column FRAME", "files of one kind: one a frame, or one a subset with FRAME");
    if (sigma < 0 && !options_.sigma)
      throw InputError("--sigma", "nothing",
                       "how sure a displacement is, px per axis: " + path + " has no column SIGMA");
    while (table.next()) {
      const Vec2 reference(table.finite(x), table.finite(y));
      Point& point = subset < 0 ? points_.at(table, file, id, reference, x) : points_.by_id(subset);
      Row row;
      row.frame = frame;
      if (subset >= 0) {
        point.reference = point.rows.empty() ? reference : point.reference;
        if (point.reference != reference)
          table.refuse(x, "the coordinates of the first row (positions in the reference picture)");
        row.frame = table.index(frame_column);
        if (row.frame == 0) continue;  // the reference with itself
        if (!point.rows.empty() && row.frame <= point.rows.back().frame)
          table.refuse(frame_column, "frames in order, each once");
      }
      row.displacement = {table.number(u), table.number(v)};
      row.sigma = options_.sigma ? *options_.sigma : table.number(sigma);
      const double said = sigma >= 0 ? table.number(sigma) : row.sigma;
      const std::optional<int> flag = status >= 0 ? dice_status(table, status) : 0;
      row.renews = flag == kDiceReset;
      const double correlation = gamma >= 0 ? 1 - table.number(gamma) / 2 : 0;
      if (flag && !is_dice_success(*flag))
        lose("STATUS_FLAG " + std::to_string(*flag));
      else if (match >= 0 && table.number(match) < 0)
        lose("MATCH below 0");
      else if (!flag || !row.displacement.allFinite() || std::isnan(said) || !std::isfinite(correlation))
        lose("a number that is not finite");
      else if (said < 0)
        lose("SIGMA below 0");
      else if (gamma >= 0 && correlation > 1)
        lose("GAMMA below 0");
      else if (!(row.sigma > 0) || !std::isfinite(row.sigma))
        table.refuse(sigma, "a deviation above 0 px, since DICe estimated none; or --sigma");
      else
        row.is_ok = gamma < 0 || accepts(correlation);
      row.correlation = std::clamp(correlation, -1.0, 1.0);
      point.rows.push_back(row);
    }
  }

  void read_opencorr(const std::string& path, int file, int frame) {
    TextTable table(path);
    const int x = table.column({"x"}), y = table.column({"y"});
    const int u = table.column({"u"}), v = table.column({"v"}), zncc = table.find({"zncc"});
    while (table.next()) {
      const Vec2 reference(table.finite(x), table.finite(y));
      Point& point = points_.at(table, file, -1, reference, x);
      Row row;
      row.frame = frame;
      row.displacement = {table.number(u), table.number(v)};
      row.sigma = *options_.sigma;
      const double correlation = zncc >= 0 ? table.number(zncc) : 0;
      if (!row.displacement.allFinite() || !std::isfinite(correlation))
        lose("a number that is not finite");
      else
        row.is_ok = zncc < 0 || accepts(correlation);
      row.correlation = std::clamp(correlation, -1.0, 1.0);
      point.rows.push_back(row);
    }
  }

  /// Points and displacements as tracks that begin in frame 0.
  TrackSet tracks() {
    if (!(options_.frame_rate > 0))
      throw InputError("--rate", "nothing",
                       "frames per second of the footage: tables of displacements have no times");
    TrackSet set;
    for (Point& point : points_.points()) {
      std::stable_sort(point.rows.begin(), point.rows.end(),
                       [](const Row& a, const Row& b) { return a.frame < b.frame; });
      double least = std::numeric_limits<double>::infinity();
      for (const Row& row : point.rows)
        if (row.is_ok) least = std::min(least, row.sigma * row.sigma);
      report_.observations += static_cast<long>(point.rows.size());
      if (!std::isfinite(least)) {
        ++report_.never_seen;
        continue;
      }
      const double shared = 0.5 * least;
      Track track{point.id, options_.camera, {observation(0, point.reference, shared)}};
      track.observations.reserve(point.rows.size() + 1);
      track.observations.front().correlation = 1;
      bool is_renewed = false;
      for (const Row& row : point.rows) {
        Observation o = observation(row.frame, point.reference + row.displacement,
                                    row.is_ok ? row.sigma * row.sigma - shared : 1);
        o.correlation = row.correlation;
        o.status = row.is_ok ? TrackStatus::ok : TrackStatus::lost;
        o.renewed = row.is_ok && is_renewed;
        is_renewed = row.is_ok ? row.renews : is_renewed;
        report_.ok += row.is_ok;
        track.observations.push_back(o);
      }
      set.tracks.push_back(std::move(track));
    }
    std::sort(set.tracks.begin(), set.tracks.end(),
              [](const Track& a, const Track& b) { return a.id < b.id; });
    return set;
  }

  Observation observation(int frame, const Vec2& pixel, double variance) const {
    Observation o;
    o.frame = frame;
    o.time_s = frame / options_.frame_rate;
    o.status = TrackStatus::ok;
    o.pixel = pixel;
    o.covariance = variance * Eigen::Matrix2d::Identity();
    return o;
  }

  TrackSet read_csv(const std::string& path) {
    TextTable table(path);
    const int frame = table.column({"frame"}), id = table.column({"track", "track_id", "point"});
    const int x = table.column({"x", "x_px"}), y = table.column({"y", "y_px"});
    const int sigma = table.find({"sigma", "sigma_px"}), time = table.find({"time_s", "time"});
    const int camera = table.find({"camera"}), corr = table.find({"corr"}), status = table.find({"status"});
    if (sigma < 0 && !options_.sigma)
      throw InputError("--sigma", "nothing",
                       "how sure a displacement is, px per axis: " + path + " has no column sigma");
    if (time < 0 && !(options_.frame_rate > 0))
      throw InputError("--rate", "nothing",
                       "frames per second of the footage: " + path + " has no column time_s");
    std::map<std::pair<std::string, int>, Track> by_track;
    while (table.next()) {
      const std::string seen_by = camera >= 0 ? std::string(table.text(camera)) : options_.camera;
      if (!is_camera_name(seen_by)) table.refuse(camera, kCameraName);
      Track& track = by_track[{seen_by, table.index(id)}];
      track.id = table.index(id), track.camera = seen_by;
      const auto is_empty = [&table](int column) { return table.text(column).empty(); };
      const TrackStatus said = status >= 0 ? csv_status(table, status) : TrackStatus::ok;
      const bool is_lost = said != TrackStatus::ok || (is_empty(x) && is_empty(y));
      Observation o = observation(table.index(frame), Vec2::Zero(), 1);
      if (time >= 0) o.time_s = table.finite(time);
      ++report_.observations;
      if (is_lost)
        lose(said != TrackStatus::ok ? to_string(said) : "no position");
      else
        o.pixel = {table.number(x), table.number(y)};
      const bool has_correlation = corr >= 0 && !is_lost && !is_empty(corr);
      const double correlation = has_correlation ? table.number(corr) : 0;
      bool is_ok = !is_lost && o.pixel.allFinite() && std::isfinite(correlation);
      if (!is_lost && !is_ok) lose("a number that is not finite");
      if (is_ok && has_correlation) is_ok = accepts(correlation);
      if (is_ok) {
        const double deviation = options_.sigma ? *options_.sigma / std::sqrt(2.0) : table.number(sigma);
        if (!(deviation > 0) || !std::isfinite(deviation)) table.refuse(sigma, "a deviation above 0 px");
        o.covariance = deviation * deviation * Eigen::Matrix2d::Identity();
        o.correlation = std::clamp(correlation, -1.0, 1.0);
        ++report_.ok;
      }
      o.status = is_ok ? TrackStatus::ok : said != TrackStatus::ok ? said : TrackStatus::lost;
      track.observations.push_back(o);
    }
    return sorted(path, by_track);
  }

  /// By camera and track, frames in order. Throws InputError for a frame that a track has twice.
  TrackSet sorted(const std::string& path, std::map<std::pair<std::string, int>, Track>& by_track) {
    TrackSet set;
    for (auto& [key, track] : by_track) {
      std::vector<Observation>& list = track.observations;
      const auto earlier = [](const Observation& a, const Observation& b) { return a.frame < b.frame; };
      if (!std::is_sorted(list.begin(), list.end(), earlier))
        std::stable_sort(list.begin(), list.end(), earlier);
      const auto twice =
          std::adjacent_find(list.begin(), list.end(),
                             [](const Observation& a, const Observation& b) { return a.frame == b.frame; });
      if (twice != list.end())
        throw InputError(
            path,
            "frame " + std::to_string(twice->frame) + " of track " + std::to_string(key.second) + " twice",
            "a row per frame and track");
      const bool is_seen = std::any_of(list.begin(), list.end(),
                                       [](const Observation& o) { return o.status == TrackStatus::ok; });
      if (is_seen)
        set.tracks.push_back(std::move(track));
      else
        ++report_.never_seen;
    }
    return set;
  }

  const TrackImportOptions& options_;
  TrackImportReport& report_;
  PointSet points_;
};

void check(const TrackImportOptions& options) {
  if (options.sigma && !(*options.sigma > 0 && *options.sigma < 1e6))
    throw InputError("--sigma", std::to_string(*options.sigma), "a deviation above 0 px");
  if (!(options.frame_rate >= 0) || !std::isfinite(options.frame_rate))
    throw InputError("--rate", std::to_string(options.frame_rate), "frames per second above 0");
  if (!is_camera_name(options.camera))
    throw InputError("--camera", "'" + shown_text(options.camera) + "'", kCameraName);
  require(!options.first_frame || *options.first_frame >= 1, "import_tracks: the reference is frame 0");
}

void summarise(const TrackSet& set, TrackImportReport* report) {
  report->tracks = static_cast<int>(set.tracks.size());
  bool is_first = true;
  for (const Track& track : set.tracks) {
    if (track.observations.empty()) continue;
    const int first = track.observations.front().frame, last = track.observations.back().frame;
    report->first_frame = is_first ? first : std::min(report->first_frame, first);
    report->last_frame = is_first ? last : std::max(report->last_frame, last);
    is_first = false;
  }
}

}  // namespace

const char* to_string(TrackFormat format) {
  switch (format) {
    case TrackFormat::rhytid:
      return "rhytid";
    case TrackFormat::opencorr:
      return "opencorr";
    case TrackFormat::dice:
      return "dice";
    case TrackFormat::csv:
      return "csv";
  }
  throw ContractError("unknown TrackFormat");
}

TrackFormat recognise_tracks(const std::string& path) {
  const TextTable table(path);
  const auto has = [&table](std::initializer_list<std::string_view> names) { return table.find(names) >= 0; };
  if (has({"sxx_px2"})) return TrackFormat::rhytid;
  if (has({"COORDINATE_X", "SUBSET_COORDINATES_X"}) && has({"DISPLACEMENT_X", "SUBSET_DISPLACEMENT_X"}))
    return TrackFormat::dice;
  if (has({"frame"}) && has({"track", "track_id", "point"})) return TrackFormat::csv;
  if (has({"x"}) && has({"y"}) && has({"u"}) && has({"v"})) return TrackFormat::opencorr;
  throw InputError(
      path, "columns '" + table.header().substr(0, 80) + "'",
      "tracks: x,y,u,v,... (OpenCorr), COORDINATE_X,... (DICe), frame,track,x,y,... or tracks.csv");
}

TrackSet import_tracks(const std::vector<std::string>& files, const TrackImportOptions& options,
                       TrackImportReport* report) {
  require(!files.empty(), "import_tracks: no files");
  check(options);
  *report = {};
  report->files = static_cast<int>(files.size());
  report->format = options.format ? *options.format : recognise_tracks(files.front());
  TrackSet set;
  if (report->format == TrackFormat::rhytid) {
    if (files.size() != 1) throw InputError(files[1], "a second file", "one tracks.csv");
    if (options.first_frame)
      throw InputError("--first-frame", std::to_string(*options.first_frame),
                       "nothing: tracks.csv has frames");
    set = read_tracks(files.front());
    for (const Track& track : set.tracks) {
      report->observations += static_cast<long>(track.observations.size());
      for (const Observation& o : track.observations)
        if (o.status == TrackStatus::ok)
          ++report->ok;
        else
          ++report->lost[to_string(o.status)];
    }
  } else {
    Importer importer(options, report);
    set = report->format == TrackFormat::dice       ? importer.dice(files)
          : report->format == TrackFormat::opencorr ? importer.opencorr(files)
                                                    : importer.csv(files);
  }
  summarise(set, report);
  if (set.tracks.empty())
    throw InputError(files.front(), "no point that was found in any frame", "tracks of points");
  return set;
}

}  // namespace rhytid::fitting
