#include "fitting/identifiability.h"

#include <Eigen/Eigenvalues>
#include <algorithm>
#include <cmath>
#include <cstdio>
#include <limits>

#include "adjoint/directions.h"
#include "sim/core/error.h"

namespace rhytid::fitting {
namespace {

constexpr double kInfinity = std::numeric_limits<double>::infinity();

std::string format(const char* pattern, double x) {
  char text[64];
  std::snprintf(text, sizeof(text), pattern, x);
  return text;
}

constexpr double kNormalQuantile = 1.959963984540054;  // 97.5 %

/// Beyond so many degrees of freedom an expansion errs by less than 1e-7.
constexpr double kExactStudent = 100;

/// P(|T| <= t) of Student's t with v >= 1 degrees of freedom: with t = √v tan θ the density is
/// cos^(v−1) θ / B(v/2, 1/2) on both sides, integrated by Simpson's rule.
double student_within(double t, double v) {
  constexpr int panels = 400;
  const double end = std::atan(t / std::sqrt(v)), step = end / panels;
  double sum = 0;
  for (int i = 0; i <= panels; ++i) {
    const double weight = i == 0 || i == panels ? 1 : i % 2 == 1 ? 4 : 2;
    sum += weight * std::pow(std::cos(i * step), v - 1);
  }
  return 2 * sum * step / 3 / std::beta(0.5 * v, 0.5);
}

}  // namespace

Identifiability::Identifiability(const MatrixXd& jacobian, const std::vector<FitVariable>& variables,
                                 double widening, int degrees_of_freedom,
                                 const std::vector<WhitenedTrack>& tracks)
    : variables_(variables),
      scale_(VectorXd::Ones(jacobian.cols())),
      misfit_({}, MatrixXd()),
      widening_(widening),
      degrees_of_freedom_(degrees_of_freedom) {
  const int n = static_cast<int>(jacobian.cols());
  require(n == static_cast<int>(variables.size()), "Identifiability: one variable per column");
  require(jacobian.rows() >= n && jacobian.allFinite(), "Identifiability: Jacobian is wide or not finite");
  for (int k = 0; k < n; ++k)
    if (variables[k].transform == ParameterTransform::none)
      scale_[k] = variables[k].upper - variables[k].lower;
  const adjoint::Directions directions = adjoint::directions_of(jacobian * scale_.asDiagonal());
  singular_values_ = directions.singular_values;
  right_vectors_ = directions.right_vectors;
  rank_ = directions.rank;
  basis_ = scale_.asDiagonal() * directions.basis();
  misfit_ = SpatialMisfit(tracks, basis_);
  if (rank_ == 0) return;
  const Eigen::SelfAdjointEigenSolver<MatrixXd> eigen(misfit_.covariance());
  directions_ = eigen.eigenvectors();
  variances_ = eigen.eigenvalues().cwiseMax(widening * widening);
}

bool Identifiability::is_open(const VectorXd& g) const {
  const VectorXd scaled = scale_.cwiseProduct(g);
  const VectorXd null_part = right_vectors_.rightCols(scale_.size() - rank_).transpose() * scaled;
  return null_part.size() > 0 && null_part.cwiseAbs().maxCoeff() > 1e-6 * scaled.norm();
}

void Identifiability::add_systematic(const std::vector<double>& shift) {
  require(static_cast<Eigen::Index>(shift.size()) == scale_.size(),
          "Identifiability: one shift per parameter");
  systematic_.emplace_back(Eigen::Map<const VectorXd>(shift.data(), scale_.size()));
}

double Identifiability::noise_sigma(const VectorXd& g) const {
  if (is_open(g)) return kInfinity;
  const VectorXd along = directions_.transpose() * (basis_.transpose() * g);
  return std::sqrt(along.cwiseAbs2().dot(variances_));
}

double Identifiability::systematic(const VectorXd& g) const {
  double squares = 0;
  for (const VectorXd& shift : systematic_) squares += std::pow(g.dot(shift), 2);
  return std::sqrt(squares);
}

double Identifiability::sigma(const VectorXd& g) const {
  return std::hypot(noise_sigma(g), systematic(g));
}

double Identifiability::sigma(int parameter) const {
  return sigma(VectorXd::Unit(scale_.size(), parameter));
}

double Identifiability::degrees(const VectorXd& g) const {
  if (is_open(g)) return 1;
  const VectorXd y = basis_.transpose() * g, along = directions_.transpose() * y;
  double by_noise = 0, by_misfit = 0;
  for (int i = 0; i < rank_; ++i)
    (variances_[i] > widening_ * widening_ ? by_misfit : by_noise) += along[i] * along[i] * variances_[i];
  const double total = by_noise + by_misfit;
  if (!(by_misfit > 0)) return std::max(1, degrees_of_freedom_);
  return total * total /
         (by_misfit * by_misfit / misfit_.degrees(y) +
          by_noise * by_noise / std::max(1, degrees_of_freedom_));
}

double Identifiability::half_width(const VectorXd& g) const {
  return std::hypot(student_quantile_975(degrees(g)) * noise_sigma(g), kNormalQuantile * systematic(g));
}

double Identifiability::half_width(int parameter) const {
  return half_width(VectorXd::Unit(scale_.size(), parameter));
}

double Identifiability::widened_by_misfit(int parameter) const {
  const VectorXd g = VectorXd::Unit(scale_.size(), parameter);
  return is_open(g) ? 1 : noise_sigma(g) / (widening_ * (basis_.transpose() * g).norm());
}

MatrixXd Identifiability::correlation() const {
  const Eigen::Index n = scale_.size();
  const MatrixXd root = basis_ * directions_ * variances_.cwiseSqrt().asDiagonal();
  MatrixXd covariance = root * root.transpose();
  for (const VectorXd& shift : systematic_) covariance += shift * shift.transpose();
  MatrixXd result = MatrixXd::Identity(n, n);
  for (Eigen::Index a = 0; a < n; ++a)
    for (Eigen::Index b = 0; b < n; ++b) {
      if (a == b) continue;
      const bool finite = !is_open(VectorXd::Unit(n, a)) && !is_open(VectorXd::Unit(n, b));
      result(a, b) = finite ? covariance(a, b) / std::sqrt(covariance(a, a) * covariance(b, b))
                            : std::numeric_limits<double>::quiet_NaN();
    }
  return result;
}

double Identifiability::deviation_along(int i) const {
  const VectorXd along = directions_.row(i).transpose();
  return std::hypot(std::sqrt(along.cwiseAbs2().dot(variances_)) / singular_values_[i],
                    systematic(right_vectors_.col(i).cwiseQuotient(scale_)));
}

bool Identifiability::determined(int parameter) const {
  const double limit = variables_[parameter].transform == ParameterTransform::none ? 0.25 : 1.0;
  return sigma(parameter) <= limit * scale_[parameter];
}

std::string Identifiability::direction_in_words(int i) const {
  std::vector<std::string> names;
  for (const FitVariable& variable : variables_) names.push_back(variable.name);
  return adjoint::direction_in_words(right_vectors_.col(i), names) +
         (i >= rank_ ? " changes no tracked feature."
                     : " by 10 % changes all tracked features together by only " +
                           format("%.2g", 0.1 / deviation_along(i)) + " standard deviations.");
}

std::vector<std::string> Identifiability::cannot_tell() const {
  std::vector<std::string> sentences;
  for (int i = static_cast<int>(singular_values_.size()) - 1; i >= 0; --i)  // the worst first
    if (i >= rank_ || deviation_along(i) > 1) sentences.push_back(direction_in_words(i));
  for (int k = 0; k < scale_.size(); ++k) {
    if (determined(k)) continue;
    const double s = sigma(k) / scale_[k];
    const bool is_plain = variables_[k].transform == ParameterTransform::none;
    sentences.push_back("This footage does not determine " + variables_[k].name + ": " +
                        (std::isfinite(s) ? "its standard deviation is " +
                                                (is_plain ? format("%.2g", s) + " of the allowed range"
                                                          : "a factor of " + format("%.2g", std::exp(s)))
                                          : "any value fits") +
                        ".");
  }
  return sentences;
}

double student_quantile_975(double degrees_of_freedom) {
  const double v = std::max(1.0, degrees_of_freedom);
  if (v > kExactStudent) {
    const double z = kNormalQuantile, z3 = z * z * z, z5 = z3 * z * z, z7 = z5 * z * z;
    return z + (z3 + z) / (4 * v) + (5 * z5 + 16 * z3 + 3 * z) / (96 * v * v) +
           (3 * z7 + 19 * z5 + 17 * z3 - 15 * z) / (384 * v * v * v);
  }
  double low = 1.9, high = 12.8;  // the quantiles of infinity and of one degree of freedom lie inside
  for (int round = 0; round < 60; ++round) {
    const double middle = 0.5 * (low + high);
    (student_within(middle, v) < 0.95 ? low : high) = middle;
  }
  return 0.5 * (low + high);
}

double interval_widening(double reduced_chi_square, double autocorrelation) {
  const double rho = std::clamp(autocorrelation, 0.0, 0.95);
  return std::sqrt(std::max(1.0, reduced_chi_square) * (1 + rho) / (1 - rho));
}

double lag_one_autocorrelation(const std::vector<MatrixXd>& series,
                               const std::vector<std::vector<int>>& frames) {
  double products = 0, squares = 0;
  for (std::size_t k = 0; k < series.size(); ++k)
    for (Eigen::Index j = 0; j + 1 < series[k].rows(); ++j) {
      if (frames[k][j + 1] != frames[k][j] + 1) continue;
      products += series[k].row(j).dot(series[k].row(j + 1));
      squares += 0.5 * (series[k].row(j).squaredNorm() + series[k].row(j + 1).squaredNorm());
    }
  return squares > 0 ? products / squares : 0;
}

}  // namespace rhytid::fitting
