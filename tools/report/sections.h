// The sections of report.html, in their order on the page. Each leaves out what its data do not hold and says
// so.
#pragma once

#include "tools/progress.h"
#include "tools/report/html.h"
#include "tools/report/report_data.h"

namespace rhytid::tools {

/// The answer in words, as a forest plot and as a table.
void add_answer(HtmlPage& page, const ReportData& data);

/// Map of the ligament parameter b with its sources, and its posterior deviation.
void add_ligaments(HtmlPage& page, const ReportData& data);

/// Standard deviation of b per column, 1/mm, by linear propagation of the fitted parameters' covariance:
///   σ_b² = diag(G Σ Gᵀ),  G = ∂b/∂p,  Σ = D C D,  D = diag(σ_t dp/dt).
/// NaN where an undetermined parameter acts. Empty when nothing that was fitted moves b.
VectorXd ligament_deviation(const SceneModel& model, const fitting::FitResult& fit);

/// Observed and predicted features over a late frame, and the residual of every frame.
void add_footage(HtmlPage& page, const ReportData& data);

/// Forces and wrinkles that were measured, against the fitted prediction; nothing where there were none.
void add_measured(HtmlPage& page, const ReportData& data);

/// The simulated surface beside the footage. `displacement` [num_nodes·3] mm of `frame`.
void add_surface(HtmlPage& page, const ReportData& data, const VectorXd& displacement, int frame);

/// Cost and parameters over the iterations.
void add_convergence(HtmlPage& page, const ReportData& data);

/// Singular values, correlations, the weakest combination.
void add_identifiability(HtmlPage& page, const ReportData& data);

/// What finer elements and steps would do to the answer, where the fit looked.
void add_discretisation(HtmlPage& page, const ReportData& data);

/// The checks of certificate.json, where the folder has one.
void add_certificate(HtmlPage& page, ReportData& data);

/// Versions, schemes, counts, timings, files, commands.
void add_run_facts(HtmlPage& page, const ReportData& data);

}  // namespace rhytid::tools
