#include <algorithm>
#include <cmath>

#include "sim/output/plot.h"
#include "sim/output/text.h"
#include "tools/report/sections.h"
#include "tools/report/wording.h"

namespace rhytid::tools {
namespace {

using fitting::FitIteration;
using fitting::FitResult;
using fitting::FittedParameter;
using fitting::FittedStart;

/// An optimiser records a trial whose run failed with a cost near the largest number there is.
constexpr double failed_cost = 1e100;

LinePlot plot_over_iterations(const std::string& y_label) {
  LinePlot plot;
  plot.width = 460;
  plot.height = 310;
  plot.x.label = "iteration";
  plot.y.label = y_label;
  return plot;
}

PlotSeries series_of(const std::vector<FitIteration>& history, const std::string& label, auto value) {
  PlotSeries series;
  series.label = label;
  series.style = PlotStyle::line_and_points;
  for (const FitIteration& i : history) {
    series.x.push_back(i.iteration);
    series.y.push_back(value(i));
  }
  return series;
}

/// Where a value lies between its bounds, 0 to 1; on a logarithmic scale when the optimiser saw it so.
double between_bounds(const FittedParameter& p, double value) {
  if (p.transform == "log" && p.lower > 0) return std::log(value / p.lower) / std::log(p.upper / p.lower);
  return (value - p.lower) / (p.upper - p.lower);
}

/// Optima that the searches ended at, the best first.
void add_optima(HtmlPage& page, const FitResult& fit) {
  HtmlTable table;
  table.caption =
      "Optima. Searches that ended within a tenth of a standard deviation of each other are one; the "
      "screened cost is that of the best of them on the early frames, comparable among starts alone.";
  table.header = {"optimum", "from starts", "status", "screened cost", "cost", "forward runs"};
  table.text_columns = 3;
  table.wide = true;
  for (const FittedParameter& p : fit.parameters)
    table.header.push_back(p.name + (p.unit.empty() ? "" : " [" + p.unit + "]"));
  int num_optima = 0;
  for (const FittedStart& start : fit.starts) num_optima = std::max(num_optima, start.optimum);
  for (int m = 1; m <= num_optima; ++m) {
    const FittedStart* best = nullptr;
    std::string from;
    int runs = 0;
    for (size_t i = 0; i < fit.starts.size(); ++i) {
      const FittedStart& start = fit.starts[i];
      if (start.optimum != m) continue;
      from += (from.empty() ? "" : ", ") + std::to_string(i);
      runs += start.forward_runs;
      if (best == nullptr || start.final_cost < best->final_cost) best = &start;
    }
    if (best == nullptr || best->values.size() != fit.parameters.size()) continue;
    const std::string screened = std::isnan(best->screened_cost) ? "–" : short_text(best->screened_cost, 5);
    std::vector<TableCell> row = {
        std::to_string(m),   from, best->status, screened, short_text(best->final_cost, 6),
        std::to_string(runs)};
    for (const double value : best->values) row.emplace_back(short_text(value, 4));
    table.rows.push_back(std::move(row));
  }
  if (!table.rows.empty()) page.table(table);
}

void add_starts(HtmlPage& page, const FitResult& fit) {
  if (fit.starts.empty()) return;
  page.heading("From several starts");
  LinePlot fan;
  fan.width = 640;
  fan.height = 340;
  fan.x.label = "forward runs of the search";
  fan.y.label = "cost";
  fan.y.logarithmic = true;
  long searched = 0, failed = 0;
  std::string alt = "Cost of each search over its forward runs:";
  for (size_t i = 0; i < fit.starts.size(); ++i) {
    const FittedStart& start = fit.starts[i];
    failed += start.failure.empty() ? 0 : 1;
    if (start.status.empty()) continue;
    ++searched;
    PlotSeries series;
    series.label = "start " + std::to_string(i) + (i == 0 ? " (of the case)" : "");
    series.style = PlotStyle::line_and_points;
    series.dashed = fan.series.size() >= 7;  // the palette repeats
    for (size_t j = 0; j < start.costs.size(); ++j) {
      series.x.push_back(start.evaluations[j]);
      series.y.push_back(start.costs[j] < failed_cost ? start.costs[j] : std::nan(""));
    }
    if (std::isfinite(start.final_cost))
      alt += " start " + std::to_string(i) + " to " + short_text(start.final_cost, 4) + ";";
    fan.series.push_back(std::move(series));
  }
  page.paragraph(counted(static_cast<long>(fit.starts.size()), "start") +
                 " were compared on the early frames" +
                 (failed > 0 ? " (" + std::to_string(failed) + " could not be run)" : "") + ", " +
                 std::to_string(searched) +
                 " of them were searched from. What follows about the answer is of the best search.");
  fan.height += 14 * static_cast<int>(std::max<size_t>(6, fan.series.size()) - 6);
  page.svg_figure(svg(fan), alt, "Cost over the forward runs of each search, on a logarithmic scale.");
  add_optima(page, fit);
}

}  // namespace

void add_convergence(HtmlPage& page, const ReportData& data) {
  const auto& history = data.fit.history;
  page.section("convergence", "Convergence");
  if (history.empty()) {
    page.paragraph("The fit left no history.");
    return;
  }
  page.paragraph("Cost went from " + short_text(data.fit.initial_cost, 4) + " to " +
                 short_text(data.fit.final_cost, 4) + " in " +
                 counted(static_cast<long>(history.back().iteration), "iteration") + "; " +
                 counted(data.fit.forward_runs, "forward run") + " in all" +
                 (data.fit.starts.empty() && data.fit.profiles.empty()
                      ? "."
                      : ", those of other starts and of profiles included."));
  LinePlot cost = plot_over_iterations("cost, gradient norm");
  cost.y.logarithmic = true;
  cost.series.push_back(series_of(
      history, "cost", [](const FitIteration& i) { return i.cost < failed_cost ? i.cost : std::nan(""); }));
  PlotSeries gradient =
      series_of(history, "gradient norm", [](const FitIteration& i) { return i.gradient_norm; });
  gradient.dashed = true;
  cost.series.push_back(gradient);

  LinePlot values = plot_over_iterations("place between the bounds");
  values.y.minimum = -0.03;
  values.y.maximum = 1.03;
  values.rules = {{false, 0, "lower bound"}, {false, 1, "upper bound"}};
  for (size_t k = 0; k < data.fit.parameters.size(); ++k) {
    const FittedParameter& p = data.fit.parameters[k];
    PlotSeries series = series_of(history, p.name, [&](const FitIteration& i) {
      return k < i.values.size() ? between_bounds(p, i.values[k]) : std::nan("");
    });
    series.dashed = k >= 7;  // the palette repeats
    values.series.push_back(series);
  }
  // A legend of many names needs room of its own.
  values.height += 14 * static_cast<int>(std::max<size_t>(4, data.fit.parameters.size()) - 4);
  page.begin_row();
  page.svg_figure(svg(cost), "Cost and gradient norm over the iterations, logarithmic.",
                  "Cost ½|z|² of the whitened residuals and the norm of its gradient, on a logarithmic "
                  "scale. A gap is a trial whose run failed.");
  page.svg_figure(svg(values), "Each parameter between its bounds over the iterations.",
                  "Each parameter between its lower (0) and upper (1) bound, logarithmic for those fitted as "
                  "logarithms.");
  page.end_row();
  add_starts(page, data.fit);
}

}  // namespace rhytid::tools
