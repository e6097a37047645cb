// What numbers of the scene that no derivative is known of do to the answer when they are wrong: the thickness of a
// layer, the onset of a contact, the size of the patch. As for parameters that are held (consider.h), with the
// change of the predictions from one more forward run of the scene with the number off by its deviation
// (difference_shifts.h):
//
//   δ = −(JᵀJ)⁺ Jᵀ W (predicted(q) − predicted(q + σ))
//
// The step is σ itself, upwards, so what is not linear in it is in the shift as it is on that side. Of this the answer's
// covariance has what the residuals leave (error_posterior.h).
//
// By default the thickness of every layer is considered. In vivo it is known badly: in 200 adults of one sex and of ten years
// of age, 50 MHz ultrasound finds cheeks of 1.90 ± 0.21 mm, canthi of 1.36 ± 0.11 and eyelids of 1.24 ± 0.25 ("Research value
// of 50 MHz high-frequency ultrasound on sonography of normal facial skin in adult", Southwest Medical University 2019), 8 to 20 %
// among persons and sites that a scene takes for the same; what is measured at one point of the patch itself is about
// half a tenth of a millimetre off at either face.
//
// Tests: tests/fitting/considered_quantities_test.cpp
#pragma once

#include <vector>

#include "fitting/fit.h"

namespace rhytid::fitting {

/// Deviation that the thickness of a layer is taken to have where the case says nothing, of itself.
inline constexpr double kThicknessSigma = 0.1;

/// The numbers to consider: those of the case, or, where the case names nothing at all (`consider`), the thicknesses
/// of all layers of all clips; layers of one name are one skin.
std::vector<ConsideredQuantity> considered_quantities(const JointFitInput& input);

/// The scene with that number off by its deviation. Throws InputError where the scene has none or cannot be so.
Scene moved_scene(const Scene& scene, const ConsideredQuantity& quantity);

/// One forward run of every clip per quantity, as difference_shifts.
std::vector<SystematicShift> quantity_shifts(const JointFitInput& input, JointProblem& problem,
                                             const VectorXd& t, const FitProblem::Linearised& linearised,
                                             const MatrixXd& basis, const FitObserver& observer);

}  // namespace rhytid::fitting
