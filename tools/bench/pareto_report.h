// Errors of variants against a reference, which of them nothing beats, and the tables and plots of that.
#pragma once

#include <map>
#include <string>
#include <vector>

#include "sim/core/types.h"
#include "tools/study/comparison.h"
#include "tools/study/variant_result.h"

namespace rhytid::tools {

/// What measure_pareto_variant left of a variant.
struct ParetoRun {
  VariantResult result;
  MatrixXd displacements;  ///< [frames · points][3], mm; nan beside the surface
  MatrixXd forces;         ///< [frames][3 · colliders], N
};

/// Reads the files of a variant that is finished.
ParetoRun read_pareto_run(const std::string& folder, VariantResult result);

/// An error with the time that it took.
struct ParetoPoint {
  double seconds = 0, error = 0;
};

/// Of each point, whether no other has a smaller error in at most the time, or the same in less. Points that
/// are not finite are not.
std::vector<bool> pareto_front(const std::vector<ParetoPoint>& points);

/// The measures of a comparison in the order of the tables; errors are relative except `displacement_mm`:
///  - displacement: rms over points and frames, over that of the reference;
///  - wavelength, amplitude: of the last frame, of one number;
///  - force: rms over frames and colliders; energy: stored, last frame; gradient: 2-norm over the parameters.
/// What one of the two has not, or what is 0 in the reference, is missing.
std::map<std::string, double> errors_against(const ParetoRun& run, const ParetoRun& reference);
const std::vector<std::string>& pareto_measures();

/// Writes pareto.csv, pareto.md and GROUP_MEASURE.svg into `folder`; runs by name. What is not among them is
/// left out. Returns the Markdown.
std::string write_pareto_report(const std::string& folder, const std::string& title,
                                const std::vector<ComparisonGroup>& groups,
                                const std::map<std::string, ParetoRun>& runs);

}  // namespace rhytid::tools
