// What the parameters of a scene do to its surface: one polished run, its tangent by all parameters in log or
// logit coordinates, and the adjoint of one figure by the ligament parameter b of every node.
// Tests: tests/tools/study_gradients_test.cpp
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "adjoint/directions.h"
#include "adjoint/parameter_space.h"
#include "adjoint/surface_response.h"
#include "sim/scene/parameter.h"
#include "tools/study/experiment.h"
#include "tools/study/shown_figures.h"
#include "tools/study/study_run.h"
#include "tools/verb.h"

namespace rhytid::tools {

struct SensitivityOptions {
  StudySize size = StudySize::quick;
  std::string variant;                 ///< of an experiment; empty = the first
  std::string shown_variant;           ///< "experiment, variant", for the page; empty for a scene
  std::vector<std::string> addresses;  ///< empty = all of the scene
  PredictedTracks tracks;
  std::string hold;             ///< address taken as known; empty = the modulus of the softest layer
  bool map_all_frames = false;  ///< the map's figure is the mean over frames, not that of the last
};

/// The tables of a study, before they are written.
struct Sensitivity {
  std::vector<ParameterSpec> parameters;         ///< those with an effect
  std::vector<adjoint::Coordinate> coordinates;  ///< of `parameters`
  std::vector<std::string> without_effect;       ///< addresses
  adjoint::SurfaceResponse response;             ///< by `parameters`
  adjoint::Directions directions;                ///< of √tracks/noise · response.root
  bool has_gauge = false;                        ///< "all stiffnesses together" leads the null vectors
  VectorXd deviations;                           ///< of the coordinates, all free; infinite when open
  int held = -1;                                 ///< index into `parameters`; −1 = none
  VectorXd held_deviations;                      ///< with it known (its own: 0)
  MatrixXd correlation;                          ///< likewise; NaN for pairs that are open
  std::vector<std::string> sentences;            ///< what positions cannot tell

  std::vector<ShownFigure> shown;  ///< forces, energy, wrinkles; derivatives by `coordinates`

  double figure = 0;  ///< ⟨|u|²⟩ of the outer surface, mm², of the last frame or the mean over all
  VectorXd b, dJ_db;  ///< [columns] 1/mm, mm³; empty without ligaments
  VectorXd area;      ///< [columns] mm² of the inner surface
  VectorXd share;     ///< [columns] b/J dJ/db per area, 1/cm²: % of the figure for 1 % of b on a cm²
};

/// Singular directions, deviations and sentences of a response, `gauge` being the coordinates of the gauge
/// direction if there is one: fills all of `s` that follows from `s.response`.
void judge(Sensitivity& s, const SensitivityOptions& options, const std::optional<VectorXd>& gauge);

/// Runs the study and writes its files. Throws InputError.
ExitCode run_sensitivity(VerbContext& context, const SensitivityOptions& options);

}  // namespace rhytid::tools
