// rhytid study sensitivity: what the parameters of a scene do to its surface, from one run.
#include <CLI/CLI.hpp>

#include "tools/study/sensitivity.h"
#include "tools/study/study_command.h"
#include "tools/study/study_run.h"

namespace rhytid::tools {
namespace {

class SensitivityCommand final : public StudyCommand {
 public:
  StudyHelp help() const override {
    return {
        "sensitivity",
        "what each parameter does to the surface, and what positions cannot tell",
        "Runs the scene once, converged for derivatives, and differentiates it by its parameters in log or "
        "logit coordinates (places in units of half of what a fit may move them): how far a unit of each "
        "moves the outer surface; singular values of the Jacobian "
        "and the directions that positions cannot tell, by name; predicted standard deviations and "
        "correlations under a stated noise; what each changes of forces, stored energy and, with an "
        "experiment, "
        "of the wrinkles it measures; and, by the adjoint, where on the face the ligament parameter "
        "b matters. All to first order, at the scene's own values.",
        "a scene, a case for its scene, or experiment.json for one of its variants",
        "sensitivity.txt and .json; parameters.csv, frames.csv, figures.csv, singular_values.csv, "
        "correlation.csv, "
        "map.csv; rms.svg; map.png, .vtp and .ply; response_NAME.png; index.html with all of it. Prints the "
        "text",
        "rhytid study sensitivity data/scenes/sheet_drag/scene.json -o run/sensitivity"};
  }

 protected:
  std::string file_help() const override { return "a scene, a case, or experiment.json"; }
  void add_options(CLI::App& app) override {
    app.add_option(
           "--parameter", options_.addresses,
           "differentiate by this address, as /ligaments/stiffness; repeatable (default: all but places)")
        ->allow_extra_args(false)
        ->option_text("ADDRESS");
    app.add_option("--variant", options_.variant, "of an experiment (default: the first)")
        ->option_text("NAME");
    add_track_options(app, options_.tracks);
    app.add_option("--hold", options_.hold,
                   "parameter taken as known (default: the modulus of the softest layer, when scaling all "
                   "stiffnesses together moves nothing)")
        ->option_text("ADDRESS");
    app.add_flag("--all-frames", options_.map_all_frames,
                 "the map's figure is the mean over all frames, not that of the last");
  }

  std::string variant() const override { return options_.variant; }

  ExitCode study(VerbContext& context) override {
    options_.size = size();
    return run_sensitivity(context, options_);
  }

 private:
  SensitivityOptions options_;
};

}  // namespace

std::unique_ptr<StudyCommand> make_study_sensitivity() {
  return std::make_unique<SensitivityCommand>();
}

}  // namespace rhytid::tools
