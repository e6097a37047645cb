// rhytid study plan: which swipe to film next.
#include <CLI/CLI.hpp>

#include "tools/study/plan.h"
#include "tools/study/study_command.h"
#include "tools/study/study_run.h"

namespace rhytid::tools {
namespace {

class PlanCommand final : public StudyCommand {
 public:
  StudyHelp help() const override {
    return {
        "plan",
        "what planned swipes would tell, and which to film next",
        "Takes the variants of an experiment for swipes of one face, runs each once and differentiates it. "
        "From a stated noise and a prior follows the posterior of every swipe before there is footage: "
        "deviations per parameter, D- and A-optimality, the best pairs and the order in which to film "
        "(greedily, beside what is --filmed). Coordinates are logs, logits of fractions, and of places half "
        "of "
        "what a fit may move them: a prior of 1 is a factor e, of the odds for fractions, 5 mm for knots of "
        "a "
        "path and 10 mm for sources. To first order at the scene's values; skin that the finger hides counts "
        "as seen. Swipes "
        "that were run are kept; noise, tracks and priors may change without running them again.",
        "experiment.json and its scene; parameters have the same values in all its variants",
        "plan.txt, swipes.csv, pairs.csv, order.csv, posterior.svg, index.html, a folder per swipe. Prints "
        "the text",
        "rhytid study plan data/scenes/demo_swipes/experiment.json -o run/plan"};
  }
  bool is_of_experiments() const override { return true; }

 protected:
  std::string file_help() const override { return "experiment.json whose variants are swipes"; }
  void add_options(CLI::App& app) override {
    app.add_option("--only", options_.only, "plan with this swipe only; repeatable")
        ->allow_extra_args(false)
        ->option_text("NAME");
    app.add_option("--filmed", options_.filmed, "this swipe has been filmed already; repeatable")
        ->allow_extra_args(false)
        ->option_text("NAME");
    app.add_option("--parameter", options_.addresses,
                   "an unknown, as /ligaments/stiffness; repeatable (default: all but places that "
                   "have the same value in all swipes)")
        ->allow_extra_args(false)
        ->option_text("ADDRESS");
    add_track_options(app, options_.tracks);
    app.add_option(
           "--prior", options_.prior,
           "standard deviation of every coordinate before (default 1: a factor e, for places a length)")
        ->check(size_check())
        ->option_text("SD");
    app.add_option("--prior-of", options_.priors, "that of one parameter; repeatable")
        ->allow_extra_args(false)
        ->option_text("ADDRESS=SD");
    app.add_flag("--anew", options_.anew, "run again what is finished");
  }

  ExitCode study(VerbContext& context) override {
    return run_plan(context, load_experiment(context.options.file, size()), options_);
  }

 private:
  PlanOptions options_;
};

}  // namespace

std::unique_ptr<StudyCommand> make_study_plan() {
  return std::make_unique<PlanCommand>();
}

}  // namespace rhytid::tools
