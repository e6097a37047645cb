// One draw of a repeated twin study: footage with noise of its own, tracks, a fit, and what the fit found.
// Tests: tests/tools/recovery_test.cpp
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "fitting/fit_result.h"
#include "tools/bench/recovery_twin.h"
#include "tools/bench/recovery_variant.h"
#include "tools/study/variant_result.h"
#include "tools/track_footage.h"

namespace rhytid::tools {

/// What a draw found of one parameter; values in the parameter's unit. In the coordinate of the fit, ln p for
/// `log`, ln((p − lower)/(upper − p)) for `logit` and p itself for `none`, are error and sigma.
struct RecoveredParameter {
  std::string address, unit, transform = {};
  double truth = 0, value = 0, low95 = 0, high95 = 0;
  double error = 0;  ///< estimate − truth
  double sigma = 0;  ///< as the fit reports it; nan: not determined
  bool is_inside() const { return low95 <= truth && truth <= high95; }
};

struct RecoveryDraw {
  int draw = 0;
  bool answered =
      false;  ///< the fit converged; else `status` says why not, and the numbers count for nothing
  std::string status;
  std::vector<RecoveredParameter> parameters;
  double reduced_chi_square = 0, rms_px = 0;
  int tracks = 0, observations = 0, forward_runs = 0;
  double cpu_seconds = 0, seconds = 0;  ///< of film, tracks and fit
};

/// Between a draw and the columns of variant.json.
VariantResult draw_result(const RecoveryDraw& draw, const VariantIdentity& identity);
RecoveryDraw read_draw(const VariantResult& result);

/// What a fit found of the parameters whose truth is known.
std::vector<RecoveredParameter> recovered_parameters(const fitting::FitResult& result);

/// All that the draws of a variant share.
struct DrawSetup {
  VariedCase varied;
  Scene fit;           ///< of the varied case
  std::string folder;  ///< of the twin: camera.yaml, truth.json
  TrackJob job;        ///< but for the footage
};

/// Films draw `draw` (noise by the case's seed + draw), tracks it, fits it, and keeps tracks.csv in `own`: what
/// `rhytid render`, `track` and `fit` do with that seed for the noise. A track or a fit that fails is an
/// outcome. Nothing when interrupted.
std::optional<RecoveryDraw> run_recovery_draw(const RecoveryTwin& twin, const DrawSetup& setup, int draw,
                                              const std::string& own, Progress& progress);

}  // namespace rhytid::tools
