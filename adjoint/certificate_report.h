// The certificate for people and for programs.
#pragma once

#include <nlohmann/json.hpp>
#include <string>

#include "adjoint/certificate.h"

namespace rhytid::adjoint {

/// The table with every check, the figures of each Taylor series, parameters with their slopes, contact
/// counts, times. Lines end in "\n".
std::string certificate_text(const CertificateReport& report);

/// Everything in the report. Numbers that are not finite become null.
nlohmann::json certificate_json(const CertificateReport& report);

}  // namespace rhytid::adjoint
