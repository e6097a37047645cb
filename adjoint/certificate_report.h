// The certificate for people and for programs.
#pragma once

#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "adjoint/certificate.h"

namespace rhytid::adjoint {

/// The table with every check, the figures of each Taylor series, parameters with their slopes, contact
/// counts, times. Lines end in "\n".
std::string certificate_text(const CertificateReport& report);

/// One sentence for the whole, as the text begins and the page shows it.
std::string certificate_verdict(bool passed, bool interrupted);

/// Everything in the report. Numbers that are not finite become null.
nlohmann::json certificate_json(const CertificateReport& report);

/// The checks of what certificate_json wrote. Throws nlohmann::json::exception on anything else.
std::vector<CertificateCheck> certificate_checks(const nlohmann::json& certificate);

}  // namespace rhytid::adjoint
