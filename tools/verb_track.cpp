// rhytid track: footage to tracks of skin points, with their uncertainty.
#include <CLI/CLI.hpp>
#include <algorithm>
#include <sstream>

#include "fitting/case.h"
#include "sim/core/error.h"
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
    app.add_option("--max-tracks", max_tracks_, "at most this many tracks")
        ->option_text("N")
        ->check(CLI::Range(1, 100000));
    app.add_option("--frames", frames_, "only the first N frames")
        ->option_text("N")
        ->check(CLI::Range(1, 1000000));
    app.add_option("--model", model_,
                   "how the picture around a point may deform: affine (default), or translation for poor "
                   "footage, as of faces")
        ->option_text("MODEL")
        ->check(CLI::IsMember({"affine", "translation"}));
  }

  ExitCode run(VerbContext& context) override {
    if (context.options.file.empty() && video_.empty())
      throw InputError("track", "neither a case nor --video", "one of the two");
    const auto is_in_range = [](double value) { return value >= 0 && value <= 1e5; };  // as /track/roi
    if (roi_.size() == 4 &&
        !(std::all_of(roi_.begin(), roi_.end(), is_in_range) && roi_[2] >= 1 && roi_[3] >= 1))
      throw InputError("--roi", roi_text(),
                       "X,Y,W,H in px, from 0 to 100000, with a width and a height of at least 1");
    const std::string folder = context.output_folder();
    TrackJob job;
    if (context.options.file.empty()) {
      job.footage.path = video_;
      job.options.seeds.max_tracks = 300;
    } else {
      const fitting::Case c = fitting::load_case(context.options.file, context.options.settings);
      job = track_job(c, folder, video_, context.progress);
    }
    if (roi_.size() == 4)
      job.options.seeds.region = cv::Rect(static_cast<int>(roi_[0]), static_cast<int>(roi_[1]),
                                          static_cast<int>(roi_[2]), static_cast<int>(roi_[3]));
    if (!model_.empty())
      job.options.model =
          model_ == "translation" ? fitting::WarpModel::translation : fitting::WarpModel::affine;
    if (max_tracks_ > 0) job.options.seeds.max_tracks = max_tracks_;
    if (frames_ > 0) job.footage.last = frames_ - 1;
    return track_footage(job, folder, context.options.threads, context.progress, context.out);
  }

 private:
  std::string roi_text() const {
    std::ostringstream text;
    for (const double value : roi_) text << (text.tellp() > 0 ? "," : "") << value;
    return text.str();
  }

  std::string video_, model_;
  std::vector<double> roi_;
  int max_tracks_ = 0, frames_ = 0;
};

}  // namespace

std::unique_ptr<Verb> make_verb_track() {
  return std::make_unique<TrackVerb>();
}

}  // namespace rhytid::tools
