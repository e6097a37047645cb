#include "tools/study/sweep_report.h"

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <filesystem>

#include "sim/core/parse_number.h"
#include "sim/output/atomic_file.h"
#include "sim/output/csv.h"
#include "sim/output/image.h"
#include "sim/output/plot.h"
#include "tools/report/html.h"

namespace rhytid::tools {
namespace {

namespace fs = std::filesystem;

/// Of a large grid so many runs have lines in the plots and pictures on the page.
constexpr std::size_t kMostShown = 21;

/// The columns of all results, in the order of their first appearance; without values.
std::vector<ResultColumn> all_columns(const std::vector<VariantResult>& results) {
  std::vector<ResultColumn> columns;
  for (const VariantResult& r : results)
    for (const ResultColumn& c : r.columns)
      if (std::none_of(columns.begin(), columns.end(),
                       [&](const auto& known) { return known.name == c.name; }))
        columns.push_back({c.name, c.unit, std::nullopt});
  return columns;
}

std::optional<double> value_of(const VariantResult& r, const std::string& name) {
  for (const ResultColumn& c : r.columns)
    if (c.name == name) return c.value;
  return std::nullopt;
}

std::string rounded(std::optional<double> value) {
  if (!value || !std::isfinite(*value)) return "-";
  char text[32];
  const bool is_count = *value == std::floor(*value) && std::abs(*value) < 1e9;
  std::snprintf(text, sizeof text, is_count ? "%.0f" : "%.4g", *value);
  return text;
}

std::string heading(const ResultColumn& c) {
  std::string text = c.name;
  std::replace(text.begin(), text.end(), '_', ' ');
  return c.unit.empty() ? text : text + " [" + c.unit + "]";
}

/// The addresses that a grid or a table sets; none in other sweeps.
std::vector<std::string> swept_addresses(const Experiment& experiment) {
  std::vector<std::string> addresses;
  for (const SweptValue& value : experiment.variants.front().values) addresses.push_back(value.address);
  return addresses;
}

/// What the sweep set in a variant, as it was written.
std::vector<std::string> swept_values(const Experiment& experiment, const std::string& variant) {
  std::vector<std::string> values;
  for (const Variant& v : experiment.variants)
    if (v.name == variant)
      for (const SweptValue& value : v.values) values.push_back(value.text);
  return values;
}

/// A number without quotes, anything else as text.
CsvCell cell_of(const std::string& text) {
  double number = 0;
  if (parse(text, number)) return number;
  return text;
}

void write_csv(const std::string& path, const Experiment& experiment,
               const std::vector<ResultColumn>& columns, const std::vector<VariantResult>& results) {
  std::vector<CsvColumn> header = {{"variant", ""}, {"status", ""}};
  for (const std::string& address : swept_addresses(experiment)) header.push_back({address, ""});
  for (const ResultColumn& c : columns) header.push_back({c.name, c.unit});
  CsvTable table(header);
  for (const VariantResult& r : results) {
    std::vector<CsvCell> row = {r.name, r.status};
    for (const std::string& text : swept_values(experiment, r.name)) row.push_back(cell_of(text));
    for (const ResultColumn& c : columns) {
      const auto value = value_of(r, c.name);
      if (value)
        row.emplace_back(*value);
      else
        row.emplace_back(std::string());
    }
    table.add_row(std::move(row));
  }
  table.write(path);
}

/// The table of the page and of results.md, header first. A few variants are columns, of the many numbers;
/// the many runs of a grid are rows.
std::vector<std::vector<std::string>> cells(const Experiment& experiment,
                                            const std::vector<ResultColumn>& columns,
                                            const std::vector<VariantResult>& results) {
  const std::vector<std::string> addresses = swept_addresses(experiment);
  std::vector<std::vector<std::string>> rows = {{"variant", "status"}};
  rows[0].insert(rows[0].end(), addresses.begin(), addresses.end());
  for (const ResultColumn& c : columns) rows[0].push_back(heading(c));
  for (const VariantResult& r : results) {
    std::vector<std::string> row = {r.name, r.status};
    const std::vector<std::string> values = swept_values(experiment, r.name);
    row.insert(row.end(), values.begin(), values.end());
    for (const ResultColumn& c : columns) row.push_back(rounded(value_of(r, c.name)));
    rows.push_back(std::move(row));
  }
  if (!addresses.empty()) return rows;
  std::vector<std::vector<std::string>> turned(rows[0].size());
  for (std::size_t k = 0; k < turned.size(); ++k)
    for (const auto& row : rows) turned[k].push_back(row[k]);
  return turned;
}

std::string markdown(const Experiment& experiment, const std::vector<ResultColumn>& columns,
                     const std::vector<VariantResult>& results, const std::string& left_out) {
  std::string text = "# " + experiment.name + "\n\n" + experiment.description + "\n\n";
  if (!left_out.empty()) text += left_out + "\n\n";
  bool is_header = true;
  for (const auto& row : cells(experiment, columns, results)) {
    text += "|";
    for (std::size_t k = 0; k < row.size(); ++k)
      text += " " + (is_header && k == 0 ? std::string() : row[k]) + " |";
    text += "\n";
    if (is_header) {
      text += "| --- |";
      for (std::size_t k = 1; k < row.size(); ++k) text += " ---: |";
      text += "\n";
    }
    is_header = false;
  }
  return text;
}

HtmlTable html_table(const Experiment& experiment, const std::vector<ResultColumn>& columns,
                     const std::vector<VariantResult>& results) {
  HtmlTable table;
  table.caption = "What was measured, at the last frame";
  table.wide = true;
  for (const auto& row : cells(experiment, columns, results)) {
    if (table.header.empty()) {
      table.header = row;
      continue;
    }
    table.rows.emplace_back(row.begin(), row.end());
  }
  return table;
}

/// One column of a table of each variant over another; empty when no variant has both.
std::vector<PlotSeries> series(const std::string& folder, const std::vector<VariantResult>& results,
                               const std::string& file, const std::string& x, const std::string& y) {
  std::vector<PlotSeries> all;
  for (const VariantResult& r : results) {
    const std::string path = folder + "/" + r.name + "/" + file;
    if (!fs::exists(path)) continue;
    PlotSeries one;
    one.label = r.name;
    one.dashed = all.size() >= 7;  // where the palette begins again
    for (auto& [header, values] : read_number_table(path)) {
      if (header == x) one.x = values;
      if (header == y) one.y = values;
    }
    if (!one.x.empty() && one.x.size() == one.y.size()) all.push_back(std::move(one));
    if (all.size() == kMostShown) break;
  }
  return all;
}

void add_plot(HtmlPage& page, const std::string& folder, const std::string& name, const LinePlot& plot) {
  std::error_code ignored;  // of an earlier report, about something else
  if (plot.series.empty()) fs::remove(folder + "/" + name, ignored);
  if (plot.series.empty()) return;
  const std::string drawn = svg(plot);
  write_file(folder + "/" + name, drawn);
  page.svg_figure(drawn, plot.title, plot.title);
}

LinePlot line_plot(const std::string& title, const std::string& x, const std::string& y,
                   std::vector<PlotSeries> lines) {
  LinePlot plot;
  plot.title = title;
  plot.x.label = x, plot.y.label = y;
  plot.series = std::move(lines);
  plot.width = 900, plot.height = 380;
  return plot;
}

void add_pictures(HtmlPage& page, const std::string& folder, const VariantResult& r) {
  std::vector<std::pair<std::string, std::string>> pictures = {
      {"above.png", "from above, coloured by displacement along the normals"},
      {"ligaments.png", "ligament parameter b"}};
  // The last shaded picture.
  std::vector<std::string> shaded;
  std::error_code error;
  for (fs::directory_iterator it(folder + "/" + r.name + "/pictures", error), end; !error && it != end; ++it)
    if (it->path().filename().string().starts_with("shaded_"))
      shaded.push_back("pictures/" + it->path().filename().string());
  if (!shaded.empty()) pictures.push_back({*std::max_element(shaded.begin(), shaded.end()), "shaded"});
  page.heading(r.name);
  if (!r.reason.empty()) page.paragraph(r.reason);
  page.begin_row();
  for (const auto& [file, what] : pictures) {
    const std::string path = folder + "/" + r.name + "/" + file;
    if (!fs::exists(path)) continue;
    const std::string bytes = read_file(path);
    const Image image = read_png(path);
    page.image_figure(png_uri(bytes), image.width(), image.height(), r.name + ", " + what, what);
  }
  page.end_row();
}

}  // namespace

const std::vector<std::string>& sweep_files() {
  static const std::vector<std::string> files = {"results.csv",  "results.md",    "index.html",
                                                 "profiles.svg", "amplitude.svg", "crests.svg"};
  return files;
}

void write_sweep_report(const std::string& folder, const Experiment& experiment,
                        const std::vector<VariantResult>& results, const std::string& left_out) {
  const std::vector<ResultColumn> columns = all_columns(results);
  write_csv(folder + "/results.csv", experiment, columns, results);
  write_file(folder + "/results.md", markdown(experiment, columns, results, left_out));

  HtmlPage page(experiment.name, experiment.description);
  page.section("results", "Results");
  if (!left_out.empty()) page.paragraph(left_out);
  page.table(html_table(experiment, columns, results));
  page.section("profiles", "Profiles");
  add_plot(page, folder, "profiles.svg",
           line_plot("Heights along the line, band-passed, at the last frame", "place [mm]", "height [mm]",
                     series(folder, results, "profile.csv", "place_mm", "wrinkles_mm")));
  add_plot(page, folder, "amplitude.svg",
           line_plot("Amplitude along the line over time", "time [s]", "amplitude [mm]",
                     series(folder, results, "wrinkles.csv", "time_s", "line_amplitude_mm")));
  add_plot(page, folder, "crests.svg",
           line_plot("Crests along the line over time", "time [s]", "crests",
                     series(folder, results, "wrinkles.csv", "time_s", "line_crests")));
  page.section("pictures", "Pictures");
  for (std::size_t i = 0; i < std::min(results.size(), kMostShown); ++i)
    add_pictures(page, folder, results[i]);
  if (results.size() > kMostShown)
    page.note("Plots and pictures show the first " + std::to_string(kMostShown) + " of " +
              std::to_string(results.size()) + " runs; those of the others are in their folders.");
  write_file(folder + "/index.html", page.finish());
}

}  // namespace rhytid::tools
