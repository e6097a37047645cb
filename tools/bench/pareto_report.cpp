#include "tools/bench/pareto_report.h"

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <filesystem>
#include <optional>

#include "sim/output/atomic_file.h"
#include "sim/output/csv.h"
#include "sim/output/plot.h"
#include "tools/bench/pareto_variant.h"

namespace rhytid::tools {
namespace {

constexpr Rgb kGrey{150, 150, 150};

/// Columns `first` to the last of a table of numbers.
MatrixXd columns_from(const std::string& path, std::size_t first) {
  const auto table = read_number_table(path);
  const auto rows = static_cast<Eigen::Index>(table[0].second.size());
  MatrixXd m(rows, static_cast<Eigen::Index>(table.size() - first));
  for (std::size_t k = first; k < table.size(); ++k)
    for (Eigen::Index i = 0; i < rows; ++i)
      m(i, static_cast<Eigen::Index>(k - first)) = table[k].second[static_cast<std::size_t>(i)];
  return m;
}

std::optional<double> value_of(const VariantResult& result, const std::string& column) {
  for (const ResultColumn& c : result.columns)
    if (c.name == column) return c.value;
  return std::nullopt;
}

double number_of(const VariantResult& result, const std::string& column) {
  return value_of(result, column).value_or(std::nan(""));
}

/// Sums over the rows that both have.
struct Difference {
  double square = 0, of_reference = 0;
  long rows = 0;
};
Difference difference_of(const MatrixXd& a, const MatrixXd& b) {
  Difference d;
  if (a.rows() != b.rows() || a.cols() != b.cols()) return d;
  for (Eigen::Index i = 0; i < a.rows(); ++i) {
    if (!a.row(i).allFinite() || !b.row(i).allFinite()) continue;
    d.square += (a.row(i) - b.row(i)).squaredNorm();
    d.of_reference += b.row(i).squaredNorm();
    ++d.rows;
  }
  return d;
}

VectorXd gradient_of(const VariantResult& result) {
  std::vector<double> values;
  for (const ResultColumn& c : result.columns)
    if (c.name.starts_with(gradient_column) && c.value) values.push_back(*c.value);
  return Eigen::Map<const VectorXd>(values.data(), static_cast<Eigen::Index>(values.size()));
}

std::string formatted(const char* format, double value) {
  if (!std::isfinite(value)) return "-";
  char text[32];
  std::snprintf(text, sizeof text, format, value);
  return text;
}

/// A variant in the tables of a group.
struct Row {
  const ParetoRun* run;
  std::map<std::string, double> errors;
  std::map<std::string, bool> front;

  double error(const std::string& measure) const {
    const auto found = errors.find(measure);
    return found == errors.end() ? std::nan("") : found->second;
  }
  /// A derivative takes the run and the sweep.
  double seconds(const std::string& measure) const {
    const double run_seconds = number_of(run->result, "cpu");
    return measure == "gradient" ? run_seconds + number_of(run->result, "adjoint_cpu") : run_seconds;
  }
};

std::vector<Row> rows_of(const ComparisonGroup& group, const std::map<std::string, ParetoRun>& runs) {
  std::vector<Row> rows;
  const auto reference = runs.find(group.reference);
  if (reference == runs.end()) return rows;
  for (const std::string& name : group.variants)
    if (const auto run = runs.find(name); run != runs.end())
      rows.push_back({&run->second, errors_against(run->second, reference->second), {}});
  for (const std::string& measure : pareto_measures()) {
    std::vector<ParetoPoint> points;
    for (const Row& row : rows) points.push_back({row.seconds(measure), row.error(measure)});
    const std::vector<bool> front = pareto_front(points);
    for (std::size_t k = 0; k < rows.size(); ++k) rows[k].front[measure] = front[k];
  }
  std::sort(rows.begin(), rows.end(),
            [](const Row& a, const Row& b) { return a.seconds("") < b.seconds(""); });
  return rows;
}

void plot(const std::string& path, const std::string& title, const std::string& measure,
          const std::vector<Row>& rows) {
  PlotSeries others, front;
  others.label = "others", front.label = "nothing is better";
  others.style = PlotStyle::points, front.style = PlotStyle::line_and_points;
  others.colour = kGrey;
  for (const Row& row : rows) {
    PlotSeries& series = row.front.at(measure) ? front : others;
    if (!(row.error(measure) > 0)) continue;
    series.x.push_back(row.seconds(measure));
    series.y.push_back(row.error(measure));
    series.names.push_back(row.run->result.name);
  }
  std::error_code ignored;  // of an earlier report
  std::filesystem::remove(path, ignored);
  if (front.x.empty()) return;
  LinePlot plot;
  plot.title = title;
  plot.x.label = measure == "gradient" ? "CPU time of run and adjoint [s]" : "CPU time [s]";
  plot.y.label = "relative error of " + measure;
  plot.x.logarithmic = plot.y.logarithmic = true;
  plot.width = 900, plot.height = 560;
  // Room for the names beside the points.
  double least = front.x[0], most = front.x[0];
  for (const PlotSeries* s : {&others, &front})
    for (const double x : s->x) least = std::min(least, x), most = std::max(most, x);
  const double room = std::max(std::pow(most / least, 0.25), 1.2);
  plot.x.minimum = least / std::sqrt(room), plot.x.maximum = most * room;
  plot.series = {std::move(others), std::move(front)};
  write_file(path, svg(plot));
}

}  // namespace

const std::vector<std::string>& pareto_measures() {
  static const std::vector<std::string> measures = {"displacement", "wavelength", "amplitude",
                                                    "force",        "energy",     "gradient"};
  return measures;
}

ParetoRun read_pareto_run(const std::string& folder, VariantResult result) {
  ParetoRun run;
  run.result = std::move(result);
  run.displacements = columns_from(folder + "/displacements.csv", 2);
  if (run.result.status == "complete") run.forces = columns_from(folder + "/forces.csv", 1);
  return run;
}

std::vector<bool> pareto_front(const std::vector<ParetoPoint>& points) {
  std::vector<bool> front;
  for (const ParetoPoint& p : points) {
    const bool beaten = std::any_of(points.begin(), points.end(), [&p](const ParetoPoint& other) {
      return (other.error < p.error && other.seconds <= p.seconds) ||
             (other.error <= p.error && other.seconds < p.seconds);
    });
    front.push_back(std::isfinite(p.error) && std::isfinite(p.seconds) && !beaten);
  }
  return front;
}

std::map<std::string, double> errors_against(const ParetoRun& run, const ParetoRun& reference) {
  std::map<std::string, double> errors;
  const Difference moved = difference_of(run.displacements, reference.displacements),
                   pushed = difference_of(run.forces, reference.forces);
  if (moved.of_reference > 0) {
    errors["displacement_mm"] = std::sqrt(moved.square / static_cast<double>(moved.rows));
    errors["displacement"] = std::sqrt(moved.square / moved.of_reference);
  }
  if (pushed.of_reference > 0) errors["force"] = std::sqrt(pushed.square / pushed.of_reference);
  for (const auto& [measure, column] :
       {std::pair{"wavelength", "wavelength"}, {"amplitude", "amplitude"}, {"energy", "stored_energy"}}) {
    const double truth = number_of(reference.result, column),
                 error = std::abs(number_of(run.result, column) - truth);
    if (truth > 0 && std::isfinite(error)) errors[measure] = error / truth;
  }
  const VectorXd gradient = gradient_of(run.result), truth = gradient_of(reference.result);
  if (truth.size() > 0 && gradient.size() == truth.size() && truth.norm() > 0)
    errors["gradient"] = (gradient - truth).norm() / truth.norm();
  return errors;
}

std::string write_pareto_report(const std::string& folder, const std::string& title,
                                const std::vector<ComparisonGroup>& groups,
                                const std::map<std::string, ParetoRun>& runs) {
  std::vector<CsvColumn> header = {{"group", ""},
                                   {"variant", ""},
                                   {"status", ""},
                                   {"nodes", ""},
                                   {"steps", ""},
                                   {"iterations", ""},
                                   {"factorisations", ""},
                                   {"cpu", "s"},
                                   {"adjoint_cpu", "s"},
                                   {"peak_memory", "MB"},
                                   {"crests", ""},
                                   {"wavelength", "mm"},
                                   {"amplitude", "mm"},
                                   {"stored_energy", "mJ"},
                                   {"displacement_error", "mm"}};
  for (const std::string& measure : pareto_measures()) {
    header.push_back({measure + "_relative_error", ""});
    header.push_back({measure + "_front", ""});
  }
  CsvTable csv(header);
  std::string markdown =
      "# " + title +
      "\n\nErrors against the reference of each group, relative unless a unit is given; bold: "
      "nothing is better in less CPU time.\n";
  for (const ComparisonGroup& group : groups) {
    const std::vector<Row> rows = rows_of(group, runs);
    std::vector<std::string> shown;  // measures that someone has
    for (const std::string& measure : pareto_measures())
      if (std::any_of(rows.begin(), rows.end(),
                      [&](const Row& row) { return std::isfinite(row.error(measure)); }))
        shown.push_back(measure);
    const auto add = [&](const Row& row, bool is_reference) {
      const VariantResult& r = row.run->result;
      std::vector<CsvCell> cells = {group.name, r.name, is_reference ? std::string("reference") : r.status};
      for (const char* column : {"nodes", "steps", "iterations", "factorisations", "cpu", "adjoint_cpu",
                                 "peak_memory", "crests", "wavelength", "amplitude", "stored_energy"})
        cells.emplace_back(number_of(r, column));
      cells.emplace_back(row.error("displacement_mm"));
      for (const std::string& measure : pareto_measures()) {
        cells.emplace_back(row.error(measure));
        const auto front = row.front.find(measure);
        cells.emplace_back(std::int64_t{front != row.front.end() && front->second ? 1 : 0});
      }
      csv.add_row(std::move(cells));
      markdown += "| " + r.name + (is_reference ? " (reference)" : "") + " | " +
                  formatted("%.0f", number_of(r, "nodes")) + " | " +
                  formatted("%.0f", number_of(r, "iterations")) + " | " +
                  formatted("%.3g", number_of(r, "cpu")) + " | " +
                  formatted("%.3g", number_of(r, "adjoint_cpu")) + " | " +
                  formatted("%.0f", number_of(r, "peak_memory")) + " |";
      if (r.status != "complete") {
        markdown += " " + r.reason + " |\n";
        return;
      }
      markdown += " " + formatted("%.2g", row.error("displacement_mm")) + " |";
      for (const std::string& measure : shown) {
        const auto front = row.front.find(measure);
        const char* mark = front != row.front.end() && front->second ? "**" : "";
        markdown += std::string(" ") + mark + formatted("%.2g", row.error(measure)) + mark + " |";
      }
      markdown += "\n";
    };
    markdown += "\n## " + group.name +
                "\n\n| variant | nodes | iterations | CPU s | adjoint s | MB | displacement, mm |";
    for (const std::string& measure : shown) markdown += " " + measure + " |";
    markdown += "\n|";
    for (std::size_t k = 0; k < 7 + shown.size(); ++k) markdown += " --- |";
    markdown += "\n";
    for (const Row& row : rows) add(row, false);
    if (const auto reference = runs.find(group.reference); reference != runs.end())
      add({&reference->second, {}, {}}, true);
    for (const std::string& measure : pareto_measures())
      plot(folder + "/" + group.name + "_" + measure + ".svg", title + ", " + group.name + ": " + measure,
           measure, rows);
  }
  csv.write(folder + "/pareto.csv");
  write_file(folder + "/pareto.md", markdown);
  return markdown;
}

}  // namespace rhytid::tools
