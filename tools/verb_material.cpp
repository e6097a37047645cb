// rhytid material: one layer's law at one material point, driven through a history of deformation.
#include <CLI/CLI.hpp>
#include <Eigen/LU>
#include <algorithm>
#include <charconv>
#include <cmath>
#include <cstdio>
#include <filesystem>
#include <map>
#include <nlohmann/json.hpp>
#include <optional>
#include <ostream>
#include <sstream>

#include "sim/core/error.h"
#include "sim/core/units.h"
#include "sim/output/atomic_file.h"
#include "sim/output/csv.h"
#include "sim/output/plot.h"
#include "sim/output/text.h"
#include "sim/scene/load.h"
#include "sim/scene/names.h"
#include "sim/terms/material_point.h"
#include "tools/material/history.h"
#include "tools/scene_argument.h"
#include "tools/verb.h"

namespace rhytid::tools {
namespace {

constexpr const char* kParameterUnits[SkinParameters::count] = {"", "MPa", "MPa", "MPa", "MPa/s"};

/// A plain number is in internal units, as in scene files.
double given_quantity(const std::string& text, Dimension dimension, const std::string& flag) {
  double value = 0;
  const char* end = text.data() + text.size();
  const auto [after, status] = std::from_chars(text.data(), end, value);
  const bool is_plain = status == std::errc() && after == end && std::isfinite(value);
  return is_plain ? value : parse_quantity(text, dimension, flag);
}

std::string by_default(double value, Dimension dimension) {
  return " (default " + format_quantity(value, dimension) + ")";
}

class Material : public Verb {
 public:
  VerbHelp help() const override {
    return {
        "material",
        "drive one layer's material through a deformation history, without a mesh",
        "Runs the law of one skin layer at one material point: stress, stored energy and viscous history "
        "through a "
        "uniaxial, equibiaxial, planar or shear test, or a history from a file; on request with the "
        "derivatives "
        "of the stress "
        "by the five parameters. Directions that are not prescribed are traction-free.",
        "a scene for the layer (optional) and a history as CSV or JSON (optional): time_s and F11 to F33, or "
        "time_s and "
        "stretch1 (stretch2, stretch3)",
        "material.csv and material.json (times, F, P and Kirchhoff stress in MPa, energy, C^v, derivatives) "
        "and "
        "material.svg; the peak "
        "and the last stress on stdout",
        "rhytid material --uniaxial 1.3 --rate '2 Hz' --hold '0.5 s' --derivatives -o run/uniaxial"};
  }
  bool takes_file() const override { return false; }

  void add_options(CLI::App& app) override {
    const SkinParameters p;
    app.add_option("--scene", scene_, "take the layer and the damper from this scene")->option_text("FILE");
    app.add_option("--layer", layer_, "name of the layer in the scene (default: the first)")
        ->option_text("NAME");
    app.add_option("--set", settings_, "change one value of the scene; repeatable")
        ->option_text("/POINTER=VALUE")
        ->allow_extra_args(false);
    for (const auto& [flag, help_text] :
         {std::pair{"youngs-modulus", "instantaneous E" + by_default(p.youngs_modulus, dimension::pressure)},
          {"poissons-ratio", "ν" + by_default(p.poissons_ratio, dimension::none)},
          {"stiffening", "C of the exponential" + by_default(p.stiffening, dimension::none)},
          {"relaxing-fraction", "share of μ that relaxes" + by_default(p.relaxing_fraction, dimension::none)},
          {"relaxation-time", "τ" + by_default(p.relaxation_time, dimension::time)}})
      app.add_option(std::string("--") + flag, given_[flag], help_text)->option_text("VALUE");
    app.add_option("--damper", damper_, "exponential, literal, strang, backward_euler or none")
        ->option_text("NAME");
    auto* group = app.add_option_group("what is done to the point", "exactly one of");
    group->add_option("--uniaxial", uniaxial_, "stretch to this along 1, sides free")->option_text("STRETCH");
    group->add_option("--equibiaxial", equibiaxial_, "stretch to this along 1 and 2, 3 free")
        ->option_text("STRETCH");
    group->add_option("--planar", planar_, "stretch to this along 1, 2 held, 3 free (pure shear)")
        ->option_text("STRETCH");
    group->add_option("--shear", shear_, "simple shear F12 to this amount")->option_text("AMOUNT");
    group->add_option("--history", history_, "CSV or JSON with the history")->option_text("FILE");
    group->require_option(1);
    app.add_option("--rate", rate_, "rate of stretch or shear, e.g. '2 Hz' (default: an instantaneous jump)")
        ->option_text("RATE");
    app.add_option("--hold", hold_, "how long to hold afterwards (default: 0 s)")->option_text("TIME");
    app.add_option("--step", step_, "longest time step (default: 1/24 s)")->option_text("TIME");
    app.add_flag("--derivatives", derivatives_,
                 "add derivatives of the loading stress by the five parameters");
    app.add_option("-o,--output", output_, "folder for results (default run/material)")->option_text("DIR");
  }

  ExitCode run(VerbContext& context) override {
    SkinParameters parameters;
    DamperScheme scheme = DamperScheme::exponential;
    read_layer(parameters, scheme, context.progress);
    const MaterialProgram program = make_program();
    const MaterialPointRun run = run_material_point(parameters, scheme, program);
    std::error_code error;
    std::filesystem::create_directories(output_, error);
    if (error || !std::filesystem::is_directory(output_))
      throw InputError("--output", "'" + output_ + "'", "a folder that can be written");
    write_table(run);
    write_plot(run);
    report(run, context.out);
    if (run.complete) return ExitCode::ok;
    context.progress.warning(run.failure);
    return ExitCode::not_converged;
  }

 private:
  void read_layer(SkinParameters& p, DamperScheme& scheme, Progress& progress) const {
    if (!scene_.empty()) {
      for (const std::string& text : settings_) check_setting(text);
      const Scene scene = load_scene_argument(scene_, settings_, progress);
      scheme = scene.time.damper;
      const auto& layers = scene.skin.layers;
      auto it = layers.begin();
      if (!layer_.empty())
        it =
            std::find_if(layers.begin(), layers.end(), [&](const LayerScene& l) { return l.name == layer_; });
      if (it == layers.end()) {
        std::string names;
        for (const LayerScene& l : layers) names += (names.empty() ? "" : ", ") + l.name;
        throw InputError("--layer", "'" + layer_ + "'", "one of " + names);
      }
      p = {it->youngs_modulus, it->poissons_ratio, it->stiffening, it->relaxing_fraction,
           it->relaxation_time};
    } else if (!layer_.empty() || !settings_.empty()) {
      throw InputError(layer_.empty() ? "--set" : "--layer", "no --scene", "a scene to take the layer from");
    }
    struct Field {
      const char* flag;
      Dimension dimension;
      double* value;
      double low, high;  // allowed range, ends excluded where the law does not exist there
      const char* expected;
    };
    const Field fields[] = {
        {"youngs-modulus", dimension::pressure, &p.youngs_modulus, 1e-300, 1e300, "a pressure > 0"},
        {"poissons-ratio", dimension::none, &p.poissons_ratio, -0.999999, 0.499999,
         "a number above -1 and below 0.5"},
        {"stiffening", dimension::none, &p.stiffening, 0, 1e6, "a number ≥ 0"},
        {"relaxing-fraction", dimension::none, &p.relaxing_fraction, 0, 1, "a number from 0 to 1"},
        {"relaxation-time", dimension::time, &p.relaxation_time, 1e-300, 1e300, "a time > 0"}};
    for (const Field& f : fields) {
      const std::string& text = given_.at(f.flag);
      if (text.empty()) continue;
      const double value = given_quantity(text, f.dimension, std::string("--") + f.flag);
      if (!(value >= f.low && value <= f.high))
        throw InputError(std::string("--") + f.flag, text, f.expected);
      *f.value = value;
    }
    if (!damper_.empty()) {
      const auto& words = EnumNames<DamperScheme>::words;
      const auto it = std::find(words.begin(), words.end(), damper_);
      if (it == words.end())
        throw InputError("--damper", "'" + damper_ + "'",
                         "exponential, literal, strang, backward_euler or none");
      scheme = static_cast<DamperScheme>(it - words.begin());
    }
  }

  static double duration(const std::string& text, const char* flag, double fallback) {
    if (text.empty()) return fallback;
    const double value = given_quantity(text, dimension::time, flag);
    if (!(value >= 0)) throw InputError(flag, text, "a time ≥ 0");
    return value;
  }

  MaterialProgram make_program() const {
    if (!history_.empty()) {
      for (const auto& [flag, text] : {std::pair{"--rate", rate_}, {"--hold", hold_}, {"--step", step_}})
        if (!text.empty())
          throw InputError(flag, text, "no such flag with --history: the file has the times");
      return parse_material_history(read_file(history_), history_);
    }
    Mat3 target = Mat3::Identity();
    std::array<bool, 3> free{false, false, false};
    double amount = 0;
    if (uniaxial_) {
      amount = *uniaxial_ - 1;
      free = {false, true, true};
      target = Vec3(*uniaxial_, 1, 1).asDiagonal();
    } else if (equibiaxial_) {
      amount = *equibiaxial_ - 1;
      free = {false, false, true};
      target = Vec3(*equibiaxial_, *equibiaxial_, 1).asDiagonal();
    } else if (planar_) {
      amount = *planar_ - 1;
      free = {false, false, true};
      target = Vec3(*planar_, 1, 1).asDiagonal();
    } else {
      amount = target(0, 1) = shear_.value();
    }
    if (!(target(0, 0) > 0) || !(target.allFinite()))
      throw InputError(uniaxial_ ? "--uniaxial"
                       : planar_ ? "--planar"
                                 : "--equibiaxial",
                       short_text(target(0, 0)), "a stretch > 0");
    double ramp = 0;
    if (!rate_.empty()) {
      const double rate = given_quantity(rate_, dimension::frequency, "--rate");
      if (!(rate > 0)) throw InputError("--rate", rate_, "a rate > 0");
      ramp = std::fabs(amount) / rate;
    }
    const double hold = duration(hold_, "--hold", 0), step = duration(step_, "--step", 1. / 24);
    if (!(step > 0) || (ramp + hold) / step > 1e6)
      throw InputError(step_.empty() ? "--hold" : "--step",
                       step_.empty() ? "'" + hold_ + "'" : "'" + step_ + "'",
                       step_.empty() ? "a time of at most a million steps of 1/24 s, or a longer --step"
                                     : "a time that gives at most a million steps");
    MaterialProgram program = ramp_and_hold(target, ramp, hold, step);
    program.traction_free = free;
    // Constant volume as the first guess of what is free.
    for (Mat3& f : program.deformation)
      for (int k = 0; k < 3; ++k)
        if (free[static_cast<std::size_t>(k)])
          f(k, k) = std::pow(f(0, 0) * (free[1] ? 1 : f(1, 1)), free[1] ? -0.5 : -1.0);
    return program;
  }

  /// The stress component that the program drives.
  int loading_row() const { return 0; }
  int loading_column() const { return shear_ ? 1 : 0; }
  std::string loading_name() const { return "P1" + std::to_string(loading_column() + 1); }

  void write_table(const MaterialPointRun& run) const {
    std::vector<CsvColumn> columns{{"time", "s"}};
    const auto add_matrix = [&](const std::string& symbol, const std::string& unit, bool symmetric) {
      for (int i = 1; i <= 3; ++i)
        for (int j = symmetric ? i : 1; j <= 3; ++j)
          columns.push_back({symbol + std::to_string(i) + std::to_string(j), unit});
    };
    add_matrix("F", "", false);
    add_matrix("P", "MPa", false);
    add_matrix("kirchhoff", "MPa", true);
    columns.push_back({"energy", "MPa"});
    add_matrix("Cv", "", true);
    if (derivatives_)
      for (int k = 0; k < SkinParameters::count; ++k)
        columns.push_back({"d" + loading_name() + "_d_" + SkinParameters::names[k], kParameterUnits[k]});
    CsvTable table(std::move(columns));
    std::vector<std::vector<double>> rows;
    for (const MaterialPointState& s : run.states) {
      std::vector<double> row{s.time};
      const auto add = [&](const Mat3& m, bool symmetric) {
        for (int i = 0; i < 3; ++i)
          for (int j = symmetric ? i : 0; j < 3; ++j) row.push_back(m(i, j));
      };
      add(s.deformation, false);
      add(s.piola, false);
      add(s.kirchhoff, true);
      row.push_back(s.energy);
      add(s.viscous, true);
      if (derivatives_)
        for (int k = 0; k < SkinParameters::count; ++k)
          row.push_back(s.piola_by_parameter(3 * loading_row() + loading_column(), k));
      table.add_numbers(row);
      rows.push_back(std::move(row));
    }
    table.write(output_ + "/material.csv");
    write_json(table.text().substr(0, table.text().find('\n')), rows);
  }

  /// The same columns as lists, under the names of the CSV header.
  void write_json(const std::string& header, const std::vector<std::vector<double>>& rows) const {
    nlohmann::ordered_json lists;
    std::istringstream names(header);
    std::string name;
    for (std::size_t k = 0; std::getline(names, name, ','); ++k) {
      nlohmann::ordered_json& list = lists[name] = nlohmann::ordered_json::array();
      for (const std::vector<double>& row : rows) list.push_back(row[k]);
    }
    write_file(output_ + "/material.json", lists.dump(1) + "\n");
  }

  void write_plot(const MaterialPointRun& run) const {
    LinePlot plot;
    plot.title = "Material point";
    plot.x.label = "time [s]";
    plot.y.label = "first Piola-Kirchhoff stress [kPa]";
    PlotSeries series;
    series.label = loading_name();
    for (const MaterialPointState& s : run.states) {
      series.x.push_back(s.time);
      series.y.push_back(1e3 * s.piola(loading_row(), loading_column()));
    }
    const bool over_time = !run.states.empty() && run.states.back().time > run.states.front().time;
    if (!over_time) {  // a jump: stress against deformation says more than against a time that stands still
      plot.x.label = shear_ ? "shear F12 [1]" : "stretch F11 [1]";
      for (std::size_t i = 0; i < run.states.size(); ++i)
        series.x[i] = run.states[i].deformation(loading_row(), loading_column());
    }
    series.style = PlotStyle::line_and_points;
    plot.series.push_back(std::move(series));
    write_file(output_ + "/material.svg", svg(plot));
  }

  void report(const MaterialPointRun& run, std::ostream& out) const {
    if (run.states.empty()) return;
    const auto stress = [&](const MaterialPointState& s) { return s.piola(loading_row(), loading_column()); };
    const auto peak = std::max_element(
        run.states.begin(), run.states.end(),
        [&](const auto& a, const auto& b) { return std::fabs(stress(a)) < std::fabs(stress(b)); });
    for (const auto& [label, s] : {std::pair{"peak", *peak}, {"last", run.states.back()}}) {
      char text[200];
      std::snprintf(
          text, sizeof text,
          "%s: t = %.6g s, F1%d = %.6g, J = %.6g, %s = %.6g kPa, stored energy %.6g kPa (mJ/cm^3)\n", label,
          s.time, loading_column() + 1, s.deformation(loading_row(), loading_column()),
          s.deformation.determinant(), loading_name().c_str(), 1e3 * stress(s), 1e3 * s.energy);
      out << text;
    }
    out << "written: " << output_ << "/material.csv, " << output_ << "/material.json, " << output_
        << "/material.svg\n";
  }

  std::string scene_, layer_, damper_, history_, rate_, hold_, step_, output_ = "run/material";
  std::vector<std::string> settings_;
  std::map<std::string, std::string> given_;
  std::optional<double> uniaxial_, equibiaxial_, planar_, shear_;
  bool derivatives_ = false;
};

}  // namespace

std::unique_ptr<Verb> make_verb_material() {
  return std::make_unique<Material>();
}

}  // namespace rhytid::tools
