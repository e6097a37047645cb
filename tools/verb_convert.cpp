// rhytid convert: tracks and cameras of other programs to ours, and back.
#include <CLI/CLI.hpp>
#include <algorithm>
#include <filesystem>
#include <optional>
#include <ostream>

#include "fitting/colmap.h"
#include "fitting/track_export.h"
#include "fitting/track_import.h"
#include "sim/core/error.h"
#include "sim/output/text.h"
#include "tools/verb.h"

namespace rhytid::tools {
namespace {

namespace fs = std::filesystem;
using fitting::TrackFormat;

constexpr const char* kTrackFormats = "rhytid, opencorr, dice, csv";

std::optional<TrackFormat> track_format(const std::string& name) {
  for (const TrackFormat f :
       {TrackFormat::rhytid, TrackFormat::opencorr, TrackFormat::dice, TrackFormat::csv})
    if (name == to_string(f)) return f;
  return std::nullopt;
}

bool is_camera_file(const std::string& file) {
  const fs::path extension = fs::path(file).extension();
  return extension == ".yaml" || extension == ".yml" || extension == ".xml" || extension == ".json";
}

class Convert : public Verb {
 public:
  VerbHelp help() const override {
    return {
        "convert",
        "tracks and cameras of other programs to ours, and back",
        "Tracks: tables of OpenCorr (x,y,u,v,...,ZNCC, one file a frame) and DICe (DICe_solution_N.txt), or "
        "a csv of frame,track,x,y[,sigma][,time_s], become tracks.csv for fit, or tracks.csv becomes one "
        "of these. Points that were not found become lost. How sure a position is comes from the file "
        "(DICe's SIGMA, a column sigma) or from --sigma, and from nowhere else. Cameras: a view of COLMAP's "
        "text "
        "export (the folder of cameras.txt and images.txt) becomes camera.yaml, or camera files become such "
        "a folder.",
        "the tables of all frames, in any order: the number in their names says which frame; or a folder of "
        "COLMAP, or camera files",
        "tracks.csv, or DICe_solution_N.txt, opencorr_N.csv, tracks_plain.csv; camera.yaml, or cameras.txt "
        "and "
        "images.txt; what was lost, and why, on stdout",
        "rhytid convert dic/DICe_solution_*.txt --rate 25 -o run/case"};
  }
  bool takes_file() const override { return false; }

  void add_options(CLI::App& app) override {
    app.add_option("files", files_, "tables of tracks, a folder of COLMAP, or camera files")
        ->required()
        ->option_text("FILES...");
    app.add_option("--from", from_, "opencorr, dice, csv or rhytid (default: by the columns)")
        ->option_text("FORMAT")
        ->check(CLI::IsMember({"opencorr", "dice", "csv", "rhytid"}));
    app.add_option(
           "--to", to_,
           "tracks: rhytid (default), opencorr, dice, csv; cameras: opencv (default for COLMAP's), colmap")
        ->option_text("FORMAT")
        ->check(CLI::IsMember({"rhytid", "opencorr", "dice", "csv", "opencv", "colmap"}));
    app.add_option("--rate", import_.frame_rate,
                   "frames per second of the footage, where files have no times")
        ->option_text("HZ")
        ->check(CLI::Range(1e-6, 1e9));
    app.add_option(
           "--sigma", import_.sigma,
           "standard deviation of a displacement since the first frame, px per axis, in place of what "
           "files say")
        ->option_text("PX")
        ->check(CLI::Range(1e-6, 1e6));
    app.add_option("--min-correlation", import_.min_correlation, "points below it are lost (0.6)")
        ->option_text("C")
        ->check(CLI::Range(-1.0, 1.0));
    app.add_option(
           "--first-frame", import_.first_frame,
           "frame of the file with the lowest number (default: that number, at least 1; the reference "
           "is frame 0); where no file says which frame it is of")
        ->option_text("N")
        ->check(CLI::Range(1, 1000000));
    app.add_option("--camera", import_.camera, "name of the camera in tracks.csv (camera)")
        ->option_text("NAME");
    app.add_option("--image", image_, "which image of COLMAP's the camera took, as in images.txt")
        ->option_text("NAME");
    app.add_option(
           "--mm-per-unit", mm_per_unit_,
           "length of COLMAP's unit, which its files do not know, in mm: a distance in the scene over the "
           "same in COLMAP")
        ->option_text("S")
        ->check(CLI::Range(1e-12, 1e12));
    app.add_option("-o,--output", output_, "folder for results (default run/convert)")->option_text("DIR");
  }

  ExitCode run(VerbContext& context) override {
    if (fitting::is_colmap(files_.front())) return from_colmap(context);
    if (is_camera_file(files_.front())) return to_colmap(context);
    return tracks(context);
  }

 private:
  std::string output_folder() const {
    std::error_code error;
    fs::create_directories(output_, error);
    if (error || !fs::is_directory(output_))
      throw InputError("--output", "'" + output_ + "'", "a folder that can be written");
    return output_;
  }

  double scale() const {
    if (!mm_per_unit_)
      throw InputError("--mm-per-unit", "nothing",
                       "the length of COLMAP's unit in mm: its files have no unit");
    return *mm_per_unit_;
  }

  ExitCode from_colmap(VerbContext& context) const {
    if (!to_.empty() && to_ != "opencv") throw InputError("--to", to_, "opencv, for a camera of COLMAP's");
    if (files_.size() != 1) throw InputError(files_[1], "a second folder", "one folder of COLMAP");
    const fitting::Camera camera = fitting::read_colmap_camera(files_.front(), image_, scale());
    const std::string path = (fs::path(output_folder()) / "camera.yaml").string();
    fitting::write_camera(camera, path);
    const Vec3 c = camera.centre();
    context.out << path << ": " << camera.width << " x " << camera.height << " px, at ("
                << fixed_text(c.x(), 1) << ", " << fixed_text(c.y(), 1) << ", " << fixed_text(c.z(), 1)
                << ") mm\n";
    return ExitCode::ok;
  }

  ExitCode to_colmap(VerbContext& context) const {
    if (to_ != "colmap") throw InputError("--to", to_.empty() ? "nothing" : to_, "colmap, for camera files");
    std::vector<fitting::Camera> cameras;
    for (const std::string& file : files_) cameras.push_back(fitting::read_camera(file));
    const double s = scale();
    fitting::write_colmap_cameras(cameras, output_folder(), s);
    context.out << (fs::path(output_) / "cameras.txt").string()
                << ", images.txt: " << counted(static_cast<long>(cameras.size()), "camera") << '\n';
    return ExitCode::ok;
  }

  ExitCode tracks(VerbContext& context) {
    const std::optional<TrackFormat> target = track_format(to_.empty() ? "rhytid" : to_);
    if (!target) throw InputError("--to", to_, std::string(kTrackFormats) + ", for tracks");
    import_.format = track_format(from_);
    fitting::TrackImportReport report;
    context.progress.stage("read tracks", 0);
    const fitting::TrackSet set = fitting::import_tracks(files_, import_, &report);
    if (to_.empty() && report.format == TrackFormat::rhytid)
      throw InputError("--to", "nothing",
                       "opencorr, dice or csv, since " + files_.front() + " is a tracks.csv");
    for (const std::string& sentence : report.notes) context.progress.note(sentence);
    const fitting::TrackExportReport written = fitting::export_tracks(set, *target, output_folder());
    if (written.without_reference > 0)
      context.progress.warning(counted(written.without_reference, "track") +
                               " not seen in the first frame: left out of tables of displacements");
    if (written.reference_frame != 0)
      context.progress.warning("displacements are since frame " + std::to_string(written.reference_frame) +
                               ": it is frame 0 of the tables, and their numbers count from it");
    if (written.renewed > 0)
      context.progress.warning(counted(written.renewed, "renewed template") +
                               ": what they add to the deviation is not in this format");
    context.progress.finish();
    if (written.files.empty())
      throw InputError(files_.front(), "no frame but the first", "tracks over at least two frames");
    print(report, written, context.out);
    return ExitCode::ok;
  }

  static void print(const fitting::TrackImportReport& report, const fitting::TrackExportReport& written,
                    std::ostream& out) {
    out << written.files.front();
    if (written.files.size() > 1) out << " ... " << fs::path(written.files.back()).filename().string();
    out << ": " << counted(written.tracks, "track") << " from " << counted(report.files, "file") << " ("
        << to_string(report.format) << "), frames " << report.first_frame << " to " << report.last_frame
        << ", " << report.ok << " of " << counted(report.observations, "observation") << " ok\n";
    if (!report.lost.empty()) {
      out << "lost:";
      const char* comma = " ";
      for (const auto& [reason, count] : report.lost) {
        out << comma << count << " " << reason;
        comma = ", ";
      }
      out << '\n';
    }
    if (report.never_seen > 0)
      out << counted(report.never_seen, "point") << " not found in any frame: left out\n";
  }

  std::vector<std::string> files_;
  std::string from_, to_, image_, output_ = "run/convert";
  fitting::TrackImportOptions import_;
  std::optional<double> mm_per_unit_;
};

}  // namespace

std::unique_ptr<Verb> make_verb_convert() {
  return std::make_unique<Convert>();
}

}  // namespace rhytid::tools
