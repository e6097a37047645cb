// rhytid track: footage to tracks of skin points, with their uncertainty.
#include <CLI/CLI.hpp>
#include <algorithm>
#include <charconv>
#include <optional>
#include <sstream>

#include "fitting/case.h"
#include "sim/core/error.h"
#include "tools/clip_argument.h"
#include "tools/share_check.h"
#include "tools/track_footage.h"
#include "tools/verb.h"

namespace rhytid::tools {
namespace {

class TrackVerb : public Verb {
 public:
  VerbHelp help() const override {
    return {
        "track",
        "follow skin points through footage",
        "Finds corners on the skin in the first frame and follows them with sub-pixel accuracy and a "
        "covariance each; skin under the projected finger of the scene is masked. Run it before fit. With "
        "--video it works on any footage without a case.",
        "case.json with its footage, camera and scene; or a video",
        "tracks.csv, overlay.mp4 (overlay.avi where no H.264 encoder works), overlay.png, track.json; beside "
        "rendered footage also the error against "
        "the truth",
        "rhytid track data/scenes/demo/case.json -o run/demo"};
  }
  bool file_is_optional() const override { return true; }
  bool takes_case() const override { return true; }
  void add_options(CLI::App& app) override {
    app.add_option("--video", video_, "footage to track, in place of the case's")->option_text("FILE");
    app.add_option("--roi", roi_, "region of interest in the first frame, px")
        ->expected(4)
        ->delimiter(',')
        ->option_text("X,Y,W,H");
    app.add_option("--max-tracks", max_tracks_, "at most this many points, the best corners first (300)")
        ->option_text("N")
        ->check(CLI::Range(1, 100000));
    app.add_option("--min-distance", min_distance_, "between points in the first frame, px (8)")
        ->option_text("PX")
        ->check(CLI::Range(1.0, 1000.0));
    app.add_option(
           "--window", window_,
           "side of the window about a point, px, odd (21); a small one resolves finer motion, a large "
           "one is surer where texture is weak")
        ->option_text("PX")
        ->check(CLI::Validator(odd_window, ""));
    app.add_option("--frames", frames_, "only the first N frames")
        ->option_text("N")
        ->check(CLI::Range(1, 1000000));
    app.add_option("--model", model_,
                   "how the picture around a point may deform: affine (default), or translation, which has "
                   "less freedom and fits skin that only shifts")
        ->option_text("MODEL")
        ->check(CLI::IsMember({"affine", "translation"}));
    app.add_flag(
        "--no-redetect", gives_up_,
        "leave points that were covered or lost alone; else they are looked for in later frames, and go on "
        "under their number where they are found and lead back to their start");
    app.add_option(
           "--exposure", exposure_,
           "share of the frame interval that the shutter is open, whose blur is allowed for where skin moves "
           "by more than a pixel meanwhile (default: found out from the blur; 0: not allowed for)")
        ->option_text("FRACTION")
        ->check(share_check());
    app.add_flag("--there-and-back", there_and_back_,
                 "also follow the points back from the last frame to the first and say how far from their "
                 "start they end: drift, in px; takes as long again");
    add_clip_option(app, clip_);
  }

  ExitCode run(VerbContext& context) override {
    if (context.options.file.empty() && video_.empty())
      throw InputError("track", "neither a case nor --video", "one of the two");
    const auto is_in_range = [](double value) { return value >= 0 && value <= 1e5; };  // as /track/roi
    if (roi_.size() == 4 &&
        !(std::all_of(roi_.begin(), roi_.end(), is_in_range) && roi_[2] >= 1 && roi_[3] >= 1))
      throw InputError("--roi", roi_text(),
                       "X,Y,W,H in px, from 0 to 100000, with a width and a height of at least 1");
    std::string folder = context.output_folder();
    TrackJob job;
    if (context.options.file.empty()) {
      job = track_job(video_, asked({}));
    } else {
      const ChosenView chosen =
          chosen_view(fitting::load_case(context.options.file, context.options.settings), clip_, folder);
      folder = chosen.folder;
      job = track_job(chosen.of_view, folder, video_, context.progress, asked(chosen.of_view.track));
    }
    job.there_and_back = there_and_back_;
    if (frames_ > 0) job.footage.last = frames_ - 1;
    return track_footage(job, folder, context.options.threads, context.progress, context.out);
  }

 private:
  static std::string odd_window(const std::string& text) {
    int value = 0;
    const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), value);
    const bool is_number = error == std::errc() && end == text.data() + text.size();
    if (is_number && value >= 7 && value <= 201 && value % 2 == 1) return {};
    return "got " + text + ", expected an odd number of px from 7 to 201";
  }

  /// `track` with what the options say in its place.
  fitting::TrackCase asked(fitting::TrackCase track) const {
    if (roi_.size() == 4) track.roi = {roi_[0], roi_[1], roi_[2], roi_[3]};
    if (!model_.empty()) track.model = model_;
    if (max_tracks_ > 0) track.max_tracks = max_tracks_;
    if (min_distance_ > 0) track.min_distance = min_distance_;
    if (window_ > 0) track.window = window_;
    if (gives_up_) track.redetect = false;
    if (exposure_) track.exposure = exposure_;
    return track;
  }

  std::string roi_text() const {
    std::ostringstream text;
    for (const double value : roi_) text << (text.tellp() > 0 ? "," : "") << value;
    return text.str();
  }

  std::string video_, model_, clip_;
  std::vector<double> roi_;
  std::optional<double> exposure_;
  int max_tracks_ = 0, frames_ = 0, window_ = 0;
  double min_distance_ = 0;
  bool there_and_back_ = false, gives_up_ = false;
};

}  // namespace

std::unique_ptr<Verb> make_verb_track() {
  return std::make_unique<TrackVerb>();
}

}  // namespace rhytid::tools
