// A whole report from a synthetic fit: well formed, self-contained, with the numbers of the fit; and what it
// does when files are missing. RHYTID_REPORT_FOLDER keeps the report for looking at.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cstdlib>
#include <filesystem>
#include <limits>
#include <sstream>

#include "adjoint/certificate_report.h"
#include "sim/core/error.h"
#include "sim/output/text.h"
#include "sim/scene/parameter.h"
#include "tests/tools/report/html_checker.h"
#include "tests/tools/report/synthetic_fit.h"
#include "tools/report/report_data.h"
#include "tools/report/sections.h"
#include "tools/report/write_report.h"

namespace rhytid::tools {
namespace {

using ::testing::AllOf;
using ::testing::HasSubstr;
using ::testing::Not;

namespace fs = std::filesystem;

std::string folder_for(const std::string& name) {
  const char* kept = std::getenv("RHYTID_REPORT_FOLDER");
  return (kept ? std::string(kept) : testing::TempDir() + "/rhytid_report") + "_" + name;
}

size_t count(const std::string& text, const std::string& part) {
  size_t n = 0;
  for (size_t at = text.find(part); at != std::string::npos; at = text.find(part, at + 1)) ++n;
  return n;
}

/// The page without its pictures, in whose base64 any short word may turn up.
std::string without_pictures(std::string html) {
  const std::string mark = ";base64,";
  for (size_t at = html.find(mark); at != std::string::npos; at = html.find(mark, at + mark.size()))
    html.erase(at + mark.size(), html.find('"', at) - at - mark.size());
  return html;
}

ReportOutcome report(const std::string& folder, bool run) {
  std::ostringstream log;
  Progress progress(ProgressStyle::plain_lines, log);
  return write_report(folder, progress, {.run = run});
}

TEST(Report, HoldsTheWholeFit) {
  const std::string folder = folder_for("whole");
  const fitting::FitResult fit = test::write_synthetic_fit(folder, 4);
  const ReportOutcome outcome = report(folder, true);
  EXPECT_THAT(outcome.left_out, testing::IsEmpty());
  const std::string page = read_file(outcome.path);
  EXPECT_EQ(test::html_complaint(page), "");
  EXPECT_LT(page.size(), 6u << 20);
  const std::string html = without_pictures(page);
  EXPECT_THAT(html, AllOf(Not(HasSubstr("http")), Not(HasSubstr("nan")), HasSubstr("<html lang=\"en\">")));

  // Words and numbers.
  EXPECT_THAT(html, HasSubstr("Fit of drag &lt;twin&gt; &amp; &quot;marks&quot;"));
  EXPECT_THAT(
      html,
      HasSubstr("film youngs_modulus: 1.013 MPa (95\u00a0% interval 0.9741 to 1.053 MPa). The truth is 1 MPa "
                "(the estimate is off by +1.3\u00a0%): inside the interval."));
  EXPECT_THAT(html, HasSubstr("outside the interval"));  // right strength
  EXPECT_THAT(html, HasSubstr(xml_escaped(fit.gauge)));
  EXPECT_THAT(html, HasSubstr("too short &lt;for it&gt;"));
  for (const auto& p : fit.parameters)
    EXPECT_THAT(html, HasSubstr("<strong>" + short_text(p.value, 7) + "</strong>"));
  EXPECT_THAT(html, HasSubstr("left strength and right strength trade off (correlation -0.86)"));
  // The weakest combination's deviation is of the covariance that sigma and the correlations are from.
  VectorXd weakest = fit.right_vectors.rightCols(1);
  for (Eigen::Index k = 0; k < weakest.size(); ++k) weakest[k] *= fit.parameters[k].sigma;
  EXPECT_THAT(html, HasSubstr("One standard deviation along this combination is " +
                              short_text(std::sqrt(weakest.dot(fit.correlation * weakest)), 3)));
  EXPECT_THAT(html, HasSubstr("hardly notices when left strength rises"));
  EXPECT_THAT(html,
              HasSubstr("<th scope=\"row\" class=\"t\">22</th>"));  // the track that slipped is the worst
  EXPECT_THAT(html, HasSubstr("rhytid report " + folder));
  EXPECT_THAT(html, HasSubstr("exponential"));

  EXPECT_THAT(html,
              HasSubstr("order 4 in the plane instead of 3, which moves the predicted points by 0.11 px"));
  EXPECT_THAT(html, HasSubstr("Misfit: Residuals are 1.1 times"));
  EXPECT_THAT(html, HasSubstr(">+9.4 %<"));  // left strength: exp(0.09)
  EXPECT_THAT(html, AllOf(HasSubstr("another camera 45° up"), HasSubstr("0.62")));
  EXPECT_THAT(html, HasSubstr("force_finger_z [N]"));
  EXPECT_THAT(html, HasSubstr("Could not be run: did not converge in frame 3"));

  // Pictures: two maps, shaded skin, height, slide; overlay and frame of the footage; seven plots.
  EXPECT_EQ(count(html, "src=\"data:image/png;base64,"), 5u);
  EXPECT_EQ(count(html, "src=\"data:image/jpeg;base64,"), 2u);
  EXPECT_EQ(count(html, "<svg"), 7u);
}

TEST(Report, SeveralStartsAreAFanAndATable) {
  const std::string folder = folder_for("starts");
  fitting::FitResult fit = test::write_synthetic_fit(folder, 1);
  const size_t plots = count(without_pictures(read_file(report(folder, false).path)), "<svg");
  fit.starts.resize(3);
  for (size_t i = 0; i < 2; ++i) {
    fitting::FittedStart& start = fit.starts[i];
    start.screened_cost = 900 + static_cast<double>(i);
    start.status = "converged";
    start.final_cost = i == 0 ? 345.25 : 210;
    start.optimum = i == 0 ? 2 : 1;
    start.forward_runs = 8;
    for (const auto& p : fit.parameters) start.values.push_back(p.value * (i == 0 ? 7 : 1));
    start.initial = start.values;
    start.evaluations = {1, 2, 5};
    start.costs = {1000, std::numeric_limits<double>::max(), start.final_cost};
  }
  fit.starts[2].failure = "did not complete";
  fitting::write_fit_result(fit, folder);
  const std::string html = without_pictures(read_file(report(folder, false).path));
  EXPECT_EQ(test::html_complaint(html), "");
  EXPECT_EQ(count(html, "<svg"), plots + 1);
  EXPECT_THAT(html, AllOf(HasSubstr("From several starts"), HasSubstr("3 starts were compared"),
                          HasSubstr("(1 could not be run)"), HasSubstr("2 of them were searched from"),
                          HasSubstr("start 0 (of the case)"), HasSubstr("345.25"), Not(HasSubstr("nan"))));
}

TEST(Report, ProfilesHaveAPlotEach) {
  const std::string folder = folder_for("profiles");
  fitting::FitResult fit = test::write_synthetic_fit(folder, 1);
  const size_t plots = count(without_pictures(read_file(report(folder, false).path)), "<svg");
  for (const size_t k : {0u, 1u}) {
    const fitting::FittedParameter& p = fit.parameters[k];
    fitting::ParameterProfile& profile = fit.profiles.emplace_back();
    profile.address = p.address;
    profile.low95 = p.low95, profile.high95 = k == 0 ? p.high95 : p.upper;
    profile.linear_low95 = p.low95, profile.linear_high95 = p.high95;
    profile.bounded_above = k == 0;
    profile.sigma = p.sigma;
    profile.quantile = 1.96;
    profile.forward_runs = 17;
    for (int i = -3; i <= 3; ++i) {
      const double rise = i > 0 && k == 1 ? 0.1 * i : i * i;
      profile.points.push_back({p.value * std::exp(i * p.sigma), 210 + 0.5 * rise, rise, "converged", 2, {}});
      for (const auto& other : fit.parameters) profile.points.back().values.push_back(other.value);
    }
  }
  fit.profiles[1].warning = "the answer is not the optimum";
  fitting::write_fit_result(fit, folder);
  const std::string html = without_pictures(read_file(report(folder, false).path));
  EXPECT_EQ(test::html_complaint(html), "");
  EXPECT_EQ(count(html, "<svg"), plots + 2);
  EXPECT_THAT(html, AllOf(HasSubstr("34 forward runs"), HasSubstr("open above"), HasSubstr("linearised"),
                          HasSubstr("Warning: the answer is not the optimum"), Not(HasSubstr("nan"))));
}

TEST(Report, IsTheSameTwice) {
  const std::string folder = folder_for("twice");
  test::write_synthetic_fit(folder, 1);
  const std::string first = read_file(report(folder, false).path);
  EXPECT_EQ(read_file(report(folder, false).path), first);
}

TEST(Report, MissingFilesAreNamedNotFatal) {
  const std::string folder = folder_for("missing");
  test::write_synthetic_fit(folder, 1);
  for (const char* name : {"fitted_scene.json", "camera.yaml", "footage.avi"})
    fs::remove(fs::path(folder) / name);
  const ReportOutcome outcome = report(folder, true);
  EXPECT_EQ(outcome.left_out.size(), 3u);
  const std::string html = read_file(outcome.path);
  EXPECT_EQ(test::html_complaint(html), "");
  EXPECT_THAT(html, AllOf(HasSubstr("scene.json: the scene file is not there"),
                          HasSubstr("footage.avi is not there"), HasSubstr("the footage could not be read")));
  fs::remove(fs::path(folder) / "fit.json");
  EXPECT_THROW(report(folder, true), InputError);
}

TEST(Report, AFitThatEndedEarlyHasAPageToo) {
  const std::string folder = folder_for("early");
  fs::create_directories(folder);
  fitting::FitResult fit;
  fit.status = "failed: the forward run at the initial values did not converge";
  fitting::FittedParameter p = test::fitted("/a", "a <name>", "MPa", 1, 1, NAN, 1);
  p.determined = false, p.truth.reset();
  fit.parameters = {p};
  fitting::write_fit_result(fit, folder);
  const std::string html = without_pictures(read_file(report(folder, true).path));
  EXPECT_EQ(test::html_complaint(html), "");
  EXPECT_THAT(html, AllOf(HasSubstr("Not converged: failed: the forward run"), HasSubstr("not determined")));
}

TEST(Report, AnOpenParameterClaimsNothing) {
  const std::string folder = folder_for("open");
  fitting::FitResult fit = test::write_synthetic_fit(folder, 1);
  fitting::FittedParameter& open = fit.parameters[2];
  open.value = 0.0024, open.determined = false, open.sigma = 846;
  open.low95 = open.lower, open.high95 = open.upper;
  fit.history.back().cost = 1e304;  // a trial that failed
  fitting::write_fit_result(fit, folder);
  const std::string html = without_pictures(read_file(report(folder, false).path));
  EXPECT_THAT(html,
              HasSubstr("right strength: not determined by this footage (the fit ended at 0.0024 1/mm). "
                        "The truth is 3 1/mm."));
  EXPECT_THAT(html, HasSubstr("b has no finite deviation anywhere"));
  EXPECT_THAT(html, AllOf(Not(HasSubstr("e304")), Not(HasSubstr("1e30"))));
}

TEST(Report, ShowsTheSceneThatWasFitted) {
  const std::string folder = folder_for("fitted_scene");
  fitting::FitResult fit = test::write_synthetic_fit(folder, 1);
  set_parameter(*fit.fitted_scene, "/skin/layers/soft/poissons_ratio", 0.31);  // as --set would have
  fit.settings = {"/settings/0=/skin/layers/soft/poissons_ratio=0.31"};
  fit.case_file = "/cases/case.json";
  fitting::write_fit_result(fit, folder);
  write_file(folder + "/scene.json", "{}");  // what the fit began from plays no part
  const ReportData data = gather_report_data(folder);
  ASSERT_TRUE(data.model);
  EXPECT_EQ(get_parameter(data.model->scene(), "/skin/layers/soft/poissons_ratio"), 0.31);
  EXPECT_EQ(get_parameter(data.model->scene(), "/skin/layers/film/youngs_modulus"), 1.013);
  EXPECT_THAT(read_file(report(folder, false).path),
              HasSubstr("--set /settings/0=/skin/layers/soft/poissons_ratio=0.31"));
}

TEST(Report, ShowsACertificateThatIsThere) {
  const std::string folder = folder_for("certificate");
  test::write_synthetic_fit(folder, 1);
  EXPECT_THAT(read_file(report(folder, false).path), Not(HasSubstr("Gradient certificate")));
  adjoint::CertificateReport certificate;
  certificate.checks = {{"duality", 1, 1e-11, adjoint::Verdict::fail, "one of them is wrong"}};
  write_file(folder + "/certificate.json", adjoint::certificate_json(certificate).dump());
  const std::string page = read_file(report(folder, false).path);
  EXPECT_EQ(test::html_complaint(page), "");
  EXPECT_THAT(page, HasSubstr("Gradient certificate"));
  EXPECT_THAT(page, HasSubstr(">FAIL</td><td>1</td>"));
  write_file(folder + "/certificate.json", "{\"checks\": 3}");
  EXPECT_THAT(read_file(report(folder, false).path),
              HasSubstr("certificate.json is not what certify writes"));
}

TEST(Report, FindsFilesAfterTheFolderMoved) {
  const std::string folder = folder_for("before_move"), moved = folder_for("after_move");
  test::write_synthetic_fit(folder, 1);
  fs::remove_all(moved);
  fs::rename(folder, moved);
  const ReportData data = gather_report_data(moved);
  EXPECT_THAT(data.left_out, testing::IsEmpty());
  EXPECT_TRUE(data.model && data.camera && !data.footage.empty());
  // The scene of the pictures has the fitted values.
  EXPECT_EQ(get_parameter(data.model->scene(), "/skin/layers/film/youngs_modulus"), 1.013);
}

TEST(LigamentDeviation, IsThePropagatedCovariance) {
  const std::string folder = folder_for("deviation");
  fitting::FitResult fit = test::write_synthetic_fit(folder, 1);
  const ReportData data = gather_report_data(folder);
  const VectorXd deviation = ligament_deviation(*data.model, fit);

  // The map is linear in the strengths, so differences of whole maps are exact up to round-off.
  const auto map_with = [&](const std::string& address, double value) {
    Scene scene = data.model->scene();
    set_parameter(scene, address, value);
    return data.model->ligament_map(scene);
  };
  std::vector<VectorXd> moved;
  for (const size_t k : {1u, 2u}) {
    const auto& p = fit.parameters[k];
    const double step = p.value * p.sigma;  // log: σ is relative
    moved.push_back(0.5 * (map_with(p.address, p.value + step) - map_with(p.address, p.value - step)));
  }
  const VectorXd variance = moved[0].cwiseAbs2() + moved[1].cwiseAbs2() +
                            2 * fit.correlation(1, 2) * moved[0].cwiseProduct(moved[1]);
  ASSERT_EQ(deviation.size(), variance.size());
  EXPECT_LT((deviation - variance.cwiseSqrt()).cwiseAbs().maxCoeff(), 1e-10);
  EXPECT_GT(deviation.maxCoeff(), 1.2 * deviation.minCoeff());

  // An undetermined source makes its surroundings unknown, and nothing else of the fit matters.
  fit.parameters[1].determined = false;
  EXPECT_TRUE(ligament_deviation(*data.model, fit).hasNaN());
  fit.parameters = {fit.parameters[0]};
  fit.correlation = MatrixXd::Identity(1, 1);
  EXPECT_EQ(ligament_deviation(*data.model, fit).size(), 0);
}

}  // namespace
}  // namespace rhytid::tools
