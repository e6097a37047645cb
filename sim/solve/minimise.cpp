#include "sim/solve/minimise.h"

#include <cmath>
#include <random>
#include <utility>

#include "sim/core/error.h"
#include "sim/solve/lbfgs_memory.h"
#include "sim/solve/line_search.h"
#include "sim/solve/negative_curvature.h"

namespace rhytid {

namespace {

constexpr int kProjectedIterations = 2;    // with the projected Hessian after a failed raw factorisation
constexpr double kShift = 1e-9;            // added to the projected Hessian, relative to its largest diagonal
constexpr double kLargestShift = 1e-2;     // where giving up starts
constexpr int kMaxLineSearchFailures = 4;  // in a row, each with a more cautious direction
// Steps below the energy's resolution without halving the residual: Newton's converge quadratically, others
// slowly.
constexpr int kRawPatience = 5, kPatience = 20;
constexpr int kMaxNegativeCurvatureExits = 10;
constexpr double kLbfgsRefreshStep = 1e-6;  // the publication, "Non-Linear Solver"
// A whole step of Newton's to the tolerance whose start vouches for its end: it leaves at most this share of the
// residual, and began so near the equilibrium (residual over the force scale) that it is far too short to pass a
// critical load. From further away a straight path may lead past one without a trace in the residual.
constexpr double kCertifyingStep = 0.1, kCertifyingResidual = 1e-4;
constexpr unsigned kNegativeCurvatureSeed = 20240229;

class Minimisation {
 public:
  Minimisation(Objective& objective, VectorXd& q, const MinimiserOptions& options, CholeskyFactor& factor,
               BlockMatrix& matrix, const IterationCallback& callback, GivenFactor given)
      : objective_(objective),
        q_(q),
        options_(options),
        factor_(factor),
        matrix_(matrix),
        callback_(callback),
        given_(given),
        single_(
            options.method != Minimiser::lbfgs_literal &&
            (options.precision == FactorPrecision::mixed ||
             (options.precision == FactorPrecision::automatic && factor.factor_flops() >= kMixedFromFlops))) {
  }

  MinimiserReport run();

 private:
  using Status = MinimiserStatus;

  /// Ends with newton() unless the method is literal.
  Status lbfgs();
  Status newton();
  /// Steps of L-BFGS over the raw factor of Newton's last step, as long as they pay (kKeepWhile).
  std::optional<Status> keep_factor(LbfgsMemory& memory);
  std::optional<Status> start();
  /// Makes `next` the current point; interrupted or nothing.
  std::optional<Status> accept(Iterate next);
  std::optional<Status> note_iteration();
  bool small() const { return report_.residual <= report_.tolerance; }
  /// The factor of the raw Hessian; `full` in double precision whatever steers.
  bool factor_raw(bool full);
  bool factor_projected(bool full = false);
  /// matrix_ + shift·I: in single precision while that is trusted, and in double precision where it fails. It is
  /// no longer trusted where the other then succeeds.
  bool factorize(double shift, bool full);
  /// −H⁻¹ g with the factor of the raw Hessian; nothing when single precision took for definite what is not.
  std::optional<VectorXd> raw_direction();
  /// Why factor_projected failed.
  Status no_projected_factor() const;
  /// After an accepted step of the given slope: true when steps have sunk below the energy's resolution and
  /// no longer reduce the residual.
  bool stagnates(double slope, double noise, int patience);
  void polish();
  bool leave_along_negative_curvature(Iterate& next);

  Objective& objective_;
  VectorXd& q_;
  const MinimiserOptions& options_;
  CholeskyFactor& factor_;
  BlockMatrix& matrix_;
  const IterationCallback& callback_;
  GivenFactor given_;
  bool single_;  ///< factors in single precision are worth trying

  MinimiserReport report_;
  Iterate at_;
  double shift_ = kShift;
  double stagnation_residual_ = 0;
  int stagnant_steps_ = 0;
};

std::optional<MinimiserStatus> Minimisation::note_iteration() {
  report_.energy = at_.energy;
  report_.residual = at_.gradient.norm();
  report_.tolerance = options_.relative_tolerance * objective_.force_scale() + options_.absolute_tolerance;
  report_.residuals.push_back(report_.residual);
  if (callback_ && !callback_(report_.iterations, report_.energy, report_.residual))
    return Status::interrupted;
  return std::nullopt;
}

std::optional<MinimiserStatus> Minimisation::start() {
  at_ = evaluate(objective_, q_);
  ++report_.evaluations;
  if (!at_.finite()) {
    report_.energy = at_.energy;
    return Status::not_finite;
  }
  stagnation_residual_ = at_.gradient.norm();
  return note_iteration();
}

std::optional<MinimiserStatus> Minimisation::accept(Iterate next) {
  at_ = std::move(next);
  ++report_.iterations;
  return note_iteration();
}

bool Minimisation::factorize(double shift, bool full) {
  const auto attempt = [&](Precision precision) {
    ++report_.factorisations;
    if (precision == Precision::single) ++report_.single_factorisations;
    const bool ok = factor_.factorize(matrix_, shift, precision);
    if (shift == 0) {  // the raw Hessian
      report_.smallest_pivot = factor_.smallest_pivot();
      report_.largest_pivot = factor_.largest_pivot();
    }
    if (!ok) ++report_.failed_factorisations;
    return ok;
  };
  if (full || !single_) return attempt(Precision::full);
  if (attempt(Precision::single)) return true;
  if (!attempt(Precision::full)) return false;
  single_ = false;
  return true;
}

bool Minimisation::factor_raw(bool full) {
  objective_.hessian(at_.q, Curvature::raw, matrix_);
  return factorize(0, full);
}

bool Minimisation::factor_projected(bool full) {
  objective_.hessian(at_.q, Curvature::projected, matrix_);
  const double scale = matrix_.diagonal_max();
  for (; shift_ <= kLargestShift; shift_ *= 10)
    if (factorize(shift_ * scale, full)) return true;
  return false;
}

std::optional<VectorXd> Minimisation::raw_direction() {
  if (factor_.precision() == Precision::full) return -factor_.solve(at_.gradient);
  if (auto found = factor_.solve_iteratively(matrix_, at_.gradient, kDirectionTolerance, kMaxCorrections))
    return -*found;
  if (!factorize(0, /*full=*/true)) return std::nullopt;
  single_ = false;
  return -factor_.solve(at_.gradient);
}

MinimiserStatus Minimisation::no_projected_factor() const {
  for (const double value : std::as_const(matrix_).values())
    if (!std::isfinite(value)) return Status::not_finite;
  return Status::line_search_failed;
}

bool Minimisation::stagnates(double slope, double noise, int patience) {
  if (-slope > noise) {
    stagnant_steps_ = 0;
    stagnation_residual_ = report_.residual;
    return false;
  }
  if (report_.residual < 0.5 * stagnation_residual_) {
    stagnation_residual_ = report_.residual;
    stagnant_steps_ = 0;
    return false;
  }
  return ++stagnant_steps_ >= patience;
}

void Minimisation::polish() {
  Iterate next = evaluate(objective_, at_.q - VectorXd(factor_.solve(at_.gradient)));
  ++report_.evaluations;
  if (!next.finite() || !(next.gradient.norm() < report_.residual)) {
    // The objective keeps data of its last evaluation (force scale): leave it at the point returned.
    objective_.energy(at_.q, &at_.gradient);
    ++report_.evaluations;
    return;
  }
  at_ = std::move(next);
  ++report_.iterations;
  report_.energy = at_.energy;
  report_.residual = at_.gradient.norm();
  report_.residuals.push_back(report_.residual);
}

bool Minimisation::leave_along_negative_curvature(Iterate& next) {
  std::mt19937 random(kNegativeCurvatureSeed + static_cast<unsigned>(report_.negative_curvature_exits));
  std::uniform_real_distribution<double> uniform(-1, 1);
  const VectorXd r = VectorXd::NullaryExpr(at_.q.size(), [&] { return uniform(random); });
  if (!factor_projected(/*full=*/true)) return false;
  VectorXd start = matrix_.multiply(r);
  objective_.hessian(at_.q, Curvature::raw, matrix_);
  start -= matrix_.multiply(r);
  const std::optional<NegativeCurvature> found = find_negative_curvature(matrix_, factor_, start);
  if (!found) return false;
  VectorXd v = found->direction;
  if (v.dot(at_.gradient) > 0) v = -v;

  // The gradient says nothing about how far to go: start where the predicted decrease t²|θ|/2 just exceeds
  // the energy's rounding, then double while that pays.
  const double noise = energy_noise(objective_, at_);
  const double limit = 0.9 * objective_.largest_feasible_step(at_.q, v);
  double step = noise > 0 ? std::sqrt(20 * noise / -found->curvature) : 1e-9 / v.cwiseAbs().maxCoeff();
  bool decreased = false;
  for (int doubling = 0; doubling < 100 && step <= limit; ++doubling, step *= 2) {
    Iterate trial = evaluate(objective_, at_.q + step * v);
    ++report_.evaluations;
    if (!trial.finite() || trial.energy > at_.energy + noise) break;
    if (decreased && trial.energy >= next.energy) break;
    if (trial.energy < at_.energy - noise) {
      next = std::move(trial);
      decreased = true;
    }
  }
  // The objective's scales are those of its last evaluation, a rejected trial further out: tolerances follow
  // them.
  if (decreased) {
    next = evaluate(objective_, next.q);
    ++report_.evaluations;
  }
  return decreased;
}

std::optional<MinimiserStatus> Minimisation::keep_factor(LbfgsMemory& memory) {
  while (!small() && report_.iterations < options_.max_iterations) {
    const VectorXd direction = memory.descent_direction(at_.gradient, factor_);
    const double slope = at_.gradient.dot(direction), before = report_.residual;
    LineSearchResult found;
    // One trial: a direction that needs shortening is not worth what a new factor gives.
    if (slope < 0 && direction.allFinite())
      found = line_search(objective_, at_, direction, slope, /*most_trials=*/1);
    report_.evaluations += found.evaluations;
    if (!found.accepted) break;
    memory.add(found.next.q - at_.q, found.next.gradient - at_.gradient);
    ++report_.lbfgs_iterations;
    if (const auto stop = accept(std::move(found.next))) return stop;
    if (!(report_.residual <= kKeepWhile * before)) break;
  }
  return std::nullopt;
}

MinimiserStatus Minimisation::newton() {
  const bool always_projected = options_.method == Minimiser::newton_projected;
  const bool wants_raw = options_.certify_minimum || options_.polish;
  int projected_left = 0, failures = 0;
  if (given_ == GivenFactor::near && factor_.usable() && options_.keep_factor &&
      options_.method == Minimiser::newton) {
    LbfgsMemory memory(options_.lbfgs_memory);
    if (const auto stop = keep_factor(memory)) return *stop;
  }
  for (;;) {
    if (small() && !wants_raw) return Status::converged;
    const bool try_raw = small() || (!always_projected && projected_left == 0);
    bool raw = try_raw && factor_raw(/*full=*/small() && options_.polish);
    if (small()) {
      if (raw && options_.polish) polish();
      if (raw || !options_.certify_minimum) return Status::converged;
      if (report_.iterations >= options_.max_iterations) return Status::max_iterations;
      Iterate next;
      if (report_.negative_curvature_exits >= kMaxNegativeCurvatureExits ||
          !leave_along_negative_curvature(next))
        return Status::not_a_minimum;
      ++report_.negative_curvature_exits;
      projected_left = failures = 0;
      shift_ = kShift;
      if (const auto stop = accept(std::move(next))) return *stop;
      continue;
    }
    if (report_.iterations >= options_.max_iterations) return Status::max_iterations;
    std::optional<VectorXd> newton_direction;
    if (raw) newton_direction = raw_direction();
    raw = newton_direction.has_value();
    if (!raw) {
      if (try_raw) projected_left = kProjectedIterations;
      if (projected_left > 0) --projected_left;
      if (!factor_projected()) return no_projected_factor();
      // Also from single precision as it is: the projected Hessian is a model anyway.
      newton_direction = -factor_.solve(at_.gradient);
    }

    const VectorXd& direction = *newton_direction;
    const double slope = at_.gradient.dot(direction), noise = energy_noise(objective_, at_);
    LineSearchResult found;
    if (slope < 0 && direction.allFinite()) found = line_search(objective_, at_, direction, slope);
    if (found.accepted && !raw && !always_projected) lengthen(objective_, at_, direction, slope, found);
    report_.evaluations += found.evaluations;
    if (!found.accepted) {
      const bool below_resolution = std::abs(slope) <= noise;
      if (++failures >= kMaxLineSearchFailures)
        return below_resolution ? Status::stagnated : Status::line_search_failed;
      if (below_resolution && (raw || always_projected))
        return Status::stagnated;  // the best direction there is
      projected_left = below_resolution ? 0 : kProjectedIterations;
      if (!raw) shift_ *= 10;
      continue;
    }
    failures = 0;
    shift_ = kShift;
    const double before = report_.residual;
    const bool keep = options_.keep_factor && raw && found.step == 1 && found.next.gradient.norm() <= before;
    const bool certifies = !options_.polish && raw && found.step == 1 &&
                           before <= kCertifyingResidual * objective_.force_scale();
    LbfgsMemory memory(options_.lbfgs_memory);
    if (keep) memory.add(found.next.q - at_.q, found.next.gradient - at_.gradient);
    if (const auto stop = accept(std::move(found.next))) return *stop;
    if (certifies && small() && report_.residual <= kCertifyingStep * before) return Status::converged;
    if (!small() && stagnates(slope, noise, raw ? kRawPatience : kPatience)) return Status::stagnated;
    if (!keep) continue;
    if (const auto stop = keep_factor(memory)) return *stop;
  }
}

MinimiserStatus Minimisation::lbfgs() {
  LbfgsMemory memory(options_.lbfgs_memory);
  int since_refresh = -1;       // no factor yet
  std::optional<Status> stuck;  // why it goes no further
  while (!small() && !stuck) {
    if (report_.iterations >= options_.max_iterations) return Status::max_iterations;
    if (since_refresh < 0 || since_refresh >= options_.lbfgs_refresh) {
      if (!factor_projected()) return no_projected_factor();
      shift_ = kShift;
      memory.clear();
      since_refresh = 0;
    }
    const VectorXd direction = memory.descent_direction(at_.gradient, factor_);
    const double slope = at_.gradient.dot(direction), noise = energy_noise(objective_, at_);
    LineSearchResult found;
    if (slope < 0 && direction.allFinite()) found = line_search(objective_, at_, direction, slope);
    report_.evaluations += found.evaluations;
    if (!found.accepted) {
      if (since_refresh == 0)  // a fresh factor and no progress
        stuck = std::abs(slope) <= noise ? Status::stagnated : Status::line_search_failed;
      since_refresh = -1;
      continue;
    }
    memory.add(found.next.q - at_.q, found.next.gradient - at_.gradient);
    since_refresh = found.step < kLbfgsRefreshStep ? -1 : since_refresh + 1;
    ++report_.lbfgs_iterations;
    if (const auto stop = accept(std::move(found.next))) return *stop;
    if (!small() && stagnates(slope, noise, kPatience)) stuck = Status::stagnated;
  }
  if (options_.method == Minimiser::lbfgs_literal) return stuck.value_or(Status::converged);
  stagnant_steps_ = 0;
  return newton();
}

MinimiserReport Minimisation::run() {
  if (const auto stop = start()) {
    report_.status = *stop;
  } else {
    const bool starts_with_lbfgs =
        options_.method == Minimiser::lbfgs || options_.method == Minimiser::lbfgs_literal;
    report_.status = starts_with_lbfgs ? lbfgs() : newton();
    q_ = at_.q;
  }
  return std::move(report_);
}

}  // namespace

void MinimiserOptions::validate() const {
  require(relative_tolerance >= 0 && relative_tolerance < 1,
          "MinimiserOptions: relative_tolerance must be in [0, 1)");
  require(absolute_tolerance >= 0 && std::isfinite(absolute_tolerance),
          "MinimiserOptions: absolute_tolerance must be non-negative and finite");
  require(max_iterations >= 0, "MinimiserOptions: max_iterations must not be negative");
  require(lbfgs_memory >= 1, "MinimiserOptions: lbfgs_memory must be at least 1");
  require(lbfgs_refresh >= 1, "MinimiserOptions: lbfgs_refresh must be at least 1");
}

MinimiserOptions published_minimiser() {
  MinimiserOptions options;
  options.method = Minimiser::lbfgs_literal;
  options.relative_tolerance = 0;
  options.absolute_tolerance = 1e-6;
  options.lbfgs_memory = 10;
  options.lbfgs_refresh = 50;
  options.certify_minimum = false;
  return options;
}

const char* name(Minimiser method) {
  switch (method) {
    case Minimiser::newton:
      return "newton";
    case Minimiser::newton_projected:
      return "newton_projected";
    case Minimiser::lbfgs:
      return "lbfgs";
    case Minimiser::lbfgs_literal:
      return "lbfgs_literal";
  }
  return "unknown";
}

const char* name(FactorPrecision precision) {
  switch (precision) {
    case FactorPrecision::automatic:
      return "automatic";
    case FactorPrecision::full:
      return "full";
    case FactorPrecision::mixed:
      return "mixed";
  }
  return "unknown";
}

const char* name(MinimiserStatus status) {
  switch (status) {
    case MinimiserStatus::converged:
      return "converged";
    case MinimiserStatus::max_iterations:
      return "max_iterations";
    case MinimiserStatus::line_search_failed:
      return "line_search_failed";
    case MinimiserStatus::not_a_minimum:
      return "not_a_minimum";
    case MinimiserStatus::not_finite:
      return "not_finite";
    case MinimiserStatus::interrupted:
      return "interrupted";
    case MinimiserStatus::stagnated:
      return "stagnated";
  }
  return "unknown";
}

MinimiserReport minimise(Objective& objective, VectorXd& q, const MinimiserOptions& options,
                         CholeskyFactor& factor, BlockMatrix& matrix, const IterationCallback& callback,
                         GivenFactor given) {
  options.validate();
  require(&matrix.pattern() == &objective.pattern(),
          "minimise: the matrix has another pattern than the objective");
  require(q.size() == objective.pattern().num_unknowns(), "minimise: wrong number of unknowns");
  return Minimisation(objective, q, options, factor, matrix, callback, given).run();
}

}  // namespace rhytid
