// The Taylor test: is the gradient that of the simulation?
//
//   ρ(h) = Q(p + h v) − Q(p) − h Q'v,   ρ ~ h² when Q'v is right, ρ ~ h when it is not
//
// Q is evaluated by solving every step again (resimulate.h). The step h starts at the largest of the series
// and is halved until three neighbouring slopes d ln ρ / d ln h lie in the window, or ρ has sunk to the noise
// of Q; then once more at an h as small as the noise allows, which bounds the error of Q'v. When that one is out of
// line and not on a smooth curve with its neighbours either, as what an error of Q'v leaves would be, it is noise not
// measured before: it counts as such, and the last h is chosen anew. Contact and
// friction are only piecewise smooth: points that change piece between p and p + hv bend the parabola, so
// they are counted, and small h are needed where they are many.
//
// Tests    tests/adjoint/certificate_test.cpp, sweeps_test.cpp
#pragma once

#include <string>
#include <vector>

#include "adjoint/outputs.h"
#include "adjoint/parameter_space.h"
#include "adjoint/resimulate.h"

namespace rhytid::adjoint {

struct TaylorOptions {
  double first_step = 1. / 512;  ///< h of the first evaluation; directions have largest component 1
  int max_evaluations = 14;      ///< of Q, per direction
  int clean_slopes = 3;          ///< neighbouring slopes that must lie in the window
  double smallest_slope = 1.95, largest_slope = 2.05;
  long many_switches = 8;    ///< with more than these the parabola is not in sight: h shrinks eightfold
  double noise_factor = 30;  ///< stop when ρ is below this many times the noise of Q
};

/// One direction.
struct TaylorSeries {
  std::string group;      ///< "joint", or what the parameters of the direction have in common
  std::string direction;  ///< "random" or "gradient"
  double linear = 0;      ///< Q'v of the gradient under test
  /// h, ρ(h) and the number of (step, point) pairs on another smooth piece than at p; largest h first.
  std::vector<double> steps, remainders;
  std::vector<long> switches;
  std::vector<double> slopes;  ///< one fewer
  double noise = 0;  ///< of Q, measured at a step so small that ρ is nothing else, or met on the way
  /// Relative error of Q'v that the last two remainders leave room for: the part of ρ linear in h.
  double first_order_error = 0;
  bool passed = false;
  std::string sentence;
};

/// Q = Σ_f w_f · q_f as a function of coordinates, relative to its value at the nominal run.
class FunctionalDifference {
 public:
  /// `run` must be complete with states, histories that it dropped are recomputed; all arguments must outlive
  /// it.
  FunctionalDifference(const SceneModel& scene_model, const Trajectory& run, const Output& output,
                       const std::vector<VectorXd>& weights, const MinimiserOptions& minimiser);

  struct Result {
    bool complete = false;
    std::string failure;
    double difference = 0;  ///< Q(x) − Q(0)
    long switches = 0;
    int iterations = 0;
    Trajectory run;  ///< displacements only
  };
  /// Q at other native parameters, warm-started from displacements (null: from the nominal run's own).
  Result evaluate(const VectorXd& native, const StartGuess& guess = {},
                  const std::function<bool()>& go_on = {}) const;
  /// Q of a trajectory of the scene's own parameters over the same steps that kept its states, relative to
  /// the nominal one.
  double difference(const Trajectory& other) const;

  /// What the last digits of the outputs are worth in Q: ε Σ |w| |outputs|, the finest that Q can be told from itself.
  double rounding() const;

  const Trajectory& run() const { return *run_; }
  const Model& model() const { return scene_model_->model(); }
  /// Pieces of every step at the nominal run.
  const std::vector<std::vector<signed char>>& regimes() const { return regimes_; }

 private:
  const SceneModel* scene_model_;
  const Trajectory* run_;
  const Output* output_;
  const std::vector<VectorXd>* weights_;
  MinimiserOptions minimiser_;
  std::vector<VectorXd> values_;  ///< per frame, nominal
  std::vector<std::vector<signed char>> regimes_;
};

/// Rounding and solver noise of Q, measured near x = 0 along `direction`: |Q(h v) − 2 Q(h v/2) + Q(0)| at a
/// step h so small that nothing else is left, the middle one of three; rounding() where two of them have the same bits. Does not use a
/// gradient. Six evaluations.
double measure_noise(const FunctionalDifference& functional, const ParameterSpace& space,
                     const VectorXd& direction, const std::function<bool()>& go_on = {});

/// The test along `direction` [space.size()], scaled to largest component 1. `gradient` is dQ/dx at 0,
/// `noise` that of Q. `go_on` is called after every step solved and may return false to stop (the series has
/// then not passed).
TaylorSeries taylor_test(const FunctionalDifference& functional, const ParameterSpace& space,
                         const VectorXd& direction, const VectorXd& gradient, double noise,
                         const TaylorOptions& options, const std::function<bool()>& go_on = {});

}  // namespace rhytid::adjoint
