// steps.csv: one row of scalars per converged step.
#pragma once

#include <string>

#include "sim/output/csv.h"
#include "tools/step_reading.h"

namespace rhytid::tools {

/// Columns: step, frame, time; energy per term in the step's potential (the name says `incremental` where it
/// includes dissipation); the energy account (sim/time/energy_account.h): stored by part now, and since the
/// start of the run what was dissipated and what bodies did, by term, then the totals, the numerical
/// dissipation and what is left over; minimiser (softened: the step started from softened contacts);
/// extremes; force and penetration per body.
class StepTable {
 public:
  explicit StepTable(const Model& model);
  /// Adds the row of a converged step.
  void add(const StepEvent& event);
  const CsvTable& table() const { return table_; }

  /// What the next row needs besides its step, for a checkpoint: the sums since the start.
  std::vector<double> carried() const;
  /// Continues a table: rows of `csv` (text of an earlier table) up to frame `last_frame`, and what was
  /// carried. Throws InputError naming `path` when the columns differ, a row is damaged or one is missing.
  void restore(const std::string& csv, int last_frame, const std::vector<double>& carried,
               const std::string& path);

 private:
  CsvTable table_;
  std::vector<double> sums_;  ///< mJ, of the columns that sum over the run
};

/// The columns as Markdown; NAME stands for a term, layer or body of the scene.
std::string step_table_documentation();

}  // namespace rhytid::tools
