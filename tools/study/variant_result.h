// What a sweep knows of one variant: variant.json in its folder, and the row of the tables.
#pragma once

#include <nlohmann/json.hpp>
#include <optional>
#include <string>
#include <utility>
#include <vector>

namespace rhytid::tools {

/// A column of the results with its unit, e.g. {"line_wavelength", "mm"}; the value is a number or empty.
struct ResultColumn {
  std::string name, unit;
  std::optional<double> value;
};

/// Digests of what a result depends on; another one means another result.
struct VariantIdentity {
  std::string scene;    ///< after defaults, with all settings
  std::string measure;  ///< where wrinkles are measured
  std::string files;    ///< contents of what the scene names: mesh, maps, lists, points
  std::string program;  ///< this build
  bool operator==(const VariantIdentity&) const = default;
};

/// What of `now` is not as it was `then`, "settings", "measure", "files" or "program"; empty when all is.
std::string difference(const VariantIdentity& now, const VariantIdentity& then);

struct VariantResult {
  std::string name;
  VariantIdentity identity;
  std::string status;  ///< running | complete | not_converged
  std::string reason;  ///< a sentence when not complete
  std::vector<ResultColumn> columns;

  bool finished() const { return status == "complete" || status == "not_converged"; }
};

/// Reads variant.json; nothing when there is none, or none that this program can read.
std::optional<VariantResult> read_variant(const std::string& folder);
/// Writes it atomically. Throws InputError naming the path.
void write_variant(const std::string& folder, const VariantResult& result);

/// Whether the folder has what `study plan` keeps of a swipe, or what `simulate` and a sweep write: each takes
/// folders of its own.
bool is_of_plan(const std::string& folder);
bool is_of_run(const std::string& folder);

/// Reads the numbers of a run from the files it left in `folder`: sizes and times of run.json, sums, extremes
/// and last values of steps.csv, last row of wrinkles.csv.
std::vector<ResultColumn> read_results(const std::string& folder);

/// A CSV of numbers (nan and inf among them) as columns, in its own order. Throws InputError naming the line
/// for anything else.
std::vector<std::pair<std::string, std::vector<double>>> read_number_table(const std::string& path);

}  // namespace rhytid::tools
