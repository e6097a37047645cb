#include <algorithm>
#include <cmath>

#include "sim/output/plot.h"
#include "sim/output/text.h"
#include "tools/report/sections.h"
#include "tools/report/wording.h"

namespace rhytid::tools {
namespace {

using fitting::DerivedQuantity;
using fitting::FitResult;
using fitting::FittedParameter;

std::string percent_off(double value, double truth) {
  const double percent = 100 * (value / truth - 1);
  if (percent > 300) return "a factor of " + short_text(value / truth, 2);
  const double size = std::abs(percent);
  return (percent >= 0 ? "+" : "−") + (size < 10 ? short_text(size, 2) : fixed_text(size, 0)) + "\u00a0%";
}

std::string truth_sentence(double value, double low, double high, const std::string& unit,
                           const std::optional<double>& truth, bool determined) {
  // An interval that spans all that was allowed holds the truth without saying anything.
  const auto inside = determined ? truth_inside(truth, low, high) : std::nullopt;
  if (!truth || std::isnan(*truth)) return {};
  std::string text = " The truth is " + readable_unit(value, unit).text(*truth, digits_for(value, low, high));
  if (determined && *truth != 0) text += " (the estimate is off by " + percent_off(value, *truth) + ")";
  if (!inside) return text + ".";
  return text + (*inside ? ": inside the interval." : ": outside the interval.");
}

std::vector<std::string> estimates(const FitResult& fit) {
  std::vector<std::string> lines;
  for (const FittedParameter& p : fit.parameters) {
    std::string line = p.name + ": " + estimate_text(p) + ".";
    if (p.at_bound) line += " It ended at the edge of its allowed range, so the range decides it.";
    lines.push_back(line + truth_sentence(p.value, p.low95, p.high95, p.unit, p.truth, p.determined));
  }
  for (const DerivedQuantity& d : fit.derived) {
    lines.push_back(
        d.name + ": " + estimate_text(d) + "." +
        truth_sentence(d.value, d.low95, d.high95, d.unit, d.truth, std::isfinite(d.high95 - d.low95)));
  }
  return lines;
}

void add_verdict(HtmlPage& page, const FitResult& fit) {
  const bool failed = fit.status.starts_with("failed");
  page.badge(fit.converged ? Verdict::good
             : failed      ? Verdict::bad
                           : Verdict::doubtful,
             fit.converged ? "Converged" : "Not converged: " + fit.status);
  std::string text = "The simulated skin follows " + counted(fit.num_tracks, "tracked feature") + " over " +
                     counted(fit.frames, "frame") + " with " + short_text(fit.rms_px, 3) +
                     " px root mean square error (" + counted(fit.num_observations, "observation") + ").";
  if (fit.reduced_chi_square > 0) {
    text += " The misfit is " + short_text(std::sqrt(fit.reduced_chi_square), 3) +
            " times what the tracker's own noise explains";
    text +=
        fit.reduced_chi_square > 1 ? "; the intervals are wider for it (the notes of the fit say how)." : ".";
  }
  page.paragraph(text);
  if (!fit.converged) {
    page.paragraph(
        "The values below are the best ones found. Their intervals assume a minimum that was not "
        "reached, so take them as a first guess only.");
  }
}

double reference_of(double initial, const std::optional<double>& truth) {
  return truth && std::isfinite(*truth) && *truth != 0 ? *truth : initial;
}

PlotInterval interval(const std::string& name, double value, double low, double high, double reference,
                      bool determined) {
  PlotInterval row{name, value / reference, low / reference, high / reference, {}, {}};
  if (reference < 0) std::swap(row.low, row.high);
  const double half = 0.5 * std::abs(row.high - row.low);
  // Numbers are in the table; here only what has no interval to draw.
  if (!determined || !std::isfinite(half)) row.note = "not determined";
  return row;
}

void add_forest(HtmlPage& page, const FitResult& fit) {
  IntervalPlot plot;
  bool all_truths = true, any_truth = false;
  std::vector<double> ends;
  const auto add = [&](const PlotInterval& row, bool has_truth, bool determined) {
    all_truths = all_truths && has_truth;
    any_truth = any_truth || has_truth;
    plot.rows.push_back(row);
    for (const double x : {row.value, row.low, row.high}) {
      if (std::isfinite(x) && (determined || x == row.value)) ends.push_back(x);
    }
  };
  for (const FittedParameter& p : fit.parameters) {
    const double reference = reference_of(p.initial, p.truth);
    if (reference == 0 || !std::isfinite(reference)) continue;
    add(interval(p.name, p.value, p.low95, p.high95, reference, p.determined), p.truth.has_value(),
        p.determined);
  }
  for (const DerivedQuantity& d : fit.derived) {
    if (!d.truth || !std::isfinite(*d.truth) || *d.truth == 0) continue;  // no common scale without a truth
    add(interval(d.name, d.value, d.low95, d.high95, *d.truth, std::isfinite(d.high95 - d.low95)), true,
        true);
  }
  if (plot.rows.empty()) return;
  plot.reference = 1;
  plot.axis.label = all_truths  ? "fitted value / truth"
                    : any_truth ? "fitted value / truth, or / initial value where no truth is known"
                                : "fitted value / initial value";
  ends.push_back(1);
  const auto [low, high] = std::minmax_element(ends.begin(), ends.end());
  plot.axis.logarithmic = *low > 0 && *high / *low > 4;
  // The finite ends set the range: an open interval becomes an arrow and does not squeeze the rest.
  const double room = 0.08;
  if (plot.axis.logarithmic) {
    plot.axis.minimum = *low * std::pow(*high / *low, -room);
    plot.axis.maximum = *high * std::pow(*high / *low, room);
  } else if (*high > *low) {
    plot.axis.minimum = *low - room * (*high - *low);
    plot.axis.maximum = *high + room * (*high - *low);
  }
  plot.width = 460;
  page.svg_figure(
      svg(plot),
      "Fitted values with 95 percent intervals, each divided by its truth or initial value; "
      "the numbers are in the table below.",
      std::string("Dots: fitted values. Bars: 95 % intervals; an arrow means that the interval goes on. ") +
          "The dotted line at 1 is the " +
          (all_truths  ? "truth."
           : any_truth ? "truth or the initial value."
                       : "initial value."));
}

void add_table(HtmlPage& page, const FitResult& fit) {
  HtmlTable table;
  table.caption =
      "Exact numbers in internal units (mm, N, MPa, s). σ belongs to the transformed parameter: for "
      "log it is relative.";
  table.header = {"parameter", "unit", "scale",         "initial", "fitted", "low 95 %",
                  "high 95 %", "σ",    "allowed range", "truth",   "inside"};
  table.text_columns = 3;
  table.wide = true;
  const auto number = [](double x) { return std::isnan(x) ? std::string("–") : short_text(x, 7); };
  const auto inside = [](const auto& q, bool determined) -> std::string {
    const auto known = truth_inside(q.truth, q.low95, q.high95);
    return !known || !determined ? "–" : *known ? "yes" : "no";
  };
  for (const FittedParameter& p : fit.parameters) {
    TableCell value(number(p.value));
    value.strong = true;
    table.rows.push_back({p.name, p.unit, p.transform, number(p.initial), value, number(p.low95),
                          number(p.high95), std::isnan(p.sigma) ? "–" : short_text(p.sigma, 3),
                          short_text(p.lower, 4) + " to " + short_text(p.upper, 4),
                          p.truth ? number(*p.truth) : "–", inside(p, p.determined)});
  }
  for (const DerivedQuantity& d : fit.derived) {
    TableCell value(number(d.value));
    value.strong = true;
    table.rows.push_back({d.name, d.unit, "derived", "–", value, number(d.low95), number(d.high95), "–", "–",
                          d.truth ? number(*d.truth) : "–", inside(d, std::isfinite(d.high95 - d.low95))});
  }
  page.table(table);
}

/// What each clip contributed and how well it is followed: a clip that stands out has an error of its own.
void add_clips(HtmlPage& page, const FitResult& fit) {
  if (fit.clips.empty()) return;
  HtmlTable table;
  table.caption =
      "The clips. Reduced chi-square is the squared misfit per independent number of the clip: one that "
      "stands "
      "out has a path, a camera or a scene that fits it less.";
  table.header = {"clip",     "camera",   "frames",
                  "tracks",   "left out", "observations",
                  "rms [px]", "cost",     "reduced chi-square"};
  table.text_columns = 2;
  for (const fitting::FittedClip& clip : fit.clips) {
    const bool is_single = clip.views.size() == 1;
    table.rows.push_back({clip.name.empty() ? "–" : clip.name, is_single ? clip.views[0].camera : "all",
                          std::to_string(clip.frames), std::to_string(clip.num_tracks),
                          std::to_string(clip.tracks_left_out), std::to_string(clip.num_observations),
                          short_text(clip.rms_px, 3), short_text(clip.cost, 4),
                          short_text(clip.reduced_chi_square, 3)});
    for (size_t v = 0; v < clip.views.size() && !is_single; ++v)
      table.rows.push_back({"", clip.views[v].camera, "", std::to_string(clip.views[v].num_tracks), "",
                            std::to_string(clip.views[v].num_observations),
                            short_text(clip.views[v].rms_px, 3), "", ""});
  }
  page.table(table);
}

}  // namespace

void add_answer(HtmlPage& page, const ReportData& data) {
  const FitResult& fit = data.fit;
  page.section("answer", "The answer");
  add_verdict(page, fit);
  page.list(estimates(fit));
  if (!fit.gauge.empty()) {
    page.heading("What was held fixed");
    page.paragraph(fit.gauge);
    page.paragraph(
        "All else in the scene, from Poisson's ratios and relaxation to the stiffness of ligaments, bone and "
        "finger, stayed at the values that the scene gives (rhytid check SCENE --parameters lists them). The "
        "intervals hold if those values do, but for those that are named below with how well they are "
        "known.");
  }
  page.heading("What this footage cannot tell");
  if (fit.cannot_tell.empty()) {
    page.paragraph(
        "Each fitted parameter is determined by this footage on its own. Which of them trade off against "
        "each "
        "other, so that one may be wrong where another makes up for it, is told under identifiability.");
  } else {
    page.list(fit.cannot_tell);
  }
  add_forest(page, fit);
  add_table(page, fit);
  add_clips(page, fit);
}

}  // namespace rhytid::tools
