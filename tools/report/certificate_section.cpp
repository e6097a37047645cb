#include <filesystem>

#include "adjoint/certificate_report.h"
#include "sim/output/atomic_file.h"
#include "tools/certificate_page.h"
#include "tools/report/sections.h"

namespace rhytid::tools {

void add_certificate(HtmlPage& page, ReportData& data) {
  const std::string path = (std::filesystem::path(data.folder) / "certificate.json").string();
  if (!std::filesystem::exists(path)) return;
  try {
    const auto json = nlohmann::json::parse(read_file(path));
    const std::vector<adjoint::CertificateCheck> checks = adjoint::certificate_checks(json);
    const bool passed = json.at("passed").get<bool>(), interrupted = json.at("interrupted").get<bool>();
    const std::string scene = json.value("scene", "");
    page.section("certificate", "Gradient certificate");
    add_certificate_checks(page, checks, passed, interrupted);
    page.note("From certificate.json of this folder" + (scene.empty() ? "" : ", of " + scene) +
              "; certificate.html beside it has the plots.");
  } catch (const nlohmann::json::exception&) {
    data.left_out.push_back("No gradient certificate: " + path + " is not what certify writes.");
  }
}

}  // namespace rhytid::tools
