// Several clips of one skin, fitted together: each is a FitProblem with a run of its own, what they share is
// fitted to all of them.
//
//   F(t) = Σ_c F_c(t_c) + priors,   z = (z_1, z_2, ...),   ∂z_c/∂t = ∂z_c/∂t_c S_c
//
// with t_c = S_c t the parameters that clip c knows: a shared one is a column of every clip whose scene has
// it, one of a single clip of that clip alone. A prior counts once. A clip whose run fails makes the point
// fail. One clip alone gives the bits of its FitProblem.
//
// Addresses  /skin/layers/film/youngs_modulus        shared by all clips whose scene has it
//            /clips/NAME/time/offset                 of clip NAME alone
// Tests      tests/fitting/joint_test.cpp
#pragma once

#include <deque>
#include <functional>
#include <optional>
#include <string>
#include <vector>

#include "fitting/fit_problem.h"

namespace rhytid::fitting {

/// What one experiment supplies: a run and all that was seen of it.
struct FitClip {
  std::string name;   ///< empty only where it is the only one
  std::string files;  ///< where its tracks come from, for messages; may be empty
  Scene scene;
  std::vector<Camera> cameras;
  TrackSet tracks;                         ///< of all cameras, by their names
  std::vector<Measurement> measured = {};  ///< what else was measured in the run
  double weight = 1;                       ///< in (0, 1], of its tracks
};

/// "/clips/NAME/..." for a parameter of one clip, the address itself for a shared one.
std::string joint_address(const FitParameter& parameter);

class JointProblem final : public Objective {
 public:
  /// Throws InputError, naming clip and files where there are several: what a FitProblem refuses, an address
  /// that no clip has, and a held gauge modulus that differs between clips (its scale is that of all).
  JointProblem(const std::vector<FitClip>& clips, const FitCase& fit);
  JointProblem(const JointProblem&) = delete;
  JointProblem& operator=(const JointProblem&) = delete;

  const std::vector<FitVariable>& variables() const override { return variables_; }
  VectorXd initial() const override { return initial_; }
  VectorXd lower() const override { return lower_; }
  VectorXd upper() const override { return upper_; }
  int num_residuals() const override;
  const ObjectiveEvaluation& evaluate(const VectorXd& t) override;
  std::optional<MatrixXd> jacobian(const VectorXd& t) override;
  std::optional<VectorXd> gradient(const VectorXd& t) override;
  int forward_runs() const override { return forward_runs_; }
  bool was_stopped() const override;
  const std::string& last_failure() const override { return last_failure_; }

  int num_clips() const { return static_cast<int>(clips_.size()); }
  FitProblem& clip(int c) { return clips_[c]; }
  const FitProblem& clip(int c) const { return clips_[c]; }
  const std::string& name(int c) const { return names_[c]; }
  VectorXd values(const VectorXd& t) const;                             ///< parameters, internal units
  VectorXd of_clip(int c, const VectorXd& t) const;                     ///< t_c = S_c t
  const std::vector<int>& columns(int c) const { return columns_[c]; }  ///< S_c: variable of each of t_c
  int num_observations() const;
  int degrees_of_freedom() const;  ///< as FitProblem::degrees_of_freedom
  /// All clips' FitProblem::linearised, one below the other.
  std::optional<FitProblem::Linearised> linearised(const VectorXd& t);

  const std::string& gauge_layer() const { return clips_[0].parametrisation().gauge_layer(); }
  std::string gauge_sentence() const;
  bool gauge_is_free() const;  ///< in all clips
  int num_measured() const;    ///< values besides pixels
  bool has_forces() const;     ///< among them
  /// The variable that is a layer's Young's modulus in the first clip; −1 = held.
  int modulus_variable(const std::string& layer) const;
  /// Sentences about skin that differs between the clips though nothing of it is fitted per clip.
  std::vector<std::string> differences() const;

  std::function<void(const FitProgress&)> on_run;  ///< after every evaluation that ran or replayed a clip
  /// Polled inside runs; true makes them fail.
  void stop_when(const std::function<bool()>& should_stop);

 private:
  void choose_variables(const std::vector<FitClip>& clips, const FitCase& fit);
  void build_clips(const std::vector<FitClip>& clips, const FitCase& fit);
  void require_one_gauge() const;
  void run(const VectorXd& t);
  void fail(int clip, const std::string& why);
  int runs_of_clips() const;

  std::vector<std::string> names_;
  std::vector<std::vector<FitParameter>> parameters_;  ///< per clip, nothing left open
  std::vector<std::vector<int>> columns_;
  std::deque<FitProblem> clips_;
  std::vector<FitVariable> variables_;
  VectorXd initial_, lower_, upper_;

  VectorXd t_;
  ObjectiveEvaluation evaluation_;
  FitProgress running_;  ///< of the evaluation under way
  int forward_runs_ = 0;
  std::string last_failure_;
};

}  // namespace rhytid::fitting
