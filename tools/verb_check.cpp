// rhytid check: everything that can be said about a scene before it runs.
#include <CLI/CLI.hpp>
#include <algorithm>
#include <cmath>
#include <iomanip>
#include <nlohmann/json.hpp>
#include <ostream>

#include "sim/core/units.h"
#include "sim/scene/feature_work.h"
#include "sim/scene/load.h"
#include "sim/scene/names.h"
#include "sim/scene/parameter.h"
#include "tools/frame_writer.h"
#include "tools/model_size.h"
#include "tools/scene_argument.h"
#include "tools/scene_review.h"
#include "tools/verb.h"

namespace rhytid::tools {
namespace {

using nlohmann::ordered_json;

/// 12345678 -> "12.3 M".
std::string count_text(double n) {
  char text[32];
  if (n < 1e5) {
    std::snprintf(text, sizeof text, "%.0f", n);
  } else if (n < 1e6) {
    std::snprintf(text, sizeof text, "%.0f k", n / 1e3);
  } else {
    std::snprintf(text, sizeof text, "%.3g M", n / 1e6);
  }
  return text;
}

std::string number_text(double value, const char* pattern = "%.3g") {
  char text[32];
  std::snprintf(text, sizeof text, pattern, value);
  return text;
}

std::string seconds_text(double s) {
  return s < 10 ? number_text(s, "%.2g s") : duration_text(s);
}

/// All findings of a check.
struct Findings {
  const SceneModel& scene_model;
  ModelSize size;
  StepCost cost;
  MemoryEstimate memory;
  std::optional<WrinkleScale> wrinkles;
  SurfaceEdgeLengths edges;
  double picture_seconds = 0;  ///< per frame that is written
  std::vector<std::string> warnings;

  Findings(const SceneModel& built, double program_memory)
      : scene_model(built),
        size(model_size(built)),
        cost(measure_step_cost(built)),
        memory(memory_estimate(built, size, cost.factor_entries)),
        wrinkles(wrinkle_scale(built)),
        edges(surface_edge_lengths(built.model().mesh.surface)),
        picture_seconds(built.scene().output.pictures ? measure_pictures(built, {}) : 0),
        warnings(scene_warnings(built.scene())) {
    memory.program = program_memory;
    const std::vector<std::string> more = review_scene(built, cost);
    warnings.insert(warnings.end(), more.begin(), more.end());
  }
  int pictured_frames() const {
    const Scene& scene = scene_model.scene();
    return scene.output.pictures ? 1 + (scene.time.frames + scene.output.every - 1) / scene.output.every : 0;
  }
  int steps() const {
    const TimeScene& time = scene_model.scene().time;
    return time.frames * time.substeps + (scene_model.run_options().settle ? 1 : 0);
  }
  /// Over the lag, of which there is one where nothing lags.
  int passes() const {
    const auto& terms = scene_model.model().terms;
    const auto lags = [](const Term& term) { return term.kernels().history_is_lag; };
    return std::any_of(terms.begin(), terms.end(), lags) ? scene_model.scene().time.lag_passes : 1;
  }
  double run_seconds() const { return cost.analysis_seconds + steps() * cost.step_seconds(passes()); }
};

ordered_json to_json(const Findings& f) {
  const Scene& scene = f.scene_model.scene();
  ordered_json j = {{"scene", scene.name}, {"file", scene.file}};
  const TriangleSurface& surface = f.scene_model.model().mesh.surface;
  if (!surface.format.empty()) {
    j["surface"] = {{"file", surface.origin}, {"format", surface.format}, {"notes", surface.notes}};
  }
  j["surface"]["edges_mm"] = {f.edges.shortest, f.edges.median, f.edges.longest};
  j["surface"]["box_mm"] = {f.edges.box[0], f.edges.box[1], f.edges.box[2]};
  j["sizes"] = {{"faces", f.size.faces},
                {"columns", f.size.columns},
                {"levels", f.size.levels},
                {"nodes", f.size.nodes},
                {"elements", f.size.elements},
                {"unknowns", f.size.unknowns},
                {"history", f.size.history},
                {"matrix_entries", f.size.matrix_entries},
                {"factor_entries", f.cost.factor_entries}};
  j["terms"] = ordered_json::array();
  for (std::size_t k = 0; k < f.size.terms.size(); ++k) {
    const TermSize& t = f.size.terms[k];
    const TermCounters& counters = f.scene_model.model().terms[k].counters();
    j["terms"].push_back({{"name", t.name},
                          {"points", t.points},
                          {"points_per_element", t.points_per_element},
                          {"history", t.history},
                          {"counters",
                           {{"energy", long{counters.energy}},
                            {"gradient", long{counters.gradient}},
                            {"hessian", long{counters.hessian}},
                            {"update", long{counters.update}}}}});
  }
  j["features"] = ordered_json::array();
  for (const FeatureNote& n : f.scene_model.features())
    j["features"].push_back({{"feature", n.feature}, {"present", n.present}, {"detail", n.detail}});
  j["work"] = ordered_json::array();
  for (const FeatureWork& w : feature_work(f.scene_model))
    j["work"].push_back({{"feature", w.feature},
                         {"prepared", w.prepared},
                         {"energies", w.energies},
                         {"gradients", w.gradients},
                         {"hessians", w.hessians},
                         {"updates", w.updates},
                         {"heat_maps", w.heat_maps},
                         {"points", w.points},
                         {"history", w.history},
                         {"shapes", w.shapes},
                         {"neighbours", w.neighbours},
                         {"bytes", w.bytes}});
  j["rest"] = {{"residual_N", f.cost.rest_residual},
               {"positive_definite", f.cost.positive_definite},
               {"smallest_pivot", f.cost.smallest_pivot},
               {"largest_pivot", f.cost.largest_pivot}};
  if (f.wrinkles)
    j["wrinkles"] = {{"film", f.wrinkles->film},
                     {"soft", f.wrinkles->soft},
                     {"wavelength_mm", f.wrinkles->wavelength},
                     {"critical_strain", f.wrinkles->critical_strain},
                     {"node_spacing_mm", f.wrinkles->node_spacing},
                     {"nodes_per_wavelength", f.wrinkles->nodes_per_wavelength()}};
  j["estimate"] = {{"steps", f.steps()},
                   {"iterations_per_pass", expected_iterations},
                   {"factors_per_step", expected_factors},
                   {"residual_s", f.cost.residual_seconds},
                   {"hessian_s", f.cost.hessian_seconds},
                   {"factorisation_s", f.cost.factor_seconds},
                   {"solve_s", f.cost.solve_seconds},
                   {"direction_s", f.cost.direction_seconds},
                   {"step_s", f.cost.step_seconds()},
                   {"analysis_s", f.cost.analysis_seconds},
                   {"run_s", f.run_seconds()},
                   {"pictures_s", f.pictured_frames() * f.picture_seconds},
                   {"memory_MB",
                    {{"model", f.memory.model},
                     {"matrix", f.memory.matrix},
                     {"factor", f.memory.factor},
                     {"states", f.memory.states},
                     {"elements", f.memory.elements},
                     {"program", f.memory.program},
                     {"total", f.memory.total()}}},
                   {"resident_MB", resident_memory_mb()}};
  j["warnings"] = f.warnings;
  return j;
}

class Lines {
 public:
  explicit Lines(std::ostream& out) : out_(out) {}
  void heading(const std::string& text) { out_ << '\n' << text << '\n'; }
  void row(const std::string& name, const std::string& value) {
    out_ << "  " << std::left << std::setw(22) << name << value << '\n';
  }

 private:
  std::ostream& out_;
};

std::string term_text(const TermSize& t) {
  std::string text = count_text(static_cast<double>(t.points)) + " points (";
  for (std::size_t k = 0; k < t.points_per_element.size(); ++k)
    text += (k ? " + " : "") + std::to_string(t.points_per_element[k]);
  text += t.points_per_element.size() > 1 ? " per face)" : " per element)";
  return t.history ? text + ", " + count_text(static_cast<double>(t.history)) + " numbers of history" : text;
}

/// "1 shape", "2 shapes".
std::string counted(double n, const char* thing) {
  return count_text(n) + " " + thing + (n == 1 ? "" : "s");
}

/// All numbers of a feature, zeros in words only when every one of them is zero.
std::string work_text(const FeatureWork& w) {
  if (w.is_nothing()) return "nothing: 0 evaluations, 0 points, 0 numbers of history, 0 bytes";
  std::string text = std::to_string(w.evaluations()) + " evaluations of " +
                     count_text(static_cast<double>(w.points)) + " points, " +
                     count_text(static_cast<double>(w.history)) + " numbers of history, " +
                     number_text(static_cast<double>(w.bytes) / 1e6) + " MB";
  if (w.heat_maps > 0) text += "; " + counted(static_cast<double>(w.heat_maps), "heat map");
  if (w.shapes > 0) text += "; " + counted(static_cast<double>(w.shapes), "rigid shape");
  if (w.neighbours > 0) text += " with " + counted(static_cast<double>(w.neighbours), "listed neighbour");
  return text;
}

void print(const Findings& f, std::ostream& out) {
  const Scene& scene = f.scene_model.scene();
  Lines lines(out);
  out << shown_name(scene) << " (" << scene.file << ") is valid\n";
  if (!scene.description.empty()) out << scene.description << '\n';

  lines.heading("Surface");
  const TriangleSurface& surface = f.scene_model.model().mesh.surface;
  if (!surface.format.empty()) {
    lines.row("file", surface.origin + ", " + surface.format);
    for (std::size_t k = 0; k < surface.notes.size(); ++k) lines.row(k ? "" : "read", surface.notes[k]);
    const double scale = scene.skin.surface.mm_per_unit;
    lines.row("unit", scale > 0 ? number_text(scale, "%.6g mm") : "not given: mm");
  }
  lines.row("box", number_text(f.edges.box[0], "%.4g x ") + number_text(f.edges.box[1], "%.4g x ") +
                       number_text(f.edges.box[2], "%.4g mm"));
  lines.row("edges", number_text(f.edges.shortest) + " to " + number_text(f.edges.longest) + " mm, median " +
                         number_text(f.edges.median) + " mm");

  lines.heading("Sizes");
  lines.row("faces", std::to_string(f.size.faces) + ", " + std::to_string(f.size.elements) + " elements");
  lines.row("nodes", std::to_string(f.size.nodes) + " (" + std::to_string(f.size.columns) + " columns x " +
                         std::to_string(f.size.levels) + " levels)");
  lines.row("unknowns", std::to_string(f.size.unknowns));
  lines.row("nnz(A), nnz(L)", count_text(static_cast<double>(f.size.matrix_entries)) + " (lower triangle), " +
                                  count_text(static_cast<double>(f.cost.factor_entries)));
  for (const TermSize& t : f.size.terms) lines.row(t.name, term_text(t));

  lines.heading("Physics");
  for (const FeatureNote& n : f.scene_model.features())
    lines.row(n.feature, (n.present ? "yes: " : "left out: ") + n.detail);
  const bool settles = f.scene_model.run_options().settle;
  lines.row(
      "residual at rest",
      f.cost.rest_residual == 0 ? "0 N, exactly an equilibrium"
      : !std::isfinite(f.cost.rest_residual)
          ? "none: an element is inverted or a point behind the bone where the run starts; it cannot start so"
          : number_text(f.cost.rest_residual) +
                (settles ? " N, from which the skin settles before frame 0" : " N"));
  if (f.wrinkles)
    lines.row("wrinkles", f.wrinkles->film + " on " + f.wrinkles->soft + ": wavelength " +
                              format_quantity(f.wrinkles->wavelength, dimension::length, 3) +
                              " from a compression of " + number_text(100 * f.wrinkles->critical_strain) +
                              " % (half-space), " + number_text(f.wrinkles->nodes_per_wavelength()) +
                              " nodes per wavelength");

  lines.heading("Work and memory by feature, in this check");
  for (const FeatureWork& w : feature_work(f.scene_model)) lines.row(w.feature, work_text(w));

  lines.heading("Estimate");
  lines.row("memory",
            number_text(f.memory.total(), "%.0f MB") + ": model " + number_text(f.memory.model, "%.0f") +
                ", matrix " + number_text(f.memory.matrix, "%.0f") + ", factor " +
                number_text(f.memory.factor, "%.0f") + ", states " + number_text(f.memory.states, "%.0f") +
                ", elements " + number_text(f.memory.elements, "%.0f") + ", program " +
                number_text(f.memory.program, "%.0f") + "; this check holds " +
                number_text(resident_memory_mb(), "%.0f MB"));
  lines.row("one Newton step", seconds_text(f.cost.newton_seconds() + 4. / 3 * f.cost.residual_seconds) +
                                   ": residual " + seconds_text(f.cost.residual_seconds) + ", Hessian " +
                                   seconds_text(f.cost.hessian_seconds) + ", factorisation " +
                                   seconds_text(f.cost.factor_seconds) + "; with a factor kept " +
                                   seconds_text(f.cost.iteration_seconds()));
  lines.row("run", "about " + seconds_text(f.run_seconds()) + ": " + std::to_string(f.steps()) + " steps x " +
                       (f.passes() > 1 ? std::to_string(f.passes()) + " passes x " : "") +
                       std::to_string(expected_iterations) + " iterations, " +
                       std::to_string(expected_factors) + " factors a step, on cores of its own");
  if (f.pictured_frames() > 0)
    lines.row("pictures", "about " + seconds_text(f.pictured_frames() * f.picture_seconds) +
                              " more: 2 of each of " + std::to_string(f.pictured_frames()) +
                              " frames; none with --set /output/pictures=false");

  lines.heading(f.warnings.empty() ? "No warnings" : "Warnings");
  for (const std::string& w : f.warnings) out << "  - " << w << '\n';
}

ordered_json parameters_json(const Scene& scene) {
  ordered_json list = ordered_json::array();
  for (const ParameterSpec& p : all_parameters(scene))
    list.push_back({{"address", p.address},
                    {"value", p.value},
                    {"unit", p.unit},
                    {"lower", p.lower},
                    {"upper", p.upper},
                    {"transform", to_string(p.transform)}});
  return list;
}

void print_parameters(const Scene& scene, std::ostream& out) {
  const std::vector<ParameterSpec> all = all_parameters(scene);
  std::size_t width = 10;
  for (const ParameterSpec& p : all) width = std::max(width, p.address.size());
  const auto row = [&](const std::string& address, const auto&... cells) {
    out << std::left << std::setw(static_cast<int>(width)) << address;
    ((out << "  " << std::setw(10) << cells), ...);
  };
  row("address", "value", "unit", "lower", "upper");
  out << "  transform\n";
  for (const ParameterSpec& p : all) {
    row(p.address, number_text(p.value, "%.6g"), p.unit.empty() ? "-" : p.unit, number_text(p.lower, "%.6g"),
        number_text(p.upper, "%.6g"));
    out << "  " << to_string(p.transform) << '\n';
  }
}

class Check : public Verb {
 public:
  VerbHelp help() const override {
    return {
        "check",
        "validate a scene; sizes, memory and time, what is left out, warnings",
        "Validates the scene, builds its mesh and energy terms, and measures one Newton iteration at rest. "
        "Prints sizes, the features in use and those left out with the reason, the predicted wrinkle "
        "wavelength against the mesh, estimates of memory and time, and warnings about settings that are "
        "allowed but doubtful. Nothing is simulated and nothing is written.",
        "scene.json, and the mesh it names",
        "a report on stdout; one JSON object with --json; with --parameters a table of the addresses that a "
        "fit "
        "may use",
        "rhytid check data/scenes/sheet_drag/scene.json"};
  }
  void add_options(CLI::App& app) override {
    app.add_flag("--json", as_json_, "the findings as one JSON object");
    app.add_flag("--parameters", parameters_,
                 "only list what a fit may use: addresses with value, unit, default bounds and transform");
  }

  ExitCode run(VerbContext& context) override {
    Scene scene = load_scene_argument(context.options.file, context.options.settings, context.progress);
    if (parameters_) {
      if (as_json_) {
        context.out << parameters_json(scene).dump(2) << '\n';
      } else {
        print_parameters(scene, context.out);
      }
      return ExitCode::ok;
    }
    const double program_memory = resident_memory_mb();  // before anything is built
    const SceneModel scene_model(std::move(scene));
    const Findings findings(scene_model, program_memory);
    if (as_json_) {
      context.out << to_json(findings).dump(2) << '\n';
    } else {
      print(findings, context.out);
    }
    return context.progress.interrupted() ? ExitCode::interrupted : ExitCode::ok;
  }

 private:
  bool as_json_ = false, parameters_ = false;
};

}  // namespace

std::unique_ptr<Verb> make_verb_check() {
  return std::make_unique<Check>();
}

}  // namespace rhytid::tools
