// rhytid certify: is the gradient of this scene that of its simulation?
#include <CLI/CLI.hpp>
#include <algorithm>
#include <ostream>

#include "adjoint/certificate_report.h"
#include "sim/core/build_info.h"
#include "sim/output/atomic_file.h"
#include "sim/scene/load.h"
#include "tools/certificate_page.h"
#include "tools/polished_run.h"
#include "tools/scene_argument.h"
#include "tools/verb.h"

namespace rhytid::tools {
namespace {

class Certify : public Verb {
 public:
  VerbHelp help() const override {
    return {
        "certify",
        "check the gradient of a scene against its own simulation",
        "Runs the scene, differentiates it with respect to its parameters and gives evidence that the "
        "derivatives are right, on this very scene: tangent against adjoint (duality), Taylor slopes in a "
        "random direction and along the gradient by full simulations at nearby parameters, the identity "
        "that scaling all stiffnesses together moves nothing, error bars of a loosely converged run, how "
        "near to singular each step is, and that repetition gives the same bits. Run it before trusting a "
        "fit of a new scene. It takes the time of ten to thirty simulations; --thorough tests every "
        "parameter on "
        "its own as well.",
        "scene.json and what it names",
        "certificate.html (the page), certificate.txt, certificate.json; prints the text",
        "rhytid certify data/scenes/bent_patch/scene.json -o run/certificate --thorough"};
  }
  void add_options(CLI::App& app) override {
    app.add_option("--parameters", addresses_,
                   "addresses to differentiate by, as /ligaments/stiffness,... (default: all that have an "
                   "effect; left out where results have a kink in them)")
        ->delimiter(',')
        ->option_text("ADDRESS,...");
    app.add_flag("--thorough", thorough_, "a Taylor test of every parameter on its own");
    app.add_option("--seed", seed_, "seed of the functional and the directions (default 1)");
    app.add_option("--points", points_, "outer points that the functional looks at (default 200)")
        ->check(CLI::Range(1, 1000000));
  }

  ExitCode run(VerbContext& context) override {
    Progress& progress = context.progress;
    const SceneModel scene_model(
        load_scene_argument(context.options.file, context.options.settings, context.progress));
    for (const std::string& address : addresses_) (void)describe_parameter(scene_model.scene(), address);
    const std::string folder = context.output_folder();
    ExitCode code = ExitCode::ok;
    const std::optional<Trajectory> run = polished_run(scene_model, progress, code);
    if (!run) return code;

    const auto output = adjoint::default_output(scene_model.model(), points_);
    const auto weights = adjoint::random_weights(*output, run->frames(), seed_);
    adjoint::CertificateOptions certificate;
    certificate.addresses = addresses_;
    certificate.each_parameter = thorough_;
    certificate.seed = seed_;
    adjoint::CertificateReport report;
    try {
      report = adjoint::certify(scene_model, *run, *output, weights, certificate,
                                [&](const std::string& part, int done, int total) {
                                  if (done == 0) {
                                    progress.stage(part, total);
                                  } else {
                                    progress.step_done(total > 0 ? std::min(done, total) : done);
                                  }
                                  return !progress.interrupted();
                                });
    } catch (const adjoint::GradientError& error) {
      progress.error(std::string("the run has no gradient: ") + error.what());
      return ExitCode::not_converged;
    }
    progress.finish();
    const std::string text = adjoint::certificate_text(report);
    write_file(folder + "/certificate.txt", text);
    nlohmann::json json = adjoint::certificate_json(report);
    json["scene"] = scene_model.scene().file;
    json["functional_points"] = points_;
    json["seed"] = seed_;
    json["version"] = build_info().version;
    write_file(folder + "/certificate.json", json.dump(1) + "\n");
    write_file(folder + "/certificate.html",
               certificate_page(report, scene_model, {points_, seed_, command(context)}));
    context.out << text;
    if (report.interrupted) {
      progress.note("interrupted; the checks so far are kept, the same command starts over");
      return ExitCode::interrupted;
    }
    return report.passed() ? ExitCode::ok : ExitCode::not_converged;
  }

 private:
  std::vector<std::string> command(const VerbContext& context) const {
    std::vector<std::string> words = {context.program.name, "certify", context.options.file};
    for (const std::string& setting : context.options.settings) words.insert(words.end(), {"--set", setting});
    std::string addresses;
    for (const std::string& address : addresses_) addresses += (addresses.empty() ? "" : ",") + address;
    if (!addresses.empty()) words.insert(words.end(), {"--parameters", addresses});
    if (thorough_) words.emplace_back("--thorough");
    words.insert(words.end(), {"--seed", std::to_string(seed_), "--points", std::to_string(points_)});
    return words;
  }

  std::vector<std::string> addresses_;
  bool thorough_ = false;
  unsigned seed_ = 1;
  int points_ = 200;
};

}  // namespace

std::unique_ptr<Verb> make_verb_certify() {
  return std::make_unique<Certify>();
}

}  // namespace rhytid::tools
