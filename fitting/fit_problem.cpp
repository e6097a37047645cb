#include "fitting/fit_problem.h"

#include <algorithm>
#include <chrono>
#include <cmath>

#include "adjoint/output_values.h"
#include "adjoint/sweeps.h"
#include "sim/core/error.h"
#include "sim/core/units.h"

namespace rhytid::fitting {
namespace {

int last_used_frame(const Scene& scene, const FitCase& fit) {
  return fit.last_frame > 0 ? std::min(fit.last_frame, scene.time.frames) : scene.time.frames;
}

void require_names(const std::vector<Camera>& cameras, const TrackSet& tracks) {
  if (cameras.empty()) throw InputError("fit: cameras", "none", "at least one camera");
  for (std::size_t a = 0; a < cameras.size(); ++a)
    for (std::size_t b = 0; b < a; ++b)
      if (cameras[a].name == cameras[b].name)
        throw InputError("fit: cameras", "two with the name '" + cameras[a].name + "'",
                         "a name of its own for each");
  if (cameras.size() < 2) return;  // others' tracks in one file are no error: they are not used
  for (const Track& track : tracks.tracks)
    if (std::none_of(cameras.begin(), cameras.end(),
                     [&](const Camera& camera) { return camera.name == track.camera; }))
      throw InputError("tracks: track " + std::to_string(track.id), "camera '" + track.camera + "'",
                       "the name of one of the cameras");
}

std::vector<adjoint::MaterialPoint> points_of(const Registration& found) {
  std::vector<adjoint::MaterialPoint> points;
  for (const RegisteredTrack& r : found.tracks) points.push_back(r.point);
  return points;
}

/// The surface that frame 0 shows: at rest, or settled (initial parameters).
SkinMesh first_frame_mesh(const SceneModel& model, const RunOptions& options) {
  SkinMesh mesh = model.model().mesh;
  if (!options.settle) return mesh;
  RunOptions settle_only = options;
  settle_only.frames = 0;
  const Trajectory settled = simulate(model.model(), model.native(), settle_only);
  if (!settled.complete) throw InputError("fit: frame 0", settled.failure, "a scene that settles");
  const VectorXd& u = settled.at_frame(0).u;
  for (int n = 0; n < mesh.num_nodes(); ++n) mesh.rest.row(n) += u.segment<3>(3 * n).transpose();
  return mesh;
}

/// Whether derivatives need steps to be polished: at the default tolerances they are right to 1e-9 without, far better
/// than the tracks that they explain, and a polish costs every pass of a step a factor.
bool needs_polish(const MinimiserOptions& options) {
  const MinimiserOptions usual;
  return options.relative_tolerance > usual.relative_tolerance ||
         options.absolute_tolerance > usual.absolute_tolerance;
}

}  // namespace

FitProblem::FitProblem(const Scene& scene, const FitCase& fit, const Camera& camera, const TrackSet& tracks)
    : FitProblem(scene, fit, std::vector<Camera>{camera}, tracks) {}

FitProblem::FitProblem(const Scene& scene, const FitCase& fit, const std::vector<Camera>& cameras,
                       const TrackSet& tracks, const std::vector<Measurement>& measured)
    : parametrisation_(scene, fit), model_(parametrisation_.scene(parametrisation_.initial())) {
  options_ = model_.run_options();
  options_.frames = last_used_frame(scene, fit);
  options_.keep_states = true;
  // The error of a derivative is of the order of the tolerance, or of its square after a polish.
  options_.minimiser.polish = needs_polish(options_.minimiser);
  if (options_.frames < 1) throw InputError("fit: frames", "0", "a scene with at least one frame after rest");
  require_names(cameras, tracks);
  const SkinMesh seen_first = first_frame_mesh(model_, options_);
  for (std::size_t c = 0; c < cameras.size(); ++c)
    attach(scene, fit, cameras[c], static_cast<int>(c), tracks, seen_first);
  require_observations(fit, cameras);

  if (!measured.empty()) measured_.emplace(model_.model(), measured, fit.wrinkles, options_.frames);
  predict_by(cameras);

  if (fit.waves) waves_.emplace(wave_points(), *fit.waves), num_residuals_ += waves_->size();
  for (const TrackNoise& n : noise_) num_residuals_ += n.num_rows();
  if (measured_) num_residuals_ += static_cast<int>(measured_->values().size());
  for (const FitVariable& v : parametrisation_.variables()) num_residuals_ += v.prior_sigma ? 1 : 0;
}

void FitProblem::predict_by(const std::vector<Camera>& cameras) {
  std::vector<std::vector<int>> points_in_frame(options_.frames + 1);
  output_row_.resize(compared_.size());
  for (std::size_t i = 0; i < compared_.size(); ++i)
    for (const int f : compared_[i].frames) {
      output_row_[i].push_back(2 * static_cast<int>(points_in_frame[f].size()));
      points_in_frame[f].push_back(static_cast<int>(i));
    }
  if (options_.settle)  // in the order of the tracks, see first_prediction
    for (std::size_t i = 0; i < compared_.size(); ++i) points_in_frame[0].push_back(static_cast<int>(i));
  std::vector<int> seen_by;
  for (const ComparedTrack& c : compared_) seen_by.push_back(c.camera);
  prediction_ = std::make_shared<ProjectedPoints>(model_.model().mesh, points_of(registration_), cameras,
                                                  std::move(seen_by), std::move(points_in_frame));
  for (std::size_t c = 0; c < head_motion_.size(); ++c)
    prediction_->set_poses(static_cast<int>(c), head_motion_[c].cameras);
  output_ = prediction_;
  if (measured_)
    output_ = std::make_shared<adjoint::CombinedOutput>(
        std::vector<std::shared_ptr<const adjoint::Output>>{prediction_, measured_->output()});
  for (int f = 0; f <= options_.frames; ++f) {
    frame_row_.push_back(num_predicted_);
    num_predicted_ += output_->size(f);
  }
}

int FitProblem::degrees_of_freedom() const {
  int dof = static_cast<int>(std::lround(2 * sum_of_weights_)) - num_parameters();
  if (measured_) dof += static_cast<int>(measured_->values().size());
  for (const FitVariable& v : parametrisation_.variables()) dof += v.prior_sigma ? 1 : 0;
  return dof;
}

const FitEvaluation& FitProblem::evaluate(const VectorXd& t) {
  if (!is_current(t)) run(t);
  return evaluation_;
}

void FitProblem::run(const VectorXd& t) {
  using Kind = EvaluationLog::Kind;
  t_ = t;
  trajectory_.reset();
  difference_jacobians_.reset();
  evaluation_ = FitEvaluation();
  was_stopped_ = was_stopped_ || (should_stop && should_stop());
  if (was_stopped_) return fail("stopped");
  try {
    native_ = model_.native(parametrisation_.scene(t));
  } catch (const InputError& error) {  // values that are allowed one by one but not together
    return fail(error.what());
  }
  std::optional<EvaluationLog::Record> record = log != nullptr ? log->find(Kind::run, t) : std::nullopt;
  if (record && record->failure.empty() && record->values.size() != num_predicted_) record.reset();
  const bool is_replayed = record.has_value();
  if (!record) {
    record = simulate_and_project();
    if (was_stopped_) return fail("stopped");
    if (log != nullptr) log->add(Kind::run, t, *record);
  }
  const Bits bits(t.begin(), t.end());
  const bool is_known = without_derivative_.contains(bits);
  if (!record->failure.empty())
    fail(record->failure);
  else if (is_known)
    fail("the run at these values cannot be differentiated");
  else
    compare(record->values);
  // What this fit has asked for before and the log holds costs nothing and is not counted again.
  if (!counted_.insert({Kind::run, bits}).second && is_replayed) return;

  FitProgress progress;
  progress.values = parametrisation_.values(t);
  progress.forward_runs = ++counters_.forward_runs;
  if (evaluation_.failed) ++counters_.failed_runs;
  progress.seconds = record->seconds;
  progress.replayed = is_replayed;
  counters_.forward_seconds.push_back(progress.seconds);
  progress.cost = evaluation_.cost;
  progress.failed = evaluation_.failed;
  progress.failure = evaluation_.failure;
  if (on_run) on_run(progress);
}

EvaluationLog::Record FitProblem::simulate_and_project() {
  const auto start = std::chrono::steady_clock::now();
  RunObserver observer;
  observer.iteration = [&](int, double, int, double, double) {
    was_stopped_ = was_stopped_ || (should_stop && should_stop());
    return !was_stopped_;
  };
  trajectory_ = simulate(model_.model(), native_, options_, observer);
  EvaluationLog::Record record;
  if (trajectory_->complete) {
    record.values.resize(num_predicted_, 1);
    const std::vector<VectorXd> values =
        measured_ ? adjoint::output_values(model_.model(), native_, *trajectory_, *output_)
                  : std::vector<VectorXd>();
    for (int f = 0; f <= frames(); ++f)
      record.values.col(0).segment(frame_row_[f], output_->size(f)) =
          measured_ ? values[f] : prediction_->values(f, trajectory_->at_frame(f));
  } else {
    record.failure = trajectory_->failure.empty() ? "the run did not complete" : trajectory_->failure;
  }
  record.seconds = std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
  return record;
}

void FitProblem::fail(const std::string& why) {
  evaluation_.failed = true;
  evaluation_.failure = last_failure_ = why;
}

std::vector<Vec3> FitProblem::rest_points() const {
  const VectorXd rest = VectorXd::Zero(3 * model_.model().mesh.num_nodes());
  std::vector<Vec3> points;
  for (std::size_t i = 0; i < compared_.size(); ++i)
    points.push_back(prediction_->interpolation().position(static_cast<int>(i), rest));
  return points;
}

void FitProblem::compare(const VectorXd& predicted) {
  evaluation_.residuals.resize(num_residuals_);
  Eigen::Index row = 0;
  for (std::size_t i = 0; i < compared_.size(); ++i) {
    const ComparedTrack& c = compared_[i];
    VectorXd r(2 * c.frames.size());
    for (std::size_t j = 0; j < c.frames.size(); ++j)
      r.segment<2>(2 * j) = c.observed[j] - predicted.segment<2>(frame_row_[c.frames[j]] + output_row_[i][j]);
    // Where frame 0 moves with the parameters, the track's own way since then is compared.
    if (options_.settle) {
      const Vec2 moved = predicted.segment<2>(first_prediction(i)) - c.first;
      for (std::size_t j = 0; j < c.frames.size(); ++j) r.segment<2>(2 * j) += moved;
    }
    if (!r.allFinite()) {
      fail("a tracked point left the view of the camera");
      return;
    }
    evaluation_.tracks.push_back(noise_[i].evaluate(r));
    evaluation_.residuals.segment(row, noise_[i].num_rows()) = evaluation_.tracks.back().whitened;
    row += noise_[i].num_rows();
    evaluation_.differences.push_back(std::move(r));
  }
  const std::vector<MeasuredQuantities::Value> measured = this->measured();
  evaluation_.measured.resize(static_cast<Eigen::Index>(measured.size()));
  for (std::size_t i = 0; i < measured.size(); ++i) {
    const Measurement& m = measured[i].measurement;
    evaluation_.measured[static_cast<Eigen::Index>(i)] =
        (m.value - predicted[measured_row(measured[i])]) / m.sigma;
  }
  if (!evaluation_.measured.allFinite()) return fail("a measured quantity has no value");
  evaluation_.residuals.segment(row, evaluation_.measured.size()) = evaluation_.measured;
  row += evaluation_.measured.size();
  if (waves_) {
    evaluation_.waves = waves_->residuals(evaluation_.differences);
    evaluation_.residuals.segment(row, evaluation_.waves.size()) = evaluation_.waves;
    row += evaluation_.waves.size();
  }
  for (int k = 0; k < num_parameters(); ++k)
    if (const auto& prior = parametrisation_.variables()[k].prior_sigma)
      evaluation_.residuals[row++] = (t_[k] - parametrisation_.initial()[k]) / *prior;
  evaluation_.cost = 0.5 * evaluation_.residuals.squaredNorm();
  evaluation_.failed = false;
}

std::optional<MatrixXd> FitProblem::derivative(EvaluationLog::Kind kind,
                                               const std::function<MatrixXd()>& sweep, int& count,
                                               std::vector<double>& seconds) {
  const Bits bits(t_.begin(), t_.end());
  std::optional<EvaluationLog::Record> record = log != nullptr ? log->find(kind, t_) : std::nullopt;
  if (!record) {
    if (!trajectory_) simulate_and_project();  // the run came from the log, its states did not
    if (was_stopped_) {
      fail("stopped");
      return std::nullopt;
    }
    const auto start = std::chrono::steady_clock::now();
    record.emplace();
    try {
      record->values = sweep();
    } catch (const adjoint::GradientError& error) {
      record->failure = error.what();
    } catch (const InputError& error) {  // at a bound that takes a part of the model away
      record->failure = error.what();
    }
    record->seconds = std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
    if (log != nullptr) log->add(kind, t_, *record);
  }
  if (!record->failure.empty()) {
    fail(record->failure);
    without_derivative_.insert(bits);
    return std::nullopt;
  }
  if (counted_.insert({kind, bits}).second) {
    ++count;
    seconds.push_back(record->seconds);
  }
  return std::move(record->values);
}

std::optional<std::vector<MatrixXd>> FitProblem::difference_jacobians(const VectorXd& t) {
  if (evaluate(t).failed) return std::nullopt;
  if (difference_jacobians_) return difference_jacobians_;
  const auto sweep = [&] {
    const adjoint::TangentResult tangent = adjoint::tangent_sweep(
        model_.model(), native_, *trajectory_, *output_, parametrisation_.native_directions(model_, t));
    MatrixXd all(num_predicted_, num_parameters());
    for (int f = 0; f <= frames(); ++f) all.middleRows(frame_row_[f], output_->size(f)) = tangent.frames[f];
    return all;
  };
  const auto tangent =
      derivative(EvaluationLog::Kind::tangent, sweep, counters_.tangent_sweeps, counters_.tangent_seconds);
  if (!tangent) return std::nullopt;
  std::vector<MatrixXd> result;
  for (std::size_t i = 0; i < compared_.size(); ++i) {
    const ComparedTrack& c = compared_[i];
    MatrixXd dr(2 * c.frames.size(), num_parameters());
    for (std::size_t j = 0; j < c.frames.size(); ++j)
      dr.middleRows<2>(2 * j) = -tangent->middleRows<2>(frame_row_[c.frames[j]] + output_row_[i][j]);
    if (options_.settle)
      for (std::size_t j = 0; j < c.frames.size(); ++j)
        dr.middleRows<2>(2 * j) += tangent->middleRows<2>(first_prediction(i));
    result.push_back(std::move(dr));
  }
  const std::vector<MeasuredQuantities::Value> measured = this->measured();
  measured_jacobian_.resize(static_cast<Eigen::Index>(measured.size()), num_parameters());
  for (std::size_t i = 0; i < measured.size(); ++i)
    measured_jacobian_.row(static_cast<Eigen::Index>(i)) =
        -tangent->row(measured_row(measured[i])) / measured[i].measurement.sigma;
  difference_jacobians_ = std::move(result);
  return difference_jacobians_;
}

std::optional<MatrixXd> FitProblem::point_motion(const VectorXd& t) {
  if (evaluate(t).failed) return std::nullopt;
  const auto sweep = [&] {
    const adjoint::PointPositions points(model_.model().mesh, points_of(registration_), 0);
    const adjoint::TangentResult tangent = adjoint::tangent_sweep(
        model_.model(), native_, *trajectory_, points, parametrisation_.native_directions(model_, t));
    MatrixXd all(3 * num_observations_, 1 + num_parameters());
    Eigen::Index row = 0;
    for (std::size_t i = 0; i < compared_.size(); ++i)
      for (const int f : compared_[i].frames) {
        const int point = static_cast<int>(i);
        all.block<3, 1>(row, 0) = points.interpolation().position(point, trajectory_->at_frame(f).u);
        all.middleRows<3>(row).rightCols(num_parameters()) = tangent.frames[f].middleRows<3>(3 * point);
        row += 3;
      }
    return all;
  };
  int count = 0;  // of what nobody asks
  std::vector<double> seconds;
  return derivative(EvaluationLog::Kind::points, sweep, count, seconds);
}

std::optional<MatrixXd> FitProblem::jacobian(const VectorXd& t) {
  const auto dr = difference_jacobians(t);
  if (!dr) return std::nullopt;
  MatrixXd out = MatrixXd::Zero(num_residuals_, num_parameters());
  Eigen::Index row = 0;
  for (std::size_t i = 0; i < noise_.size(); ++i) {
    out.middleRows(row, noise_[i].num_rows()) =
        noise_[i].whitened_jacobian(evaluation_.differences[i], evaluation_.tracks[i], (*dr)[i]);
    row += noise_[i].num_rows();
  }
  out.middleRows(row, measured_jacobian_.rows()) = measured_jacobian_;
  row += measured_jacobian_.rows();
  if (waves_) {
    out.middleRows(row, waves_->size()) = waves_->jacobian(evaluation_.differences, *dr);
    row += waves_->size();
  }
  for (int k = 0; k < num_parameters(); ++k)
    if (const auto& prior = parametrisation_.variables()[k].prior_sigma) out(row++, k) = 1 / *prior;
  return out;
}

std::optional<FitProblem::Linearised> FitProblem::linearised(const VectorXd& t) {
  const auto dr = difference_jacobians(t);
  if (!dr) return std::nullopt;
  Linearised out{evaluation_.residuals, MatrixXd::Zero(num_residuals_, num_parameters())};
  Eigen::Index row = 0;
  for (std::size_t i = 0; i < noise_.size(); ++i) {
    const Eigen::Index n = noise_[i].num_rows();
    out.residuals.segment(row, n) =
        noise_[i].weighted_residual(evaluation_.differences[i], evaluation_.tracks[i]);
    out.jacobian.middleRows(row, n) = noise_[i].weighted_jacobian(evaluation_.tracks[i], (*dr)[i]);
    row += n;
  }
  out.jacobian.middleRows(row, measured_jacobian_.rows()) = measured_jacobian_;
  row += measured_jacobian_.rows();
  if (waves_) {
    out.residuals.segment(row, waves_->size()).setZero();
    row += waves_->size();
  }
  for (int k = 0; k < num_parameters(); ++k)
    if (const auto& prior = parametrisation_.variables()[k].prior_sigma) out.jacobian(row++, k) = 1 / *prior;
  return out;
}

std::optional<VectorXd> FitProblem::gradient(const VectorXd& t) {
  if (evaluate(t).failed) return std::nullopt;
  const auto sweep = [&]() -> MatrixXd {
    std::vector<VectorXd> weights(frames() + 1);
    for (int f = 0; f <= frames(); ++f) weights[f] = VectorXd::Zero(output_->size(f));
    const std::vector<VectorXd> of_waves =
        waves_ ? waves_->gradient(evaluation_.differences) : std::vector<VectorXd>();
    for (std::size_t i = 0; i < compared_.size(); ++i)
      for (std::size_t j = 0; j < compared_[i].frames.size(); ++j) {
        Vec2 gradient = evaluation_.tracks[i].gradient.segment<2>(2 * j);
        if (waves_) gradient += of_waves[i].segment<2>(2 * j);
        weights[compared_[i].frames[j]].segment<2>(output_row_[i][j]) = -gradient;
        if (options_.settle) weights[0].segment<2>(first_prediction(i)) += gradient;
      }
    const std::vector<MeasuredQuantities::Value> measured = this->measured();
    for (std::size_t i = 0; i < measured.size(); ++i) {
      const Measurement& m = measured[i].measurement;
      weights[m.frame][prediction_->size(m.frame) + measured[i].row] -=
          evaluation_.measured[static_cast<Eigen::Index>(i)] / m.sigma;
    }
    const adjoint::AdjointResult result =
        adjoint::adjoint_sweep(model_.model(), native_, *trajectory_, *output_, weights);
    return parametrisation_.native_directions(model_, t).transpose() * result.native_bar;
  };
  const auto of_tracks =
      derivative(EvaluationLog::Kind::adjoint, sweep, counters_.adjoint_sweeps, counters_.adjoint_seconds);
  if (!of_tracks) return std::nullopt;
  VectorXd out = of_tracks->col(0);
  for (int k = 0; k < num_parameters(); ++k)
    if (const auto& prior = parametrisation_.variables()[k].prior_sigma)
      out[k] += (t[k] - parametrisation_.initial()[k]) / (*prior * *prior);
  return out;
}

}  // namespace rhytid::fitting
