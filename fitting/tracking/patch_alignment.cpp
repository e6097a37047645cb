#include "fitting/tracking/patch_alignment.h"

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>
#include <iterator>
#include <tuple>

#include "sim/core/error.h"

namespace rhytid::fitting {
namespace {

constexpr int kMost = 10;
/// The ramp is fitted when it takes a third of the squared residual (a fifth of the residual): in windows of little
/// texture it is hard to tell from the position, and real faces drift further with a lower threshold.
constexpr double kRampTakes = 1 - 1 / (1.25 * 1.25);
/// Variance of the noise over that of its residuals, at most.
constexpr double kMostLost = 2;
/// At the rim of a window, over its mean: soft shadows reach 0.08, the edge of a finger 0.2.
constexpr double kSteepestRamp = 0.1;

using VecP = Eigen::Matrix<double, kMost, 1>;
using MatP = Eigen::Matrix<double, kMost, kMost>;

/// p in the units of the solver: A and the ramp are scaled by the half window so that all entries of J are
/// alike in size.
struct Unknowns {
  PatchWarp warp;
  double gain = 1;  // per template deviation
  double bias = 0;
  Vec2 ramp = Vec2::Zero();  // grey at the window's rim
};

/// JᵀJ, Jᵀr and |r|², those of a ramp that is not fitted included.
struct System {
  MatP normal = MatP::Zero();
  VecP gradient = VecP::Zero();
  double cost = 0;
};

/// Order of p: c_x, c_y, A_xx, A_xy, A_yx, A_yy (times half), gain, bias, ramp_x, ramp_y; the A block is absent
/// for translation, the ramp where it is not fitted.
class Problem {
 public:
  Problem(const PatchTemplate& patch, const SplineImage& image, WarpModel model)
      : patch_(patch), image_(image), affine_(model == WarpModel::affine), size_(affine_ ? 8 : 4) {}

  int size() const { return size_; }
  int half() const { return patch_.half; }
  bool is_affine() const { return affine_; }
  int light() const { return affine_ ? 6 : 2; }  ///< index of the gain
  bool has_ramp() const { return size_ == light() + 4; }
  void fit_ramp(bool is_fitted) { size_ = light() + (is_fitted ? 4 : 2); }
  int count() const { return static_cast<int>(patch_.values.size()); }

  bool inside(const PatchWarp& w) const {
    const double h = patch_.half;
    for (double sx : {-h, h})
      for (double sy : {-h, h}) {
        const Vec2 x = w.centre + w.gradient * Vec2(sx, sy);
        if (!image_.contains(x.x(), x.y())) return false;
      }
    return true;
  }

  /// Calls visit(i, residual, row of J) for every pixel of the window.
  template <class Visit>
  void for_each(const Unknowns& p, Visit visit) const {
    const int h = patch_.half;
    const double inverse_half = 1.0 / std::max(h, 1);
    int i = 0;
    for (int y = -h; y <= h; ++y)
      for (int x = -h; x <= h; ++x, ++i) {
        const Vec2 at = p.warp.centre + p.warp.gradient * Vec2(x, y);
        const SplineImage::Sample s = image_.sample(at.x(), at.y());
        const double shape = (patch_.values[i] - patch_.mean) / patch_.deviation;
        VecP row = VecP::Zero();
        row[0] = s.dx;
        row[1] = s.dy;
        int k = 2;
        if (affine_) {
          const double xi = x * inverse_half, eta = y * inverse_half;
          row[2] = s.dx * xi;
          row[3] = s.dx * eta;
          row[4] = s.dy * xi;
          row[5] = s.dy * eta;
          k = 6;
        }
        row[k] = -shape;
        row[k + 1] = -1;
        row[k + 2] = -x * inverse_half;
        row[k + 3] = -y * inverse_half;
        visit(i, s.value - p.gain * shape - p.bias - (p.ramp.x() * x + p.ramp.y() * y) * inverse_half, row);
      }
  }

  System assemble(const Unknowns& p) const {
    System at;
    for_each(p, [&](int, double r, const VecP& row) {
      // Upper triangle by columns: the fixed size lets the compiler vectorise it.
      for (int c = 0; c < kMost; ++c)
        for (int d = 0; d <= c; ++d) at.normal(d, c) += row[d] * row[c];
      at.gradient += r * row;
      at.cost += r * r;
    });
    at.normal.triangularView<Eigen::StrictlyLower>() = at.normal.transpose();
    return at;
  }

  double cost(const Unknowns& p) const {
    double sum = 0;
    const int h = patch_.half;
    const Vec2 ramp = p.ramp / std::max(h, 1);
    int i = 0;
    for (int y = -h; y <= h; ++y)
      for (int x = -h; x <= h; ++x, ++i) {
        const Vec2 at = p.warp.centre + p.warp.gradient * Vec2(x, y);
        const double shape = (patch_.values[i] - patch_.mean) / patch_.deviation;
        const double light = p.gain * shape + p.bias + ramp.x() * x + ramp.y() * y;
        const double r = image_.sample(at.x(), at.y()).value - light;
        sum += r * r;
      }
    return sum;
  }

  Unknowns moved(const Unknowns& p, const VecP& step) const {
    Unknowns q = p;
    q.warp.centre += step.head<2>();
    int k = 2;
    if (affine_) {
      const double scale = 1.0 / std::max(patch_.half, 1);
      q.warp.gradient(0, 0) += scale * step[2];
      q.warp.gradient(0, 1) += scale * step[3];
      q.warp.gradient(1, 0) += scale * step[4];
      q.warp.gradient(1, 1) += scale * step[5];
      k = 6;
    }
    q.gain += step[k];
    q.bias += step[k + 1];
    if (has_ramp()) q.ramp += step.segment<2>(k + 2);
    return q;
  }

  /// Largest motion of a point of the window under a step, px.
  double motion(const VecP& step) const {
    double m = step.head<2>().norm();
    if (affine_) m += step.segment<4>(2).norm();
    return m;
  }

 private:
  const PatchTemplate& patch_;
  const SplineImage& image_;
  bool affine_;
  int size_;  // of p
};

/// Gain and bias that fit best at a fixed warp: with them the first step does not see the lighting.
void fit_lighting(const PatchTemplate& patch, const SplineImage& image, Unknowns* p) {
  const int h = patch.half;
  double sum = 0, product = 0;
  int i = 0;
  for (int y = -h; y <= h; ++y)
    for (int x = -h; x <= h; ++x, ++i) {
      const Vec2 at = p->warp.centre + p->warp.gradient * Vec2(x, y);
      const double value = image.sample(at.x(), at.y()).value;
      sum += value;
      product += value * (patch.values[i] - patch.mean) / patch.deviation;
    }
  p->bias = sum / i;
  p->gain = product / i;
}

/// Gauss-Newton from p on; `at` is the system there and then at the solution. Counts iterations.
AlignmentStatus solve(const Problem& problem, const AlignmentOptions& options, Unknowns* p, System* at,
                      Alignment* out) {
  const int n = problem.size();
  for (int k = 0; k < options.max_iterations; ++k) {
    ++out->iterations;
    const Eigen::LDLT<MatrixXd> factor(at->normal.topLeftCorner(n, n));
    const VectorXd pivots = factor.vectorD();
    // 1e-10: a relative pivot below this means a direction without any texture (aperture problem).
    if (factor.info() != Eigen::Success || !(pivots.minCoeff() > 1e-10 * pivots.maxCoeff()))
      return AlignmentStatus::flat;
    VecP step = VecP::Zero();
    step.head(n) = factor.solve(-at->gradient.head(n));
    // A step beyond a third of the window leaves the region in which the linearisation means anything.
    const double longest = std::max(1.0, problem.half() / 1.5);
    if (problem.motion(step) > longest) step *= longest / problem.motion(step);

    Unknowns trial = problem.moved(*p, step);
    int halvings = 0;
    for (; halvings < 8; ++halvings) {
      if (problem.inside(trial.warp) && problem.cost(trial) <= at->cost * (1 + 1e-12)) break;
      // At the tolerance the cost is flat to round-off: accept rather than search noise.
      if (problem.motion(step) < options.tolerance_px) break;
      step *= 0.5;
      trial = problem.moved(*p, step);
    }
    if (!problem.inside(trial.warp)) return AlignmentStatus::outside;
    if (halvings == 8) return AlignmentStatus::not_converged;
    *p = trial;
    *at = problem.assemble(*p);
    if (problem.motion(step) < options.tolerance_px) return AlignmentStatus::converged;
  }
  return AlignmentStatus::not_converged;
}

/// By how much a ramp would lower the cost at a minimum without one, to first order.
double ramp_takes(const Problem& problem, const System& at) {
  const int n = problem.light() + 4;
  return at.gradient.head(n).dot(at.normal.topLeftCorner(n, n).ldlt().solve(at.gradient.head(n)));
}

/// Residuals, influence of each pixel on c, noise and correlation at the solution.
void finish(const Problem& problem, const Unknowns& p, const System& at, Alignment* out) {
  const int n = problem.count(), size = problem.size();
  const MatrixXd inverse = at.normal.topLeftCorner(size, size).ldlt().solve(MatrixXd::Identity(size, size));
  out->residuals.resize(n);
  out->influence.resize(2, n);
  out->jacobian.resize(size, n);
  double product = 0, sum = 0, sum2 = 0;
  problem.for_each(p, [&](int i, double r, const VecP& row) {
    out->residuals[i] = static_cast<float>(r);
    out->influence.col(i) = inverse.topRows<2>() * row.head(size);
    out->jacobian.col(i) = row.head(size).cast<float>();
    const double shape = -row[problem.light()];
    const double value = r + p.gain * shape;  // I(W) without bias and ramp
    product += value * shape;
    sum += value;
    sum2 += value * value;
  });
  out->unit_covariance = inverse.topLeftCorner<2, 2>();
  out->residual_rms = std::sqrt(at.cost / std::max(1, n - size));
  // The shape has mean 0 and deviation 1.
  const double variance = sum2 / n - (sum / n) * (sum / n);
  out->correlation = variance > 0 ? std::clamp(product / n / std::sqrt(variance), -1.0, 1.0) : 0.0;
  if (!problem.is_affine()) return;
  // Information on c with A fixed: the lighting eliminated from the c block, A left out.
  const int k = problem.light();
  const MatrixXd lighting = at.normal.block(k, k, size - k, size - k),
                 cross = at.normal.block(0, k, 2, size - k);
  const Eigen::Matrix2d held =
      at.normal.topLeftCorner<2, 2>() - cross * lighting.inverse() * cross.transpose();
  out->deformation_cost = std::max(1.0, (held * out->unit_covariance).eigenvalues().real().maxCoeff());
}

bool is_usable(const Alignment* a) {
  return a != nullptr && !a->residuals.empty() && a->residual_rms > 0;
}

/// At most 12 usable ones, evenly from the list: enough for an average over windows.
std::vector<const Alignment*> spread(const std::vector<const Alignment*>& all) {
  constexpr std::size_t kEnough = 12;
  std::vector<const Alignment*> usable, few;
  std::copy_if(all.begin(), all.end(), std::back_inserter(usable), is_usable);
  const std::size_t count = std::min(kEnough, usable.size());
  for (std::size_t i = 0; i < count; ++i) few.push_back(usable[i * usable.size() / count]);
  return few;
}

}  // namespace

PatchTemplate make_template(std::vector<double> values, int half) {
  PatchTemplate t;
  t.half = half;
  t.values = std::move(values);
  double sum = 0, sum2 = 0;
  for (const double v : t.values) sum += v;
  t.mean = sum / t.values.size();
  for (const double v : t.values) sum2 += (v - t.mean) * (v - t.mean);
  t.deviation = std::sqrt(sum2 / t.values.size());
  return t;
}

PatchTemplate cut_template(const SplineImage& image, const Vec2& centre, int half) {
  if (!image.contains(centre.x() - half, centre.y() - half) ||
      !image.contains(centre.x() + half, centre.y() + half))
    return {half, {}, 0, 0};
  std::vector<double> values;
  for (int y = -half; y <= half; ++y)
    for (int x = -half; x <= half; ++x) values.push_back(image.sample(centre.x() + x, centre.y() + y).value);
  return make_template(std::move(values), half);
}

Alignment align(const PatchTemplate& patch, const SplineImage& image, const PatchWarp& start,
                const AlignmentOptions& options) {
  Alignment out;
  out.warp = start;
  out.unit_covariance.setZero();
  require(!patch.values.empty(), "align: the template is empty");
  // Half a grey level of texture is below what 8 bit images resolve.
  if (!(patch.deviation > 0.5)) {
    out.status = AlignmentStatus::flat;
    return out;
  }
  Problem problem(patch, image, options.model);
  if (!problem.inside(start)) {
    out.status = AlignmentStatus::outside;
    return out;
  }
  Unknowns p;
  p.warp = start;
  fit_lighting(patch, image, &p);
  System at = problem.assemble(p);
  out.status = solve(problem, options, &p, &at, &out);
  if (out.status == AlignmentStatus::converged && ramp_takes(problem, at) > kRampTakes * at.cost) {
    const auto without = std::make_tuple(p, at, out);
    problem.fit_ramp(true);
    out.status = solve(problem, options, &p, &at, &out);
    if (out.status != AlignmentStatus::converged || !(p.ramp.norm() < kSteepestRamp * p.bias)) {
      problem.fit_ramp(false);
      std::tie(p, at, out) = without;
    }
  }
  out.warp = p.warp;
  if (out.status == AlignmentStatus::converged) finish(problem, p, at, &out);
  return out;
}

ResidualCorrelation::ResidualCorrelation(const std::vector<const Alignment*>& alignments) {
  rho_[0][kReach] = 1;
  Lags sum{}, count{};
  for (const Alignment* a : alignments) {
    if (!is_usable(a)) continue;
    const int side = static_cast<int>(std::lround(std::sqrt(static_cast<double>(a->residuals.size()))));
    const double scale = 1 / (a->residual_rms * a->residual_rms);
    for (int dy = 0; dy <= kReach; ++dy)
      for (int dx = dy == 0 ? 0 : -kReach; dx <= kReach; ++dx) {
        double products = 0;
        for (int y = 0; y + dy < side; ++y)
          for (int x = std::max(0, -dx); x < side - std::max(0, dx); ++x)
            products +=
                static_cast<double>(a->residuals[y * side + x]) * a->residuals[(y + dy) * side + x + dx];
        sum[dy][dx + kReach] += products * scale;
        count[dy][dx + kReach] += static_cast<double>((side - dy) * (side - std::abs(dx)));
      }
  }
  if (!(count[0][kReach] > 0)) return;
  Lags raw{};
  for (int dy = 0; dy <= kReach; ++dy)
    for (int dx = -kReach; dx <= kReach; ++dx)
      if (count[dy][dx + kReach] > 0) raw[dy][dx + kReach] = sum[dy][dx + kReach] / count[dy][dx + kReach];
  for (int dx = 1; dx <= kReach; ++dx) raw[0][kReach - dx] = raw[0][kReach + dx];
  take(raw);
  const std::vector<const Alignment*> few = spread(alignments);
  for (int pass = 0; pass < 2; ++pass) {
    const Lags lost = taken_by_fit(few);
    Lags whole = raw;
    for (int dy = 0; dy <= kReach; ++dy)
      for (int dx = -kReach; dx <= kReach; ++dx) whole[dy][dx + kReach] += variance_ * lost[dy][dx + kReach];
    // More than half of the variance lost to the fit: the residuals say nothing about such noise but that it is much.
    if (!(whole[0][kReach] < kMostLost * raw[0][kReach])) {
      variance_ = kMostLost * raw[0][kReach];
      break;
    }
    take(whole);
  }
  // Residuals and the number of unknowns alone say 1.
  variance_ = std::max(1.0, variance_);
}

void ResidualCorrelation::take(const Lags& covariance) {
  variance_ = covariance[0][kReach];
  for (int dy = 0; dy <= kReach; ++dy)
    for (int dx = -kReach; dx <= kReach; ++dx) {
      // Flat up to half the reach, then falling: the tail of the estimate is noise.
      const auto fade = [](int lag) {
        return std::min(1.0, 2.0 * (kReach + 1 - std::abs(lag)) / (kReach + 2));
      };
      rho_[dy][dx + kReach] = fade(dx) * fade(dy) * covariance[dy][dx + kReach] / variance_;
    }
}

ResidualCorrelation::Lags ResidualCorrelation::taken_by_fit(
    const std::vector<const Alignment*>& alignments) const {
  Lags sum{}, count{};
  for (const Alignment* a : alignments) {
    const int n = static_cast<int>(a->residuals.size());
    const int side = static_cast<int>(std::lround(std::sqrt(static_cast<double>(n))));
    // J' = L⁻¹ J with L Lᵀ = J Jᵀ (rows are parameters): then H = J'ᵀ J'.
    const MatrixXd full = a->jacobian.cast<double>();
    const Eigen::LLT<MatrixXd> factor(full * full.transpose());
    if (factor.info() != Eigen::Success) continue;
    const MatrixXd J = factor.matrixL().solve(full);
    MatrixXd K = MatrixXd::Zero(J.rows(), n);  // J' Σ
    for (int dy = -kReach; dy <= kReach; ++dy)
      for (int dx = -kReach; dx <= kReach; ++dx) {
        const double rho = dy >= 0 ? at(dx, dy) : at(-dx, -dy);
        const int begin = std::max(0, -dx), length = side - std::abs(dx);
        if (rho == 0 || length <= 0) continue;
        for (int y = std::max(0, -dy); y < side - std::max(0, dy); ++y)
          K.middleCols(y * side + begin, length) += rho * J.middleCols((y + dy) * side + begin + dx, length);
      }
    const MatrixXd L = K - 0.5 * (K * J.transpose()) * J;
    // Σ − (I − H) Σ (I − H) = HΣ + ΣH − HΣH = J'ᵀ L + Lᵀ J'.
    for (int dy = 0; dy <= kReach; ++dy)
      for (int dx = -kReach; dx <= kReach; ++dx) {
        const int begin = std::max(0, -dx), length = side - std::abs(dx);
        for (int y = 0; length > 0 && y + dy < side; ++y) {
          const int i = y * side + begin, j = (y + dy) * side + begin + dx;
          sum[dy][dx + kReach] += J.middleCols(i, length).cwiseProduct(L.middleCols(j, length)).sum() +
                                  L.middleCols(i, length).cwiseProduct(J.middleCols(j, length)).sum();
        }
        count[dy][dx + kReach] += static_cast<double>((side - dy) * std::max(0, length));
      }
  }
  for (int dy = 0; dy <= kReach; ++dy)
    for (int dx = -kReach; dx <= kReach; ++dx)
      if (count[dy][dx + kReach] > 0) sum[dy][dx + kReach] /= count[dy][dx + kReach];
  return sum;
}

Eigen::Matrix2d ResidualCorrelation::covariance(const Alignment& a, double sigma) const {
  const int side = static_cast<int>(std::lround(std::sqrt(static_cast<double>(a.residuals.size()))));
  Eigen::Matrix2d total = a.unit_covariance;
  for (int dy = 0; dy <= kReach; ++dy)
    for (int dx = dy == 0 ? 1 : -kReach; dx <= kReach; ++dx) {
      const double rho = rho_[dy][dx + kReach];
      if (rho == 0) continue;
      Eigen::Matrix2d products = Eigen::Matrix2d::Zero();
      for (int y = 0; y + dy < side; ++y) {
        const int begin = std::max(0, -dx), length = side - std::abs(dx);
        if (length <= 0) continue;
        products.noalias() += a.influence.middleCols(y * side + begin, length) *
                              a.influence.middleCols((y + dy) * side + begin + dx, length).transpose();
      }
      total += rho * (products + products.transpose());  // lag d and −d
    }
  const Eigen::Matrix2d excess = total - 0.25 * a.unit_covariance;
  if (!(excess.determinant() > 0 && excess.trace() > 0)) total = a.unit_covariance;

  // Noise in the gradients: JᵀJ = M + N σ_g² I, while the curvature of the cost is M alone. The residual is
  // the difference of two images, its central difference has variance σ² (1 − ρ(2))/2, half of it from each
  // image.
  const double rho2 = 0.5 * (rho_[0][kReach + 2] + rho_[2][kReach]);
  const double gradient_noise = variance_ * sigma * sigma * (1 - rho2) / 4;
  const Eigen::Matrix2d share = static_cast<double>(a.residuals.size()) * gradient_noise * a.unit_covariance;
  // Beyond one half the gradients are mostly noise and the expansion means nothing.
  const double cap = std::min(1.0, 0.5 / std::max(share.trace(), 1e-300));
  const Eigen::Matrix2d correction = (Eigen::Matrix2d::Identity() - cap * share).inverse();
  total = correction * total * correction.transpose();
  return variance_ * sigma * sigma * total;
}

}  // namespace rhytid::fitting
