#include "sim/output/text.h"
#include "tools/report/program_facts.h"
#include "tools/report/sections.h"
#include "tools/report/wording.h"

namespace rhytid::tools {
namespace {

Facts count_facts(const ReportData& data) {
  const fitting::FitResult& fit = data.fit;
  Facts facts = {
      {"Optimiser", fit.optimiser + ", " + fit.status},
      {"Forward runs",
       std::to_string(fit.forward_runs) + ", median " + short_text(fit.forward_seconds, 3) + " s"},
      {"Jacobians", std::to_string(fit.jacobian_runs)},
      {"Whole fit", duration_text(fit.seconds)},
      {"Observations", std::to_string(fit.num_observations) + " of " + counted(fit.num_tracks, "track") +
                           " over " + counted(fit.frames, "frame")},
      {"Tracks left out", std::to_string(fit.tracks_left_out)}};
  return facts;
}

Facts file_facts(const ReportData& data) {
  Facts facts;
  const auto add = [&facts](const std::string& what, const std::string& path) {
    if (!path.empty()) facts.emplace_back(what, path);
  };
  add("Case", data.fit.case_file);
  add("Scene of the fit", data.fit.scene_file);
  add("Scene at the fitted values", data.scene_file);
  add("Footage", data.fit.footage_file);
  add("Tracks", data.fit.tracks_file);
  add("Camera", data.fit.camera_file);
  for (const fitting::FittedClip& clip : data.fit.clips)
    for (const fitting::FittedView& view : clip.views)
      add("Tracks of " + (clip.name.empty()       ? "camera " + view.camera
                          : clip.views.size() > 1 ? clip.name + ", camera " + view.camera
                                                  : clip.name),
          view.tracks_file);
  add("Results", data.folder);
  return facts;
}

}  // namespace

void add_run_facts(HtmlPage& page, const ReportData& data) {
  page.section("run", "How this was made");
  page.facts(count_facts(data));
  if (data.model) {
    page.heading("Schemes");
    page.facts(scheme_facts(*data.model));
  }
  if (!data.fit.notes.empty()) {
    page.heading("Notes of the fit");
    page.list(data.fit.notes);
  }
  page.heading("Program");
  page.facts(build_facts());
  page.heading("Files");
  page.facts(file_facts(data));
  page.heading("To do it again");
  std::string commands;
  if (!data.fit.case_file.empty()) {
    commands = "rhytid fit " + shell_word(data.fit.case_file) + " -o " + shell_word(data.folder);
    if (!data.fit.optimiser.empty())
      commands += " --optimiser " + data.fit.optimiser.substr(0, data.fit.optimiser.find(' '));
    std::string addresses;
    for (const auto& p : data.fit.parameters)
      if (p.address.find("/path/offset/") == std::string::npos)  // the fit adds these by itself
        addresses += (addresses.empty() ? "" : ",") + p.address;
    if (!addresses.empty()) commands += " --parameters " + shell_word(addresses);
    for (const std::string& setting : data.fit.settings) commands += " --set " + shell_word(setting);
    commands += "\n";
  }
  page.code(commands + "rhytid report " + shell_word(data.folder));
  if (!commands.empty())
    page.note("Evaluations that are still in the folder are not computed again (--anew computes all).");
  if (!data.left_out.empty()) {
    page.heading("Left out of this report");
    page.list(data.left_out);
  }
}

}  // namespace rhytid::tools
