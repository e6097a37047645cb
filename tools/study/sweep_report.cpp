#include "tools/study/sweep_report.h"

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <filesystem>

#include "sim/output/atomic_file.h"
#include "sim/output/csv.h"
#include "sim/output/image.h"
#include "sim/output/plot.h"
#include "tools/report/html.h"

namespace rhytid::tools {
namespace {

namespace fs = std::filesystem;

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

void write_csv(const std::string& path, const std::vector<ResultColumn>& columns,
               const std::vector<VariantResult>& results) {
  std::vector<CsvColumn> header = {{"variant", ""}, {"status", ""}};
  for (const ResultColumn& c : columns) header.push_back({c.name, c.unit});
  CsvTable table(header);
  for (const VariantResult& r : results) {
    std::vector<CsvCell> row = {r.name, r.status};
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

/// Variants are columns: there are few of them and many numbers.
std::string markdown(const Experiment& experiment, const std::vector<ResultColumn>& columns,
                     const std::vector<VariantResult>& results, const std::string& left_out) {
  std::string text = "# " + experiment.name + "\n\n" + experiment.description + "\n\n";
  if (!left_out.empty()) text += left_out + "\n\n";
  text += "|  |";
  for (const VariantResult& r : results) text += " " + r.name + " |";
  text += "\n| --- |";
  for (std::size_t i = 0; i < results.size(); ++i) text += " ---: |";
  text += "\n| status |";
  for (const VariantResult& r : results) text += " " + r.status + " |";
  for (const ResultColumn& c : columns) {
    text += "\n| " + heading(c) + " |";
    for (const VariantResult& r : results) text += " " + rounded(value_of(r, c.name)) + " |";
  }
  return text + "\n";
}

HtmlTable html_table(const std::vector<ResultColumn>& columns, const std::vector<VariantResult>& results) {
  HtmlTable table;
  table.header = {"variant"};
  table.caption = "What was measured, at the last frame";
  table.wide = true;
  for (const VariantResult& r : results) table.header.push_back(r.name);
  std::vector<TableCell> status = {"status"};
  for (const VariantResult& r : results) status.emplace_back(r.status);
  table.rows.push_back(std::move(status));
  for (const ResultColumn& c : columns) {
    std::vector<TableCell> row = {heading(c)};
    for (const VariantResult& r : results) row.emplace_back(rounded(value_of(r, c.name)));
    table.rows.push_back(std::move(row));
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
  write_csv(folder + "/results.csv", columns, results);
  write_file(folder + "/results.md", markdown(experiment, columns, results, left_out));

  HtmlPage page(experiment.name, experiment.description);
  page.section("results", "Results");
  if (!left_out.empty()) page.paragraph(left_out);
  page.table(html_table(columns, results));
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
  for (const VariantResult& r : results) add_pictures(page, folder, r);
  write_file(folder + "/index.html", page.finish());
}

}  // namespace rhytid::tools
