// certificate.html: the gradient certificate for people, as one file.
//
// Tests    tests/tools/certificate_page_test.cpp, certify.sh
#pragma once

#include <string>
#include <vector>

#include "adjoint/certificate.h"
#include "sim/scene/scene_model.h"
#include "tools/report/html.h"

namespace rhytid::tools {

/// What the page says about how it was made, beside the report.
struct CertificateOrigin {
  int points = 0;     ///< outer points of the functional
  unsigned seed = 1;  ///< of functional and directions
  /// The words of a command that makes the certificate again.
  std::vector<std::string> command;
};

/// Verdict, checks, Taylor remainders over their steps, pivots over time, parameters, how it was made.
std::string certificate_page(const adjoint::CertificateReport& report, const SceneModel& scene_model,
                             const CertificateOrigin& origin);

/// The verdict as a badge and a sentence, a table with every check, its verdict in colour, figure and limit,
/// then what each found in words and what it is for.
void add_certificate_checks(HtmlPage& page, const std::vector<adjoint::CertificateCheck>& checks, bool passed,
                            bool interrupted);

}  // namespace rhytid::tools
