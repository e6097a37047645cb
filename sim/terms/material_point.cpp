#include "sim/terms/material_point.h"

#include <Eigen/Dense>
#include <cmath>
#include <cstdio>

#include "sim/core/error.h"
#include "sim/terms/skin_law.h"

namespace rhytid {

namespace {

using D5 = Dual<SkinParameters::count>;

/// μ∞, C, K, μ_m, τ with their derivatives by E, ν, C, fraction, τ.
void law_parameters(const SkinParameters& p, DamperScheme scheme, D5* theta) {
  const D5 e = D5::variable(p.youngs_modulus, 0), nu = D5::variable(p.poissons_ratio, 1);
  D5 fraction = D5::variable(p.relaxing_fraction, 3);
  if (scheme == DamperScheme::none) fraction = D5(0.0);  // as in a scene: all of μ is elastic
  const D5 mu = e / (2.0 * (nu + 1.0));
  theta[SkinTheta::mu_inf] = (1.0 - fraction) * mu;
  theta[SkinTheta::stiffening] = D5::variable(p.stiffening, 2);
  theta[SkinTheta::bulk] = e / (3.0 * (1.0 - 2.0 * nu));
  theta[SkinTheta::mu_m] = fraction * mu;
  theta[SkinTheta::tau] = D5::variable(p.relaxation_time, 4);
}

/// Y = H + Hᵀ + HᵀH from F, row-major.
template <class T>
void strain_of(const T* f, T* y) {
  T h[9];
  for (int i = 0; i < 9; ++i) h[i] = i % 4 == 0 ? f[i] - 1.0 : f[i];
  for (int c = 0; c < 6; ++c) {
    const int k = kSymRow[c], l = kSymCol[c];
    y[c] = h[3 * k + l] + h[3 * l + k] + h[k] * h[l] + h[3 + k] * h[3 + l] + h[6 + k] * h[6 + l];
  }
}

/// P = F S, S = 2 ∂ψ/∂C.
template <class T>
void piola_of(const SkinLaw& law, const T* f, const T* prepared, const T* theta, double dt, T* p) {
  T y[6], sigma[6];
  strain_of(f, y);
  (void)law.stress<T>(y, prepared, theta, nullptr, dt, sigma);
  for (int a = 0; a < 3; ++a)
    for (int i = 0; i < 3; ++i) {
      p[3 * a + i] = T(0.0);
      for (int k = 0; k < 3; ++k) {
        const T s = k == i ? 2.0 * sigma[i] : sigma[kSym[k][i]];
        p[3 * a + i] += f[3 * a + k] * s;
      }
    }
}

double determinant(const double* f) {
  return f[0] * (f[4] * f[8] - f[5] * f[7]) - f[1] * (f[3] * f[8] - f[5] * f[6]) +
         f[2] * (f[3] * f[7] - f[4] * f[6]);
}

/// The free diagonal entries: Newton on P_kk = 0 with the dual tangent, steps halved while they leave det F >
/// 0 or do not reduce |P_kk|. Writes the tangent ∂P_kk/∂F_ll at the solution.
bool solve_free(const SkinLaw& law, const std::vector<int>& axes, const double* prepared, const double* theta,
                double dt, double* f, MatrixXd& tangent) {
  using D3 = Dual<3>;
  const int n = static_cast<int>(axes.size());
  const auto residual = [&](const double* at, VectorXd& r, MatrixXd* slope) {
    D3 fd[9], pd[6], td[5], p[9];
    for (int i = 0; i < 9; ++i) fd[i] = at[i];
    for (int k = 0; k < n; ++k) fd[4 * axes[k]] = D3::variable(at[4 * axes[k]], k);
    for (int i = 0; i < 6; ++i) pd[i] = prepared[i];
    for (int i = 0; i < 5; ++i) td[i] = theta[i];
    piola_of(law, fd, pd, td, dt, p);
    r.resize(n);
    if (slope) slope->resize(n, n);
    for (int k = 0; k < n; ++k) {
      r[k] = p[4 * axes[k]].v;
      for (int l = 0; slope && l < n; ++l) (*slope)(k, l) = p[4 * axes[k]].d[l];
    }
  };
  VectorXd r, trial_r;
  residual(f, r, &tangent);
  for (int iteration = 0; iteration < 100; ++iteration) {
    const VectorXd step = -tangent.fullPivLu().solve(r);
    if (!step.allFinite()) return false;
    double trial[9], length = 1;
    bool better = false;
    for (int halving = 0; halving < 40 && !better; ++halving, length /= 2) {
      std::copy(f, f + 9, trial);
      for (int k = 0; k < n; ++k) trial[4 * axes[k]] += length * step[k];
      if (!(determinant(trial) > 0)) continue;
      residual(trial, trial_r, nullptr);
      better = trial_r.allFinite() && trial_r.norm() < r.norm();
    }
    if (!better) break;  // the last digit is reached, or there is no way down
    std::copy(trial, trial + 9, f);
    residual(f, r, &tangent);
  }
  return r.norm() <= 1e-10 * (theta[SkinTheta::bulk] + theta[SkinTheta::mu_inf] + theta[SkinTheta::mu_m]);
}

}  // namespace

void MaterialProgram::validate() const {
  require(!times.empty(), "MaterialProgram: no times");
  require(times.size() == deformation.size(), "MaterialProgram: one deformation per time");
  require(!(traction_free[0] && traction_free[1] && traction_free[2]),
          "MaterialProgram: no direction is prescribed");
  for (std::size_t i = 0; i < times.size(); ++i) {
    require(std::isfinite(times[i]), "MaterialProgram: a time is not finite");
    require(i == 0 || times[i] >= times[i - 1], "MaterialProgram: times must not fall");
    require(deformation[i].allFinite() && deformation[i].determinant() > 0,
            "MaterialProgram: det F must be positive");
  }
}

MaterialPointRun run_material_point(const SkinParameters& parameters, DamperScheme scheme,
                                    const MaterialProgram& program) {
  program.validate();
  const SkinLaw law{scheme}, stored{DamperScheme::none};
  D5 theta[5], y_old[6], history[6];
  law_parameters(parameters, scheme, theta);
  double theta_value[5];
  for (int i = 0; i < 5; ++i) theta_value[i] = theta[i].v;
  std::vector<int> axes;
  for (int k = 0; k < 3; ++k)
    if (program.traction_free[k]) axes.push_back(k);
  double free_stretch[3] = {1, 1, 1};
  MaterialPointRun run;
  double t_old = program.times.front();
  for (std::size_t at = 0; at < program.times.size(); ++at) {
    const double dt = program.times[at] - t_old;
    t_old = program.times[at];
    D5 prepared[6];
    law.prepare<D5>(y_old, history, theta, nullptr, dt, prepared);
    double f[9], prepared_value[6];
    for (int i = 0; i < 9; ++i) f[i] = program.deformation[at](i / 3, i % 3);
    for (int k : axes) f[4 * k] = at == 0 ? f[4 * k] : free_stretch[k];
    for (int i = 0; i < 6; ++i) prepared_value[i] = prepared[i].v;
    MatrixXd tangent;
    if (!(determinant(f) > 0) ||
        (!axes.empty() && !solve_free(law, axes, prepared_value, theta_value, dt, f, tangent))) {
      char text[120];
      std::snprintf(text, sizeof text, "t = %.6g s: no stretch makes the free directions traction-free",
                    program.times[at]);
      run.failure = text;
      return run;
    }
    D5 fd[9], p[9], y[6], sigma[6];
    for (int i = 0; i < 9; ++i) fd[i] = f[i];
    piola_of(law, fd, prepared, theta, dt, p);
    if (!axes.empty()) {
      const auto lu = tangent.fullPivLu();
      for (int j = 0; j < SkinParameters::count; ++j) {
        VectorXd r(axes.size());
        for (std::size_t k = 0; k < axes.size(); ++k) r[static_cast<Eigen::Index>(k)] = p[4 * axes[k]].d[j];
        const VectorXd moved = -lu.solve(r);
        for (std::size_t k = 0; k < axes.size(); ++k)
          fd[4 * axes[k]].d[j] = moved[static_cast<Eigen::Index>(k)];
      }
      piola_of(law, fd, prepared, theta, dt, p);
      for (int k : axes) free_stretch[k] = f[4 * k];
    }
    strain_of(fd, y);
    law.update<D5>(y, prepared, theta, nullptr, dt, history);
    MaterialPointState s;
    s.time = program.times[at];
    for (int i = 0; i < 9; ++i) {
      s.deformation(i / 3, i % 3) = f[i];
      s.piola(i / 3, i % 3) = p[i].v;
      for (int j = 0; j < SkinParameters::count; ++j) s.piola_by_parameter(i, j) = p[i].d[j];
    }
    s.kirchhoff = s.piola * s.deformation.transpose();
    s.energy = stored.stress<D5>(y, history, theta, nullptr, dt, sigma).v;
    for (int i = 0; i < 3; ++i)
      for (int j = 0; j < 3; ++j) s.viscous(i, j) = history[kSym[i][j]].v + (i == j ? 1.0 : 0.0);
    std::copy(y, y + 6, y_old);
    run.states.push_back(s);
  }
  run.complete = true;
  return run;
}

MaterialProgram ramp_and_hold(const Mat3& target, double ramp, double hold, double step) {
  require(ramp >= 0 && hold >= 0 && step > 0,
          "ramp_and_hold: durations must not be negative, the step positive");
  require((ramp + hold) / step < 1e7, "ramp_and_hold: more than ten million steps");
  MaterialProgram program;
  program.times = {0};
  program.deformation = {Mat3::Identity()};
  const int ramp_steps = std::max(1, static_cast<int>(std::ceil(ramp / step - 1e-9)));
  for (int i = 1; i <= ramp_steps; ++i) {
    const double s = static_cast<double>(i) / ramp_steps;
    program.times.push_back(s * ramp);
    program.deformation.push_back(Mat3::Identity() + s * (target - Mat3::Identity()));
  }
  const int hold_steps = static_cast<int>(std::ceil(hold / step - 1e-9));
  for (int i = 1; i <= hold_steps; ++i) {
    program.times.push_back(ramp + hold * i / hold_steps);
    program.deformation.push_back(target);
  }
  return program;
}

}  // namespace rhytid
