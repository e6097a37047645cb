#include "tools/study/sensitivity_report.h"

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <nlohmann/json.hpp>
#include <numeric>

#include "sim/output/atomic_file.h"
#include "sim/output/csv.h"
#include "sim/output/plot.h"
#include "sim/output/surface_files.h"
#include "sim/output/text.h"
#include "tools/ply_file.h"
#include "tools/report/html.h"
#include "tools/scene_argument.h"
#include "tools/study/study_page.h"
#include "tools/study/study_run.h"

namespace rhytid::tools {
namespace {

namespace fs = std::filesystem;

/// Parameters whose response is painted: so many of the strongest, and all ligament sources.
constexpr std::size_t kPictures = 12;

const char* transform_name(ParameterTransform t) {
  return t == ParameterTransform::log ? "log" : t == ParameterTransform::logit ? "logit" : "none";
}

std::vector<int> strongest_first(const Sensitivity& s) {
  std::vector<int> order(s.parameters.size());
  std::iota(order.begin(), order.end(), 0);
  std::stable_sort(order.begin(), order.end(),
                   [&](int a, int b) { return s.response.rms[a] > s.response.rms[b]; });
  return order;
}

/// "response_NAME" of every parameter, all different.
std::vector<std::string> response_names(const Sensitivity& s) {
  std::vector<std::string> names;
  for (const ParameterSpec& p : s.parameters) names.push_back("response_" + p.name);
  return file_names(names);
}

/// Of a parameter's row: name, value, unit of the coordinate, both responses, both deviations.
std::vector<std::string> parameter_cells(const Sensitivity& s, int k) {
  const ParameterSpec& p = s.parameters[k];
  const adjoint::Coordinate& c = s.coordinates[k];
  return {p.name,
          short_text(p.value) + (p.unit.empty() ? "" : " " + p.unit),
          coordinate_text(c, p.unit),
          short_text(s.response.rms[k], 3),
          short_text(s.response.largest[k], 3),
          deviation_text(s.deviations[k], c, p.unit),
          deviation_text(s.held_deviations[k], c, p.unit)};
}

/// Change of a figure in the last frame per unit of coordinate k: relative for sizes.
double change_of(const ShownFigure& figure, int k) {
  const Eigen::Index last = figure.values.size() - 1;
  return figure.derivatives(last, k) / (figure.relative ? figure.values[last] : 1);
}

/// Header, values and a row per parameter, strongest first, of what the last frame shows.
std::vector<std::vector<std::string>> shown_rows(const Sensitivity& s) {
  const auto text = [](double x, int digits) {
    return std::isfinite(x) ? short_text(x, digits) : std::string("none");
  };
  std::vector<std::vector<std::string>> rows = {{"parameter"}, {"(value)"}};
  for (const ShownFigure& figure : s.shown) {
    rows[0].push_back(figure.name);
    rows[1].push_back(text(figure.values[figure.values.size() - 1], 4) +
                      (figure.unit.empty() ? "" : " " + figure.unit));
  }
  for (const int k : strongest_first(s)) {
    rows.push_back({s.parameters[k].name});
    for (const ShownFigure& figure : s.shown) rows.back().push_back(text(change_of(figure, k), 3));
  }
  return rows;
}

std::string figure_name(const SensitivityOptions& options) {
  return options.map_all_frames ? "mean square displacement of the outer surface over all frames"
                                : "mean square displacement of the outer surface in the last frame";
}

void write_tables(const std::string& folder, const Sensitivity& s) {
  const std::size_t n = s.parameters.size();
  CsvTable parameters({{"address", ""},
                       {"name", ""},
                       {"unit", ""},
                       {"value", ""},
                       {"coordinate", ""},
                       {"coordinate_unit", ""},
                       {"rms", "mm"},
                       {"max", "mm"},
                       {"rms_last_frame", "mm"},
                       {"deviation", ""},
                       {"deviation_with_held", ""}});
  std::vector<CsvColumn> frame_columns = {{"frame", ""}}, direction_columns = {{"singular_value", ""}},
                         correlation_columns = {{"address", ""}};
  for (std::size_t k = 0; k < n; ++k) {
    const ParameterSpec& p = s.parameters[k];
    const auto i = static_cast<Eigen::Index>(k);
    parameters.add_row({p.address, p.name, p.unit, p.value, std::string(transform_name(p.transform)),
                        coordinate_text(s.coordinates[k], p.unit), s.response.rms[i], s.response.largest[i],
                        s.response.rms_of_frame(s.response.rms_of_frame.rows() - 1, i), s.deviations[i],
                        s.held_deviations[i]});
    frame_columns.push_back({p.address, "mm"});
    direction_columns.push_back({p.address, ""});
    correlation_columns.push_back({p.address, ""});
  }
  parameters.write(folder + "/parameters.csv");
  CsvTable frames(frame_columns), directions(direction_columns), correlation(correlation_columns);
  for (Eigen::Index f = 0; f < s.response.rms_of_frame.rows(); ++f) {
    std::vector<CsvCell> row = {static_cast<std::int64_t>(f + 1)};
    for (const double x : s.response.rms_of_frame.row(f)) row.emplace_back(x);
    frames.add_row(std::move(row));
  }
  for (std::size_t i = 0; i < n; ++i) {
    std::vector<CsvCell> row = {s.directions.singular_values[static_cast<Eigen::Index>(i)]};
    for (const double x : s.directions.right_vectors.col(static_cast<Eigen::Index>(i))) row.emplace_back(x);
    directions.add_row(std::move(row));
    std::vector<CsvCell> pairs = {s.parameters[i].address};
    for (const double x : s.correlation.row(static_cast<Eigen::Index>(i))) pairs.emplace_back(x);
    correlation.add_row(std::move(pairs));
  }
  frames.write(folder + "/frames.csv");
  std::vector<CsvColumn> shown_columns = {{"frame", ""}, {"figure", ""}, {"unit", ""}, {"value", ""}};
  for (const ParameterSpec& p : s.parameters) shown_columns.push_back({p.address, ""});
  CsvTable shown(shown_columns);
  for (const ShownFigure& figure : s.shown)
    for (Eigen::Index f = 0; f < figure.values.size(); ++f) {
      std::vector<CsvCell> row = {static_cast<std::int64_t>(f + 1), figure.name, figure.unit,
                                  figure.values[f]};
      for (const double x : figure.derivatives.row(f)) row.emplace_back(x);
      shown.add_row(std::move(row));
    }
  shown.write(folder + "/figures.csv");
  directions.write(folder + "/singular_values.csv");
  correlation.write(folder + "/correlation.csv");
}

void write_map(const std::string& folder, const SceneModel& scene_model, const Sensitivity& s,
               double end_time) {
  if (s.b.size() == 0) return;
  const SkinMesh& mesh = scene_model.model().mesh;
  MatrixX3 outer(mesh.num_columns, 3);
  for (int c = 0; c < mesh.num_columns; ++c) outer.row(c) = mesh.rest.row(mesh.node(c, mesh.num_levels - 1));
  CsvTable table({{"column", ""},
                  {"x", "mm"},
                  {"y", "mm"},
                  {"z", "mm"},
                  {"b", "per_mm"},
                  {"area", "mm2"},
                  {"dJ_db", "mm3"},
                  {"share", "per_cm2"}});
  for (Eigen::Index c = 0; c < outer.rows(); ++c)
    table.add_row({static_cast<std::int64_t>(c), outer(c, 0), outer(c, 1), outer(c, 2), s.b[c], s.area[c],
                   s.dJ_db[c], s.share[c]});
  table.write(folder + "/map.csv");
  const auto field = [](const VectorXd& v) { return std::vector<double>(v.begin(), v.end()); };
  std::vector<OutputField> fields = {{"ligament_b_per_mm", 1, field(s.b)},
                                     {"dJ_db_mm3", 1, field(s.dJ_db)},
                                     {"share_per_cm2", 1, field(s.share)}};
  const std::vector<std::string> files = response_names(s);
  for (std::size_t k = 0; k < s.parameters.size(); ++k)
    fields.push_back({files[k] + "_mm", 1, field(s.response.last.col(static_cast<Eigen::Index>(k)))});
  write_vtp(folder + "/map.vtp", outer, scene_model.column_triangles(), fields);
  const double range = std::max(s.share.cwiseAbs().maxCoeff(), 1e-300);
  std::vector<Rgb> colours;
  for (const double x : s.share) colours.push_back(map_colour(ColourMap::diverging, 0.5 + 0.5 * x / range));
  write_ply(folder + "/map.ply", outer, scene_model.column_triangles(), colours, "share", s.share);
  draw_on_skin(scene_model, s.share, "% of J per % of b on 1 cm2", shown_name(scene_model.scene()),
               folder + "/map.png", ColourMap::diverging, end_time);
}

std::string json_text(const Sensitivity& s, const SensitivityOptions& options) {
  using nlohmann::ordered_json;
  const auto number = [](double x) { return std::isfinite(x) ? ordered_json(x) : ordered_json(); };
  const auto list = [&](const auto& v) {
    ordered_json j = ordered_json::array();
    for (Eigen::Index i = 0; i < v.size(); ++i) j.push_back(number(v[i]));
    return j;
  };
  ordered_json parameters = ordered_json::array(), correlation = ordered_json::array(),
               directions = ordered_json::array();
  for (std::size_t k = 0; k < s.parameters.size(); ++k) {
    const auto i = static_cast<Eigen::Index>(k);
    const ParameterSpec& p = s.parameters[k];
    parameters.push_back({{"address", p.address},
                          {"unit", p.unit},
                          {"value", p.value},
                          {"coordinate", transform_name(p.transform)},
                          {"coordinate_unit", coordinate_text(s.coordinates[k], p.unit)},
                          {"rms_mm", s.response.rms[i]},
                          {"max_mm", s.response.largest[i]},
                          {"deviation", number(s.deviations[i])},
                          {"deviation_with_held", number(s.held_deviations[i])}});
    correlation.push_back(list(VectorXd(s.correlation.row(i))));
    directions.push_back({{"singular_value", s.directions.singular_values[i]},
                          {"vector", list(VectorXd(s.directions.right_vectors.col(i)))}});
  }
  ordered_json shown = ordered_json::array();
  for (const ShownFigure& figure : s.shown) {
    const Eigen::Index last = figure.values.size() - 1;
    shown.push_back({{"figure", figure.name},
                     {"unit", figure.unit},
                     {"value", number(figure.values[last])},
                     {"derivatives", list(VectorXd(figure.derivatives.row(last)))}});
  }
  const ordered_json all = {
      {"noise_mm", options.tracks.noise},
      {"tracks", options.tracks.count},
      {"view", options.tracks.view ? list(*options.tracks.view) : ordered_json()},
      {"parameters", parameters},
      {"without_effect", s.without_effect},
      {"rank", s.directions.rank},
      {"gauge", s.has_gauge},
      {"directions", directions},
      {"held", s.held >= 0 ? ordered_json(s.parameters[s.held].address) : ordered_json()},
      {"correlation", correlation},
      {"cannot_tell", s.sentences},
      {"last_frame", shown},
      {"figure", {{"what", figure_name(options)}, {"mm2", s.figure}}}};
  return all.dump(1) + "\n";
}

/// Pictures of the strongest parameters; what they show and their names.
std::vector<StudyPicture> draw_responses(const std::string& folder, const SceneModel& scene_model,
                                         const Sensitivity& s, double end_time) {
  std::vector<StudyPicture> pictures;
  const std::vector<std::string> files = response_names(s);
  std::size_t rank = 0;
  for (const int k : strongest_first(s)) {
    const ParameterSpec& p = s.parameters[k];
    if (++rank > kPictures && !p.address.starts_with("/ligaments/sources/")) continue;
    const std::string file = files[static_cast<std::size_t>(k)] + ".png";
    draw_on_skin(scene_model, s.response.last.col(k), "mm per unit", p.name, folder + "/" + file,
                 ColourMap::sequential, end_time);
    pictures.push_back({file, p.name});
  }
  return pictures;
}

HtmlTable parameter_table(const Sensitivity& s) {
  HtmlTable table;
  table.header = {"parameter", "value", "unit of coordinate", "rms [mm]", "max [mm]", "all free", "one held"};
  table.caption = "Motion of the surface per unit of each coordinate, and predicted standard deviations";
  for (const int k : strongest_first(s)) {
    const std::vector<std::string> cells = parameter_cells(s, k);
    table.rows.emplace_back(cells.begin(), cells.end());
  }
  return table;
}

HtmlTable shown_table(const Sensitivity& s) {
  const std::vector<std::vector<std::string>> rows = shown_rows(s);
  HtmlTable table;
  table.header = {rows[0].begin(), rows[0].end()};
  table.caption = "What the last frame shows: change per unit of each coordinate";
  for (std::size_t i = 1; i < rows.size(); ++i) table.rows.emplace_back(rows[i].begin(), rows[i].end());
  return table;
}

HtmlTable direction_table(const Sensitivity& s) {
  std::vector<std::string> names;
  for (const ParameterSpec& p : s.parameters) names.push_back(p.name);
  HtmlTable table;
  table.header = {"direction", "singular value", "deviation [units]"};
  table.caption = "Singular directions of the whitened Jacobian, best known first";
  for (Eigen::Index i = 0; i < s.directions.singular_values.size(); ++i) {
    const bool is_null = i >= s.directions.rank;
    std::string words = adjoint::direction_in_words(s.directions.right_vectors.col(i), names);
    if (const auto colon = words.find(':'); colon != std::string::npos) words.resize(colon);
    if (const auto only = words.find(" is not determined"); only != std::string::npos) words.resize(only);
    if (i == s.directions.rank && s.has_gauge) words = "all stiffnesses together";
    table.rows.push_back({words, is_null ? "0" : short_text(s.directions.singular_values[i], 3),
                          is_null ? "open" : short_text(1 / s.directions.singular_values[i], 3)});
  }
  return table;
}

std::string rms_plot(const Sensitivity& s) {
  BarChart chart;
  chart.title = "Motion of the surface per unit of each coordinate";
  chart.y.label = "mm";
  chart.y.logarithmic = true;
  chart.series = {"rms", "largest"};
  for (const int k : strongest_first(s))
    chart.groups.push_back({s.parameters[k].name, {s.response.rms[k], s.response.largest[k]}, {}});
  chart.width = std::max(640, 60 + 44 * static_cast<int>(s.parameters.size()));
  chart.height = 460;
  return svg(chart);
}

}  // namespace

std::string sensitivity_text(const Sensitivity& s, const SensitivityOptions& options) {
  const std::string held = s.held >= 0 ? s.parameters[s.held].name + " held" : "none held";
  TextTable table({"parameter", "value", "unit", "rms mm", "max mm", "all free", held});
  for (const int k : strongest_first(s)) table.add(parameter_cells(s, k));
  std::string text =
      "Motion of the surface per unit of coordinate (a factor e of parameters or of the odds of fractions, "
      "a\n"
      "length for places), and predicted deviations from " +
      options.tracks.text() + "\n\n" + table.text() + "\n";
  const std::vector<std::vector<std::string>> rows = shown_rows(s);
  TextTable shown(rows[0]);
  for (std::size_t i = 1; i < rows.size(); ++i) shown.add(rows[i]);
  text +=
      "What the last frame shows besides, and its change per unit of coordinate: relative (0.5: a per cent\n"
      "more of the parameter is half a per cent more of the figure), direction in degrees, coherence as it "
      "is\n\n" +
      shown.text() + "\n";
  if (!s.without_effect.empty()) {
    text += "Without effect on positions:";
    for (const std::string& address : s.without_effect) text += " " + address;
    text += "\n";
  }
  text += "Without noise positions tell " + std::to_string(s.directions.rank) + " of " +
          std::to_string(s.parameters.size()) + " directions.\n";
  for (const std::string& sentence : s.sentences) text += "- " + sentence + "\n";
  return text;
}

void write_sensitivity(const std::string& folder, const SceneModel& scene_model, double end_time,
                       const Sensitivity& s, const SensitivityOptions& options) {
  std::error_code ignored;
  // Of an earlier study only; nothing in a folder that is not its own.
  const bool is_own = fs::exists(folder + "/sensitivity.json");
  for (const auto& entry : fs::directory_iterator(folder, ignored)) {
    const std::string name = entry.path().filename().string();
    if (!is_own) break;
    if ((name.starts_with("response_") && name.ends_with(".png")) || name.starts_with("map."))
      fs::remove(entry.path(), ignored);
  }
  write_tables(folder, s);
  write_map(folder, scene_model, s, end_time);
  const std::vector<StudyPicture> pictures = draw_responses(folder, scene_model, s, end_time);
  write_file(folder + "/sensitivity.json", json_text(s, options));
  write_file(folder + "/sensitivity.txt", sensitivity_text(s, options));
  const std::string plot = rms_plot(s);
  write_file(folder + "/rms.svg", plot);

  std::vector<std::string> names;
  for (const ParameterSpec& p : s.parameters) names.push_back(p.name);
  HtmlPage page("Sensitivity of " + shown_name(scene_model.scene()) +
                    (options.shown_variant.empty() ? "" : ": " + options.shown_variant),
                scene_model.scene().description);
  page.section("parameters", "Parameters");
  page.paragraph(
      "How far a unit of each coordinate moves the outer surface (log parameters: a unit is a "
      "factor e, so 10 % more is a tenth of it; of the odds for fractions; a length for places), to first "
      "order, as rms and largest value over "
      "surface and frames. Predicted standard deviations for " +
      options.tracks.text() + ": with all parameters free, and with " +
      (s.held >= 0 ? s.parameters[s.held].name + " known." : "none known."));
  page.table(parameter_table(s));
  page.svg_figure(plot, "rms and largest motion per parameter",
                  "Motion of the surface per unit, strongest first");
  for (const std::string& address : s.without_effect) page.note(address + " has no effect on positions.");
  page.section("shown", "Forces, energy and wrinkles");
  page.paragraph(
      "Figures of the last frame, and how each changes per unit of a coordinate, to first order: relative "
      "for "
      "sizes (0.5: a per cent more of the parameter is half a per cent more of the figure), degrees for the "
      "direction of the waves, coherence as it is. All frames are in figures.csv, with the derivatives in "
      "their own units per "
      "unit of coordinate. Wrinkles are measured "
      "where "
      "an experiment says so.");
  page.table(shown_table(s));
  page.section("directions", "What positions tell");
  page.paragraph("Of " + std::to_string(s.parameters.size()) + " directions, positions without noise tell " +
                 std::to_string(s.directions.rank) + ".");
  if (!s.sentences.empty()) page.list(s.sentences);
  page.table(direction_table(s));
  page.section("correlations", "Correlations");
  page.table(correlation_table(
      names, s.correlation,
      s.held >= 0 ? "Correlations with " + s.parameters[s.held].name + " known" : "Correlations, all free"));
  page.section("map", "Where ligaments matter");
  if (s.b.size() > 0) {
    page.paragraph(
        "J is the " + figure_name(options) + ", " + short_text(s.figure) +
        " mm². Painted is b/J dJ/db per area: by how many per cent J grows when b grows by one per "
        "cent on a square centimetre. Blue: stiffer ligaments there hold the skin back. Dots are the "
        "sources.");
    add_pictures(page, folder, {{"map.png", "adjoint map of J"}});
  } else {
    page.paragraph("The scene has no ligaments.");
  }
  page.section("responses", "What each parameter moves");
  page.paragraph(
      "Displacement of the outer surface in the last frame per unit of the coordinate, strongest "
      "parameters first, each with its own scale.");
  add_pictures(page, folder, pictures);
  write_file(folder + "/index.html", page.finish());
}

}  // namespace rhytid::tools
