#include "fitting/residual_signature.h"

#include <Eigen/Cholesky>
#include <algorithm>
#include <cmath>
#include <cstdio>

#include "fitting/identifiability.h"

namespace rhytid::fitting {
namespace {

/// Reduced chi-squares up to this are not spoken of: covariances of tracks are no better known. Of few observations
/// noise alone may make more; they are spoken of from kLeastDeviations above 1 on.
constexpr double kDoubtful = 1.2;
/// A signature is told when one of its axes, which are told then, is so many deviations from 0, and when it explains this
/// share of what is above the noise.
constexpr double kLeastDeviations = 3, kLeastShare = 0.1;
/// Signatures that are told at most.
constexpr std::size_t kMost = 3;
/// A column whose part beyond the fitted parameters is less than this share of it shows nothing.
constexpr double kLeastPart = 1e-6;

std::string number(const char* format, double x) {
  char text[64];
  std::snprintf(text, sizeof text, format, x);
  return text;
}

/// "finger path x by +0.18 ± 0.01 mm (18 σ)".
std::string in_words(const ResidualAxis& axis, double widening) {
  const double estimate = axis.estimate * axis.amount, sigma = axis.sigma * std::fabs(axis.amount) * widening;
  const std::string size = number("%+.2g", estimate) + " ± " + number("%.1g", sigma);
  return axis.name + " by " +
         (axis.unit.empty() ? "(" + size + ") times that change" : size + " " + axis.unit) + " (" +
         number("%.0f", std::fabs(estimate) / sigma) + " σ)";
}

}  // namespace

MatrixXd own_part(const FitProblem::Linearised& at, const MatrixXd& basis, const MatrixXd& columns) {
  const MatrixXd fitted = at.jacobian * basis;  // orthonormal
  MatrixXd own = columns - fitted * (fitted.transpose() * columns);
  own -= fitted * (fitted.transpose() * own);  // what rounding left of it
  return own;
}

void add_signature(const FitProblem::Linearised& at, const MatrixXd& basis, const MatrixXd& columns,
                   const std::vector<ResidualAxis>& axes, SystematicShift& shift) {
  const MatrixXd own = own_part(at, basis, columns);
  for (Eigen::Index k = 0; k < columns.cols(); ++k)
    if (!(own.col(k).norm() > kLeastPart * columns.col(k).norm())) return;
  const Eigen::LLT<MatrixXd> information(own.transpose() * own);
  if (information.info() != Eigen::Success) return;
  const VectorXd score = own.transpose() * at.residuals;
  const VectorXd estimate = -information.solve(score);
  if (!estimate.allFinite()) return;
  const MatrixXd covariance = information.solve(MatrixXd::Identity(columns.cols(), columns.cols()));
  shift.signature = axes;
  for (Eigen::Index k = 0; k < columns.cols(); ++k) {
    ResidualAxis& axis = shift.signature[static_cast<std::size_t>(k)];
    axis.estimate = estimate[k];
    axis.sigma = std::sqrt(covariance(k, k));
  }
  shift.explained = -score.dot(estimate);
}

std::vector<std::string> misfit_sentences(const FitResult& result, int degrees_of_freedom,
                                          double autocorrelation) {
  if (degrees_of_freedom < 1) return {};
  const double of_noise = std::sqrt(2. / degrees_of_freedom) * interval_widening(1, autocorrelation);
  if (!(result.reduced_chi_square > std::max(kDoubtful, 1 + kLeastDeviations * of_noise))) return {};
  const double all = result.reduced_chi_square * degrees_of_freedom;
  struct Told {
    double share;
    std::string text;
  };
  std::vector<Told> told;
  for (const SystematicShift& shift : result.systematic) {
    if (shift.signature.empty()) continue;
    const double share = shift.explained / (all - degrees_of_freedom);
    const double left = std::max(0.0, all - shift.explained) / degrees_of_freedom;
    const double widening = interval_widening(left, autocorrelation);
    std::string list;
    for (const ResidualAxis& axis : shift.signature)
      if (std::fabs(axis.estimate) >= kLeastDeviations * widening * axis.sigma)
        list += (list.empty() ? "" : ", ") + in_words(axis, widening);
    if (list.empty() || share < kLeastShare) continue;
    told.push_back({share, list + ": reduced chi-square would be " + number("%.2f", left) + " instead of " +
                               number("%.2f", result.reduced_chi_square)});
  }
  std::stable_sort(told.begin(), told.end(), [](const Told& a, const Told& b) { return a.share > b.share; });
  const std::string begin = "Residuals are " + number("%.2g", std::sqrt(result.reduced_chi_square)) +
                            " times what the tracks' noise says: the model misses something.";
  if (told.empty())
    return {begin + (result.systematic.empty()
                         ? std::string()
                         : " They look like none of the changes that were considered.")};
  std::vector<std::string> sentences = {begin + " They look most as if this were off: " + told[0].text + "."};
  for (std::size_t k = 1; k < std::min(kMost, told.size()); ++k)
    sentences.push_back("They also look, by itself, as if this were off: " + told[k].text + ".");
  return sentences;
}

}  // namespace rhytid::fitting
