#include <algorithm>
#include <cmath>

#include "sim/output/plot.h"
#include "sim/output/text.h"
#include "tools/report/sections.h"

namespace rhytid::tools {
namespace {

using fitting::FitResult;
using fitting::FittedParameter;
using fitting::SystematicShift;

/// The part of a parameter's deviation that the shifts do not make.
double rest_of_deviation(const FitResult& fit, std::size_t k) {
  double squares = fit.parameters[k].sigma * fit.parameters[k].sigma;
  for (const SystematicShift* d : fitting::counted_shifts(fit.systematic))
    squares -= d->shift[k] * d->shift[k];
  return std::sqrt(std::max(0.0, squares));
}

std::string signed_text(double value, int digits) {
  return (value < 0 ? "−" : "+") + short_text(std::abs(value), digits);
}

std::string moved(const FittedParameter& p, const SystematicShift& d, std::size_t k) {
  const double shift = d.shift[k];
  if (!p.determined && std::abs(shift) > 1) return "–";
  const auto text = [&d](double value, int digits) {
    return d.axes.empty() ? signed_text(value, digits) : "±" + short_text(value, digits);
  };
  if (p.transform == "log") return text(100 * std::expm1(shift), 2) + " %";
  return text(shift, 3) + (p.transform == "none" ? " " + p.unit : "");
}

void add_bars(HtmlPage& page, const FitResult& fit, const std::vector<const SystematicShift*>& run) {
  BarChart chart;
  chart.width = 640;
  chart.height = 320;
  chart.y.label = "shift / deviation from noise and misfit";
  std::string alt = "Shifts in units of the deviation from noise and misfit: ";
  for (const SystematicShift* d : run) chart.series.push_back(d->name);
  for (std::size_t k = 0; k < fit.parameters.size(); ++k) {
    const double deviation = rest_of_deviation(fit, k);
    if (!fit.parameters[k].determined || !(deviation > 0)) continue;
    BarGroup& group = chart.groups.emplace_back();
    group.label = fit.parameters[k].name;
    for (const SystematicShift* d : run) group.values.push_back(d->shift[k] / deviation);
    alt += fit.parameters[k].name;
    for (const double value : group.values) alt += " " + short_text(value, 2);
    alt += "; ";
  }
  if (chart.groups.empty()) return;
  page.svg_figure(
      svg(chart), alt,
      "By how much each would move a parameter, in units of the standard deviation that noise and misfit "
      "alone give it. Bars beyond ±1 say that this, and not the footage, limits that answer.");
}

}  // namespace

void add_discretisation(HtmlPage& page, const ReportData& data) {
  const FitResult& fit = data.fit;
  if (fit.systematic.empty()) return;
  page.section("discretisation", "What finer elements, steps and held values would do");
  std::vector<const SystematicShift*> run;
  std::vector<std::string> list;
  for (const SystematicShift& d : fit.systematic) {
    if (d.failure.empty()) run.push_back(&d);
    list.push_back(d.name + ": " + d.change +
                   (!d.failure.empty() ? ". Could not be run: " + d.failure
                    : d.rms_px > 0
                        ? ", which moves the predicted points by " + short_text(d.rms_px, 2) + " px (rms)"
                        : ""));
  }
  page.paragraph(
      "At the answer the tracks were predicted again with each kind of step of the discretisation finer and "
      "with numbers of the scene that are held without being known exactly off by their deviation, and "
      "differentiated by parameters that are held so and by where paths are. To first order the answer would "
      "move by what the table says, of what is held by what the residuals leave of its deviation; the "
      "intervals have room for it.");
  for (const std::string& sentence : fit.misfit) page.paragraph("Misfit: " + sentence);
  page.list(list);
  if (run.empty()) return;
  HtmlTable table;
  table.caption = "By how much the answer would move.";
  table.header = {"parameter"};
  for (const SystematicShift* d : run) table.header.push_back(d->name);
  for (std::size_t k = 0; k < fit.parameters.size(); ++k) {
    std::vector<TableCell> row = {fit.parameters[k].name};
    for (const SystematicShift* d : run) row.emplace_back(moved(fit.parameters[k], *d, k));
    table.rows.push_back(std::move(row));
  }
  page.table(table);
  add_bars(page, fit, run);
}

}  // namespace rhytid::tools
