#include "tools/certificate_page.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>

#include "adjoint/certificate_report.h"
#include "sim/output/plot.h"
#include "sim/output/text.h"
#include "sim/scene/names.h"
#include "tools/report/program_facts.h"
#include "tools/scene_argument.h"

namespace rhytid::tools {
namespace {

using adjoint::CertificateCheck;
using adjoint::CertificateReport;
using adjoint::LimitKind;
using adjoint::TaylorSeries;

/// Of the palette: its colours tell lines of one plot apart.
constexpr std::size_t kLinesOfAPlot = 6;

struct Purpose {
  const char *check, *text;
};
/// What the checks are for, in their order; their own sentences say what they found. Names of checks begin so.
constexpr std::array<Purpose, 7> kPurposes = {{
    {"duality", "both sweeps differentiate the same linearised steps, one forward, one backward."},
    {"gauge identity",
     "displacements cannot tell how stiff everything is together, and the gradient knows it."},
    {"Taylor slope",
     "full simulations at nearby parameters answer as the gradient foretells: what it leaves unexplained "
     "shrinks "
     "with the square of the change (slope 2)."},
    {"no effect", "what the gradient calls without effect changes nothing in a simulation either."},
    {"error bar", "the adjoint tells how far a run that stopped too early is off."},
    {"pivots",
     "where the smallest pivot dips, the onset of a wrinkle or another bifurcation is near, and the gradient "
     "holds "
     "in a small neighbourhood only."},
    {"repeatability", "the same run gives the same bits, whatever the number of threads."},
}};

TableCell verdict_cell(adjoint::Verdict verdict) {
  switch (verdict) {
    case adjoint::Verdict::pass:
      return {"pass", {11, 107, 75}};
    case adjoint::Verdict::warning:
      return {"look", {240, 200, 110}};
    case adjoint::Verdict::fail:
      break;
  }
  return {"FAIL", {164, 38, 44}};
}

/// A number that does not break at its minus.
std::string figure_text(double figure, int digits = 4) {
  if (!std::isfinite(figure)) return "-";
  std::string text = short_text(figure, digits);
  for (std::size_t at = text.find('-'); at != std::string::npos; at = text.find('-', at))
    text.replace(at, 1, "−");
  return text;
}

std::string limit_text(const CertificateCheck& check) {
  const char* sign = check.limit == LimitKind::at_most    ? "≤"
                     : check.limit == LimitKind::at_least ? "≥"
                                                          : "near";
  return std::string(sign) + "\u00a0" + figure_text(check.threshold, 3);
}

std::string name_of(const TaylorSeries& s) {
  return s.group + ", " + s.direction;
}

/// C h², above all remainders so that it stands apart.
PlotSeries slope_two(const std::vector<PlotSeries>& series) {
  PlotSeries line;
  line.label = "slope 2";
  line.dashed = true;
  line.colour = Rgb{120, 120, 120};
  double low = std::numeric_limits<double>::infinity(), high = 0, factor = 0;
  for (const PlotSeries& s : series)
    for (std::size_t k = 0; k < s.x.size(); ++k) {
      low = std::min(low, s.x[k]);
      high = std::max(high, s.x[k]);
      factor = std::max(factor, s.y[k] / (s.x[k] * s.x[k]));
    }
  if (factor > 0) {
    line.x = {low, high};
    for (const double h : line.x) line.y.push_back(2 * factor * h * h);
  }
  return line;
}

LinePlot taylor_plot(const std::string& y_label) {
  LinePlot plot;
  plot.x.label = "step h";
  plot.x.logarithmic = true;
  plot.y.label = y_label;
  plot.width = 560;
  plot.height = 340;
  return plot;
}

/// Remainders, and the points that changed piece, of a few series.
void add_taylor_plots(HtmlPage& page, const std::vector<TaylorSeries>& taylor, std::size_t begin,
                      std::size_t end, double noise) {
  LinePlot remainders = taylor_plot("remainder"), switches = taylor_plot("points on another piece");
  remainders.y.logarithmic = true;
  switches.y.minimum = 0;
  std::string names;
  for (std::size_t k = begin; k < end; ++k) {
    const TaylorSeries& s = taylor[k];
    PlotSeries line;
    line.label = name_of(s);
    line.style = PlotStyle::line_and_points;
    line.x = s.steps;
    PlotSeries counts = line;
    for (const double r : s.remainders) line.y.push_back(std::fabs(r));
    for (const long n : s.switches) counts.y.push_back(static_cast<double>(n));
    remainders.series.push_back(std::move(line));
    switches.series.push_back(std::move(counts));
    names += (names.empty() ? "" : "; ") + name_of(s);
  }
  long most = 0;
  for (std::size_t k = begin; k < end; ++k)
    for (const long n : taylor[k].switches) most = std::max(most, n);
  if (most == 0) switches.y.maximum = 1;
  remainders.series.push_back(slope_two(remainders.series));
  if (noise > 0) remainders.rules.push_back({false, noise, "noise of the functional"});
  page.begin_row();
  page.svg_figure(svg(remainders), "Taylor remainders over the step, logarithmic: " + names,
                  "|Q(p + h v) − Q(p) − h Q'v| over h, both logarithmic: parallel to the dashed line where "
                  "the gradient is right, half as steep where it is not.");
  page.svg_figure(
      svg(switches), "Points of contact and friction that changed piece, over the step: " + names,
      "Points of contact and friction, summed over the steps, that are on another smooth piece of "
      "their law (pressed or not, stick or slip) than at p. They bend the parabola.");
  page.end_row();
}

void add_taylor(HtmlPage& page, const CertificateReport& r) {
  page.section("taylor", "Taylor test");
  if (r.taylor.empty()) {
    page.paragraph("No Taylor test was done.");
    return;
  }
  page.paragraph(
      "Q is a fixed random combination of what the functional below reads in every frame; Q'v its derivative "
      "along a direction v of all parameters together, or of one. Every point is a simulation of its own.");
  for (std::size_t begin = 0; begin < r.taylor.size(); begin += kLinesOfAPlot)
    add_taylor_plots(page, r.taylor, begin, std::min(begin + kLinesOfAPlot, r.taylor.size()), r.noise);
  HtmlTable table;
  table.caption = "Each direction: steps from the largest to the smallest, as in the plots";
  table.header = {"direction", "Q'v", "h", "slopes", "points on another piece", "error left room for"};
  for (const TaylorSeries& s : r.taylor) {
    std::string slopes, switches;
    for (const double slope : s.slopes)
      slopes += (slopes.empty() ? "" : ", ") + (std::isfinite(slope) ? fixed_text(slope, 3) : "-");
    for (const long n : s.switches) switches += (switches.empty() ? "" : ", ") + std::to_string(n);
    const std::string range =
        s.steps.empty() ? "-" : figure_text(s.steps.front(), 3) + " to " + figure_text(s.steps.back(), 3);
    table.rows.push_back({name_of(s), figure_text(s.linear), range, slopes.empty() ? "-" : slopes,
                          switches.empty() ? "-" : switches, figure_text(s.first_order_error, 2)});
  }
  page.table(table);
}

void add_steps(HtmlPage& page, const CertificateReport& r, double dip) {
  page.section("steps", "Steps");
  const std::vector<double> pivots = r.steps.relative_pivots();
  if (pivots.empty() || pivots.size() != r.step_times.size()) {
    page.paragraph("No sweep went over the steps.");
    return;
  }
  LinePlot plot;
  plot.x.label = "time [s]";
  plot.y.label = "smallest pivot / median";
  plot.y.logarithmic = true;
  plot.width = 560;
  plot.height = 300;
  plot.rules = {{false, dip, "dip"}};
  PlotSeries line;
  line.style = PlotStyle::line_and_points;
  line.x = r.step_times;
  line.y = pivots;
  plot.series = {line};
  LinePlot changes = plot;
  changes.y = {};
  changes.y.label = "points that changed piece";
  changes.y.minimum = 0;
  changes.rules.clear();
  changes.series[0].y.assign(r.steps.regime_changes.begin(), r.steps.regime_changes.end());
  const bool has_changes = r.steps.regime_changes.size() == r.step_times.size();
  if (has_changes && std::all_of(r.steps.regime_changes.begin(), r.steps.regime_changes.end(),
                                 [](long n) { return n == 0; }))
    changes.y.maximum = 1;
  page.begin_row();
  page.svg_figure(
      svg(plot), "Smallest pivot of every step, relative to the median of all",
      "Smallest over largest pivot of the Hessian that each step ended with, relative to the median "
      "of all steps. A dip marks the onset of wrinkles or another bifurcation.");
  if (has_changes)
    page.svg_figure(
        svg(changes), "Points of contact and friction that changed piece in every step",
        "Points of contact and friction that are on another piece of their law than at the end of "
        "the step before.");
  page.end_row();
  if (r.regimes.empty()) return;
  HtmlTable table;
  table.caption = "Points of contact and friction over all steps";
  table.header = {"term", "piece", "points"};
  table.text_columns = 2;
  for (const adjoint::RegimeCount& c : r.regimes)
    table.rows.push_back({c.term, c.regime, std::to_string(c.points)});
  page.table(table);
}

void add_parameters(HtmlPage& page, const CertificateReport& r) {
  page.section("parameters", "Parameters");
  if (!r.parameters.empty()) {
    HtmlTable table;
    table.caption = "Parameters that were tested together, and the derivative of Q by their coordinate";
    table.header = {"parameter", "coordinate", "value", "unit", "dQ / d(coordinate)"};
    table.text_columns = 2;
    for (std::size_t k = 0; k < r.parameters.size(); ++k) {
      const ParameterSpec& p = r.parameters[k];
      table.rows.push_back({p.address, to_string(p.transform), short_text(p.value), p.unit,
                            k < r.gradient.size() ? figure_text(r.gradient[k]) : "-"});
    }
    page.table(table);
  }
  page.heading("Without effect");
  if (r.without_effect.empty()) {
    page.paragraph(r.parameters.empty() ? "Parameters were not looked at."
                                        : "All parameters have an effect.");
  } else {
    page.paragraph(
        "The derivative by these is zero but for rounding. They were left out of the Taylor tests and "
        "changed "
        "together in a run of their own (check \"no effect\").");
    page.list(r.without_effect);
  }
}

void add_not_smooth(HtmlPage& page, const CertificateReport& r) {
  if (r.not_smooth.empty()) return;
  page.heading("Not tested");
  page.paragraph(
      "Results have a kink in these here: a path changes its speed at a knot where a step ends, or within "
      "0.1 ms of "
      "that, which a Taylor test would step over. Exactly there the derivative is the mean of both sides.");
  page.list(r.not_smooth);
}

void add_origin(HtmlPage& page, const CertificateReport& r, const SceneModel& scene_model,
                const CertificateOrigin& origin) {
  page.section("run", "How this was made");
  Facts facts = scheme_facts(scene_model);
  facts.emplace_back("Scene file", scene_model.scene().file);
  facts.emplace_back("Functional", "positions and mean normal displacement of " +
                                       counted(origin.points, "point") +
                                       " at most, in every frame, with random weights");
  facts.emplace_back("Seed", std::to_string(origin.seed));
  facts.emplace_back("Noise", short_text(r.noise, 2) + ", of Q");
  facts.emplace_back("Seconds", "simulation " + short_text(r.forward_seconds, 3) + ", tangent sweep " +
                                    short_text(r.tangent_seconds, 3) + ", adjoint sweep " +
                                    short_text(r.adjoint_seconds, 3) + ", certificate " +
                                    short_text(r.total_seconds, 3));
  page.facts(facts);
  page.heading("Program");
  page.facts(build_facts());
  page.heading("To do it again");
  std::string command;
  for (const std::string& word : origin.command) command += (command.empty() ? "" : " ") + shell_word(word);
  page.code(command);
}

}  // namespace

void add_certificate_checks(HtmlPage& page, const std::vector<CertificateCheck>& checks, bool passed,
                            bool interrupted) {
  const auto count = [&checks](adjoint::Verdict verdict) {
    return std::count_if(checks.begin(), checks.end(),
                         [verdict](const CertificateCheck& c) { return c.verdict == verdict; });
  };
  const long failed = count(adjoint::Verdict::fail), looks = count(adjoint::Verdict::warning);
  page.badge(!passed     ? Verdict::bad
             : looks > 0 ? Verdict::doubtful
                         : Verdict::good,
             passed        ? looks > 0 ? "certified, look at " + counted(looks, "check") : "certified"
             : interrupted ? "interrupted"
                           : "not certified");
  std::string sentence = adjoint::certificate_verdict(passed, interrupted);
  if (failed > 0)
    sentence += " " + std::to_string(failed) + " of " + counted(checks.size(), "check") + " failed.";
  page.paragraph(sentence);
  HtmlTable table;
  table.caption = "Every check, its figure and the limit of that";
  table.header = {"check", "verdict", "figure", "limit"};
  table.text_columns = 2;
  std::vector<std::pair<std::string, std::string>> words;
  for (const CertificateCheck& c : checks) {
    table.rows.push_back({c.name, verdict_cell(c.verdict), figure_text(c.figure), limit_text(c)});
    words.emplace_back(c.name, c.sentence + (c.sentence.ends_with(".") ? "" : "."));
  }
  page.table(table);
  page.heading("In words");
  page.facts(words);
  page.heading("What the checks are for");
  std::vector<std::string> purposes;
  for (const Purpose& p : kPurposes)
    if (std::any_of(checks.begin(), checks.end(),
                    [&p](const CertificateCheck& c) { return c.name.starts_with(p.check); }))
      purposes.push_back(std::string(p.check) + ": " + p.text);
  page.list(purposes);
}

std::string certificate_page(const CertificateReport& report, const SceneModel& scene_model,
                             const CertificateOrigin& origin) {
  HtmlPage page("Gradient certificate of " + shown_name(scene_model.scene()),
                "Rhytid: are the derivatives of this simulation those of the simulation?");
  page.section("verdict", "Verdict");
  add_certificate_checks(page, report.checks, report.passed(), report.interrupted);
  add_taylor(page, report);
  double dip = adjoint::CertificateOptions().pivot_dip;
  for (const CertificateCheck& c : report.checks)
    if (c.name == "pivots") dip = c.threshold;
  add_steps(page, report, dip);
  add_parameters(page, report);
  add_not_smooth(page, report);
  add_origin(page, report, scene_model, origin);
  return page.finish();
}

}  // namespace rhytid::tools
