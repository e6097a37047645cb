// rhytid simulate: a forward run with its files.
#include <CLI/CLI.hpp>

#include "tools/forward_run.h"
#include "tools/verb.h"

namespace rhytid::tools {
namespace {

class Simulate : public Verb {
 public:
  VerbHelp help() const override {
    return {
        "simulate",
        "run a scene forward; frames, table of scalars, pictures",
        "Runs the scene from rest, one implicit step per frame (or substep). Every frame is on disk before "
        "the next one starts, so that a run that is stopped or does not converge leaves whole files. A "
        "step that fails is halved up to /time/max_bisections times; then the run ends with exit code 3. "
        "After Ctrl-C the same command with --resume continues from the last whole frame and ends at the "
        "same bits. A new run into the folder of an earlier one removes that one's files, and nothing else.",
        "scene.json, and the mesh it names",
        "run.json (versions, scene after defaults, schemes, timings, why it ended); steps.csv (energies, "
        "iterations, residual, min J, contact forces per step); frames.pvd (volume, Lagrange wedges) and "
        "surface.pvd (outer surface) for ParaView; pictures/*.png; state.bin (for --resume). /output in "
        "the scene selects them.",
        "rhytid simulate data/scenes/elastic_patch/scene.json -o run/elastic_patch"};
  }
  void add_options(CLI::App& app) override {
    app.add_flag("--resume", resume_, "continue the run in -o DIR from its last whole frame");
    app.add_option("--subdivide", options_.subdivision,
                   "flat triangles per face edge in surface files and pictures")
        ->option_text("N")
        ->check(CLI::Range(1, 64));
    app.add_option("--picture-width", options_.picture_width, "width of pictures, px (4:3)")
        ->option_text("PX")
        ->check(CLI::Range(64, 8192));
  }

  ExitCode run(VerbContext& context) override {
    options_.picture_height = std::max(64, options_.picture_width * 3 / 4);
    return run_forward(context, options_, resume_);
  }

 private:
  bool resume_ = false;
  FrameOptions options_;
};

}  // namespace

std::unique_ptr<Verb> make_verb_simulate() {
  return std::make_unique<Simulate>();
}

}  // namespace rhytid::tools
