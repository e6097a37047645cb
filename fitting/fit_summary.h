// What a fit says about itself at its best point: the noise against its covariances, parameters and ratios
// with intervals, residuals, sentences. Parts of run_fit (fit.h).
// Tests: tests/fitting/fit_test.cpp, tests/fitting/joint_test.cpp
#pragma once

#include <map>
#include <string>
#include <vector>

#include "fitting/fit.h"
#include "fitting/identifiability.h"

namespace rhytid::fitting {

/// Spread of the noise against its covariances, and how it repeats from frame to frame.
struct NoiseCheck {
  double reduced_chi_square = 0, autocorrelation = 0, widening = 1;
};

/// `whitened` residuals at t, where the problem was last evaluated.
NoiseCheck check_noise(JointProblem& problem, const VectorXd& t, const VectorXd& whitened);

/// Residuals and Jacobian by track, rows numbered by frame and axis, camera after camera; shifts count as
/// frame 0 and, from a renewal on, as frames behind the last. Where one camera saw one clip its pixels say
/// who neighbours whom, else millimetres of the skin do.
std::vector<WhitenedTrack> whitened_tracks(const JointProblem& problem, const FitProblem::Linearised& at);

/// Truth in the units of the held modulus: displacements only tell stiffnesses relative to it.
std::map<std::string, double> truth_in_gauge(const JointFitInput& input, const JointProblem& problem,
                                             FitResult& result);

/// The fitted parameters with intervals; without `found` they are undetermined.
void add_parameters(const JointProblem& problem, const VectorXd& t, const Identifiability* found,
                    const std::map<std::string, double>& truth, FitResult& result);
/// Moduli of the layers per that of the gauge layer.
void add_modulus_ratios(const JointProblem& problem, const Identifiability& found, const VectorXd& t,
                        const std::map<std::string, double>& truth, FitResult& result);

/// Residuals in px, their rms, and what each of several clips contributed. The problem is asked at t, where
/// it was last evaluated.
void add_residuals(const JointFitInput& input, JointProblem& problem, const VectorXd& t, FitResult& result);
/// What waves there are in the tracks of each clip, which `with_waves` measured, and in what `problem` predicts at t.
void add_waves(const JointProblem& with_waves, JointProblem& problem, const VectorXd& t, FitResult& result);
/// The clips' chi-squares, which need the Jacobian.
void add_clip_chi_squares(const JointProblem& problem, const FitProblem::Linearised& at,
                          const Identifiability& found, FitResult& result);

/// Sentences on tracks, noise, schemes. `has_point`: as for add_residuals, there is a run at t.
void add_notes(const JointFitInput& input, JointProblem& problem, const VectorXd& t, bool has_point,
               FitResult& result);
/// How the intervals came about.
std::string interval_note(const JointProblem& problem, const NoiseCheck& noise, const Identifiability& found);
/// Where a shift of `result.systematic` makes more of a parameter's variance than all else, a sentence in
/// `cannot_tell`, one for all parameters that the same thing moves; and notes on what they are.
void add_systematic_notes(const FitCase& options, FitResult& result);

}  // namespace rhytid::fitting
