// steps.csv: one row of scalars per converged step.
#pragma once

#include <string>

#include "sim/output/csv.h"
#include "tools/step_reading.h"

namespace rhytid::tools {

/// Columns: step, frame, time; energy per term in the step's potential (the name says `incremental` where it
/// includes dissipation); stored energy, work done by the colliders since rest (trapezoidal in their motion)
/// and their difference, an estimate of
/// what was dissipated, good to the error of the trapezoidal rule; minimiser; extremes; force and penetration
/// per body.
class StepTable {
 public:
  explicit StepTable(const Model& model);
  /// Adds the row of a converged step.
  void add(const StepEvent& event);
  const CsvTable& table() const { return table_; }

  /// What the next row needs besides its step: for a checkpoint. work, then force and centre per body.
  std::vector<double> carried() const;
  /// Continues a table: rows of `csv` (text of an earlier table) up to frame `last_frame`, and what was
  /// carried. Throws InputError naming `path` when the columns differ.
  void restore(const std::string& csv, int last_frame, const std::vector<double>& carried,
               const std::string& path);

 private:
  void advance_work(const StepReading& reading);

  std::size_t num_bodies_;
  CsvTable table_;
  double work_ = 0;  ///< mJ
  std::vector<ContactReading> last_;
};

}  // namespace rhytid::tools
