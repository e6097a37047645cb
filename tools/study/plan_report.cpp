#include <algorithm>
#include <cmath>

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

/// One line of the tables: what would be known with these swipes and those filmed already.
struct Row {
  std::string name;
  Posterior posterior;
};

/// What is known now, with each swipe, and with all of them.
std::vector<Row> rows(const Plan& plan) {
  const auto with = [&](const std::vector<int>& swipes) {
    return adjoint::posterior(plan.roots, and_filmed(plan, swipes), plan.priors);
  };
  std::vector<Row> list = {{plan.filmed.empty() ? "before any" : "filmed so far", with({})}};
  std::vector<int> all;
  for (int s = 0; s < static_cast<int>(plan.swipes.size()); ++s) {
    list.push_back({plan.swipes[s], with({s})});
    all.push_back(s);
  }
  list.push_back({"all of them", with(all)});
  return list;
}

/// exp of the standard deviation of a log parameter, as a percentage while that reads well.
std::string deviation_text(double deviation) {
  return deviation < 0.3 ? short_text(100 * deviation, 2) + " %" : "x " + short_text(std::exp(deviation), 2);
}

double bits(const Plan& plan, const Row& row) {
  return adjoint::information_gain_bits(row.posterior, plan.priors);
}

void write_tables(const std::string& folder, const Plan& plan) {
  std::vector<CsvColumn> columns = {{"swipe", ""}, {"D", ""}, {"A", ""}, {"information", "bits"}};
  for (const ParameterSpec& p : plan.parameters) columns.push_back({p.address, ""});
  CsvTable swipes(columns);
  for (const Row& row : rows(plan)) {
    std::vector<CsvCell> cells = {row.name, row.posterior.log_det, row.posterior.trace, bits(plan, row)};
    for (const double deviation : row.posterior.deviations()) cells.emplace_back(deviation);
    swipes.add_row(std::move(cells));
  }
  swipes.write(folder + "/swipes.csv");
  CsvTable pairs({{"criterion", ""}, {"first", ""}, {"second", ""}, {"value", ""}});
  CsvTable order({{"criterion", ""}, {"step", ""}, {"swipe", ""}, {"value", ""}});
  for (const DesignCriterion criterion : kCriteria) {
    const std::string name = adjoint::name(criterion);
    for (const auto& pair : adjoint::ranked_pairs(plan.roots, plan.priors, criterion, plan.filmed))
      pairs.add_row({name, plan.swipes[pair.first], plan.swipes[pair.second], pair.value});
    std::int64_t step = 0;
    for (const auto& next : adjoint::greedy_design(plan.roots, plan.priors, criterion, plan.filmed,
                                                   static_cast<int>(plan.swipes.size())))
      order.add_row({name, ++step, plan.swipes[next.experiment], next.value});
  }
  pairs.write(folder + "/pairs.csv");
  order.write(folder + "/order.csv");
}

/// "D: sideways, then up (-12.3), then ..." for both criteria, and the best pairs.
std::vector<std::string> recommendations(const Plan& plan) {
  std::vector<std::string> lines;
  for (const DesignCriterion criterion : kCriteria) {
    const std::string what = criterion == DesignCriterion::d_optimality
                                 ? "By D (volume of what remains possible)"
                                 : "By A (sum of the variances)";
    const auto steps = adjoint::greedy_design(plan.roots, plan.priors, criterion, plan.filmed,
                                              static_cast<int>(plan.swipes.size()));
    std::string line = what + ": film next";
    for (std::size_t i = 0; i < steps.size(); ++i)
      line += (i == 0 ? " " : ", then ") + plan.swipes[steps[i].experiment] + " (" +
              short_text(steps[i].value, 3) + ")";
    if (steps.empty()) line = what + ": all are filmed";
    lines.push_back(line + ".");
    const auto pairs = adjoint::ranked_pairs(plan.roots, plan.priors, criterion, plan.filmed);
    if (!pairs.empty())
      lines.push_back(what + ": the best pair is " + plan.swipes[pairs[0].first] + " with " +
                      plan.swipes[pairs[0].second] + " (" + short_text(pairs[0].value, 3) + ").");
  }
  return lines;
}

std::string posterior_plot(const Plan& plan) {
  BarChart chart;
  chart.title = "Standard deviations of log parameters";
  chart.y.label = "deviation";
  chart.y.logarithmic = true;
  const std::vector<Row> list = rows(plan);
  for (const Row& row : list) chart.series.push_back(row.name);
  for (std::size_t k = 0; k < plan.parameters.size(); ++k) {
    BarGroup group{plan.parameters[k].name, {}, {}};
    for (const Row& row : list)
      group.values.push_back(row.posterior.deviations()[static_cast<Eigen::Index>(k)]);
    chart.groups.push_back(std::move(group));
  }
  chart.width = std::max(800, 60 + static_cast<int>(plan.parameters.size() * (24 + 7 * list.size())));
  chart.height = 460;
  return svg(chart);
}

}  // namespace

std::string plan_text(const Plan& plan, const PlanOptions& options) {
  const std::vector<Row> list = rows(plan);
  std::vector<std::string> header = {"deviation of"}, information = {"information, bits"}, D = {"D"},
                           A = {"A"};
  for (const Row& row : list) {
    header.push_back(row.name);
    information.push_back(short_text(bits(plan, row), 3));
    D.push_back(short_text(row.posterior.log_det, 3));
    A.push_back(short_text(row.posterior.trace, 3));
  }
  TextTable table(header);
  for (std::size_t k = 0; k < plan.parameters.size(); ++k) {
    std::vector<std::string> cells = {plan.parameters[k].name};
    for (const Row& row : list)
      cells.push_back(deviation_text(row.posterior.deviations()[static_cast<Eigen::Index>(k)]));
    table.add(std::move(cells));
  }
  table.add(information), table.add(D), table.add(A);
  std::string text = "Predicted: " + options.tracks.text() + "." + "\n\n" + table.text() + "\n";
  for (const std::string& line : recommendations(plan)) text += line + "\n";
  for (const std::string& line : plan.left_out) text += "Left out: " + line + "\n";
  return text;
}

void write_plan(const std::string& folder, const Experiment& experiment, const Plan& plan,
                const PlanOptions& options) {
  write_tables(folder, plan);
  write_file(folder + "/plan.txt", plan_text(plan, options));
  const std::string plot = posterior_plot(plan);
  write_file(folder + "/posterior.svg", plot);

  HtmlPage page("What to film: " + experiment.name, experiment.description);
  page.section("next", "What to film next");
  page.paragraph("Predicted to first order, at the scene's own values: " + options.tracks.text() + ".");
  page.list(recommendations(plan));
  for (const std::string& line : plan.left_out) page.note("Left out: " + line);
  page.section("posterior", "What each swipe would tell");
  HtmlTable table;
  table.header = {"deviation of"};
  table.caption = "Predicted standard deviations, each swipe with the prior and what is filmed";
  table.wide = true;
  const std::vector<Row> list = rows(plan);
  for (const Row& row : list) table.header.push_back(row.name);
  for (std::size_t k = 0; k < plan.parameters.size(); ++k) {
    std::vector<TableCell> cells = {plan.parameters[k].name};
    for (const Row& row : list)
      cells.emplace_back(deviation_text(row.posterior.deviations()[static_cast<Eigen::Index>(k)]));
    table.rows.push_back(std::move(cells));
  }
  std::vector<TableCell> information = {"information [bits]"}, D = {"D"}, A = {"A"};
  for (const Row& row : list) {
    information.emplace_back(short_text(bits(plan, row), 3));
    D.emplace_back(short_text(row.posterior.log_det, 3));
    A.emplace_back(short_text(row.posterior.trace, 3));
  }
  for (auto* last : {&information, &D, &A}) table.rows.push_back(std::move(*last));
  page.table(table);
  page.svg_figure(plot, "predicted deviations per parameter and swipe", "Predicted standard deviations");
  page.section("pairs", "Pairs");
  for (const DesignCriterion criterion : kCriteria) {
    HtmlTable pairs;
    pairs.header = {"first", "second", adjoint::name(criterion)};
    pairs.text_columns = 2;
    pairs.caption = std::string("Best pairs by ") + adjoint::name(criterion);
    const auto ranked = adjoint::ranked_pairs(plan.roots, plan.priors, criterion, plan.filmed);
    for (std::size_t i = 0; i < std::min(ranked.size(), kPairsShown); ++i)
      pairs.rows.push_back(
          {plan.swipes[ranked[i].first], plan.swipes[ranked[i].second], short_text(ranked[i].value, 4)});
    if (!pairs.rows.empty()) page.table(pairs);
  }
  page.section("correlations", "Correlations with all swipes");
  std::vector<std::string> names;
  for (const ParameterSpec& p : plan.parameters) names.push_back(p.name);
  page.table(
      correlation_table(names, list.back().posterior.correlation(), "Correlations that all swipes leave"));
  write_file(folder + "/index.html", page.finish());
}

}  // namespace rhytid::tools
