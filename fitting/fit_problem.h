// The objective of a fit: forward run, projection, whitening; and its derivatives by the tangent or the
// adjoint sweep of the same run.
//
//   F(t) = Σ_tracks cost(observed − predicted(t)) + ½ Σ ((measured − predicted(t)) / σ)²
//          + ½ Σ ((t_k − t_k,initial) / prior_k)²
//   residuals z with F = ½|z|²;  rows: tracks one after the other, measurements, waves (wave_spectrum.h), priors
//
// The last run is kept: value, Jacobian and gradient at the same t share it. With a log, what it holds is
// taken from there instead of being computed, and what is computed is added to it. Tests:
// tests/fitting/fit_test.cpp
#pragma once

#include <functional>
#include <optional>
#include <set>
#include <string>
#include <vector>

#include "fitting/evaluation_log.h"
#include "fitting/measurements.h"
#include "fitting/objective.h"
#include "fitting/projected_points.h"
#include "fitting/registration.h"
#include "fitting/track_noise.h"
#include "fitting/wave_spectrum.h"
#include "sim/time/simulate.h"

namespace rhytid::fitting {

struct FitEvaluation : ObjectiveEvaluation {
  std::vector<VectorXd> differences;           ///< per track: observed − predicted [2n], px
  std::vector<TrackNoise::Evaluation> tracks;  ///< per track
  VectorXd measured;                           ///< (measured − predicted)/σ of the measurements
  VectorXd waves;                              ///< residuals of the wave spectrum
};

/// Called after every forward run.
struct FitProgress {
  int forward_runs = 0;
  double cost = 0, seconds = 0;  ///< of this run
  bool failed = false;
  bool replayed = false;  ///< from the log; `seconds` are those of then
  std::string failure;
  VectorXd values;  ///< parameters, internal units
};

class FitProblem final : public Objective {
 public:
  /// Registers the tracks of `camera` and builds the model. `last_frame` 0 and frames beyond the scene's
  /// last end there. Throws InputError when nothing is left to compare or times contradict the frame rate.
  FitProblem(const Scene& scene, const FitCase& fit, const Camera& camera, const TrackSet& tracks);
  /// Several cameras saw the same clip: each has the tracks that bear its name, all share a run. Throws
  /// InputError besides when two cameras have one name, a camera has no track that can be compared, or a
  /// track no camera.
  /// Besides, `measured` values of the same run are compared.
  FitProblem(const Scene& scene, const FitCase& fit, const std::vector<Camera>& cameras,
             const TrackSet& tracks, const std::vector<Measurement>& measured = {});

  const Parametrisation& parametrisation() const { return parametrisation_; }
  const std::vector<FitVariable>& variables() const override { return parametrisation_.variables(); }
  VectorXd initial() const override { return parametrisation_.initial(); }
  VectorXd lower() const override { return parametrisation_.lower(); }
  VectorXd upper() const override { return parametrisation_.upper(); }
  int num_residuals() const override { return num_residuals_; }
  int num_observations() const { return num_observations_; }  ///< pixels compared (two numbers each)
  double sum_of_weights() const { return sum_of_weights_; }   ///< of them; as many where none weighs less
  /// Independent residuals minus parameters; what weighs less counts for as much less.
  int degrees_of_freedom() const;
  int frames() const { return options_.frames; }
  const Registration& registration() const { return registration_; }
  const SceneModel& scene_model() const { return model_; }
  const RunOptions& run_options() const { return options_; }
  const ProjectedPoints& prediction() const { return *prediction_; }

  const FitEvaluation& evaluate(const VectorXd& t) override;
  std::optional<MatrixXd> jacobian(const VectorXd& t) override;  ///< by the tangent sweep
  std::optional<VectorXd> gradient(const VectorXd& t) override;  ///< by the adjoint sweep
  /// Residuals and Jacobian whitened with robust weights held fixed, for covariance estimates. Rows of waves are zero:
  /// their noise is that of the tracks, which is there already.
  struct Linearised {
    VectorXd residuals;
    MatrixXd jacobian;
  };
  std::optional<Linearised> linearised(const VectorXd& t);

  /// Positions and their derivatives, [3·observations][1 + parameters] mm, of the compared points in the frames
  /// that are compared, track after track: X, then ∂X/∂t. Nothing when the run cannot be differentiated.
  std::optional<MatrixXd> point_motion(const VectorXd& t);

  /// Compared observations of a track in the order of its differences.
  struct ComparedTrack {
    int track;       ///< index into the TrackSet
    int camera = 0;  ///< index into cameras()
    Vec2 first;      ///< its pixel in frame 0, where it was attached
    std::vector<int> frames;
    std::vector<Vec2> observed;
    std::vector<double> variances = {};  ///< px² per axis of what it has moved since frame 0
  };
  const std::vector<ComparedTrack>& compared() const { return compared_; }
  const std::vector<Camera>& cameras() const { return prediction_->cameras(); }
  /// Rest positions of the points of compared(), mm.
  std::vector<Vec3> rest_points() const;
  /// How the head moves before each camera; empty where it stands still.
  const std::vector<HeadMotion>& head_motion() const { return head_motion_; }
  /// Values compared besides pixels; empty where there are none.
  std::vector<MeasuredQuantities::Value> measured() const {
    return measured_ ? measured_->values() : std::vector<MeasuredQuantities::Value>();
  }
  const std::vector<TrackNoise>& noise() const { return noise_; }
  /// Waves of the tracks; nothing where they are not compared.
  const std::optional<WaveSpectrum>& waves() const { return waves_; }

  struct Counters {
    int forward_runs = 0, failed_runs = 0, tangent_sweeps = 0, adjoint_sweeps = 0;
    std::vector<double> forward_seconds, tangent_seconds, adjoint_seconds;
  };
  const Counters& counters() const { return counters_; }
  const std::string& last_failure() const override { return last_failure_; }
  int forward_runs() const override { return counters_.forward_runs; }

  std::string name;  ///< of the clip, for messages; empty where it is the only one

  std::function<void(const FitProgress&)> on_run;  ///< after every forward run
  std::function<bool()> should_stop;               ///< polled inside runs; true makes the run fail
  bool was_stopped() const override { return was_stopped_; }
  EvaluationLog* log = nullptr;  ///< may be null; must outlive the last evaluation

 private:
  /// Which observations of the registered tracks of one camera count; `motion` may be null.
  void choose_observations(const TrackSet& tracks, const FitCase& fit, int camera, const Registration& found,
                           const HeadMotion* motion);
  /// Attaches the tracks of one camera, still ones to the head and the others to the skin.
  void attach(const Scene& scene, const FitCase& fit, const Camera& camera, int number,
              const TrackSet& tracks, const SkinMesh& seen_first);
  std::vector<WavePoint> wave_points() const;
  void require_observations(const FitCase& fit, const std::vector<Camera>& cameras) const;
  void run(const VectorXd& t);
  /// Simulates at t_ and projects: predicted pixels of all frames below one another, [rows][1].
  EvaluationLog::Record simulate_and_project();
  /// A derivative at t_ from the log or from `sweep`; nothing when the run cannot be differentiated.
  std::optional<MatrixXd> derivative(EvaluationLog::Kind kind, const std::function<MatrixXd()>& sweep,
                                     int& count, std::vector<double>& seconds);
  void compare(const VectorXd& predicted);
  void fail(const std::string& why);
  /// Builds the output that runs are asked for.
  void predict_by(const std::vector<Camera>& cameras);
  /// Row of a measured value's prediction among those of all frames.
  Eigen::Index measured_row(const MeasuredQuantities::Value& value) const {
    const int frame = value.measurement.frame;
    return frame_row_[frame] + prediction_->size(frame) + value.row;
  }
  /// Row of a track's prediction in frame 0; only there when frame 0 is settled.
  Eigen::Index first_prediction(std::size_t compared) const {
    return frame_row_[0] + 2 * static_cast<Eigen::Index>(compared);
  }
  bool is_current(const VectorXd& t) const { return t_.size() == t.size() && t_ == t; }
  /// ∂(observed − predicted)/∂t per track, [2n][parameters].
  std::optional<std::vector<MatrixXd>> difference_jacobians(const VectorXd& t);

  Parametrisation parametrisation_;
  SceneModel model_;
  RunOptions options_;
  Registration registration_;
  std::vector<HeadMotion> head_motion_;
  std::vector<ComparedTrack> compared_;
  std::vector<TrackNoise> noise_;
  std::shared_ptr<ProjectedPoints> prediction_;
  std::optional<MeasuredQuantities> measured_;
  std::optional<WaveSpectrum> waves_;
  std::shared_ptr<const adjoint::Output> output_;  ///< pixels of a frame, then what was measured
  /// Row of (track, observation) in its frame's output, in the order of compared_.
  std::vector<std::vector<int>> output_row_;
  int num_residuals_ = 0, num_observations_ = 0;
  double sum_of_weights_ = 0;
  int weighed_away_ = 0;  ///< observations that frame_weights leave out

  std::vector<Eigen::Index> frame_row_;  ///< first row of a frame among the predictions of all
  Eigen::Index num_predicted_ = 0;

  VectorXd t_, native_;
  std::optional<Trajectory> trajectory_;  ///< at t_; not there when the run came from the log
  FitEvaluation evaluation_;
  std::optional<std::vector<MatrixXd>> difference_jacobians_;  ///< at t_
  MatrixXd measured_jacobian_;       ///< ∂(measured − predicted)/σ by t, where the former are
  using Bits = std::vector<double>;  ///< of t
  std::set<std::pair<EvaluationLog::Kind, Bits>> counted_;  ///< evaluations so far
  std::set<Bits> without_derivative_;
  std::string last_failure_;
  Counters counters_;
  bool was_stopped_ = false;
};

}  // namespace rhytid::fitting
