// Objectives whose every valley is known, for tests of what is built upon searches.
#pragma once

#include <functional>
#include <set>
#include <utility>
#include <vector>

#include "fitting/objective.h"

namespace rhytid::fitting::test {

/// Residuals and their Jacobian as functions; every evaluation at another point than the last is a run.
class HandMadeObjective final : public Objective {
 public:
  std::vector<FitVariable> list;
  int residuals = 0;
  std::function<VectorXd(const VectorXd&)> z;
  std::function<MatrixXd(const VectorXd&)> dz;
  std::function<bool(const VectorXd&)> fails = [](const VectorXd&) { return false; };
  int stops_after = 0;  ///< runs; 0 = never

  const std::vector<FitVariable>& variables() const override { return list; }
  VectorXd initial() const override {
    return of_all([](const FitVariable& v) { return v.initial; });
  }
  VectorXd lower() const override {
    return of_all([](const FitVariable& v) { return v.lower; });
  }
  VectorXd upper() const override {
    return of_all([](const FitVariable& v) { return v.upper; });
  }
  int num_residuals() const override { return residuals; }
  const ObjectiveEvaluation& evaluate(const VectorXd& t) override {
    if (t_.size() == t.size() && t_ == t) return at_;
    t_ = t;
    at_ = ObjectiveEvaluation();
    was_stopped_ = was_stopped_ || (stops_after > 0 && runs_ >= stops_after);
    if (!was_stopped_) ++runs_;
    at_.failed = was_stopped_ || fails(t);
    if (at_.failed) {
      at_.failure = last_failure_ = was_stopped_ ? "stopped" : "there is no value there";
    } else {
      at_.residuals = z(t);
      at_.cost = 0.5 * at_.residuals.squaredNorm();
    }
    return at_;
  }
  std::optional<MatrixXd> jacobian(const VectorXd& t) override {
    if (evaluate(t).failed) return std::nullopt;
    return dz(t);
  }
  std::optional<VectorXd> gradient(const VectorXd& t) override {
    if (evaluate(t).failed) return std::nullopt;
    return dz(t).transpose() * at_.residuals;
  }
  int forward_runs() const override { return runs_; }
  bool was_stopped() const override { return was_stopped_; }
  const std::string& last_failure() const override { return last_failure_; }

 private:
  VectorXd of_all(const std::function<double(const FitVariable&)>& value) const {
    VectorXd t(list.size());
    for (std::size_t k = 0; k < list.size(); ++k)
      t[static_cast<Eigen::Index>(k)] = list[k].to_transformed(value(list[k]));
    return t;
  }

  VectorXd t_;
  ObjectiveEvaluation at_;
  int runs_ = 0;
  bool was_stopped_ = false;
  std::string last_failure_;
};

inline FitVariable plain_variable(const std::string& name, double initial, double lower, double upper) {
  return {.address = "/" + name,
          .name = name,
          .unit = "mm",
          .transform = ParameterTransform::none,
          .initial = initial,
          .lower = lower,
          .upper = upper,
          .prior_sigma = {}};
}

/// 2 F = (10 (a² − 1))² + (`depth` (a + 1))² + (ln b + a)²: valleys at a = −1 with F = 0 and near a = 1 with
/// F about 2 depth². Begins at a = 0.9, b = 1; a in −2..3, b in 0.2..10 (logarithmic).
inline HandMadeObjective two_valleys(double depth) {
  HandMadeObjective o;
  o.list = {plain_variable("a", 0.9, -2, 3), plain_variable("b", 1, 0.2, 10)};
  o.list[1].transform = ParameterTransform::log;
  o.residuals = 3;
  o.z = [depth](const VectorXd& t) -> VectorXd {
    return Vec3(10 * (t[0] * t[0] - 1), depth * (t[0] + 1), t[1] + t[0]);
  };
  o.dz = [depth](const VectorXd& t) {
    MatrixXd j(3, 2);
    j << 20 * t[0], 0, depth, 0, 1, 1;
    return j;
  };
  return o;
}

/// 2 F = Σ t_k²/σ² about 0, plain variables in −1..1.
inline HandMadeObjective parabola(int parameters, double sigma) {
  HandMadeObjective o;
  for (int k = 0; k < parameters; ++k) o.list.push_back(plain_variable("p" + std::to_string(k), 0, -1, 1));
  o.residuals = parameters;
  o.z = [sigma](const VectorXd& t) -> VectorXd { return t / sigma; };
  o.dz = [sigma, parameters](const VectorXd&) -> MatrixXd {
    return MatrixXd::Identity(parameters, parameters) / sigma;
  };
  return o;
}

}  // namespace rhytid::fitting::test
