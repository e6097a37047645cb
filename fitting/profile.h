// Profile likelihood: how the least cost grows when one parameter is held at other values and all others are
// fitted again. Unlike the interval of the linearised model it needs no parabola.
//
//   F_k(τ) = min over t with t_k = τ of F(t),    D_k(τ) = 2 (F_k(τ) − F(t̂)) / w_k²,    r_k = ± √D_k
//
// and the 95 % interval is where D_k < q². w_k = σ_k / √((JᵀJ)⁻¹)_kk is by how much the reported deviation
// σ_k is wider than the noise as stated (identifiability.h: reduced chi-square, memory, what neighbours err
// alike), since a cost of residuals that repeat each other counts too much; q is the 97.5 % quantile of
// Student's t with the degrees of freedom of σ_k (1.96 for many: q² = 3.84). So for a linear model the
// interval is t̂_k ± q σ_k, as the reported one is before shifts of the discretisation, which no profile
// sees.
//
// Values go outward from the optimum in steps of σ_k, each search begins where the parabola's valley leads
// from the neighbouring one. A side ends beyond the 99 % level or at the bound; the ends of the interval come
// from r_k, interpolated by a monotone cubic, the outermost crossing.
//
// Source   D. J. Venzon, S. H. Moolgavkar, Appl. Statist. 37 (1988) 87–94; F. N. Fritsch, J. Butland, SIAM J.
//          Sci. Stat. Comput. 5 (1984) 300–304 (the interpolation)
// Tests    tests/fitting/profile_test.cpp
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "fitting/fit.h"
#include "fitting/identifiability.h"

namespace rhytid::fitting {

/// The parabola that a profile is measured by.
struct ProfileScale {
  double sigma = 1;                     ///< σ_k; infinite when the linearised model leaves t_k open
  double widening = 1;                  ///< w_k
  double quantile = 1.959963984540054;  ///< q
  VectorXd valley;                      ///< ∂t/∂t_k along the parabola's valley, 1 for t_k itself
};
ProfileScale profile_scale(const Identifiability& found, int parameter, double widening);

struct ProfiledPoint {
  double t_k = 0, cost = 0;
  VectorXd t;          ///< where the others ended
  std::string status;  ///< converged | max_evaluations | failed: ...; `optimum` for the point it began from
  int forward_runs = 0;
};

struct Profile {
  std::vector<ProfiledPoint> points;  ///< by t_k, the optimum among them; those without a cost left out
  std::optional<double> low, high;    ///< ends of the 95 % interval; nothing: no crossing on that side
  std::string failure_below, failure_above;  ///< why a side ends early
  int forward_runs = 0;
};

/// Profile of parameter k about `best` with its `cost`; `steps` > 0, ascending, in units of σ_k. Incomplete
/// when the objective is stopped.
Profile profile_of(Objective& objective, int k, const VectorXd& best, double cost, const ProfileScale& scale,
                   const LocalFit& local_fit, const std::vector<double>& steps = {0.5, 1, 1.5, 2, 3});

/// Where the monotone cubic through (x, y), x ascending, last crosses `level` from below, going right; nothing
/// when it does not.
std::optional<double> last_crossing(const std::vector<double>& x, const std::vector<double>& y, double level);

/// Variables that `/fit/profiles` names: addresses of fitted parameters, or "all". Throws InputError.
std::vector<int> profiled_variables(const JointProblem& problem, const std::vector<std::string>& addresses);

/// Profiles of `variables` about t, the best point, with `noise_widening` of the intervals, into the result:
/// table, sentences, and the cost. Incomplete when the problem is stopped.
void add_profiles(JointProblem& problem, const VectorXd& t, const std::vector<int>& variables,
                  const Identifiability& found, double noise_widening, const LocalFit& local_fit,
                  const FitObserver& observer, FitResult& result);

}  // namespace rhytid::fitting
