// certificate.html says what the certificate found: every check, what failed, what was left out.
#include "tools/certificate_page.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>

#include "adjoint/certificate_report.h"
#include "sim/scene/load.h"
#include "tests/support/small_scenes.h"
#include "tests/tools/report/html_checker.h"

namespace rhytid::tools {
namespace {

using adjoint::CertificateCheck;
using adjoint::CertificateReport;
using adjoint::LimitKind;
using ::testing::HasSubstr;
using ::testing::Not;

const SceneModel& scene_model() {
  static const SceneModel model(
      parse_scene_text(test::drag_scene(2, 4), "drag & press.json",
                       {"/skin/surface/grid/cells=[3,2]", "/skin/layers/soft/order=1"}));
  return model;
}

/// As certify fills it, without the runs.
CertificateReport report_of(adjoint::Verdict taylor, adjoint::Verdict pivots) {
  CertificateReport r;
  r.checks = {{"duality", 3e-16, 1e-11, adjoint::Verdict::pass, "sweeps are transposes"},
              {"Taylor slope, joint, random", 1.25, 2, taylor, "slope where a right gradient gives 2",
               LimitKind::near},
              {"error bar", std::nan(""), 0.5, adjoint::Verdict::pass, "not a number"},
              {"pivots", 0.02, 0.1, pivots, "smallest at step 2", LimitKind::at_least}};
  adjoint::TaylorSeries series;
  series.group = "joint";
  series.direction = "random";
  series.linear = 0.7;
  series.steps = {2e-3, 1e-3, 5e-4};
  series.remainders = {-4e-6, 1e-6, -2.5e-7};
  series.switches = {31, 17, 0};
  series.slopes = {2, 2};
  r.taylor = {series};
  r.noise = 1e-13;
  r.without_effect = {"/skin/layers/soft/relaxation_time"};
  r.regimes = {{"contact finger", "pressed", 412}};
  r.step_times = {0.1, 0.2, 0.3};
  r.steps.smallest_pivot = {1, 0.9, 0.02};
  r.steps.largest_pivot = {1, 1, 1};
  r.steps.residual = {1e-12, 1e-12, 1e-12};
  r.steps.regime_changes = {0, 5, 7};
  return r;
}

std::string page_of(const CertificateReport& report) {
  return certificate_page(report, scene_model(), {200, 7, {"rhytid", "certify", "drag & press.json"}});
}

TEST(CertificatePage, SaysVerdictAndEveryCheck) {
  const CertificateReport report = report_of(adjoint::Verdict::pass, adjoint::Verdict::pass);
  const std::string page = page_of(report);
  EXPECT_EQ(test::html_complaint(page), "");
  EXPECT_THAT(page, HasSubstr(adjoint::certificate_verdict(true, false)));
  EXPECT_THAT(page, HasSubstr("badge good\">certified<"));
  for (const CertificateCheck& check : report.checks) {
    EXPECT_THAT(page, HasSubstr("<th scope=\"row\" class=\"t\">" + check.name + "</th>"));
    EXPECT_THAT(page, HasSubstr("<dt>" + check.name + "</dt><dd>" + check.sentence + ".</dd>"));
  }
  EXPECT_THAT(page, Not(HasSubstr("FAIL")));
  EXPECT_THAT(page, Not(HasSubstr("nan")));
  for (const char* said : {"near\u00a02", "≤\u00a01e−11", "≥\u00a00.1", "slope 2", "31, 17, 0",
                           "/skin/layers/soft/relaxation_time", "<td>412</td>",
                           "certify &#39;drag &amp; press.json&#39;", "<dd>7</dd>"})
    EXPECT_THAT(page, HasSubstr(said));
}

TEST(CertificatePage, ShowsWhatFailed) {
  const std::string page = page_of(report_of(adjoint::Verdict::fail, adjoint::Verdict::warning));
  EXPECT_EQ(test::html_complaint(page), "");
  EXPECT_THAT(page, HasSubstr("badge bad\">not certified<"));
  EXPECT_THAT(page, HasSubstr(adjoint::certificate_verdict(false, false) + " 1 of 4 checks failed."));
  EXPECT_THAT(page, HasSubstr("joint, random</th><td class=\"c\" "
                              "style=\"background:#a4262c;color:#fff\">FAIL</td><td>1.25</td>"));
  EXPECT_THAT(page, HasSubstr(">look</td><td>0.02</td>"));
  const std::string doubtful = page_of(report_of(adjoint::Verdict::pass, adjoint::Verdict::warning));
  EXPECT_THAT(doubtful, HasSubstr("badge doubtful\">certified, look at 1 check<"));
}

TEST(CertificatePage, AnInterruptedOneShowsWhatThereIs) {
  CertificateReport report = report_of(adjoint::Verdict::pass, adjoint::Verdict::pass);
  report.interrupted = true;
  report.taylor.clear();
  report.steps = {};
  report.checks.resize(1);
  const std::string page = page_of(report);
  EXPECT_EQ(test::html_complaint(page), "");
  EXPECT_THAT(page, HasSubstr("badge bad\">interrupted<"));
  EXPECT_THAT(page, HasSubstr("No Taylor test was done."));
}

TEST(CertificateJson, GivesItsChecksBack) {
  const CertificateReport report = report_of(adjoint::Verdict::fail, adjoint::Verdict::warning);
  const auto checks =
      adjoint::certificate_checks(nlohmann::json::parse(adjoint::certificate_json(report).dump()));
  ASSERT_EQ(checks.size(), report.checks.size());
  for (std::size_t k = 0; k < checks.size(); ++k) {
    EXPECT_EQ(checks[k].name, report.checks[k].name);
    EXPECT_EQ(checks[k].verdict, report.checks[k].verdict);
    EXPECT_EQ(checks[k].limit, report.checks[k].limit);
    EXPECT_EQ(checks[k].sentence, report.checks[k].sentence);
    EXPECT_EQ(checks[k].threshold, report.checks[k].threshold);
  }
  EXPECT_TRUE(std::isnan(checks[2].figure));
  EXPECT_EQ(checks[0].figure, 3e-16);
}

}  // namespace
}  // namespace rhytid::tools
