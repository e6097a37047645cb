#include "tools/report/write_report.h"

#include <algorithm>
#include <filesystem>
#include <optional>

#include "sim/output/atomic_file.h"
#include "sim/time/simulate.h"
#include "tools/report/sections.h"
#include "tools/report/wording.h"
#include "tools/run_observer.h"

namespace rhytid::tools {
namespace {

struct LateFrame {
  int frame = 0;
  VectorXd displacement;
};

/// Runs to the frame of the overlay (the scene's last without residuals). Nothing when interrupted or when
/// rest is all that was reached; a run that ends early shows the frame it reached.
std::optional<LateFrame> simulate_late_frame(ReportData& data, Progress& progress, bool& interrupted) {
  const SceneModel& scene = *data.model;
  RunOptions options = scene.run_options();
  options.keep_states = false;
  if (const int late = data.late_frame(); late > 0) options.frames = std::min(options.frames, late);
  if (options.frames == 0) return std::nullopt;
  progress.stage("simulate at the fitted values", options.frames);
  LateFrame reached;
  RunObserver observer = progress_observer(progress);
  observer.step = [&](const StepEvent& event) {
    if (!event.frame_done) return;
    reached.frame = event.record.frame;
    reached.displacement = event.state.u;
    progress.step_done(reached.frame);
  };
  const Trajectory run = simulate(scene.model(), scene.native(), options, observer);
  if (progress.interrupted()) {
    interrupted = true;
    data.left_out.emplace_back("No picture of the simulated skin: the run for it was interrupted.");
    return std::nullopt;
  }
  if (!run.complete) {
    data.left_out.push_back("The run at the fitted values ended at frame " + std::to_string(reached.frame) +
                            " of " + std::to_string(options.frames) + ": " + run.failure);
  }
  if (reached.frame == 0) return std::nullopt;
  return reached;
}

std::string title_of(const ReportData& data) {
  return data.fit.case_name.empty() ? "Fit" : "Fit of " + data.fit.case_name;
}

}  // namespace

ReportOutcome write_report(const std::string& folder, Progress& progress, const ReportOptions& options) {
  ReportData data = gather_report_data(folder);
  ReportOutcome outcome;
  outcome.path = (std::filesystem::path(folder) / "report.html").string();
  std::optional<LateFrame> late;
  if (options.run && data.model) {
    late = simulate_late_frame(data, progress, outcome.interrupted);
  } else if (data.model) {
    data.left_out.emplace_back("No picture of the simulated skin: the run for it was not asked for.");
  }
  progress.stage("report", 1);
  HtmlPage page(title_of(data), "Rhytid: what a simulation of skin, fitted to footage, says about it");
  add_answer(page, data);
  add_ligaments(page, data);
  add_footage(page, data);
  add_measured(page, data);
  if (late) add_surface(page, data, late->displacement, late->frame);
  add_convergence(page, data);
  add_identifiability(page, data);
  add_discretisation(page, data);
  add_certificate(page, data);
  add_run_facts(page, data);
  write_file(outcome.path, page.finish());
  progress.step_done(1);
  outcome.left_out = data.left_out;
  return outcome;
}

}  // namespace rhytid::tools
