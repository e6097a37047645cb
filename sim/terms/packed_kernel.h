// Energy, gradient and Hessian of an element in packs of points, for laws that give their response in closed
// form (skin_response.h). The same sums as point_kernel.h, which runs them by dual numbers one point at a
// time.
//
// A law supplies     num_constants, constants(θ, dt, c)   numbers of the step that are not worth a lane's
// time
//                    response(e, prepared, θ, c, σ, tangent)   energy; σ and, unless null, ∂σ/∂e [6][6]
// Tests    tests/sim/terms/term_kernels_test.cpp, skin_response_test.cpp
#pragma once

#include <cmath>
#include <cstring>
#include <limits>

#include "sim/math/jacobi.h"
#include "sim/terms/element_sums.h"
#include "sim/terms/product_hessian.h"

namespace rhytid {
inline namespace RHYTID_ISA {

template <class Law, class Kin>
struct PackedKernel {
  static constexpr int ne = Law::ne, nz = Kin::nz, np = Law::np, nt = Law::ntheta, nc = Law::num_constants;
  static_assert(ne == 6 && nz == 9, "prisms only");
  static constexpr int at_least_one(int n) { return n > 0 ? n : 1; }

  /// Points q … q + kLanes − 1 of an element; past its end the last point is repeated with weight 0.
  struct Pack {
    Lanes h[nz], y[ne], jacobian[9] = {}, weight = {};
    Lanes prepared[at_least_one(np)] = {}, theta[nt] = {}, constants[at_least_one(nc)] = {};

    Pack(const Law& law, const ElementView& v, const double (*natural)[kMaxRows], const double* prepared_all,
         const double* shared_constants, int first) {
      // Numbers, not lanes: GCC 12 takes lanes that are set one number at a time for uninitialised.
      double local_numbers[nz][kLanes] = {};
      for (int k = 0; k < kLanes; ++k) {
        const bool inside = first + k < v.num_points;
        const int q = inside ? first + k : v.num_points - 1;
        for (int a = 0; a < 3; ++a)
          for (int r = 0; r < 3; ++r) local_numbers[3 * a + r][k] = natural[a][3 * q + r];
        for (int i = 0; i < 9; ++i) jacobian[i][k] = v.inverse_jacobian[9 * q + i];
        weight[k] = inside ? v.weight[q] : 0;
        for (int c = 0; c < np; ++c) prepared[c][k] = prepared_all[q * np + c];
        const double* th = v.theta + static_cast<std::size_t>(q) * v.theta_stride;
        for (int c = 0; c < nt; ++c) theta[c][k] = th[c];
        if (v.theta_stride != 0 && nc > 0) {
          double own[at_least_one(nc)];
          law.constants(th, v.dt, own);
          for (int c = 0; c < nc; ++c) constants[c][k] = own[c];
        }
      }
      if (v.theta_stride == 0)
        for (int c = 0; c < nc; ++c) constants[c] = broadcast<Lanes>(shared_constants[c]);
      Lanes local[nz];
      static_assert(sizeof local == sizeof local_numbers);
      std::memcpy(local, local_numbers, sizeof local);
      Kin::to_point(local, jacobian, h);
      Kin::strain(h, y);
    }
  };

  static double energy(const Law& law, const ElementView& v, const double* u, const double* prepared,
                       double* f) {
    double natural[3][kMaxRows], out[3][kMaxRows], shared[at_least_one(nc)] = {};
    if (v.theta_stride == 0) law.constants(v.theta, v.dt, shared);
    gather<3>(v, u, natural);
    Lanes total = {};
    for (int first = 0; first < v.num_points; first += kLanes) {
      const Pack p(law, v, natural, prepared, shared, first);
      if (any_of(!(Kin::det_minus_one_of(p.h) > -1))) return std::numeric_limits<double>::infinity();
      Lanes sigma[ne];
      total += p.weight * law.template response<Lanes>(p.y, p.prepared, p.theta, p.constants, sigma, nullptr);
      if (!f) continue;
      Lanes piola[nz], local[nz];
      Kin::strain_transpose(p.h, sigma, piola);
      Kin::from_point(piola, p.jacobian, p.weight, local);
      const int count = v.num_points - first < kLanes ? v.num_points - first : kLanes;
      for (int k = 0; k < count; ++k)
        for (int a = 0; a < 3; ++a)
          for (int r = 0; r < 3; ++r) out[a][3 * (first + k) + r] = local[3 * a + r][k];
    }
    double sum = 0;
    for (int k = 0; k < kLanes; ++k) sum += total[k];
    if (!std::isfinite(sum)) return std::numeric_limits<double>::infinity();
    if (f) scatter<3>(v, out, f);
    return sum;
  }

  static bool hessian(const Law& law, const ElementView& v, const double* u, const double* prepared,
                      bool projected, double* work, double* dense) {
    ElementHessian<3> blocks(v, work);
    double natural[3][kMaxRows], shared[at_least_one(nc)] = {};
    if (v.theta_stride == 0) law.constants(v.theta, v.dt, shared);
    gather<3>(v, u, natural);
    for (int first = 0; first < v.num_points; first += kLanes) {
      const Pack p(law, v, natural, prepared, shared, first);
      Lanes sigma[ne], tangent[ne][ne], a[nz][nz];
      (void)law.template response<Lanes>(p.y, p.prepared, p.theta, p.constants, sigma, tangent);
      material_block(p.h, tangent, a);
      for (int i = 0; i < 3; ++i)
        for (int j = 0; j < 3; ++j) {
          const Lanes s = i == j ? 2.0 * sigma[i] : sigma[kSym[i][j]];
          for (int c = 0; c < 3; ++c) a[3 * c + i][3 * c + j] += s;
        }
      const int count = v.num_points - first < kLanes ? v.num_points - first : kLanes;
      if (projected) project(a, count);
      // The Jacobian and the weight on both sides: natural directions.
      Lanes half[nz][nz], folded[nz][nz];
      for (int i = 0; i < nz; ++i) Kin::from_point(a[i], p.jacobian, p.weight, half[i]);
      for (int j = 0; j < nz; ++j) {
        Lanes column[nz], mapped[nz];
        for (int i = 0; i < nz; ++i) column[i] = half[i][j];
        Kin::from_point(column, p.jacobian, broadcast<Lanes>(1), mapped);
        for (int i = 0; i < nz; ++i) folded[i][j] = mapped[i];
      }
      double flat[nz * nz * kLanes];
      std::memcpy(flat, folded, sizeof flat);
      for (int k = 0; k < count; ++k) blocks.add(first + k, flat + k, kLanes);
    }
    return blocks.finish(dense);
  }

 private:
  /// a_(aI)(bJ) = Σ_KL F_aK D_(IK)(JL) F_bL, D the tangent by full index pairs: twice along a diagonal pair.
  static void material_block(const Lanes* h, const Lanes (*tangent)[ne], Lanes (*a)[nz]) {
    Lanes f[3][3], db[ne][nz];
    for (int i = 0; i < 3; ++i)
      for (int j = 0; j < 3; ++j) f[i][j] = Kin::deformation(h, i, j);
    for (int c = 0; c < ne; ++c)
      for (int b = 0; b < 3; ++b)
        for (int j = 0; j < 3; ++j) {
          Lanes sum = {};
          for (int l = 0; l < 3; ++l) {
            const Lanes d = tangent[c][kSym[j][l]];
            sum += f[b][l] * (j == l ? d + d : d);
          }
          db[c][3 * b + j] = sum;
        }
    for (int m = 0; m < 3; ++m)
      for (int i = 0; i < 3; ++i)
        for (int z = 0; z < nz; ++z) {
          Lanes sum = {};
          for (int k = 0; k < 3; ++k) {
            const Lanes d = db[kSym[i][k]][z];
            sum += f[m][k] * (i == k ? d + d : d);
          }
          a[3 * m + i][z] = sum;
        }
  }

  static void project(Lanes (*a)[nz], int count) {
    for (int k = 0; k < count; ++k) {
      double one[nz][nz];
      for (int i = 0; i < nz; ++i)
        for (int j = 0; j < nz; ++j) one[i][j] = a[i][j][k];
      project_psd<nz>(one);
      for (int i = 0; i < nz; ++i)
        for (int j = 0; j < nz; ++j) a[i][j][k] = one[i][j];
    }
  }
};

}  // namespace RHYTID_ISA
}  // namespace rhytid
