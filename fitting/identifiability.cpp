#include "fitting/identifiability.h"

#include <Eigen/SVD>
#include <algorithm>
#include <cmath>
#include <cstdio>
#include <limits>
#include <numbers>
#include <numeric>

#include "sim/core/error.h"

namespace rhytid::fitting {
namespace {

/// Singular values below this part of the largest are zero within the accuracy of the tangent sweep.
constexpr double kNullTolerance = 1e-8;
/// Components of a direction below this part of its largest one are left out of sentences.
constexpr double kMentioned = 0.3;
/// And so are all beyond this many; the sentence then says how many they are.
constexpr int kMentionedAtMost = 8;
constexpr double kInfinity = std::numeric_limits<double>::infinity();

std::string format(const char* pattern, double x) {
  char text[64];
  std::snprintf(text, sizeof(text), pattern, x);
  return text;
}

/// Up to here the finite sum for whole degrees of freedom is used; beyond, an expansion errs by less than
/// 1e-7.
constexpr int kExactStudent = 100;

/// P(|T| <= t) of Student's t with v degrees of freedom (Abramowitz and Stegun 26.7.3, 26.7.4).
double student_within(double t, int v) {
  const double theta = std::atan(t / std::sqrt(v)), c = std::cos(theta), s = std::sin(theta);
  const bool is_odd = v % 2 == 1;
  // Odd: cos + 2/3 cos³ + 2·4/(3·5) cos⁵ ... to cos^(v−2); even: 1 + 1/2 cos² + 1·3/(2·4) cos⁴ ... to the
  // same.
  double term = is_odd ? c : 1, sum = 0;
  for (int power = is_odd ? 1 : 0; power <= v - 2; power += 2) {
    sum += term;
    term *= c * c * (power + 1) / (power + 2);
  }
  return is_odd ? 2 / std::numbers::pi * (theta + s * sum) : s * sum;
}

}  // namespace

Identifiability::Identifiability(const MatrixXd& jacobian, const std::vector<FitVariable>& variables,
                                 double widening, const MatrixXd& misfit)
    : variables_(variables), scale_(VectorXd::Ones(jacobian.cols())), widening_(widening) {
  const int n = static_cast<int>(jacobian.cols());
  require(n == static_cast<int>(variables.size()), "Identifiability: one variable per column");
  require(jacobian.rows() >= n && jacobian.allFinite(), "Identifiability: Jacobian is wide or not finite");
  for (int k = 0; k < n; ++k)
    if (variables[k].transform == ParameterTransform::none)
      scale_[k] = variables[k].upper - variables[k].lower;
  const Eigen::JacobiSVD<MatrixXd> svd(jacobian * scale_.asDiagonal(), Eigen::ComputeThinV);
  singular_values_ = svd.singularValues();
  right_vectors_ = svd.matrixV();
  for (int i = 0; i < n; ++i) {
    if (singular_values_[i] > kNullTolerance * singular_values_[0]) ++rank_;
    Eigen::Index largest;  // the sign of a singular vector is free: make its largest component positive
    right_vectors_.col(i).cwiseAbs().maxCoeff(&largest);
    if (right_vectors_(largest, i) < 0) right_vectors_.col(i) *= -1;
  }
  if (misfit.size() == 0) return;
  require(misfit.rows() == n && misfit.cols() == n, "Identifiability: misfit by the parameters");
  const MatrixXd v = scale_.asDiagonal() * right_vectors_;
  misfit_ = v.transpose() * misfit * v;
}

std::pair<double, double> Identifiability::deviations(const VectorXd& g) const {
  const VectorXd part = right_vectors_.transpose() * scale_.cwiseProduct(g);
  VectorXd by_noise = VectorXd::Zero(part.size()), by_misfit = by_noise;
  for (int i = 0; i < part.size(); ++i) {
    if (i < rank_) {
      by_noise[i] = part[i] / singular_values_[i];
      by_misfit[i] = by_noise[i] / singular_values_[i];
    } else if (std::fabs(part[i]) > 1e-6 * scale_.cwiseProduct(g).norm()) {
      return {kInfinity, kInfinity};
    }
  }
  const double noise = widening_ * by_noise.norm();
  if (misfit_.size() == 0) return {noise, 0};
  return {noise, std::sqrt(std::max(0.0, by_misfit.dot(misfit_ * by_misfit)))};
}

double Identifiability::sigma(const VectorXd& g) const {
  const auto [noise, misfit] = deviations(g);
  return std::max(noise, misfit);
}

double Identifiability::widened_by_misfit(int parameter) const {
  const auto [noise, misfit] = deviations(VectorXd::Unit(scale_.size(), parameter));
  return misfit > noise ? misfit / noise : 1;
}

double Identifiability::sigma(int parameter) const {
  return sigma(VectorXd::Unit(scale_.size(), parameter));
}

MatrixXd Identifiability::correlation() const {
  const Eigen::Index n = scale_.size();
  MatrixXd covariance = MatrixXd::Zero(n, n);
  for (int i = 0; i < rank_; ++i)
    covariance +=
        right_vectors_.col(i) * right_vectors_.col(i).transpose() / std::pow(singular_values_[i], 2);
  MatrixXd result = MatrixXd::Identity(n, n);
  for (Eigen::Index a = 0; a < n; ++a)
    for (Eigen::Index b = 0; b < n; ++b) {
      if (a == b) continue;
      const bool finite =
          std::isfinite(sigma(static_cast<int>(a))) && std::isfinite(sigma(static_cast<int>(b)));
      result(a, b) = finite ? covariance(a, b) / std::sqrt(covariance(a, a) * covariance(b, b))
                            : std::numeric_limits<double>::quiet_NaN();
    }
  return result;
}

bool Identifiability::determined(int parameter) const {
  const double limit = variables_[parameter].transform == ParameterTransform::none ? 0.25 : 1.0;
  return sigma(parameter) <= limit * scale_[parameter];
}

std::string Identifiability::direction_in_words(int i) const {
  const VectorXd v = right_vectors_.col(i);
  std::vector<int> order(v.size());
  std::iota(order.begin(), order.end(), 0);
  std::stable_sort(order.begin(), order.end(),
                   [&](int a, int b) { return std::fabs(v[a]) > std::fabs(v[b]); });
  std::string up, down;
  int mentioned = 0, more = 0;
  for (const int k : order) {
    if (std::fabs(v[k]) < kMentioned * std::fabs(v[order.front()])) break;
    if (mentioned == kMentionedAtMost) {
      ++more;
      continue;
    }
    std::string& list = v[k] > 0 ? up : down;
    list += (list.empty() ? "" : ", ") + variables_[k].name;
    ++mentioned;
  }
  if (more > 0) (down.empty() ? up : down) += " and " + std::to_string(more) + " more";
  const std::string effect = i >= rank_ ? " changes no tracked feature."
                                        : " by 10 % changes all tracked features together by only " +
                                              format("%.2g", 0.1 * singular_values_[i] / widening_) +
                                              " standard deviations.";
  if (mentioned == 1) return up + " is not determined: changing it" + effect;
  if (down.empty()) return up + " go together: raising all of them" + effect;
  return up + " trade off against " + down + ": raising the former while lowering the latter" + effect;
}

std::vector<std::string> Identifiability::cannot_tell() const {
  std::vector<std::string> sentences;
  for (int i = static_cast<int>(singular_values_.size()) - 1; i >= 0; --i)  // the worst first
    if (i >= rank_ || widening_ / singular_values_[i] > 1) sentences.push_back(direction_in_words(i));
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

double student_quantile_975(int degrees_of_freedom) {
  const int v = std::max(1, degrees_of_freedom);
  if (v > kExactStudent) {
    const double z = 1.959963984540054, z3 = z * z * z, z5 = z3 * z * z, z7 = z5 * z * z;
    const double d = v;
    return z + (z3 + z) / (4 * d) + (5 * z5 + 16 * z3 + 3 * z) / (96 * d * d) +
           (3 * z7 + 19 * z5 + 17 * z3 - 15 * z) / (384 * d * d * d);
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
