// A scene run as the certificate wants it, with the default functional.
#pragma once

#include <gmock/gmock.h>

#include <cstdio>
#include <memory>
#include <random>
#include <string>
#include <vector>

#include "adjoint/certificate.h"
#include "sim/core/error.h"
#include "sim/scene/load.h"

namespace rhytid::adjoint {

struct CertifiedCase {
  SceneModel scene_model;
  RunOptions options;
  Trajectory run;
  std::shared_ptr<const Output> output;
  std::vector<VectorXd> weights;

  explicit CertifiedCase(const std::string& text, const std::vector<std::string>& settings = {})
      : scene_model(parse_scene_text(text, "test.json", settings)), options(scene_model.run_options()) {
    options.minimiser = certificate_minimiser(options.minimiser);
    run = simulate(scene_model.model(), scene_model.native(), options);
    output = default_output(scene_model.model(), 40);
    weights = random_weights(*output, run.frames(), 7);
  }
  const Model& model() const { return scene_model.model(); }
};

inline long points_in(const CertificateReport& report, const std::string& term, const std::string& regime) {
  for (const RegimeCount& c : report.regimes)
    if (c.term == term && c.regime == regime) return c.points;
  return -1;
}

/// What a failing test prints, and a passing one too: the figures.
inline void print(const CertificateReport& report) {
  for (const CertificateCheck& c : report.checks)
    std::printf("%-4s %-50s %10.3e  %s\n", name(c.verdict), c.name.c_str(), c.figure, c.sentence.c_str());
  for (const RegimeCount& c : report.regimes)
    std::printf("  %s %s %ld\n", c.term.c_str(), c.regime.c_str(), c.points);
  std::printf("  noise %.1e, forward %.2f s, tangent %.2f s, adjoint %.2f s, all %.2f s\n", report.noise,
              report.forward_seconds, report.tangent_seconds, report.adjoint_seconds, report.total_seconds);
}

}  // namespace rhytid::adjoint
