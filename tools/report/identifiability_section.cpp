#include <algorithm>
#include <cmath>
#include <numeric>

#include "sim/output/colour_map.h"
#include "sim/output/plot.h"
#include "sim/output/text.h"
#include "tools/report/sections.h"
#include "tools/report/wording.h"

namespace rhytid::tools {
namespace {

using fitting::FitResult;
using fitting::FittedParameter;
using fitting::ParameterProfile;
using fitting::ProfilePoint;

void add_singular_values(HtmlPage& page, const FitResult& fit) {
  // Bars need a base, and 1 is the natural one (a direction known to one standard deviation), but values
  // spread over decades: show log10.
  BarChart chart;
  chart.width = 460;
  chart.height = 280;
  chart.series = {""};
  chart.y.label = "log10 of the singular value";
  std::string alt = "Singular values: ";
  for (Eigen::Index i = 0; i < fit.singular_values.size(); ++i) {
    const double s = fit.singular_values[i];
    chart.groups.push_back({std::to_string(i + 1), {s > 0 ? std::log10(s) : std::nan("")}, {}});
    alt += (i ? ", " : "") + short_text(s, 3);
  }
  page.svg_figure(
      svg(chart), alt + ".",
      "Singular values of the whitened Jacobian by the transformed parameters, largest first. One over "
      "a value is the standard deviation along its combination as far as the tracks' stated noise goes: a "
      "bar "
      "below 0 belongs to a combination that the data hold no better than to ±1, for logarithms a factor of "
      "e. Intervals also have what the residuals show besides.");
}

void add_correlations(HtmlPage& page, const FitResult& fit) {
  HtmlTable table;
  table.caption = "Correlation of the fitted (transformed) parameters. Near ±1, two parameters trade off.";
  table.header = {"parameter"};
  table.wide = true;
  for (size_t k = 0; k < fit.parameters.size(); ++k) table.header.push_back(std::to_string(k + 1));
  for (size_t i = 0; i < fit.parameters.size(); ++i) {
    std::vector<TableCell> row = {std::to_string(i + 1) + " " + fit.parameters[i].name};
    for (size_t j = 0; j < fit.parameters.size(); ++j) {
      const double c = fit.correlation(static_cast<Eigen::Index>(i), static_cast<Eigen::Index>(j));
      if (std::isnan(c)) {
        row.emplace_back("–");
      } else {
        row.emplace_back(fixed_text(c, 2), map_colour(ColourMap::diverging, 0.5 + 0.5 * c));
      }
    }
    table.rows.push_back(std::move(row));
  }
  page.table(table);
}

std::string strongest_pair(const FitResult& fit) {
  double strongest = 0;
  Eigen::Index a = 0, b = 0;
  for (Eigen::Index i = 0; i < fit.correlation.rows(); ++i) {
    for (Eigen::Index j = 0; j < i; ++j) {
      if (std::abs(fit.correlation(i, j)) > std::abs(strongest))
        strongest = fit.correlation(i, j), a = j, b = i;
    }
  }
  if (std::abs(strongest) < 0.8) return "No two parameters trade off strongly: no correlation reaches ±0.8.";
  const std::string first = fit.parameters[static_cast<size_t>(a)].name;
  const std::string second = fit.parameters[static_cast<size_t>(b)].name;
  return first + " and " + second + " trade off (correlation " + fixed_text(strongest, 2) +
         "): the footage holds " + (strongest > 0 ? "their ratio or difference" : "their product or sum") +
         " better than either of them alone.";
}

/// Units of the combinations: parameters without a transform are scaled by their range.
double scale(const FittedParameter& p) {
  return p.transform == "none" ? p.upper - p.lower : 1;
}

/// What one standard deviation along a combination does to a parameter.
std::string change_text(const FittedParameter& p, double component, double deviation) {
  const double step = component * deviation;
  if (!std::isfinite(step)) return "unbounded";
  if (p.transform == "log") {
    return std::abs(step) > 20 ? "unbounded" : "× " + short_text(std::exp(step), 4);
  }
  if (p.transform == "logit") {
    const double odds = (p.value - p.lower) / (p.upper - p.value) * std::exp(step);
    return short_text(p.value, 4) + " to " + short_text(p.lower + (p.upper - p.lower) * odds / (1 + odds), 4);
  }
  return (step < 0 ? "− " : "+ ") + readable_unit(p.value, p.unit).text(std::abs(step) * scale(p), 3);
}

/// Standard deviation along a combination, from the same covariance as the intervals; where a parameter has
/// no deviation, from the noise as stated.
double deviation_along(const FitResult& fit, const VectorXd& v, double singular_value) {
  const auto n = static_cast<Eigen::Index>(fit.parameters.size());
  if (!(singular_value > 0) || fit.correlation.rows() != n || !fit.correlation.allFinite())
    return 1 / singular_value;
  VectorXd scaled(n);
  for (Eigen::Index k = 0; k < n; ++k) {
    const FittedParameter& p = fit.parameters[static_cast<size_t>(k)];
    scaled[k] = v[k] * p.sigma / scale(p);
  }
  return scaled.allFinite() ? std::sqrt(std::max(0.0, scaled.dot(fit.correlation * scaled)))
                            : 1 / singular_value;
}

void add_weakest(HtmlPage& page, const FitResult& fit) {
  const Eigen::Index last = fit.singular_values.size() - 1;
  const double smallest = fit.singular_values[last];
  VectorXd v = fit.right_vectors.col(last);
  Eigen::Index leader = 0;
  v.cwiseAbs().maxCoeff(&leader);
  if (v[leader] < 0) v = -v;  // the sign is free: let the leading parameter rise
  const double deviation = deviation_along(fit, v, smallest);
  std::vector<size_t> order(fit.parameters.size());
  std::iota(order.begin(), order.end(), 0);
  std::stable_sort(order.begin(), order.end(), [&](size_t a, size_t b) {
    return std::abs(v[static_cast<Eigen::Index>(a)]) > std::abs(v[static_cast<Eigen::Index>(b)]);
  });
  std::string up, down;
  HtmlTable table;
  table.caption = "The combination that the footage holds worst, moved by one standard deviation.";
  table.header = {"parameter", "component", "change"};
  for (const size_t k : order) {
    const double component = v[static_cast<Eigen::Index>(k)];
    const FittedParameter& p = fit.parameters[k];
    table.rows.push_back({p.name, fixed_text(component, 3), change_text(p, component, deviation)});
    if (std::abs(component) < 0.2) continue;
    std::string& side = component > 0 ? up : down;
    side += (side.empty() ? "" : " and ") + p.name;
  }
  page.heading("The weakest combination");
  std::string text =
      "The footage hardly notices when " + up + (up.find(" and ") == std::string::npos ? " rises" : " rise");
  if (!down.empty())
    text += " while " + down + (down.find(" and ") == std::string::npos ? " falls" : " fall");
  text += ". ";
  text += smallest > 0 ? "One standard deviation along this combination is " + short_text(deviation, 3) +
                             " in the transformed parameters."
                       : "Along this combination nothing changes at all: it is not determined.";
  if (fit.singular_values[0] > 0 && smallest > 0) {
    text += " The best held combination is known " + short_text(fit.singular_values[0] / smallest, 2) +
            " times more precisely.";
  }
  page.paragraph(text);
  page.table(table);
}

void add_further_views(HtmlPage& page, const FitResult& fit) {
  if (fit.further_views.empty()) return;
  page.heading("What would help");
  page.paragraph(
      "Predicted before it is filmed: the standard deviations from noise with one more view of the same "
      "swipe, "
      "as multiples of what they are. What the discretisation does to an answer no view makes smaller. Which "
      "other "
      "swipe would tell most, rhytid study design predicts for a list of them.");
  HtmlTable table;
  table.caption = "Deviations with a further view, per deviation now.";
  table.header = {"view"};
  for (const FittedParameter& p : fit.parameters) table.header.push_back(p.name);
  for (const fitting::FurtherView& view : fit.further_views) {
    std::vector<TableCell> row = {view.name};
    for (const double ratio : view.ratios) {
      if (std::isnan(ratio)) {
        row.emplace_back("–");
      } else {
        row.emplace_back(fixed_text(ratio, 2), map_colour(ColourMap::sequential, 1 - ratio));
      }
    }
    table.rows.push_back(std::move(row));
  }
  page.table(table);
}

double transformed(const FittedParameter& p, double value) {
  if (p.transform == "log") return std::log(value);
  if (p.transform == "logit") return std::log((value - p.lower) / (p.upper - value));
  return value;
}

double from_transformed(const FittedParameter& p, double t) {
  if (p.transform == "log") return std::exp(t);
  if (p.transform == "logit") return p.lower + (p.upper - p.lower) / (1 + std::exp(-t));
  return t;
}

/// Rise of the cost over the value, the parabola of the linearised model beside it.
LinePlot profile_plot(const FittedParameter& p, const ParameterProfile& profile) {
  const double level = profile.quantile * profile.quantile;
  LinePlot plot;
  plot.width = 360;
  plot.height = 250;
  const ReadableUnit unit = readable_unit(p.value, p.unit);
  plot.x.label = p.name + (unit.unit.empty() ? "" : " [" + unit.unit + "]");
  plot.y.label = "2ΔF/w²";
  plot.y.minimum = std::min(
      0.0,
      1.1 * std::min_element(profile.points.begin(), profile.points.end(), [](const auto& a, const auto& b) {
              return a.deviance < b.deviance;
            })->deviance);
  plot.y.maximum = 2.5 * level;
  PlotSeries found, parabola;
  found.label = "profile";
  found.style = PlotStyle::line_and_points;
  for (const ProfilePoint& point : profile.points) {
    found.x.push_back(point.value / unit.scale);
    found.y.push_back(point.deviance);
  }
  plot.series.push_back(found);
  if (std::isfinite(profile.sigma)) {
    parabola.label = "linearised";
    parabola.dashed = true;
    const double reach = std::sqrt(*plot.y.maximum), centre = transformed(p, p.value);
    for (int i = -40; i <= 40; ++i) {
      const double root = reach * i / 40;
      const double value = from_transformed(p, centre + root * profile.sigma);
      if (!(value >= profile.points.front().value && value <= profile.points.back().value)) continue;
      parabola.x.push_back(value / unit.scale);
      parabola.y.push_back(root * root);
    }
    plot.series.push_back(parabola);
  }
  plot.rules.push_back({false, level, "95 %"});
  // Beyond the values that were tried it would only make them narrow; the answer says the truth.
  if (p.truth && *p.truth >= profile.points.front().value && *p.truth <= profile.points.back().value)
    plot.rules.push_back({true, *p.truth / unit.scale, "truth"});
  return plot;
}

void add_profiles(HtmlPage& page, const FitResult& fit) {
  if (fit.profiles.empty()) return;
  page.heading("Profiles");
  int runs = 0;
  for (const ParameterProfile& profile : fit.profiles) runs += profile.forward_runs;
  page.paragraph(
      "Each parameter was held at values about its best one and all others were fitted again (" +
      counted(runs, "forward run") +
      "). Where the curve leaves the dashed parabola, the interval of the linearised model is only "
      "approximate; where it stays below the 95 % level up to a bound, the footage does not bound the "
      "parameter on that side. The cost is counted per widening² of the noise, as in the intervals. What "
      "elements, steps and held parameters add to the reported intervals is in neither curve.");
  HtmlTable table;
  table.caption = "95 % intervals by profile and of the linearised model, both from the footage alone.";
  table.header = {"parameter", "by profile", "linearised", "forward runs"};
  page.begin_row();
  for (const ParameterProfile& profile : fit.profiles) {
    const auto p = std::find_if(fit.parameters.begin(), fit.parameters.end(),
                                [&](const FittedParameter& x) { return x.address == profile.address; });
    if (p == fit.parameters.end() || profile.points.empty()) continue;
    const ReadableUnit unit = readable_unit(p->value, p->unit);
    const int digits = digits_for(p->value, profile.low95, profile.high95);
    const auto text = [&](double low, double high) {
      return unit.number(low, digits) + " to " + unit.text(high, digits);
    };
    std::string open;
    if (!profile.bounded_below) open = ", open below";
    if (!profile.bounded_above) open += open.empty() ? ", open above" : " and above";
    const std::string interval = text(profile.low95, profile.high95) + open;
    page.svg_figure(svg(profile_plot(*p, profile)), "Profile of " + p->name + ": " + interval + ".",
                    p->name + ": " + interval + ".");
    table.rows.push_back({p->name, interval, text(profile.linear_low95, profile.linear_high95),
                          std::to_string(profile.forward_runs)});
    for (const fitting::DerivedProfile& d : fitting::derived_profiles(fit, profile)) {
      const int own = digits_for(d.value, d.low95, d.high95);
      open = d.bounded_below ? "" : ", open below";
      if (!d.bounded_above) open += open.empty() ? ", open above" : " and above";
      const auto words = [&](double low, double high) {
        return short_text(low, own) + " to " + short_text(high, own) + (d.unit.empty() ? "" : " " + d.unit);
      };
      table.rows.push_back(
          {d.name, words(d.low95, d.high95) + open, words(d.linear_low95, d.linear_high95), "–"});
    }
  }
  page.end_row();
  page.table(table);
  for (const ParameterProfile& profile : fit.profiles)
    if (!profile.warning.empty()) page.badge(Verdict::doubtful, "Warning: " + profile.warning);
}

}  // namespace

void add_identifiability(HtmlPage& page, const ReportData& data) {
  const FitResult& fit = data.fit;
  page.section("identifiability", "What the footage determines");
  if (fit.singular_values.size() == 0 || fit.parameters.empty()) {
    page.paragraph("The fit ended before this was worked out.");
    return;
  }
  page.begin_row();
  add_singular_values(page, fit);
  if (fit.correlation.size() > 0) add_correlations(page, fit);
  page.end_row();
  if (fit.correlation.rows() > 1) page.paragraph(strongest_pair(fit));
  if (fit.right_vectors.size() > 0 && fit.parameters.size() > 1) add_weakest(page, fit);
  add_profiles(page, fit);
  add_further_views(page, fit);
}

}  // namespace rhytid::tools
