// Energy, gradient and Hessian of an element in packs of points, for laws that give their response in closed
// form (skin_response.h). The same sums as point_kernel.h, which runs them by dual numbers one point at a
// time.
//
// A law supplies     num_constants, constants(θ, dt, c)   numbers of the step that are not worth a lane's
// time
//                    response(e, prepared, θ, c, σ, tangent)   energy; σ and, unless null, ∂σ/∂e [6][6]
//                    mandel(e, J − 1, prepared, θ, c, M)       energy; Mandel stress C S, with P = F⁻ᵀ M
// Tests    tests/sim/terms/term_kernels_test.cpp, skin_response_test.cpp
#pragma once

#include <cmath>
#include <cstring>
#include <limits>

#include "sim/math/jacobi.h"
#include "sim/terms/packed_sums.h"
#include "sim/terms/product_hessian.h"

namespace rhytid {
inline namespace RHYTID_ISA {

template <class Law, class Kin>
struct PackedKernel {
  static constexpr int ne = Law::ne, nz = Kin::nz, np = Law::np, nt = Law::ntheta, nc = Law::num_constants;
  static_assert(ne == 6 && nz == 9, "prisms only");
  static constexpr int at_least_one(int n) { return n > 0 ? n : 1; }

  using Parameters = PackedParameters<nt, nc>;

  /// Points of a pack; past the element's end the last point is repeated with weight 0.
  struct Pack {
    Lanes h[nz], y[ne], jacobian[9], weight, prepared[at_least_one(np)];

    Pack(const ElementView& v, const double (*natural)[kMaxPacked], const double* prepared_all,
         const int* points, int first) {
      Lanes local[nz];
      for (int i = 0; i < nz; ++i) local[i] = load_lanes(natural[i] + first);
      load_points<9>(v.inverse_jacobian, points + first, jacobian);
      if constexpr (np > 0) load_points<np>(prepared_all, points + first, prepared);
      weight =
          make_lanes([&](int k) { return first + k < v.num_points ? v.weight[points[first + k]] : 0.0; });
      Kin::to_point(local, jacobian, h);
      Kin::strain(h, y);
    }
  };

  static double energy(const Law& law, const ElementView& v, const double* u, const double* prepared,
                       double* f) {
    alignas(8 * kLanes) double natural[nz][kMaxPacked];
    PackedSums sums(v);
    fetch(v.inverse_jacobian, 9 * v.num_points);
    fetch(prepared, np * v.num_points);
    sums.gather(u, natural);
    const auto constants = [&](const double* theta, double* c) { law.constants(theta, v.dt, c); };
    Parameters shared(v, constants);
    Lanes total = {};
    for (int first = 0; first < v.num_points; first += kLanes) {
      const Pack p(v, natural, prepared, sums.points(), first);
      const Lanes jm1 = Kin::det_minus_one_of(p.h);
      if (any_of(!(jm1 > -1))) return std::numeric_limits<double>::infinity();
      if (v.theta_stride != 0) shared = Parameters(v, sums.points() + first, constants);
      Lanes mandel[3][3];
      total +=
          p.weight * law.template mandel<Lanes>(p.y, jm1, p.prepared, shared.theta, shared.constants, mandel);
      if (!f) continue;
      Lanes piola[nz], local[nz];
      Kin::piola_from_mandel(p.h, mandel, piola);
      Kin::from_point(piola, p.jacobian, p.weight / (jm1 + 1.0), local);
      for (int i = 0; i < nz; ++i) store_lanes(local[i], natural[i] + first);
    }
    double sum = 0;
    for (int k = 0; k < kLanes; ++k) sum += total[k];
    if (!std::isfinite(sum)) return std::numeric_limits<double>::infinity();
    if (f) sums.scatter(natural, f);
    return sum;
  }

  static bool hessian(const Law& law, const ElementView& v, const double* u, const double* prepared,
                      bool projected, double* work, double* dense) {
    ElementHessian<3> blocks(v, work);
    alignas(8 * kLanes) double natural[nz][kMaxPacked];
    PackedSums sums(v);
    sums.gather_in_order(u, natural);
    const auto constants = [&](const double* theta, double* c) { law.constants(theta, v.dt, c); };
    Parameters shared(v, constants);
    for (int first = 0; first < v.num_points; first += kLanes) {
      const Pack p(v, natural, prepared, sums.points(), first);
      if (v.theta_stride != 0) shared = Parameters(v, sums.points() + first, constants);
      Lanes sigma[ne], tangent[ne][ne], a[nz][nz];
      (void)law.template response<Lanes>(p.y, p.prepared, shared.theta, shared.constants, sigma, tangent);
      material_block(p.h, tangent, a);
      for (int i = 0; i < 3; ++i)
        for (int j = 0; j < 3; ++j) {
          const Lanes s = i == j ? 2.0 * sigma[i] : sigma[kSym[i][j]];
          for (int c = 0; c < 3; ++c) a[3 * c + i][3 * c + j] += s;
        }
      const int count = v.num_points - first < kLanes ? v.num_points - first : kLanes;
      if (projected) project(a);
      natural_blocks(a, p.jacobian, p.weight, blocks.pack(first));
      blocks.add_pack(first, count);
    }
    return blocks.finish(dense);
  }

 private:
  /// Asks for data that are read once per call, long before they are.
  static void fetch(const double* from, int count) {
    for (int i = 0; i < count; i += 8) __builtin_prefetch(from + i);
  }

  /// a_(aI)(bJ) = Σ_KL F_aK D_(IK)(JL) F_bL for a ≤ b, D the tangent by full index pairs: twice along a diagonal pair.
  [[gnu::noinline]] static void material_block(const Lanes* h, const Lanes (*tangent)[ne], Lanes (*a)[nz]) {
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
        for (int z = 3 * m; z < nz; ++z) {
          Lanes sum = {};
          for (int k = 0; k < 3; ++k) {
            const Lanes d = db[kSym[i][k]][z];
            sum += f[m][k] * (i == k ? d + d : d);
          }
          a[3 * m + i][z] = sum;
        }
  }

  /// The Jacobian on both sides and the weight: blocks a ≤ b in natural directions, as BlockEntries.
  [[gnu::noinline]] static void natural_blocks(const Lanes (*a)[nz], const Lanes* jacobian,
                                               const Lanes& weight, Lanes* to) {
    Lanes weighted[9];
    for (int k = 0; k < 9; ++k) weighted[k] = weight * jacobian[k];
    for (int ca = 0; ca < 3; ++ca)
      for (int cb = ca; cb < 3; ++cb)
        for (int s = 0; s < 3; ++s) {
          Lanes column[3];
          for (int i = 0; i < 3; ++i) {
            const Lanes* const row = a[3 * ca + i] + 3 * cb;
            column[i] =
                row[0] * weighted[3 * s] + row[1] * weighted[3 * s + 1] + row[2] * weighted[3 * s + 2];
          }
          for (int r = 0; r < 3; ++r)
            to[BlockEntries::of(ca, cb, r, s)] = column[0] * jacobian[3 * r] +
                                                 column[1] * jacobian[3 * r + 1] +
                                                 column[2] * jacobian[3 * r + 2];
        }
  }

  /// Of a only the blocks a ≤ b are there; afterwards all are.
  [[gnu::noinline]] static void project(Lanes (*a)[nz]) {
    for (int i = 1; i < nz; ++i)
      for (int j = 0; j < i; ++j) a[i][j] = a[j][i];
    project_psd<nz>(a);
  }
};

/// Whether det(F + s D) = c0 + c1 s + c2 s² + c3 s³ certainly stays above 0 for s in [0, 1] at every point of a prism:
/// c0 + min(0, c1) + min(0, c2) + min(0, c3) > 0. F = I + ∇u, D = ∇d, both finite.
inline bool moves_freely(const ElementView& v, const double* u, const double* d) {
  alignas(8 * kLanes) double of_u[9][kMaxPacked], of_d[9][kMaxPacked];
  PackedSums sums(v);
  sums.gather(u, of_u);
  sums.gather(d, of_d);
  for (int first = 0; first < v.num_points; first += kLanes) {
    Lanes local[9], direction[9], jacobian[9], f[9], h[9];
    for (int i = 0; i < 9; ++i) {
      local[i] = load_lanes(of_u[i] + first);
      direction[i] = load_lanes(of_d[i] + first);
    }
    load_points<9>(v.inverse_jacobian, sums.points() + first, jacobian);
    PrismKinematics::to_point(local, jacobian, f);
    PrismKinematics::to_point(direction, jacobian, h);
    for (int i = 0; i < 9; i += 4) f[i] += 1.0;
    // Cofactors of both, by rows: c1 = cof F : D, c2 = F : cof D.
    Lanes c0 = {}, c1 = {}, c2 = {}, c3 = {};
    for (int i = 0; i < 3; ++i)
      for (int j = 0; j < 3; ++j) {
        const int k = 3 * ((i + 1) % 3), l = 3 * ((i + 2) % 3), m = (j + 1) % 3, n = (j + 2) % 3;
        const Lanes of_f = f[k + m] * f[l + n] - f[k + n] * f[l + m],
                    of_h = h[k + m] * h[l + n] - h[k + n] * h[l + m];
        if (i == 0) {
          c0 += f[j] * of_f;
          c3 += h[j] * of_h;
        }
        c1 += of_f * h[3 * i + j];
        c2 += f[3 * i + j] * of_h;
      }
    const Lanes zero = {};
    const Lanes least = c0 + (c1 < zero ? c1 : zero) + (c2 < zero ? c2 : zero) + (c3 < zero ? c3 : zero);
    if (any_of(!(least > 0.0))) return false;
  }
  return true;
}

}  // namespace RHYTID_ISA
}  // namespace rhytid
