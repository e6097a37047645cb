#include <algorithm>
#include <cmath>
#include <cstdio>
#include <map>
#include <nlohmann/json.hpp>

#include "fitting/fit.h"
#include "fitting/measured_unit.h"
#include "sim/core/error.h"
#include "sim/output/atomic_file.h"
#include "sim/scene/parameter.h"

namespace rhytid::fitting {
namespace {

using Row = std::vector<std::string>;

std::string number(double x) {
  char text[32];
  std::snprintf(text, sizeof(text), "%.4g", x);
  return text;
}

Row table_row(const std::string& name, const std::string& unit, const std::string& initial, double value,
              double low, double high, bool determined, const std::optional<double>& truth, bool has_truth) {
  Row row = {name, unit, initial, number(value), number(low) + " .. " + number(high)};
  if (!determined) row[4] += " (not determined)";
  if (!has_truth) return row;
  if (!truth) {
    row.insert(row.end(), {"", "", ""});
    return row;
  }
  char error[32];
  std::snprintf(error, sizeof(error), "%+.1f", 100 * (value / *truth - 1));
  // An interval that says nothing holds everything.
  const char* inside = !determined ? "-" : *truth >= low && *truth <= high ? "yes" : "no";
  row.insert(row.end(), {number(*truth), error, inside});
  return row;
}

/// Characters, not bytes: units hold µ and ².
std::size_t length(const std::string& text) {
  return std::count_if(text.begin(), text.end(), [](char c) { return (c & 0xC0) != 0x80; });
}

std::string layout(const std::vector<Row>& rows) {
  std::vector<std::size_t> width(rows.front().size(), 0);
  for (const Row& row : rows)
    for (std::size_t c = 0; c < row.size(); ++c) width[c] = std::max(width[c], length(row[c]));
  std::string text;
  for (const Row& row : rows) {
    std::string line;
    for (std::size_t c = 0; c < row.size(); ++c) {
      const std::string padding(width[c] - length(row[c]), ' ');
      // Text to the left, numbers to the right.
      line += c < 2 ? row[c] + padding : padding + row[c];
      line += "  ";
    }
    line.erase(line.find_last_not_of(' ') + 1);
    text += line + "\n";
  }
  return text;
}

/// What each clip contributed, camera by camera where it had several.
std::string clip_table(const FitResult& result) {
  std::vector<Row> rows = {{"clip", "camera", "frames", "tracks", "observations", "rms px", "chi-square"}};
  for (const FittedClip& clip : result.clips) {
    const bool is_single = clip.views.size() == 1;
    rows.push_back({clip.name, is_single ? clip.views[0].camera : "all", std::to_string(clip.frames),
                    std::to_string(clip.num_tracks), std::to_string(clip.num_observations),
                    number(clip.rms_px), number(clip.reduced_chi_square)});
    if (is_single) continue;
    for (const FittedView& view : clip.views)
      rows.push_back({"", view.camera, "", std::to_string(view.num_tracks),
                      std::to_string(view.num_observations), number(view.rms_px), ""});
  }
  return layout(rows);
}

/// A line per quantity that was measured besides pixels.
std::string measured_lines(const FitResult& result) {
  struct Sum {
    int count = 0, known = 0;  ///< of the latter a deviation is known
    double squares = 0, whitened = 0;
  };
  std::map<std::string, Sum> sums;
  for (const FittedMeasurement& m : result.measured) {
    Sum& sum = sums[m.quantity];
    ++sum.count;
    sum.squares += (m.value - m.predicted) * (m.value - m.predicted);
    if (m.sigma > 0) ++sum.known, sum.whitened += std::pow((m.value - m.predicted) / m.sigma, 2);
  }
  std::string text;
  for (const auto& [quantity, sum] : sums)
    text += quantity + ": " + std::to_string(sum.count) + " values, off by " +
            number(std::sqrt(sum.squares / sum.count)) + " " + measured_unit(quantity) + " rms, " +
            number(std::sqrt(sum.whitened / std::max(1, sum.known))) + " of their deviations.\n";
  return text;
}

std::string two_digits(double x) {
  char text[32];
  std::snprintf(text, sizeof(text), "%.2g", x);
  return text;
}

/// The view that would help most.
std::string further_view_line(const FitResult& result) {
  const FurtherView* best = nullptr;
  double best_mean = 0;
  for (const FurtherView& view : result.further_views) {
    double sum = 0;
    int count = 0;
    for (const double ratio : view.ratios)
      if (ratio > 0) sum += std::log(ratio), ++count;
    if (count == 0 || (best != nullptr && sum / count >= best_mean)) continue;
    best = &view, best_mean = sum / count;
  }
  if (best == nullptr) return {};
  std::string list;
  for (std::size_t k = 0; k < best->ratios.size(); ++k)
    if (best->ratios[k] > 0)
      list += (list.empty() ? "" : ", ") + result.parameters[k].name + " " + two_digits(best->ratios[k]);
  return "Of further views, " + best->name +
         " would help most: deviations from noise would be so many times what they are: " + list + ".\n";
}

/// By how much finer variants and errors of held parameters would move the parameters: per cent, or the parameter's unit where it is
/// fitted as it is.
std::string shift_table(const FitResult& result) {
  std::vector<Row> rows = {{"would move by", "unit"}};
  std::string text;
  for (const SystematicShift& d : result.systematic) {
    if (d.failure.empty())
      rows[0].push_back(d.name);
    else
      text += "Not checked: " + d.change + ": " + d.failure + "\n";
  }
  if (rows[0].size() == 2) return text;
  for (std::size_t k = 0; k < result.parameters.size(); ++k) {
    const FittedParameter& p = result.parameters[k];
    const bool is_log = p.transform == "log";
    Row row = {p.name, is_log ? "%" : p.transform == "none" ? p.unit : "logit"};
    for (const SystematicShift& d : result.systematic)
      if (d.failure.empty()) {
        char moved[32] = "-";  // of what is not determined there is nothing to move
        const double value = is_log ? 100 * std::expm1(d.shift[k]) : d.shift[k];
        if (p.determined || std::fabs(d.shift[k]) < 1)
          std::snprintf(moved, sizeof(moved),
                        d.axes.empty() ? (is_log ? "%+.1f" : "%+.3g") : (is_log ? "±%.1f" : "±%.3g"), value);
        row.push_back(moved);
      }
    rows.push_back(std::move(row));
  }
  text += layout(rows);
  for (const SystematicShift& d : result.systematic)
    if (d.failure.empty())
      text += d.name + ": " + d.change +
              (d.rms_px > 0 ? " (moves the points by " + number(d.rms_px) + " px)\n" : "\n");
  return text;
}

/// The optima that searches from several starts ended at, the best first.
std::string start_table(const FitResult& result) {
  int num_optima = 0, searched = 0, runs = 0, failed = 0;
  for (const FittedStart& start : result.starts) {
    num_optima = std::max(num_optima, start.optimum);
    searched += start.status.empty() ? 0 : 1;
    failed += start.failure.empty() ? 0 : 1;
    runs += start.forward_runs;
  }
  std::vector<Row> rows = {{"optimum", "status", "from starts", "screened", "cost", "runs"}};
  for (const FittedParameter& p : result.parameters) rows[0].push_back(p.name);
  for (int m = 1; m <= num_optima; ++m) {
    const FittedStart* best = nullptr;
    std::string from;
    int of_optimum = 0;
    for (std::size_t i = 0; i < result.starts.size(); ++i) {
      const FittedStart& start = result.starts[i];
      if (start.optimum != m) continue;
      from += (from.empty() ? "" : ", ") + std::to_string(i);
      of_optimum += start.forward_runs;
      if (best == nullptr || start.final_cost < best->final_cost) best = &start;
    }
    if (best == nullptr) continue;
    Row row = {
        std::to_string(m),         best->status, from, number(best->screened_cost), number(best->final_cost),
        std::to_string(of_optimum)};
    for (const double value : best->values) row.push_back(number(value));
    rows.push_back(std::move(row));
  }
  std::string text = "Starts: " + std::to_string(result.starts.size());
  if (failed > 0) text += ", of which " + std::to_string(failed) + " could not be run";
  text += "; searches from " + std::to_string(searched) + " in " + std::to_string(runs) + " runs.\n";
  return num_optima == 0 ? text : text + layout(rows);
}

/// Intervals by profile beside those of the linearised model.
std::string profile_table(const FitResult& result) {
  std::vector<Row> rows = {{"parameter", "unit", "fitted", "95 % by profile", "linearised", "runs"}};
  std::string warnings;
  for (const ParameterProfile& profile : result.profiles) {
    const auto p = std::find_if(result.parameters.begin(), result.parameters.end(),
                                [&](const FittedParameter& x) { return x.address == profile.address; });
    if (p == result.parameters.end()) continue;
    std::string open = profile.bounded_below ? "" : "below";
    if (!profile.bounded_above) open += open.empty() ? "above" : " and above";
    rows.push_back({p->name, p->unit, number(p->value),
                    number(profile.low95) + " .. " + number(profile.high95) +
                        (open.empty() ? "" : " (open " + open + ")"),
                    number(profile.linear_low95) + " .. " + number(profile.linear_high95),
                    std::to_string(profile.forward_runs)});
    for (const DerivedProfile& d : derived_profiles(result, profile)) {
      open = d.bounded_below ? "" : "below";
      if (!d.bounded_above) open += open.empty() ? "above" : " and above";
      rows.push_back(
          {d.name, d.unit, number(d.value),
           number(d.low95) + " .. " + number(d.high95) + (open.empty() ? "" : " (open " + open + ")"),
           number(d.linear_low95) + " .. " + number(d.linear_high95), ""});
    }
    if (!profile.warning.empty()) warnings += "Warning: " + profile.warning + ".\n";
  }
  return layout(rows) + "Both without what elements, steps and held parameters add to the interval above.\n" +
         warnings;
}

}  // namespace

std::string answer_text(const FitResult& result) {
  const auto knows_truth = [](const auto& x) { return x.truth.has_value(); };
  const bool has_truth = std::any_of(result.parameters.begin(), result.parameters.end(), knows_truth);
  Row header = {"parameter", "unit", "initial", "fitted", "95 % interval"};
  if (has_truth) header.insert(header.end(), {"truth", "error %", "inside?"});
  std::vector<Row> rows = {header};
  for (const FittedParameter& p : result.parameters)
    rows.push_back(table_row(p.name + (p.at_bound ? " (at bound)" : ""), p.unit, number(p.initial), p.value,
                             p.low95, p.high95, p.determined, p.truth, has_truth));
  for (const DerivedQuantity& d : result.derived)
    rows.push_back(table_row(d.name, d.unit, "", d.value, d.low95, d.high95, std::isfinite(d.high95), d.truth,
                             has_truth));
  std::string text = layout(rows) + "\n";
  text += "Status: " + result.status + " after " + std::to_string(result.forward_runs) +
          " forward runs; residual " + number(result.rms_px) + " px rms over " +
          std::to_string(result.num_observations) + " observations of " + std::to_string(result.num_tracks) +
          " tracks, reduced chi-square " + number(result.reduced_chi_square) + ".\n";
  for (std::size_t i = 0; i < result.stages.size(); ++i)
    text += "Stage " + std::to_string(i + 1) + " before (" + result.stages[i].change +
            "): " + std::to_string(result.stages[i].forward_runs) + " runs, " + result.stages[i].status +
            ".\n";
  text += measured_lines(result);
  if (!result.clips.empty()) text += "\n" + clip_table(result) + "\n";
  text += result.gauge + "\n";
  if (!result.starts.empty()) text += "\n" + start_table(result) + "\n";
  if (!result.profiles.empty()) text += "\n" + profile_table(result) + "\n";
  if (!result.systematic.empty()) text += "\n" + shift_table(result);
  text += further_view_line(result);
  for (const std::string& sentence : result.misfit) text += "Misfit: " + sentence + "\n";
  for (const std::string& sentence : result.cannot_tell) text += "Cannot tell: " + sentence + "\n";
  return text;
}

std::map<std::string, double> read_truth(const std::string& path, const Scene& scene) {
  const std::string expected = "{\"parameters\": [{\"address\": \"/...\", \"value\": number}, ...]}";
  const nlohmann::json json = nlohmann::json::parse(read_file(path), nullptr, false);
  if (json.is_discarded()) throw InputError(path, "no JSON", expected);
  if (!json.is_object() || !json.contains("parameters") || !json["parameters"].is_array())
    throw InputError(path, "no list 'parameters'", expected);
  const std::vector<ParameterSpec> known = all_parameters(scene);
  std::map<std::string, double> truth;
  for (const nlohmann::json& item : json["parameters"]) {
    if (!item.is_object() || !item.contains("address") || !item["address"].is_string() ||
        !item.contains("value") || !item["value"].is_number())
      throw InputError(path, item.dump(), expected);
    const std::string address = item["address"];
    // The true scene may have what the fitted one lacks.
    if (std::any_of(known.begin(), known.end(), [&](const ParameterSpec& s) { return s.address == address; }))
      truth[address] = item["value"];
  }
  return truth;
}

}  // namespace rhytid::fitting
