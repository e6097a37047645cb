#include "tools/bench/skin_operations.h"

#include <vector>

#include "sim/terms/point_kernel.h"

namespace rhytid::tools {
namespace {

/// A number that counts what is done with it. Adding to one that was only initialised to zero is no operation.
struct Counted {
  double v = 0;
  bool blank = true;
  Counted() = default;
  Counted(double value) : v(value), blank(false) {}
  static inline long operations = 0;
};

Counted counted(double value) {
  ++Counted::operations;
  return value;
}
Counted operator+(const Counted& a, const Counted& b) {
  if (a.blank) return b;
  return counted(a.v + b.v);
}
Counted operator-(const Counted& a, const Counted& b) {
  return counted(a.v - b.v);
}
Counted operator*(const Counted& a, const Counted& b) {
  return counted(a.v * b.v);
}
Counted operator/(const Counted& a, const Counted& b) {
  return counted(a.v / b.v);
}
Counted operator-(const Counted& a) {
  return {-a.v};
}
Counted& operator+=(Counted& a, const Counted& b) {
  return a = a + b;
}
Counted& operator-=(Counted& a, const Counted& b) {
  return a = a - b;
}
bool operator<(const Counted& a, const Counted& b) {
  return a.v < b.v;
}
bool operator>(const Counted& a, const Counted& b) {
  return a.v > b.v;
}
bool operator!=(const Counted& a, const Counted& b) {
  return a.v != b.v;
}
Counted select(bool condition, const Counted& a, const Counted& b) {
  return condition ? a : b;
}
Counted lane_sqrt(const Counted& a) {
  return counted(std::sqrt(a.v));
}
Counted lane_log1p(const Counted& a) {
  return counted(std::log1p(a.v));
}
Counted lane_expm1(const Counted& a) {
  return counted(std::expm1(a.v));
}
/// A logarithm; the quotient.
LogQuotients<Counted> log_quotients(const Counted& a, const Counted& b, const Counted& difference) {
  const LogQuotients<double> q = rhytid::log_quotients(a.v, b.v, difference.v);
  return {counted(q.log), counted(q.slope)};
}

using Kin = PrismKinematics;
using Kernel = PointKernel<SkinLaw, Kin>;

}  // namespace

SkinOperations count_skin_operations(const SkinLaw& law, const ElementView& view, const double* u,
                                     const double* prepared) {
  static double natural[3][kMaxRows];
  gather<3>(view, u, natural);
  double constants[SkinLaw::num_constants];
  law.constants(view.theta, view.dt, constants);
  SkinOperations total;
  for (int q = 0; q < view.num_points; ++q) {
    Counted local[9], jacobian[9], h[9], y[6], history[6], theta[5], mandel[3][3], sigma[6], tangent[6][6],
        piola[9], out[9], of_step[SkinLaw::num_constants];
    for (int c = 0; c < SkinLaw::num_constants; ++c) of_step[c] = constants[c];
    for (int a = 0; a < 3; ++a)
      for (int r = 0; r < 3; ++r) local[3 * a + r] = natural[a][3 * q + r];
    for (int i = 0; i < 9; ++i) jacobian[i] = view.inverse_jacobian[9 * q + i];
    for (int c = 0; c < 6; ++c) history[c] = prepared[6 * q + c];
    for (int c = 0; c < 5; ++c) theta[c] = view.theta[c];
    const Counted weight = view.weight[q];
    const auto count = [](auto&& call) {
      const long before = Counted::operations;
      call();
      return static_cast<double>(Counted::operations - before);
    };
    const double strain = count([&] {
      Kin::to_point(local, jacobian, h);
      Kin::strain(h, y);
    });
    total.residual += strain + count([&] {
                        const Counted jm1 = Kin::det_minus_one_of(h);
                        (void)law.mandel<Counted>(y, jm1, history, theta, of_step, mandel);
                        Kin::piola_from_mandel(h, mandel, piola);
                        Kin::from_point(piola, jacobian, weight / (jm1 + 1.0), out);
                      });
    total.hessian += strain +
                     count([&] { (void)law.response<Counted>(y, history, theta, of_step, sigma, tangent); }) +
                     9 + 2 * 54 * 5;  // the Jacobian on both sides of 54 entries
  }
  const double n = view.num_nodes;
  double sums = 2 * 9 * n;  // nodes to points, or back: three components of three directions
  if (view.product.line_points > 0) {
    const double nl = view.product.line_nodes, np = view.product.plane_nodes;
    sums = 2 * 9 * (nl * np / view.product.line_points + nl);  // over the plane, then along the line
  }
  // Material block: [6][9] and 54 sums of three products, twice its diagonal; geometric part.
  const double block = 5 * (6 * 9 + 54) + 3 * 6 + 3 * 9 + 3 + 27;
  // Left factors: six blocks (a ≤ b) of three rows; products: three full blocks and three upper halves.
  double dense = 6 * 3 * 5 * n + 3 * 3 * 2 * n * n + 3 * 3 * n * (n + 1);
  if (view.product.line_points > 0) {
    // Per point of the plane, of which each has line_points: nine sums through the thickness, left factors and products
    // for every pair of (component, line node).
    const double nl = view.product.line_nodes, nz = view.product.line_points, np = view.product.plane_nodes,
                 pairs = 3 * nl * (3 * nl + 1) / 2;
    dense = pairs * (9 * (2 * nz - 1) + 3 * 5 * np + 2 * 3 * np * np) / nz;
  }
  total.residual = total.residual / view.num_points + 2 * sums;
  total.hessian = total.hessian / view.num_points + sums + block + dense;
  return total;
}

double skin_residual_by_points(const SkinLaw& law, const ElementView& view, const double* u,
                               const double* prepared, double* f) {
  return Kernel::energy_by_points(law, view, u, prepared, f);
}

void skin_hessian_by_points(const SkinLaw& law, const ElementView& view, const double* u,
                            const double* prepared, double* dense) {
  std::vector<double> work(hessian_work_size(view.padded_nodes, view.product));
  (void)Kernel::hessian_by_points(law, view, u, prepared, false, work.data(), dense);
}

}  // namespace rhytid::tools
