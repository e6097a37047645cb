#include <algorithm>

#include "sim/output/atomic_file.h"
#include "sim/output/csv.h"
#include "sim/output/plot.h"
#include "sim/output/text.h"
#include "tools/report/html.h"
#include "tools/study/plan.h"
#include "tools/study/study_page.h"

namespace rhytid::tools {
namespace {

using adjoint::DesignCriterion;
using adjoint::Posterior;

constexpr DesignCriterion kCriteria[] = {DesignCriterion::d_optimality, DesignCriterion::a_optimality};
constexpr std::size_t kPairsShown = 10;

std::vector<int> and_filmed(const Plan& plan, std::vector<int> swipes) {
  for (const int f : plan.filmed)
    if (std::find(swipes.begin(), swipes.end(), f) == swipes.end()) swipes.push_back(f);
  return swipes;
}

/// What would be known with some swipes and those filmed already.
struct Row {
  std::string name;
  Posterior posterior;
  VectorXd deviations;  ///< of the coordinates
  double bits = 0;      ///< information over the priors
};

/// What one criterion says of pairs, and of the order in which to film.
struct Advice {
  DesignCriterion criterion;
  std::vector<adjoint::DesignPair> pairs;
  std::vector<adjoint::DesignStep> order;
};

/// All that tables, text and page say.
struct Findings {
  std::vector<Row> rows;  ///< known now, with each swipe, with all of them
  std::vector<Advice> advice;
};

Findings findings_of(const Plan& plan) {
  Findings found;
  const auto add = [&](const std::string& name, const std::vector<int>& swipes) {
    Row row{name, adjoint::posterior(plan.roots, and_filmed(plan, swipes), plan.priors), {}, 0};
    row.deviations = row.posterior.deviations();
    row.bits = adjoint::information_gain_bits(row.posterior, plan.priors);
    found.rows.push_back(std::move(row));
  };
  add(plan.filmed.empty() ? "before any" : "filmed so far", {});
  std::vector<int> all;
  for (int s = 0; s < static_cast<int>(plan.swipes.size()); ++s) {
    add(plan.swipes[s], {s});
    all.push_back(s);
  }
  add("all of them", all);
  for (const DesignCriterion criterion : kCriteria)
    found.advice.push_back({criterion, adjoint::ranked_pairs(plan.roots, plan.priors, criterion, plan.filmed),
                            adjoint::greedy_design(plan.roots, plan.priors, criterion, plan.filmed,
                                                   static_cast<int>(plan.swipes.size()))});
  return found;
}

/// The table of text and page, header first: a row per parameter, then what sums up, a column per line of rows.
std::vector<std::vector<std::string>> cells(const Plan& plan, const std::vector<Row>& rows) {
  std::vector<std::vector<std::string>> table = {{"deviation of"}};
  for (const ParameterSpec& p : plan.parameters) table.push_back({p.name});
  for (const char* sum : {"information [bits]", "D", "A"}) table.push_back({sum});
  for (const Row& row : rows) {
    std::size_t line = 0;
    table[line++].push_back(row.name);
    for (std::size_t k = 0; k < plan.parameters.size(); ++k)
      table[line++].push_back(deviation_text(row.deviations[static_cast<Eigen::Index>(k)],
                                             plan.coordinates[k], plan.parameters[k].unit));
    for (const double sum : {row.bits, row.posterior.log_det, row.posterior.trace})
      table[line++].push_back(short_text(sum, 3));
  }
  return table;
}

void write_tables(const std::string& folder, const Plan& plan, const Findings& found) {
  std::vector<CsvColumn> columns = {{"swipe", ""}, {"D", ""}, {"A", ""}, {"information", "bits"}};
  for (const ParameterSpec& p : plan.parameters) columns.push_back({p.address, ""});
  CsvTable swipes(columns);
  for (const Row& row : found.rows) {
    std::vector<CsvCell> line = {row.name, row.posterior.log_det, row.posterior.trace, row.bits};
    for (const double deviation : row.deviations) line.emplace_back(deviation);
    swipes.add_row(std::move(line));
  }
  swipes.write(folder + "/swipes.csv");
  CsvTable pairs({{"criterion", ""}, {"first", ""}, {"second", ""}, {"value", ""}});
  CsvTable order({{"criterion", ""}, {"step", ""}, {"swipe", ""}, {"value", ""}});
  for (const Advice& advice : found.advice) {
    const std::string name = adjoint::name(advice.criterion);
    for (const auto& pair : advice.pairs)
      pairs.add_row({name, plan.swipes[pair.first], plan.swipes[pair.second], pair.value});
    std::int64_t step = 0;
    for (const auto& next : advice.order)
      order.add_row({name, ++step, plan.swipes[next.experiment], next.value});
  }
  pairs.write(folder + "/pairs.csv");
  order.write(folder + "/order.csv");
}

/// "D: sideways, then up (-12.3), then ..." for both criteria, and the best pairs.
std::vector<std::string> recommendations(const Plan& plan, const std::vector<Advice>& all) {
  std::vector<std::string> lines;
  for (const Advice& advice : all) {
    const std::string what = advice.criterion == DesignCriterion::d_optimality
                                 ? "By D (volume of what remains possible)"
                                 : "By A (sum of the variances)";
    std::string line = what + ": film next";
    for (std::size_t i = 0; i < advice.order.size(); ++i)
      line += (i == 0 ? " " : ", then ") + plan.swipes[advice.order[i].experiment] + " (" +
              short_text(advice.order[i].value, 3) + ")";
    if (advice.order.empty()) line = what + ": all are filmed";
    lines.push_back(line + ".");
    if (advice.pairs.empty()) continue;
    const auto& best = advice.pairs.front();
    lines.push_back(what + ": the best pair is " + plan.swipes[best.first] + " with " +
                    plan.swipes[best.second] + " (" + short_text(best.value, 3) + ").");
  }
  return lines;
}

std::string posterior_plot(const Plan& plan, const std::vector<Row>& rows) {
  BarChart chart;
  chart.title = "Standard deviations of coordinates";
  chart.y.label = "deviation, in units of each coordinate";
  chart.y.logarithmic = true;
  for (const Row& row : rows) chart.series.push_back(row.name);
  for (std::size_t k = 0; k < plan.parameters.size(); ++k) {
    BarGroup group{plan.parameters[k].name, {}, {}};
    for (const Row& row : rows) group.values.push_back(row.deviations[static_cast<Eigen::Index>(k)]);
    chart.groups.push_back(std::move(group));
  }
  chart.width = std::max(800, 60 + static_cast<int>(plan.parameters.size() * (24 + 7 * rows.size())));
  chart.height = 460;
  return svg(chart);
}

std::string text_of(const Plan& plan, const PlanOptions& options, const Findings& found,
                    const std::vector<std::string>& advice) {
  const auto lines = cells(plan, found.rows);
  TextTable table(lines.front());
  for (std::size_t i = 1; i < lines.size(); ++i) table.add(lines[i]);
  std::string text = "Predicted: " + options.tracks.text() + "." + "\n\n" + table.text() + "\n";
  for (const std::string& line : advice) text += line + "\n";
  for (const std::string& line : plan.left_out) text += "Left out: " + line + "\n";
  return text;
}

}  // namespace

const std::vector<std::string>& plan_files() {
  static const std::vector<std::string> files = {"swipes.csv",    "pairs.csv", "order.csv",
                                                 "posterior.svg", "plan.txt",  "index.html"};
  return files;
}

std::string write_plan(const std::string& folder, const Experiment& experiment, const Plan& plan,
                       const PlanOptions& options) {
  const Findings found = findings_of(plan);
  const std::vector<std::string> advice = recommendations(plan, found.advice);
  write_tables(folder, plan, found);
  std::string text = text_of(plan, options, found, advice);
  write_file(folder + "/plan.txt", text);
  const std::string plot = posterior_plot(plan, found.rows);
  write_file(folder + "/posterior.svg", plot);

  HtmlPage page("What to film: " + experiment.name, experiment.description);
  page.section("next", "What to film next");
  page.paragraph("Predicted to first order, at the scene's own values: " + options.tracks.text() + ".");
  page.list(advice);
  for (const std::string& line : plan.left_out) page.note("Left out: " + line);
  page.section("posterior", "What each swipe would tell");
  HtmlTable table;
  table.caption = "Predicted standard deviations, each swipe with the prior and what is filmed";
  table.wide = true;
  for (const std::vector<std::string>& line : cells(plan, found.rows)) {
    if (table.header.empty())
      table.header = line;
    else
      table.rows.emplace_back(line.begin(), line.end());
  }
  page.table(table);
  page.svg_figure(plot, "predicted deviations per parameter and swipe",
                  "Predicted standard deviations of coordinates: logs, logits of fractions, units of places");
  page.section("pairs", "Pairs");
  for (const Advice& advised : found.advice) {
    HtmlTable pairs;
    const std::string name = adjoint::name(advised.criterion);
    pairs.header = {"first", "second", name};
    pairs.text_columns = 2;
    pairs.caption = "Best pairs by " + name;
    for (std::size_t i = 0; i < std::min(advised.pairs.size(), kPairsShown); ++i)
      pairs.rows.push_back({plan.swipes[advised.pairs[i].first], plan.swipes[advised.pairs[i].second],
                            short_text(advised.pairs[i].value, 4)});
    if (!pairs.rows.empty()) page.table(pairs);
  }
  page.section("correlations", "Correlations with all swipes");
  std::vector<std::string> names;
  for (const ParameterSpec& p : plan.parameters) names.push_back(p.name);
  page.table(correlation_table(names, found.rows.back().posterior.correlation(),
                               "Correlations that all swipes leave"));
  write_file(folder + "/index.html", page.finish());
  return text;
}

}  // namespace rhytid::tools
