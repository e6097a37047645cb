#include <Eigen/Eigenvalues>
#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>

#include "sim/core/error.h"
#include "sim/surface/shapes.h"

namespace rhytid {

Ellipsoid::Ellipsoid(const Vec3& semi_axes) : semi_axes_(semi_axes) {
  require(semi_axes.allFinite() && semi_axes.minCoeff() > 0, "Ellipsoid: semi-axes must be positive");
  require(semi_axes.maxCoeff() <= largest_ratio * semi_axes.minCoeff(),
          "Ellipsoid: the longest semi-axis must not exceed 1000 times the shortest");
}

namespace {

// In units of the shortest semi-axis m: z = |x|/e, r = (e/m)², s = t/m² + 1 > 0 and
//   yᵢ = eᵢ zᵢ rᵢ/(s + rᵢ − 1),   G(s) = Σ (zᵢ rᵢ/(s + rᵢ − 1))² − 1 = 0.
// G falls and is convex, so Newton from a point with G ≥ 0 goes up to the root and never past it. In s (and
// not in t) nothing cancels near the flat middle, where s → 0.
/// Nearest point to x of the surface, in the octant of x; `multiplier` is t in x − y = t y/e².
Vec3 nearest_point(const Vec3& semi_axes, const Vec3& x, double& multiplier) {
  int shortest = 0;
  const double m = semi_axes.minCoeff(&shortest);
  Vec3 scaled, excess;  // z r, r − 1
  double s = 0;
  for (int i = 0; i < 3; ++i) {
    const double e = semi_axes[i] / m;
    excess[i] = (e - 1) * (e + 1);
    scaled[i] = std::fabs(x[i]) / semi_axes[i] * (e * e);
    s = std::max(s, scaled[i] - excess[i]);  // term i alone is 1 there
  }
  const auto term = [&](int i) { return scaled[i] == 0 ? 0.0 : scaled[i] / (s + excess[i]); };
  double sum = 0;
  for (int i = 0; i < 3; ++i) sum += term(i) * term(i);
  Vec3 y;
  if (s == 0 && sum < 1) {
    // x lies in the middle plane, so near the centre that the surface above is nearer than the rim (s = 0).
    double rest = 1;
    for (int i = 0; i < 3; ++i) {
      y[i] = i == shortest ? 0 : semi_axes[i] * term(i);
      rest -= i == shortest ? 0 : term(i) * term(i);
    }
    y[shortest] = m * std::sqrt(rest);
  } else {
    for (int iteration = 0; iteration < 100; ++iteration) {
      double value = -1, slope = 0;
      for (int i = 0; i < 3; ++i) {
        const double q = term(i);
        value += q * q;
        if (q > 0) slope -= 2 * q * q / (s + excess[i]);
      }
      const double step = -value / slope;
      s += step;
      if (!(step > 1e-16 * s)) break;  // also at the root itself, where rounding may turn the step's sign
    }
    for (int i = 0; i < 3; ++i) y[i] = semi_axes[i] * term(i);
  }
  for (int i = 0; i < 3; ++i) y[i] = std::copysign(y[i], x[i] == 0 ? 1.0 : x[i]);
  multiplier = (s - 1) * m * m;
  return y;
}

GapJet jet_at(const Vec3& semi_axes, const Vec3& x) {
  GapJet jet;
  double multiplier = 0;
  const Vec3 y = nearest_point(semi_axes, x, multiplier);
  const Vec3 inverse = semi_axes.cwiseProduct(semi_axes).cwiseInverse();
  const Vec3 slope = inverse.cwiseProduct(y);  // ∇(½ Σ y²/e²)
  const double length = slope.norm();
  const Vec3 n = slope / length;
  jet.gap = multiplier * length;
  jet.gradient = n;

  const Vec3 a = n.unitOrthogonal(), b = n.cross(a);
  Eigen::Matrix2d curvature;
  curvature(0, 0) = a.dot(inverse.cwiseProduct(a)) / length;
  curvature(1, 1) = b.dot(inverse.cwiseProduct(b)) / length;
  curvature(0, 1) = curvature(1, 0) = a.dot(inverse.cwiseProduct(b)) / length;
  const Eigen::SelfAdjointEigenSolver<Eigen::Matrix2d> eigen(curvature);
  for (int k = 0; k < 2; ++k) {
    const Vec3 direction = eigen.eigenvectors()(0, k) * a + eigen.eigenvectors()(1, k) * b;
    const double kappa = eigen.eigenvalues()[k];
    // 1 + g κ = 0 at a centre of curvature, deep inside; bounded there so that nothing becomes infinite.
    jet.hessian += kappa / std::max(1 + jet.gap * kappa, 1e-9) * direction * direction.transpose();
  }
  return jet;
}

}  // namespace

GapJet Ellipsoid::evaluate(const Vec3& x) const {
  return jet_at(semi_axes_, x);
}

GapJet Ellipsoid::evaluate_sized(const Vec3& x, const Vec3& semi_axes, SizeDerivatives& by_size) const {
  const GapJet jet = jet_at(semi_axes, x);
  // ∂g/∂e_k = −n_k y_k/e_k and its derivative by x, with y = x − g n, ∂y/∂x = I − n nᵀ − g ∇n
  const Vec3& n = jet.gradient;
  const Vec3 y = x - jet.gap * n;
  const Mat3 dy = Mat3::Identity() - n * n.transpose() - jet.gap * jet.hessian;
  for (int k = 0; k < 3; ++k) {
    by_size.gap[k] = -n[k] * y[k] / semi_axes[k];
    by_size.gradient.col(k) = -(jet.hessian.col(k) * y[k] + n[k] * dy.row(k).transpose()) / semi_axes[k];
  }
  return jet;
}

}  // namespace rhytid
