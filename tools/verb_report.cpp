// rhytid report: the record of a fit as one HTML page.
#include <CLI/CLI.hpp>
#include <ostream>

#include "tools/report/write_report.h"
#include "tools/verb.h"

namespace rhytid::tools {
namespace {

class Report : public Verb {
 public:
  VerbHelp help() const override {
    return {
        "report",
        "the results of a fit as one HTML page",
        "Makes report.html from the results of a fit: the answer with its intervals, the ligament map and "
        "its "
        "deviation, predicted against tracked features, the simulated skin beside the footage, convergence, "
        "what the footage determines, and how it was made. The page loads nothing from outside. A fit writes "
        "it "
        "by itself at its end; use this verb to make it again.",
        "fit.json and residuals.csv in the folder, and the scene, camera and footage that they name",
        "report.html in the same folder",
        "rhytid report run/demo"};
  }
  bool takes_file() const override { return false; }
  void add_options(CLI::App& app) override {
    app.add_option("folder", folder_, "folder with the results of a fit")->required();
    app.add_flag("--no-run", no_run_, "do not simulate again for the picture of the skin");
  }

  ExitCode run(VerbContext& context) override {
    const ReportOutcome outcome = write_report(folder_, context.progress, {.run = !no_run_});
    for (const std::string& sentence : outcome.left_out) context.progress.warning(sentence);
    context.out << outcome.path << '\n';
    return outcome.interrupted ? ExitCode::interrupted : ExitCode::ok;
  }

 private:
  std::string folder_;
  bool no_run_ = false;
};

}  // namespace

std::unique_ptr<Verb> make_verb_report() {
  return std::make_unique<Report>();
}

}  // namespace rhytid::tools
