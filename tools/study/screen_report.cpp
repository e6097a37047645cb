#include <algorithm>
#include <cmath>
#include <filesystem>
#include <fstream>
#include <numeric>
#include <set>

#include "sim/core/csv_reader.h"
#include "sim/output/atomic_file.h"
#include "sim/output/colour_map.h"
#include "sim/output/csv.h"
#include "sim/output/plot.h"
#include "sim/output/text.h"
#include "tools/report/html.h"
#include "tools/study/screen.h"
#include "tools/study/study_page.h"

namespace rhytid::tools {
namespace {

namespace fs = std::filesystem;

/// Parameters with a colour of their own in a scatter plot: the palette has as many.
constexpr std::size_t kColours = 7;

std::string heading(const ResultColumn& output) {
  std::string text = output.name;
  std::replace(text.begin(), text.end(), '_', ' ');
  return output.unit.empty() ? text : text + " [" + output.unit + "]";
}

/// What a parameter counts for an output: μ*, or the total index.
double weight(const ScreenResult& r, std::size_t output, std::size_t k) {
  return r.is_sobol ? r.sobol[output][k].total : r.morris[output][k].mean_absolute;
}

std::vector<std::size_t> ranked(const ScreenResult& r, std::size_t output) {
  std::vector<std::size_t> order(r.ranges.size());
  std::iota(order.begin(), order.end(), 0);
  const auto value = [&](std::size_t k) {
    const double w = weight(r, output, k);
    return std::isfinite(w) ? w : -1;
  };
  std::stable_sort(order.begin(), order.end(),
                   [&](std::size_t a, std::size_t b) { return value(a) > value(b); });
  return order;
}

std::string shown(double x, int digits = 3) {
  return std::isfinite(x) ? short_text(x, digits) : "-";
}

std::string state_text(const ScreenResult& r) {
  std::string text = std::to_string(r.finished) + " of " + std::to_string(r.runs) + " runs are finished";
  if (r.failed > 0) text += ", " + std::to_string(r.failed) + " of them did not converge and do not count";
  if (r.finished < r.runs) text += "; the figures are preliminary";
  return text + ".";
}

void write_runs(const std::string& folder, const ScreenResult& r) {
  std::vector<CsvColumn> columns = {{"point", ""}, {"status", ""}};
  for (const ParameterRange& range : r.ranges) columns.push_back({range.spec.address, ""});
  for (const ResultColumn& output : r.outputs) columns.push_back({output.name, output.unit});
  CsvTable table(columns);
  for (Eigen::Index i = 0; i < r.points.rows(); ++i) {
    std::vector<CsvCell> row = {static_cast<std::int64_t>(i + 1), r.status[static_cast<std::size_t>(i)]};
    for (std::size_t k = 0; k < r.ranges.size(); ++k)
      row.emplace_back(r.ranges[k].at(r.points(i, static_cast<Eigen::Index>(k))));
    for (const double value : r.values.row(i)) row.emplace_back(value);
    table.add_row(std::move(row));
  }
  table.write(folder + "/runs.csv");
}

void write_effects(const std::string& folder, const ScreenResult& r) {
  std::vector<CsvColumn> columns = {
      {"output", ""}, {"unit", ""}, {"address", ""}, {"lower", ""}, {"upper", ""}};
  const std::vector<const char*> figures =
      r.is_sobol ? std::vector<const char*>{"first", "first_error", "total", "total_error", "count"}
                 : std::vector<const char*>{"mu", "mu_star", "mu_star_error", "sigma", "count"};
  for (const char* figure : figures) columns.push_back({figure, ""});
  CsvTable table(columns);
  for (std::size_t o = 0; o < r.outputs.size(); ++o)
    for (std::size_t k = 0; k < r.ranges.size(); ++k) {
      const ParameterRange& range = r.ranges[k];
      std::vector<CsvCell> row = {r.outputs[o].name, r.outputs[o].unit, range.spec.address, range.lower,
                                  range.upper};
      std::int64_t count = 0;
      if (r.is_sobol) {
        const SobolIndex& s = r.sobol[o][k];
        for (const double x : {s.first, s.first_error, s.total, s.total_error}) row.emplace_back(x);
        count = s.count;
      } else {
        const MorrisEffect& e = r.morris[o][k];
        for (const double x : {e.mean, e.mean_absolute, e.error, e.deviation}) row.emplace_back(x);
        count = e.count;
      }
      row.emplace_back(count);
      table.add_row(std::move(row));
    }
  table.write(folder + (r.is_sobol ? "/indices.csv" : "/effects.csv"));
}

/// μ* against σ.
std::string scatter(const ScreenResult& r, std::size_t output) {
  LinePlot plot;
  plot.title = heading(r.outputs[output]);
  plot.x.label = "mu*: mean size of effects over the range";
  plot.y.label = "sigma: their deviation";
  plot.x.minimum = 0;
  plot.y.minimum = 0;
  plot.height = 420;
  const auto order = ranked(r, output);
  PlotSeries others;
  others.label = "others", others.style = PlotStyle::points, others.colour = Rgb{150, 150, 150};
  for (std::size_t i = 0; i < order.size(); ++i) {
    const MorrisEffect& e = r.morris[output][order[i]];
    if (i >= kColours) {
      others.x.push_back(e.mean_absolute), others.y.push_back(e.deviation);
      continue;
    }
    PlotSeries one;
    one.label = r.ranges[order[i]].spec.name, one.style = PlotStyle::points;
    one.x = {e.mean_absolute}, one.y = {e.deviation};
    plot.series.push_back(std::move(one));
  }
  if (!others.x.empty()) plot.series.push_back(std::move(others));
  // Limits from the data: everything may be zero.
  double largest_x = 0, largest_y = 0;
  for (const PlotSeries& s : plot.series)
    for (std::size_t i = 0; i < s.x.size(); ++i) {
      if (std::isfinite(s.x[i])) largest_x = std::max(largest_x, s.x[i]);
      if (std::isfinite(s.y[i])) largest_y = std::max(largest_y, s.y[i]);
    }
  plot.x.maximum = largest_x > 0 ? 1.05 * largest_x : 1;
  plot.y.maximum = largest_y > 0 ? 1.05 * largest_y : 1;
  return svg(plot);
}

/// μ* of all parameters with its standard error, or both indices.
std::string ranking(const ScreenResult& r, std::size_t output) {
  const auto order = ranked(r, output);
  if (r.is_sobol) {
    BarChart chart;
    chart.title = heading(r.outputs[output]);
    chart.y.label = "share of the variance";
    chart.series = {"first order", "total"};
    for (const std::size_t k : order) {
      const SobolIndex& s = r.sobol[output][k];
      chart.groups.push_back({r.ranges[k].spec.name, {s.first, s.total}, {s.first_error, s.total_error}});
    }
    chart.width = std::max(640, 60 + 44 * static_cast<int>(order.size()));
    chart.height = 420;
    return svg(chart);
  }
  IntervalPlot plot;
  plot.title = heading(r.outputs[output]) + ", mu* and its standard error";
  plot.axis.label = r.outputs[output].unit;
  plot.reference = 0;
  for (const std::size_t k : order) {
    const MorrisEffect& e = r.morris[output][k];
    if (!std::isfinite(e.mean_absolute)) continue;
    const double error = std::isfinite(e.error) ? e.error : 0;
    plot.rows.push_back({r.ranges[k].spec.name, e.mean_absolute, e.mean_absolute - error,
                         e.mean_absolute + error, std::nullopt, shown(e.mean_absolute)});
  }
  plot.width = 760;
  return svg(plot);
}

/// Parameters against outputs, each output's largest being one.
HtmlTable overview(const ScreenResult& r) {
  HtmlTable table;
  table.header = {"parameter", "range"};
  table.caption = r.is_sobol ? "Total indices" : "mu* of each output, as a part of its largest";
  for (const ResultColumn& output : r.outputs) table.header.push_back(heading(output));
  for (std::size_t k = 0; k < r.ranges.size(); ++k) {
    const ParameterRange& range = r.ranges[k];
    std::vector<TableCell> row = {range.spec.name,
                                  short_text(range.lower, 3) + " to " + short_text(range.upper, 3) +
                                      (range.spec.unit.empty() ? "" : " " + range.spec.unit)};
    for (std::size_t o = 0; o < r.outputs.size(); ++o) {
      const double largest = r.is_sobol ? 1 : weight(r, o, ranked(r, o).front());
      const double part = weight(r, o, k) / largest;
      if (std::isfinite(part))
        row.emplace_back(fixed_text(part, 2), map_colour(ColourMap::sequential, part));
      else
        row.emplace_back("-");
    }
    table.rows.push_back(std::move(row));
  }
  return table;
}

/// Removes the tables of an earlier screening and the plots of the outputs that they list.
void remove_earlier(const std::string& folder) {
  std::error_code ignored;
  for (const char* table : {"/effects.csv", "/indices.csv"}) {
    std::ifstream lines(folder + table);
    std::set<std::string> outputs;
    for_csv_lines(lines, table, [&](const CsvLine& line) { outputs.insert(line.cells.front()); });
    for (const std::string& output : outputs) {
      if (output.find('/') != std::string::npos) continue;  // no name of ours
      for (const char* ending : {".svg", "_ranking.svg"}) fs::remove(folder + "/" + output + ending, ignored);
    }
    fs::remove(folder + table, ignored);
  }
}

}  // namespace

std::string screen_text(const ScreenResult& r) {
  std::string text = (r.is_sobol ? "Sobol indices: first order and total share of the variance"
                                 : "Morris: mu* (mean size of elementary effects over the range) and sigma") +
                     std::string("\n") + state_text(r) + "\n";
  for (std::size_t o = 0; o < r.outputs.size(); ++o) {
    TextTable table(r.is_sobol ? std::vector<std::string>{heading(r.outputs[o]), "first", "+-", "total", "+-"}
                               : std::vector<std::string>{heading(r.outputs[o]), "mu*", "+-", "mu", "sigma"});
    for (const std::size_t k : ranked(r, o)) {
      if (r.is_sobol) {
        const SobolIndex& s = r.sobol[o][k];
        table.add({r.ranges[k].spec.name, shown(s.first), shown(s.first_error, 2), shown(s.total),
                   shown(s.total_error, 2)});
      } else {
        const MorrisEffect& e = r.morris[o][k];
        table.add({r.ranges[k].spec.name, shown(e.mean_absolute), shown(e.error, 2), shown(e.mean),
                   shown(e.deviation)});
      }
    }
    text += "\n" + table.text();
  }
  return text;
}

void write_screen(const std::string& folder, const std::string& title, const ScreenResult& r) {
  if (fs::exists(folder + "/screen.txt")) remove_earlier(folder);  // nothing in a folder that is not its own
  write_runs(folder, r);
  write_effects(folder, r);
  write_file(folder + "/screen.txt", screen_text(r));

  HtmlPage page("Screening" + (title.empty() ? std::string() : " of " + title), state_text(r));
  page.section("overview", "Overview");
  page.paragraph(
      r.is_sobol
          ? "Total indices: the share of an output's variance that would remain if all but this "
            "parameter were known; about zero: it may be fixed anywhere in its range."
          : "Elementary effects of parameters over their whole range (evenly in log or logit "
            "coordinates): mu* is the mean size of the change that crossing the range makes, sigma its "
            "spread. A sigma of the size of mu* means that the effect depends on where the others are.");
  page.table(overview(r));
  page.section("outputs", "Outputs");
  for (std::size_t o = 0; o < r.outputs.size(); ++o) {
    page.heading(heading(r.outputs[o]));
    const std::string drawn = ranking(r, o);
    write_file(folder + "/" + r.outputs[o].name + "_ranking.svg", drawn);
    page.svg_figure(drawn, "ranking of parameters for " + heading(r.outputs[o]), "Ranking");
    if (r.is_sobol) continue;
    const std::string points = scatter(r, o);
    write_file(folder + "/" + r.outputs[o].name + ".svg", points);
    page.svg_figure(points, "mu* against sigma for " + heading(r.outputs[o]), "mu* against sigma");
  }
  write_file(folder + "/index.html", page.finish());
}

}  // namespace rhytid::tools
