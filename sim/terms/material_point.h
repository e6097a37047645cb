// One layer's skin law at one material point, driven through a history of deformation: no mesh, no solver.
//
//   F(t) prescribed, or with some diagonal entries F_kk free: found from P_kk = 0 (traction-free directions).
//   Between two times the step is the same as in a simulation (skin_law.h: prepare, stress, update).
//
// The whole history is run in dual numbers of the five parameters, so that ∂P/∂(E, ν, C, fraction, τ)
// includes what the parameters did to the history and to the free stretches (implicit function theorem: dF_kk
// = −A⁻¹ ∂P_kk).
//
// Source   skin_law.h.  Units  MPa, s, 1.  Tests  tests/verification/material_point_test.cpp
#pragma once

#include <array>
#include <string>
#include <vector>

#include "sim/core/types.h"
#include "sim/scene/damper_scheme.h"

namespace rhytid {

/// A layer's material as a scene states it; see LayerScene.
struct SkinParameters {
  double youngs_modulus = 0.02;  ///< MPa, instantaneous: μ = E / 2(1+ν), K = E / 3(1−2ν)
  double poissons_ratio = 0.49;
  double stiffening = 1;             ///< C
  double relaxing_fraction = 0.8;    ///< μ_m / μ
  double relaxation_time = 1. / 12;  ///< τ, s
  static constexpr int count = 5;    ///< in this order in every derivative
  static constexpr const char* names[count] = {"youngs_modulus", "poissons_ratio", "stiffening",
                                               "relaxing_fraction", "relaxation_time"};
};

/// What is done to the point. The material is at rest (F = I, C^v = I) before times[0].
struct MaterialProgram {
  std::vector<double> times;  ///< s, not falling; equal times are an instantaneous jump
  std::vector<Mat3>
      deformation;  ///< F at these times, det F > 0; diagonal entries of free axes are first guesses
  std::array<bool, 3> traction_free{false, false, false};

  /// Throws ContractError naming what is wrong (sizes, order of times, det F ≤ 0, nothing prescribed).
  void validate() const;
};

/// The point at the end of one step.
struct MaterialPointState {
  double time = 0;                      ///< s
  Mat3 deformation = Mat3::Identity();  ///< F
  Mat3 piola = Mat3::Zero();            ///< P = ∂W/∂F, first Piola-Kirchhoff, MPa
  Mat3 kirchhoff = Mat3::Zero();        ///< P Fᵀ, MPa
  double energy = 0;                    ///< stored: equilibrium and relaxed Maxwell spring, MPa = mJ/mm³
  Mat3 viscous = Mat3::Identity();      ///< C^v after the step
  /// ∂P/∂parameter, row 3a+I of P_aI, MPa per unit of the parameter.
  Eigen::Matrix<double, 9, SkinParameters::count> piola_by_parameter;
};

struct MaterialPointRun {
  std::vector<MaterialPointState> states;  ///< one per time reached
  bool complete = false;
  std::string failure;  ///< one sentence when not complete: the free stretches were not found
};

/// Runs the program. Throws ContractError for an invalid program.
MaterialPointRun run_material_point(const SkinParameters& parameters, DamperScheme scheme,
                                    const MaterialProgram& program);

/// Ramps from I to F at constant rate over `ramp` seconds (0 = jump), then holds for `hold` seconds, in steps
/// of at most `step` seconds.
MaterialProgram ramp_and_hold(const Mat3& target, double ramp, double hold, double step);

}  // namespace rhytid
