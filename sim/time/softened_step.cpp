#include <algorithm>
#include <cmath>

#include "sim/time/simulate.h"

namespace rhytid {
namespace {

constexpr double kSoftest = 1e-6;         // of the stiffest penalty
constexpr double kFactor = 10;            // between one penalty and the next
constexpr double kLooseTolerance = 1e-6;  // of the force scale, while penalties are soft
constexpr int kLooseIterations = 50;      // a soft step that has not converged is a start all the same

}  // namespace

MinimiserReport solve_step_softened(StepProblem& problem, const MinimiserOptions& options,
                                    CholeskyFactor& factor, BlockMatrix& matrix, VectorXd& q,
                                    const IterationCallback& callback) {
  const Model& model = problem.model();
  const std::vector<int> penalties = model.penalties();
  double stiffest = 0;
  for (const int i : penalties) stiffest = std::max(stiffest, problem.native()[i]);
  q = model.to_unknowns(problem.old().u);
  if (stiffest == 0) {
    MinimiserReport report;
    report.status = MinimiserStatus::line_search_failed;
    return report;
  }
  MinimiserOptions loose = options;
  loose.relative_tolerance = std::max(kLooseTolerance, options.relative_tolerance);
  loose.max_iterations = std::min(kLooseIterations, options.max_iterations);
  loose.certify_minimum = loose.polish = false;
  MinimiserReport work;
  for (double scale = kSoftest; scale < 0.5; scale *= kFactor) {
    VectorXd native = problem.native();
    for (const int i : penalties) native[i] = std::min(native[i], scale * stiffest);
    StepProblem soft(model, native, problem.step(), problem.old());
    const MinimiserReport report = minimise(soft, q, loose, factor, matrix, callback);
    work.add_work(report);
    if (report.status == MinimiserStatus::interrupted) return report;
  }
  MinimiserReport report = minimise(problem, q, options, factor, matrix, callback);
  report.add_work(work);
  return report;
}

}  // namespace rhytid
