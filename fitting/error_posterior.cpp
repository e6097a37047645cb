#include "fitting/error_posterior.h"

#include <Eigen/Eigenvalues>
#include <algorithm>
#include <cmath>
#include <cstdio>

#include "fitting/identifiability.h"
#include "fitting/residual_signature.h"

namespace rhytid::fitting {
namespace {

/// A combination of errors whose part beyond the fitted parameters is less than this share of the largest change is not told.
constexpr double kLeastPart = 1e-6;

MatrixXd positive_part(const MatrixXd& symmetric) {
  if (symmetric.size() == 0) return symmetric;  // no parameter is told; Eigen's solver wants one
  const Eigen::SelfAdjointEigenSolver<MatrixXd> eigen(symmetric);
  const MatrixXd& v = eigen.eigenvectors();
  return v * eigen.eigenvalues().cwiseMax(0).asDiagonal() * v.transpose();
}

/// "x 0.05, y 0.1 and z 0.02 mm" of axes "finger path x", ...; "3.1 %" of one.
std::string left_in_words(const SystematicShift& shift) {
  std::string text;
  for (std::size_t k = 0; k < shift.signature.size(); ++k) {
    const ResidualAxis& axis = shift.signature[k];
    char amount[32];
    std::snprintf(amount, sizeof amount, "%.2g", shift.left[k] * std::fabs(axis.amount));
    if (k > 0) text += k + 1 == shift.signature.size() ? " and " : ", ";
    const std::size_t space = axis.name.rfind(' ');
    if (shift.signature.size() > 1)
      text += (space == std::string::npos ? axis.name : axis.name.substr(space + 1)) + " ";
    text += amount + (k + 1 == shift.signature.size() ? " " + axis.unit : std::string());
  }
  return text;
}

/// What the residuals leave of one held thing: `squares` of its own errors, whose shifts are the columns of `moves`.
void weigh(const MatrixXd& squares, const MatrixXd& moves, SystematicShift& shift) {
  const VectorXd left = squares.diagonal().cwiseSqrt();
  shift.left.assign(left.begin(), left.end());
  if (shift.axes.empty())
    for (double& moved : shift.shift) moved *= left[0];
  else
    set_covariance(moves * squares * moves.transpose(), shift);
  shift.change += ", of which the residuals leave " +
                  (shift.signature.empty() ? std::string("what the table says") : left_in_words(shift));
}

}  // namespace

void set_covariance(const MatrixXd& covariance, SystematicShift& shift) {
  const VectorXd size = covariance.diagonal().cwiseMax(0).cwiseSqrt();
  shift.shift.assign(size.begin(), size.end());
  shift.axes.clear();
  const Eigen::SelfAdjointEigenSolver<MatrixXd> eigen(covariance);
  for (Eigen::Index a = size.size() - 1; a >= 0; --a) {
    if (!(eigen.eigenvalues()[a] > 0)) continue;
    const VectorXd axis = std::sqrt(eigen.eigenvalues()[a]) * eigen.eigenvectors().col(a);
    shift.axes.emplace_back(axis.begin(), axis.end());
  }
  if (shift.axes.empty()) shift.axes.push_back(shift.shift);  // nothing moves
}

ErrorPosterior error_posterior(const FitProblem::Linearised& at, const MatrixXd& basis,
                               const MatrixXd& columns, int degrees_of_freedom, double autocorrelation) {
  const MatrixXd own = own_part(at, basis, columns);
  // In the principal axes of AᵀA = R Λ Rᵀ all is by components.
  const Eigen::SelfAdjointEigenSolver<MatrixXd> eigen(own.transpose() * own);
  const VectorXd information = eigen.eigenvalues().cwiseMax(0);
  const VectorXd score = -eigen.eigenvectors().transpose() * (own.transpose() * at.residuals);
  const double least = kLeastPart * kLeastPart * columns.colwise().squaredNorm().maxCoeff();
  int seen = 0;
  double explained = 0;  // of |z|²
  for (Eigen::Index k = 0; k < information.size(); ++k) {
    if (!(information[k] > least)) continue;
    explained += score[k] * score[k] / information[k];
    ++seen;
  }
  const double widening = interval_widening(
      std::max(0.0, at.residuals.squaredNorm() - explained) / std::max(1, degrees_of_freedom - seen),
      autocorrelation);
  const double noise = widening * widening;
  const VectorXd told = information.array() / (information.array() + noise);
  ErrorPosterior found;
  // w² falls on the right-hand side, so that there is one solution, between these.
  const auto with_missed = [&](double w2) {
    const VectorXd believed = score.cwiseQuotient(VectorXd(information.array() + w2));
    return noise + kFirstOrder * kFirstOrder * information.dot(believed.cwiseAbs2()) / told.sum();
  };
  double low = noise, high = seen > 0 ? with_missed(noise) : noise;
  for (int halving = 0; halving < 100 && low < high; ++halving) {
    const double middle = 0.5 * (low + high);
    (with_missed(middle) > middle ? low : high) = middle;
  }
  found.variance = high;
  const VectorXd variances = (information.array() / found.variance + 1).inverse();
  const VectorXd mean = variances.cwiseProduct(score) / found.variance;
  found.mean = eigen.eigenvectors() * mean;
  found.covariance = eigen.eigenvectors() * variances.asDiagonal() * eigen.eigenvectors().transpose();
  return found;
}

void weigh_by_residuals(const FitProblem::Linearised& at, const MatrixXd& basis, int degrees_of_freedom,
                        double autocorrelation, std::vector<SystematicShift>& shifts) {
  Eigen::Index count = 0;
  bool holds_any = false;
  for (const SystematicShift& shift : shifts) {
    count += shift.columns.cols();
    holds_any = holds_any || (shift.is_held() && shift.columns.cols() > 0);
  }
  if (!holds_any) {
    for (SystematicShift& shift : shifts) shift.columns.resize(0, 0);
    return;
  }
  MatrixXd columns(at.residuals.size(), count);
  std::vector<bool> is_held;
  for (SystematicShift& shift : shifts) {
    const Eigen::Index axes = shift.columns.cols();
    if (axes > 0) columns.middleCols(static_cast<Eigen::Index>(is_held.size()), axes) = shift.columns;
    is_held.insert(is_held.end(), static_cast<std::size_t>(axes), shift.is_held());
  }
  const MatrixXd squares = error_posterior(at, basis, columns, degrees_of_freedom, autocorrelation).squares();
  MatrixXd apart = squares;  // finer steps by themselves
  for (Eigen::Index a = 0; a < count; ++a)
    for (Eigen::Index b = 0; b < count; ++b)
      if (!is_held[static_cast<std::size_t>(a)] || !is_held[static_cast<std::size_t>(b)])
        apart(a, b) = a == b ? 1 : 0;
  // In the coordinates y, t = P y, in which the noise is the same in all directions.
  const MatrixXd moves = -basis.transpose() * (at.jacobian.transpose() * columns);
  const MatrixXd believed = moves * squares * moves.transpose();
  const MatrixXd together = believed + positive_part(moves * apart * moves.transpose() - believed);
  Eigen::Index first = 0;
  for (SystematicShift& shift : shifts) {
    const Eigen::Index axes = shift.columns.cols();
    if (axes > 0 && shift.is_held())
      weigh(squares.block(first, first, axes, axes), basis * moves.middleCols(first, axes), shift);
    first += axes;
    shift.columns.resize(0, 0);
  }
  SystematicShift sum;
  sum.name = kTogether;
  sum.change =
      "one deviation of all of these at once, with what the residuals say of one or the other (not the root "
      "of their "
      "squares); intervals have 1.96 times it, beside the noise";
  set_covariance(basis * together * basis.transpose(), sum);
  shifts.push_back(std::move(sum));
}

}  // namespace rhytid::fitting
