#include "fitting/tracking/patch_alignment.h"

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>

#include "sim/core/error.h"

namespace rhytid::fitting {
namespace {

using Vec8 = Eigen::Matrix<double, 8, 1>;
using Mat8 = Eigen::Matrix<double, 8, 8>;

/// p in the units of the solver: A is scaled by the half window so that all entries of J are alike in size.
struct Unknowns {
  PatchWarp warp;
  double gain = 1;  // per template deviation
  double bias = 0;
};

/// Order of p: c_x, c_y, A_xx, A_xy, A_yx, A_yy (times half), gain, bias; the A block is absent for
/// translation.
class Problem {
 public:
  Problem(const PatchTemplate& patch, const SplineImage& image, WarpModel model)
      : patch_(patch), image_(image), affine_(model == WarpModel::affine), size_(affine_ ? 8 : 4) {}

  int size() const { return size_; }
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
        Vec8 row = Vec8::Zero();
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
        visit(i, s.value - (p.gain * shape + p.bias), row);
      }
  }

  void assemble(const Unknowns& p, Mat8* normal, Vec8* gradient, double* cost) const {
    normal->setZero();
    gradient->setZero();
    *cost = 0;
    for_each(p, [&](int, double r, const Vec8& row) {
      // Upper triangle by columns: the fixed size lets the compiler vectorise it.
      for (int c = 0; c < 8; ++c)
        for (int d = 0; d <= c; ++d) (*normal)(d, c) += row[d] * row[c];
      *gradient += r * row;
      *cost += r * r;
    });
    normal->triangularView<Eigen::StrictlyLower>() = normal->transpose();
  }

  double cost(const Unknowns& p) const {
    double sum = 0;
    const int h = patch_.half;
    int i = 0;
    for (int y = -h; y <= h; ++y)
      for (int x = -h; x <= h; ++x, ++i) {
        const Vec2 at = p.warp.centre + p.warp.gradient * Vec2(x, y);
        const double shape = (patch_.values[i] - patch_.mean) / patch_.deviation;
        const double r = image_.sample(at.x(), at.y()).value - (p.gain * shape + p.bias);
        sum += r * r;
      }
    return sum;
  }

  Unknowns moved(const Unknowns& p, const Vec8& step) const {
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
    return q;
  }

  /// Largest motion of a point of the window under a step, px.
  double motion(const Vec8& step) const {
    double m = step.head<2>().norm();
    if (affine_) m += step.segment<4>(2).norm();
    return m;
  }

 private:
  const PatchTemplate& patch_;
  const SplineImage& image_;
  bool affine_;
  int size_;
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

/// Residuals, influence of each pixel on c, noise and correlation at the solution.
void finish(const Problem& problem, const Unknowns& p, const Mat8& inverse, double cost, Alignment* out) {
  const int n = problem.count();
  out->residuals.resize(n);
  out->influence.resize(2, n);
  double sum = 0, sum2 = 0;
  problem.for_each(p, [&](int i, double r, const Vec8& row) {
    out->residuals[i] = static_cast<float>(r);
    out->influence.col(i) = inverse.topRows<2>() * row;
    const int k = problem.size() - 2;
    const double value = r - p.gain * row[k] + p.bias;  // I(W), since row[k] = −shape
    sum += value;
    sum2 += value * value;
  });
  out->unit_covariance = inverse.topLeftCorner<2, 2>();
  out->residual_rms = std::sqrt(cost / std::max(1, n - problem.size()));
  // g and b are the regression of I(W) on T, so the zero-mean correlation is g / deviation of I(W).
  const double variance = sum2 / n - (sum / n) * (sum / n);
  out->correlation = variance > 0 ? std::clamp(p.gain / std::sqrt(variance), -1.0, 1.0) : 0.0;
}

}  // namespace

PatchTemplate cut_template(const SplineImage& image, const Vec2& centre, int half) {
  PatchTemplate t;
  t.half = half;
  if (!image.contains(centre.x() - half, centre.y() - half) ||
      !image.contains(centre.x() + half, centre.y() + half))
    return t;
  double sum = 0, sum2 = 0;
  for (int y = -half; y <= half; ++y)
    for (int x = -half; x <= half; ++x) {
      t.values.push_back(image.sample(centre.x() + x, centre.y() + y).value);
      sum += t.values.back();
    }
  t.mean = sum / t.values.size();
  for (double v : t.values) sum2 += (v - t.mean) * (v - t.mean);
  t.deviation = std::sqrt(sum2 / t.values.size());
  return t;
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
  const Problem problem(patch, image, options.model);
  if (!problem.inside(start)) {
    out.status = AlignmentStatus::outside;
    return out;
  }
  Unknowns p;
  p.warp = start;
  fit_lighting(patch, image, &p);

  const int n = problem.size();
  Mat8 normal;
  Vec8 gradient;
  double cost = 0;
  problem.assemble(p, &normal, &gradient, &cost);
  for (out.iterations = 1; out.iterations <= options.max_iterations; ++out.iterations) {
    const Eigen::LDLT<MatrixXd> factor(normal.topLeftCorner(n, n));
    const VectorXd pivots = factor.vectorD();
    // 1e-10: a relative pivot below this means a direction without any texture (aperture problem).
    if (factor.info() != Eigen::Success || !(pivots.minCoeff() > 1e-10 * pivots.maxCoeff())) {
      out.status = AlignmentStatus::flat;
      return out;
    }
    Vec8 step = Vec8::Zero();
    step.head(n) = factor.solve(-gradient.head(n));
    // A step beyond a third of the window leaves the region in which the linearisation means anything.
    const double longest = std::max(1.0, patch.half / 1.5);
    if (problem.motion(step) > longest) step *= longest / problem.motion(step);

    Unknowns trial = problem.moved(p, step);
    int halvings = 0;
    for (; halvings < 8; ++halvings) {
      if (problem.inside(trial.warp) && problem.cost(trial) <= cost * (1 + 1e-12)) break;
      // At the tolerance the cost is flat to round-off: accept rather than search noise.
      if (problem.motion(step) < options.tolerance_px) break;
      step *= 0.5;
      trial = problem.moved(p, step);
    }
    if (!problem.inside(trial.warp)) {
      out.status = AlignmentStatus::outside;
      return out;
    }
    if (halvings == 8) break;
    p = trial;
    problem.assemble(p, &normal, &gradient, &cost);
    out.warp = p.warp;
    if (problem.motion(step) < options.tolerance_px) {
      out.status = AlignmentStatus::converged;
      break;
    }
  }
  if (out.status != AlignmentStatus::converged) return out;
  Mat8 inverse = Mat8::Zero();
  inverse.topLeftCorner(n, n) = normal.topLeftCorner(n, n).ldlt().solve(MatrixXd::Identity(n, n));
  finish(problem, p, inverse, cost, &out);
  if (options.model == WarpModel::affine) {
    // Information on c with A fixed: the lighting eliminated from the c block, A left out.
    const Eigen::Matrix2d lighting = normal.block<2, 2>(6, 6);
    const Eigen::Matrix2d cross = normal.block<2, 2>(0, 6);
    const Eigen::Matrix2d held =
        normal.topLeftCorner<2, 2>() - cross * lighting.inverse() * cross.transpose();
    out.deformation_cost = std::max(1.0, (held * out.unit_covariance).eigenvalues().real().maxCoeff());
  }
  return out;
}

ResidualCorrelation::ResidualCorrelation(const std::vector<const Alignment*>& alignments) {
  rho_[0][kReach] = 1;
  std::array<std::array<double, 2 * kReach + 1>, kReach + 1> sum{}, count{};
  for (const Alignment* a : alignments) {
    if (a == nullptr || a->residuals.empty() || !(a->residual_rms > 0)) continue;
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
  const double variance = sum[0][kReach] / count[0][kReach];
  for (int dy = 0; dy <= kReach; ++dy)
    for (int dx = -kReach; dx <= kReach; ++dx) {
      if (dy == 0 && dx <= 0) continue;
      const double c = count[dy][dx + kReach];
      // Flat up to half the reach, then falling: the tail of the estimate is noise.
      const auto fade = [](int lag) {
        return std::min(1.0, 2.0 * (kReach + 1 - std::abs(lag)) / (kReach + 2));
      };
      const double taper = fade(dx) * fade(dy);
      if (c > 0) rho_[dy][dx + kReach] = taper * sum[dy][dx + kReach] / c / variance;
      if (dy == 0) rho_[0][kReach - dx] = rho_[0][kReach + dx];
    }
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
  const double gradient_noise = sigma * sigma * (1 - rho2) / 4;
  const Eigen::Matrix2d share = static_cast<double>(a.residuals.size()) * gradient_noise * a.unit_covariance;
  // Beyond one half the gradients are mostly noise and the expansion means nothing.
  const double cap = std::min(1.0, 0.5 / std::max(share.trace(), 1e-300));
  const Eigen::Matrix2d correction = (Eigen::Matrix2d::Identity() - cap * share).inverse();
  total = correction * total * correction.transpose();
  return sigma * sigma * total;
}

}  // namespace rhytid::fitting
