#include "adjoint/certificate_report.h"

#include <cmath>
#include <cstdio>
#include <limits>

#include "sim/scene/names.h"

namespace rhytid::adjoint {

namespace {

std::string line(const char* format, auto... values) {
  char buffer[512];
  std::snprintf(buffer, sizeof buffer, format, values...);
  return std::string(buffer) + "\n";
}

const char* limit_sign(LimitKind kind) {
  return kind == LimitKind::at_most ? "<=" : kind == LimitKind::at_least ? ">=" : "near";
}

const char* verdict_word(Verdict verdict) {
  return verdict == Verdict::pass ? "pass" : verdict == Verdict::warning ? "warning" : "fail";
}

}  // namespace

std::string certificate_verdict(bool passed, bool interrupted) {
  return interrupted ? "The certificate was interrupted; what follows is what had been done."
         : passed    ? "The gradient of this scene is certified: every check passed."
                     : "The gradient of this scene is NOT certified: a check failed.";
}

std::string certificate_text(const CertificateReport& r) {
  std::string out = certificate_verdict(r.passed(), r.interrupted) + "\n";
  out += "\nverdict  check                                                  figure      limit\n";
  for (const CertificateCheck& c : r.checks) {
    out += line("%-8s %-52s %9.4g  %s %.4g", name(c.verdict), c.name.c_str(), c.figure, limit_sign(c.limit),
                c.threshold);
    out += "         " + c.sentence + "\n";
  }
  out +=
      "\nTaylor series: remainder |Q(p+hv) − Q(p) − h Q'v|, slope, points on another smooth piece than at "
      "p\n";
  for (const TaylorSeries& s : r.taylor) {
    out += line("  %s, %s: Q'v = %.6g", s.group.c_str(), s.direction.c_str(), s.linear);
    for (std::size_t k = 0; k < s.steps.size(); ++k)
      out += k == 0 ? line("    h %.2e  %.3e           %6ld", s.steps[k], std::fabs(s.remainders[k]),
                           s.switches[k])
                    : line("    h %.2e  %.3e  %7.4f  %6ld", s.steps[k], std::fabs(s.remainders[k]),
                           s.slopes[k - 1], s.switches[k]);
  }
  out += "\nparameter                                             value          dQ/d(coordinate)\n";
  for (std::size_t k = 0; k < r.parameters.size(); ++k)
    out += line("  %-50s %.6g %s (%s)  %.6e", r.parameters[k].address.c_str(), r.parameters[k].value,
                r.parameters[k].unit.c_str(), to_string(r.parameters[k].transform).c_str(), r.gradient[k]);
  for (const std::string& address : r.without_effect) out += "  " + address + "  no effect\n";
  for (const std::string& address : r.not_smooth)
    out += "  " + address + "  not tested: a path has a kink at the end of a step or within 0.1 ms of it\n";
  if (!r.regimes.empty()) out += "\npoints over all steps\n";
  for (const RegimeCount& c : r.regimes)
    out += line("  %-30s %-10s %10ld", c.term.c_str(), c.regime.c_str(), c.points);
  out += "\nstep   time/s      smallest pivot  largest pivot   residual/N\n";
  for (std::size_t i = 0; i < r.steps.smallest_pivot.size(); ++i)
    out += line("%4zu   %-10.4g  %-14.4e  %-14.4e  %.2e", i, r.step_times[i], r.steps.smallest_pivot[i],
                r.steps.largest_pivot[i], r.steps.residual[i]);
  out += line(
      "\nnoise of the functional %.1e; forward run %.2f s, adjoint %.2f s, tangent %.2f s, certificate %.2f "
      "s",
      r.noise, r.forward_seconds, r.adjoint_seconds, r.tangent_seconds, r.total_seconds);
  return out;
}

nlohmann::json certificate_json(const CertificateReport& r) {
  nlohmann::json j;
  j["passed"] = r.passed();
  j["interrupted"] = r.interrupted;
  for (auto* list : {"checks", "taylor", "parameters", "points"}) j[list] = nlohmann::json::array();
  for (const CertificateCheck& c : r.checks)
    j["checks"].push_back({{"name", c.name},
                           {"figure", c.figure},
                           {"limit", c.threshold},
                           {"passes_when", limit_sign(c.limit)},
                           {"verdict", verdict_word(c.verdict)},
                           {"sentence", c.sentence}});
  for (const TaylorSeries& s : r.taylor)
    j["taylor"].push_back({{"group", s.group},
                           {"direction", s.direction},
                           {"linear", s.linear},
                           {"steps", s.steps},
                           {"remainders", s.remainders},
                           {"slopes", s.slopes},
                           {"switches", s.switches},
                           {"noise", s.noise},
                           {"first_order_error", s.first_order_error},
                           {"passed", s.passed}});
  for (std::size_t k = 0; k < r.parameters.size(); ++k)
    j["parameters"].push_back({{"address", r.parameters[k].address},
                               {"value", r.parameters[k].value},
                               {"unit", r.parameters[k].unit},
                               {"transform", to_string(r.parameters[k].transform)},
                               {"gradient", r.gradient[k]}});
  j["without_effect"] = r.without_effect;
  j["not_smooth"] = r.not_smooth;
  for (const RegimeCount& c : r.regimes)
    j["points"].push_back({{"term", c.term}, {"regime", c.regime}, {"points", c.points}});
  j["steps"] = {{"time", r.step_times},
                {"smallest_pivot", r.steps.smallest_pivot},
                {"largest_pivot", r.steps.largest_pivot},
                {"residual", r.steps.residual},
                {"regime_changes", r.steps.regime_changes}};
  j["noise"] = r.noise;
  j["error_bar"] = r.error_bar;
  j["seconds"] = {{"forward", r.forward_seconds},
                  {"tangent", r.tangent_seconds},
                  {"adjoint", r.adjoint_seconds},
                  {"certificate", r.total_seconds}};
  return j;
}

std::vector<CertificateCheck> certificate_checks(const nlohmann::json& certificate) {
  std::vector<CertificateCheck> checks;
  for (const nlohmann::json& j : certificate.at("checks")) {
    const auto number = [&j](const char* key) {
      return j.at(key).is_null() ? std::numeric_limits<double>::quiet_NaN() : j.at(key).get<double>();
    };
    CertificateCheck check{j.at("name").get<std::string>(), number("figure"), number("limit"), Verdict::fail,
                           j.at("sentence").get<std::string>()};
    for (const Verdict verdict : {Verdict::pass, Verdict::warning})
      if (j.at("verdict") == verdict_word(verdict)) check.verdict = verdict;
    for (const LimitKind kind : {LimitKind::at_least, LimitKind::near})
      if (j.at("passes_when") == limit_sign(kind)) check.limit = kind;
    checks.push_back(std::move(check));
  }
  return checks;
}

}  // namespace rhytid::adjoint
