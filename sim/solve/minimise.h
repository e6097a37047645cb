// The minimisers: Newton with projection on demand (default) and L-BFGS over a frozen factor (the
// publication's, and ours), with a certificate that the result is a minimum. README.md has the algorithms.
//
// Source   the publication, "Non-Linear Solver" (literal L-BFGS).
#pragma once

#include <functional>
#include <optional>
#include <string>
#include <vector>

#include "sim/solve/objective.h"

namespace rhytid {

enum class Minimiser {
  newton,  ///< raw Hessian; per-point projected one for two iterations when it is not positive definite; its factor
           ///< is kept while steps with it converge fast (kKeepWhile)
  newton_projected,  ///< always projected (baseline)
  lbfgs,             ///< L-BFGS over a projected factor, then Newton for the certificate
  lbfgs_literal,     ///< L-BFGS to its end as published: no Newton, hence no certificate and no polish
};

/// What the factors that steer the iterations are computed in, and that of the certificate where no polish follows it:
/// where single precision does not find a Hessian definite, double precision decides. The polish and whatever follows it
/// (derivatives) always have one in double precision, and so has `lbfgs_literal`.
enum class FactorPrecision {
  automatic,  ///< mixed for factors of kMixedFromFlops operations and more
  full,
  mixed,  ///< single precision, corrected by conjugate gradients with the Hessian in double precision
};
/// Below it assembly costs more than the factor does, and what a float factor saves is not worth its risk.
inline constexpr double kMixedFromFlops = 2e9;
/// A direction from a factor in single precision: Newton's to this relative residual, in at most so many solves.
inline constexpr double kDirectionTolerance = 1e-3;
inline constexpr int kMaxCorrections = 12;

/// After a whole step of Newton's that lowered the residual, the factor is kept for steps of L-BFGS as long as each leaves
/// at most this share of it, at the first trial: they cost an evaluation and a solve where a new Hessian and its factor
/// cost some ten times that and leave a tenth of the residual or less, so that slower ones would not pay.
inline constexpr double kKeepWhile = 0.6;

struct MinimiserOptions {
  Minimiser method = Minimiser::newton;
  /// Converged when |gradient|₂ ≤ relative_tolerance · force_scale + absolute_tolerance.
  double relative_tolerance = 1e-9;
  double absolute_tolerance = 1e-10;  ///< N
  int max_iterations = 200;
  FactorPrecision precision = FactorPrecision::automatic;
  bool keep_factor = true;  ///< of `newton`: see kKeepWhile; such steps count as iterations too
  int lbfgs_memory = 20;
  int lbfgs_refresh = 20;  ///< iterations between factorisations
  bool certify_minimum =
      true;  ///< require the raw Hessian to factor at the end; else leave along negative curvature
  /// One more raw Newton step after convergence, kept if it lowers the residual (adjoint runs). Skipped when
  /// the raw Hessian does not factor and no certificate was asked for.
  bool polish = false;
  void validate() const;  ///< throws ContractError naming the field
};

/// What the publication says of its L-BFGS: a new factor every 50 iterations (and after a step below 1e-6),
/// converged at |gradient|₂ ≤ 1e-6 (N; it names no unit). Its number of pairs it does not say: 10.
MinimiserOptions published_minimiser();

enum class MinimiserStatus {
  converged,
  max_iterations,
  line_search_failed,  ///< no direction gave a decrease, also not with a strongly shifted Hessian
  not_a_minimum,       ///< the gradient test holds, the raw Hessian does not factor, and there is no way down
  not_finite,          ///< energy, gradient or Hessian not finite at an accepted point (the start, mostly)
  interrupted,         ///< by the callback
  stagnated,  ///< the residual stays above the tolerance, yet the energy no longer resolves the steps
};
const char* name(Minimiser method);
const char* name(FactorPrecision precision);
const char* name(MinimiserStatus status);

struct MinimiserReport {
  MinimiserStatus status = MinimiserStatus::max_iterations;
  int iterations = 0;             ///< accepted steps, including those along negative curvature and the polish
  int lbfgs_iterations = 0;       ///< of these, steps of L-BFGS, also those of Newton's with a factor kept
  int evaluations = 0;            ///< of energy and gradient
  int factorisations = 0;         ///< including the failed ones
  int failed_factorisations = 0;  ///< not positive definite
  int single_factorisations = 0;  ///< of all, those in single precision
  int negative_curvature_exits = 0;
  double energy = 0;          ///< mJ
  double residual = 0;        ///< |gradient|₂, N
  double tolerance = 0;       ///< N, what the residual was compared with
  double smallest_pivot = 0;  ///< of the last raw factor; 0 when none
  double largest_pivot = 0;
  std::vector<double> residuals;  ///< at the start and after every accepted step, N
  bool converged() const { return status == MinimiserStatus::converged; }
  /// Counts the evaluations and factorisations of an attempt that was given up.
  void add_work(const MinimiserReport& given_up) {
    evaluations += given_up.evaluations;
    factorisations += given_up.factorisations;
    failed_factorisations += given_up.failed_factorisations;
    single_factorisations += given_up.single_factorisations;
  }
};

/// Called at the start (iteration 0) and after every accepted step; return false to stop (status interrupted,
/// q is the last accepted point).
using IterationCallback = std::function<bool(int iteration, double energy, double residual)>;

/// What the factor holds that minimise() is given.
enum class GivenFactor {
  none,
  /// That of a nearby Hessian, raw or projected: `newton` begins with steps of L-BFGS over it while they pay.
  near
};

/// Minimises from q (in/out). On return with status converged and certify_minimum, `factor` holds the raw
/// Hessian's factor (in single precision where that steered and no polish followed) and `matrix` the raw Hessian, at the
/// solution or one step before it: a polish, or a last step of Newton's that began within 1e-4 of the force scale.
/// `lbfgs` hands over to Newton when its gradient test holds (certificate) or when it can go no further;
/// `lbfgs_literal` ends there, with the last projected factor.
[[nodiscard]] MinimiserReport minimise(Objective& objective, VectorXd& q, const MinimiserOptions& options,
                                       CholeskyFactor& factor, BlockMatrix& matrix,
                                       const IterationCallback& callback = {},
                                       GivenFactor given = GivenFactor::none);

}  // namespace rhytid
