#include <cmath>

#include "sim/output/plot.h"
#include "sim/output/text.h"
#include "tools/report/sections.h"
#include "tools/report/wording.h"

namespace rhytid::tools {
namespace {

using fitting::FitIteration;
using fitting::FittedParameter;

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
                 counted(static_cast<long>(history.back().iteration), "iteration") + " and " +
                 counted(data.fit.forward_runs, "forward run") + ".");
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
}

}  // namespace rhytid::tools
