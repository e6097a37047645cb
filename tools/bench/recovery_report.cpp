#include "tools/bench/recovery_report.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "sim/output/atomic_file.h"
#include "sim/output/csv.h"
#include "sim/output/plot.h"
#include "sim/output/text.h"
#include "tools/bench/timing.h"
#include "tools/report/html.h"
#include "tools/study/study_run.h"

namespace rhytid::tools {
namespace {

constexpr double kNan = std::numeric_limits<double>::quiet_NaN();

std::vector<const RecoveryDraw*> answered(const RecoveryGroup& group) {
  std::vector<const RecoveryDraw*> list;
  for (const RecoveryDraw& d : group.draws)
    if (d.answered) list.push_back(&d);
  return list;
}

const RecoveredParameter* find(const RecoveryDraw& draw, const std::string& address) {
  for (const RecoveredParameter& p : draw.parameters)
    if (p.address == address) return &p;
  return nullptr;
}

double median_of(const std::vector<const RecoveryDraw*>& draws, double (*value)(const RecoveryDraw&)) {
  std::vector<double> values;
  for (const RecoveryDraw* d : draws) values.push_back(value(*d));
  return values.empty() ? kNan : median(values);
}

/// A number in the coordinate of the fit: hundredths of a logarithm, which are nearly per cent, else as it is.
std::string in_coordinate(double value, const RecoverySummary& s, const std::string& sign = "") {
  if (!std::isfinite(value)) return "-";
  const bool is_log = s.transform == "log";
  return (value >= 0 ? sign : "") + short_text(is_log ? 100 * value : value, 2) + (is_log ? " %" : "");
}

std::string per_cent(double share) {
  return fixed_text(100 * share, 0);
}

std::string coverage_text(const RecoverySummary& s) {
  const Share share = share_interval(s.inside, s.draws);
  return std::to_string(s.inside) + "/" + std::to_string(s.draws) + " (" + per_cent(share.low) + " to " +
         per_cent(share.high) + " %)";
}

const std::vector<std::string> kHeader = {
    "parameter",   "truth",          "bias",        "spread",
    "rms error",   "sigma reported", "sigma / rms", "95 % interval holds the truth",
    "undetermined"};

std::vector<std::string> cells(const RecoverySummary& s) {
  return {s.address,
          short_text(s.truth) + (s.unit.empty() ? "" : " " + s.unit),
          in_coordinate(s.bias, s, "+"),
          in_coordinate(s.spread, s),
          in_coordinate(s.rms, s),
          in_coordinate(s.sigma, s),
          std::isfinite(s.sigma) && s.rms > 0 ? short_text(s.sigma / s.rms, 2) : "-",
          coverage_text(s),
          s.undetermined > 0 ? std::to_string(s.undetermined) : ""};
}

std::string of_group(const RecoveryGroup& group) {
  const auto draws = answered(group);
  std::string text = counted(static_cast<long>(group.draws.size()), "draw");
  if (draws.size() < group.draws.size())
    text += ", " + std::to_string(group.draws.size() - draws.size()) + " without an answer";
  const auto number = [&](double (*value)(const RecoveryDraw&), int digits) {
    return short_text(median_of(draws, value), digits);
  };
  return text + "; medians: reduced chi-square " +
         number([](const RecoveryDraw& d) { return d.reduced_chi_square; }, 3) + ", residual " +
         number([](const RecoveryDraw& d) { return d.rms_px; }, 3) + " px, " +
         number([](const RecoveryDraw& d) -> double { return d.tracks; }, 4) + " tracks, " +
         number([](const RecoveryDraw& d) -> double { return d.forward_runs; }, 3) + " forward runs, " +
         number([](const RecoveryDraw& d) { return d.cpu_seconds; }, 3) + " CPU s, " +
         number([](const RecoveryDraw& d) { return d.seconds; }, 3) + " s";
}

void write_draws(const std::string& path, const std::vector<RecoveryGroup>& groups) {
  CsvTable table({{"case", ""},         {"variant", ""},   {"draw", ""},
                  {"status", ""},       {"parameter", ""}, {"unit", ""},
                  {"transform", ""},    {"truth", ""},     {"estimate", ""},
                  {"low95", ""},        {"high95", ""},    {"error", ""},
                  {"sigma", ""},        {"inside", ""},    {"reduced_chi_square", ""},
                  {"rms", "px"},        {"tracks", ""},    {"observations", ""},
                  {"forward_runs", ""}, {"cpu", "s"},      {"wall", "s"}});
  for (const RecoveryGroup& g : groups)
    for (const RecoveryDraw& d : g.draws) {
      const auto add = [&](const RecoveredParameter& p) {
        table.add_row({g.case_name,
                       g.variant,
                       std::int64_t{d.draw},
                       d.status,
                       p.address,
                       p.unit,
                       p.transform,
                       p.truth,
                       p.value,
                       p.low95,
                       p.high95,
                       p.error,
                       p.sigma,
                       std::string(p.is_inside() ? "yes" : "no"),
                       d.reduced_chi_square,
                       d.rms_px,
                       std::int64_t{d.tracks},
                       std::int64_t{d.observations},
                       std::int64_t{d.forward_runs},
                       d.cpu_seconds,
                       d.seconds});
      };
      if (d.parameters.empty()) add({"", "", "", kNan, kNan, kNan, kNan, kNan, kNan});
      for (const RecoveredParameter& p : d.parameters) add(p);
    }
  table.write(path);
}

void write_summary(const std::string& path, const std::vector<RecoveryGroup>& groups) {
  CsvTable table({{"case", ""},
                  {"variant", ""},
                  {"parameter", ""},
                  {"unit", ""},
                  {"transform", ""},
                  {"truth", ""},
                  {"draws", ""},
                  {"unanswered", ""},
                  {"undetermined", ""},
                  {"inside", ""},
                  {"coverage", ""},
                  {"coverage_low95", ""},
                  {"coverage_high95", ""},
                  {"bias", ""},
                  {"spread", ""},
                  {"rms_error", ""},
                  {"sigma", ""},
                  {"median_reduced_chi_square", ""},
                  {"median_forward_runs", ""},
                  {"median_cpu", "s"},
                  {"median_wall", "s"}});
  for (const RecoveryGroup& g : groups) {
    const auto draws = answered(g);
    for (const RecoverySummary& s : summarise(g)) {
      const Share share = share_interval(s.inside, s.draws);
      table.add_row({g.case_name,
                     g.variant,
                     s.address,
                     s.unit,
                     s.transform,
                     s.truth,
                     std::int64_t{s.draws},
                     static_cast<std::int64_t>(g.draws.size() - draws.size()),
                     std::int64_t{s.undetermined},
                     std::int64_t{s.inside},
                     double(s.inside) / s.draws,
                     share.low,
                     share.high,
                     s.bias,
                     s.spread,
                     s.rms,
                     s.sigma,
                     median_of(draws, [](const RecoveryDraw& d) { return d.reduced_chi_square; }),
                     median_of(draws, [](const RecoveryDraw& d) -> double { return d.forward_runs; }),
                     median_of(draws, [](const RecoveryDraw& d) { return d.cpu_seconds; }),
                     median_of(draws, [](const RecoveryDraw& d) { return d.seconds; })});
    }
  }
  table.write(path);
}

PlotAxis axis_of(const RecoverySummary& s, std::string name) {
  PlotAxis axis;
  axis.label = std::move(name) + (s.unit.empty() ? "" : " [" + s.unit + "]");
  axis.logarithmic = s.transform == "log";
  return axis;
}

/// The estimates of all draws by size, about the truth.
std::string draws_plot(const RecoveryGroup& group, const RecoverySummary& s) {
  IntervalPlot plot;
  plot.title = group.case_name + ": " + s.address + ", " + coverage_text(s);
  plot.axis = axis_of(s, "estimate and 95 % interval, dashed: truth");
  plot.reference = s.truth;
  for (const RecoveryDraw* d : answered(group))
    if (const RecoveredParameter* p = find(*d, s.address))
      plot.rows.push_back({"draw " + std::to_string(d->draw), p->value, p->low95, p->high95, std::nullopt,
                           p->is_inside() ? "" : "misses"});
  std::stable_sort(plot.rows.begin(), plot.rows.end(),
                   [](const PlotInterval& a, const PlotInterval& b) { return a.value < b.value; });
  return svg(plot);
}

/// The median estimate and interval of every variant, about the truth.
std::string variants_plot(const std::vector<const RecoveryGroup*>& groups, const RecoverySummary& first) {
  IntervalPlot plot;
  plot.title = groups.front()->case_name + ": " + first.address + ", medians of the draws";
  plot.axis = axis_of(first, "estimate and 95 % interval, dashed: truth");
  plot.reference = first.truth;
  for (const RecoveryGroup* g : groups)
    for (const RecoverySummary& s : summarise(*g)) {
      if (s.address != first.address) continue;
      std::vector<double> value, low, high;
      for (const RecoveryDraw* d : answered(*g))
        if (const RecoveredParameter* p = find(*d, s.address))
          value.push_back(p->value), low.push_back(p->low95), high.push_back(p->high95);
      plot.rows.push_back({g->variant, median(value), median(low), median(high), std::nullopt,
                           std::to_string(s.inside) + "/" + std::to_string(s.draws)});
    }
  return svg(plot);
}

const char* const kMeaning =
    "One truth, one texture and one camera per case: draws differ in the noise of the picture alone. Bias is "
    "the mean error, spread the standard deviation from draw to draw, both in the coordinate of the fit; of "
    "logarithms in hundredths, which are per cent while they are small. An error of the model is the same in "
    "all "
    "draws, so that a share of intervals that hold the truth near 0 or 100 % says on which side of the "
    "interval's half-width the bias lies; it is a frequency only where bias is small against spread. "
    "Brackets: 95 % interval of the share (Wilson).";

}  // namespace

Share share_interval(int k, int n) {
  if (n < 1) return {};
  const double z = 1.959963984540054, p = static_cast<double>(k) / n, z2n = z * z / n;
  const double middle = (p + z2n / 2) / (1 + z2n);
  const double half = z / (1 + z2n) * std::sqrt(p * (1 - p) / n + z2n / (4 * n));
  return {std::max(0.0, middle - half), std::min(1.0, middle + half)};
}

std::vector<RecoverySummary> summarise(const RecoveryGroup& group) {
  std::vector<RecoverySummary> all;
  const auto draws = answered(group);
  if (draws.empty()) return all;
  for (const RecoveredParameter& first : draws.front()->parameters) {
    RecoverySummary s{first.address, first.unit, first.transform, first.truth};
    std::vector<double> errors;
    double sigmas = 0;
    for (const RecoveryDraw* d : draws) {
      const RecoveredParameter* p = find(*d, first.address);
      if (p == nullptr) continue;
      errors.push_back(p->error);
      s.inside += p->is_inside();
      if (std::isfinite(p->sigma))
        sigmas += p->sigma;
      else
        ++s.undetermined;
    }
    const Eigen::Map<const VectorXd> e(errors.data(), static_cast<Eigen::Index>(errors.size()));
    s.draws = static_cast<int>(errors.size());
    s.bias = e.mean();
    s.rms = std::sqrt(e.squaredNorm() / s.draws);
    s.spread = s.draws > 1 ? std::sqrt((e.array() - s.bias).square().sum() / (s.draws - 1)) : kNan;
    s.sigma = s.draws > s.undetermined ? sigmas / (s.draws - s.undetermined) : kNan;
    all.push_back(std::move(s));
  }
  return all;
}

std::string write_recovery_report(const std::string& folder, const std::vector<RecoveryGroup>& groups) {
  write_draws(folder + "/recovery.csv", groups);
  write_summary(folder + "/summary.csv", groups);
  std::vector<std::string> cases;
  for (const RecoveryGroup& g : groups)
    if (std::find(cases.begin(), cases.end(), g.case_name) == cases.end()) cases.push_back(g.case_name);
  std::string markdown = "# Recovery\n\n" + std::string(kMeaning) + "\n";
  HtmlPage page("Recovery", "what repeated twin experiments find again");
  page.paragraph(kMeaning);
  for (const std::string& name : cases) {
    markdown += "\n## " + name + "\n";
    page.section(file_names({name}).front(), name);
    std::vector<const RecoveryGroup*> of_case;
    for (const RecoveryGroup& g : groups)
      if (g.case_name == name && !answered(g).empty()) of_case.push_back(&g);
    for (const RecoveryGroup& g : groups) {
      if (g.case_name != name) continue;
      const std::string account = of_group(g);
      markdown += "\n**" + g.variant + "** (" + g.description + "): " + account + ".\n\n|";
      HtmlTable table{kHeader, {}, g.variant + " (" + g.description + "): " + account};
      for (const std::string& h : kHeader) markdown += " " + h + " |";
      markdown += "\n|";
      for (std::size_t k = 0; k < kHeader.size(); ++k) markdown += " --- |";
      for (const RecoverySummary& s : summarise(g)) {
        table.rows.emplace_back();
        markdown += "\n|";
        for (const std::string& cell : cells(s)) {
          table.rows.back().push_back(cell);
          markdown += " " + cell + " |";
        }
      }
      markdown += "\n";
      page.table(table);
    }
    if (of_case.empty()) continue;
    const auto summaries = summarise(*of_case.front());
    std::vector<std::string> addresses;
    for (const RecoverySummary& s : summaries) addresses.push_back(s.address.substr(1));
    const std::vector<std::string> files = file_names(addresses);
    for (std::size_t k = 0; k < summaries.size(); ++k) {
      const std::string base = folder + "/" + file_names({name}).front() + "_" + files[k];
      const std::string draws = draws_plot(*of_case.front(), summaries[k]);
      const std::string variants = variants_plot(of_case, summaries[k]);
      write_file(base + "_draws.svg", draws);
      write_file(base + "_variants.svg", variants);
      page.begin_row();
      page.svg_figure(draws, addresses[k] + " by draw", of_case.front()->variant + ": every draw");
      page.svg_figure(variants, addresses[k] + " by variant", "Medians of every variant");
      page.end_row();
    }
  }
  write_file(folder + "/recovery.md", markdown);
  write_file(folder + "/index.html", page.finish());
  return markdown;
}

}  // namespace rhytid::tools
