// How a point sees the nodes of its element: strain of a prism point, displacement of a surface point.
//
//   prism    z = H = ∇u (9), e = Y = H + Hᵀ + HᵀH (6)        surface   z = e = u (3)
//
// Each kinematics gives e, ∂e/∂z, the geometric part σ·∂²e/∂z², and the change between natural and rest
// directions.
//
// Source   the publication, "Deformation Gradient", "Strain"
// Tests    tests/sim/terms/term_kernels_test.cpp
#pragma once

#include <cstring>

#include "sim/math/lanes.h"
#include "sim/math/sym3.h"
#include "sim/terms/element_view.h"

namespace rhytid {

inline namespace RHYTID_ISA {

/// Kinematics of a prism point: z = H = ∇u (row-major a, I), e = Y = H + Hᵀ + HᵀH. V is double or Lanes.
struct PrismKinematics {
  static constexpr int rows = 3, nz = 9, ne = 6;

  template <class V>
  static void strain(const V* h, V* y) {
    for (int c = 0; c < 6; ++c) {
      const int k = kSymRow[c], l = kSymCol[c];
      y[c] = h[3 * k + l] + h[3 * l + k] + h[k] * h[l] + h[3 + k] * h[3 + l] + h[6 + k] * h[6 + l];
    }
  }
  /// det F − 1 from H.
  template <class V>
  static V det_minus_one_of(const V* h) {
    const V tr = h[0] + h[4] + h[8];
    const V minors = h[0] * h[4] - h[1] * h[3] + h[0] * h[8] - h[2] * h[6] + h[4] * h[8] - h[5] * h[7];
    const V det = h[0] * (h[4] * h[8] - h[5] * h[7]) - h[1] * (h[3] * h[8] - h[5] * h[6]) +
                  h[2] * (h[3] * h[7] - h[4] * h[6]);
    return tr + minors + det;
  }
  static bool feasible(const double* h) { return det_minus_one_of(h) > -1; }
  /// F_aI.
  template <class V>
  static V deformation(const V* h, int a, int i) {
    return a == i ? h[3 * a + i] + 1.0 : h[3 * a + i];
  }
  /// dY from dH: dY_IJ = Σ_a F_aI dH_aJ + F_aJ dH_aI.
  template <class V>
  static void strain_direction(const V* h, const V* dh, V* dy) {
    for (int c = 0; c < 6; ++c) {
      const int i = kSymRow[c], j = kSymCol[c];
      V sum = {};
      for (int a = 0; a < 3; ++a)
        sum += deformation(h, a, i) * dh[3 * a + j] + deformation(h, a, j) * dh[3 * a + i];
      dy[c] = sum;
    }
  }
  /// Its transpose: H̄_aI = Σ_J F_aJ S_IJ, S = 2 Ȳ on the diagonal and Ȳ beside it. For Ȳ = σ the first
  /// Piola stress.
  template <class V>
  static void strain_transpose(const V* h, const V* y_bar, V* h_bar) {
    for (int a = 0; a < 3; ++a)
      for (int i = 0; i < 3; ++i) {
        V sum = {};
        for (int j = 0; j < 3; ++j)
          sum += deformation(h, a, j) * (i == j ? 2.0 * y_bar[i] : y_bar[kSym[i][j]]);
        h_bar[3 * a + i] = sum;
      }
  }

  /// X⁻¹ dY X⁻ᵀ by dH in natural directions, frame = X⁻ᵀ: t[c][3a + r] = G_ia K_rj + G_ja K_ri for c = (i, j),
  /// G = X⁻¹Fᵀ, K = ∂ξ/∂X X⁻ᵀ.
  template <class V>
  static void strain_direction_in(const V (*frame)[3], const V* h, const V* ji, V (*t)[9]) {
    V g[3][3], k[3][3];
    for (int i = 0; i < 3; ++i)
      for (int a = 0; a < 3; ++a) {
        g[i][a] = frame[0][i] * deformation(h, a, 0) + frame[1][i] * deformation(h, a, 1) +
                  frame[2][i] * deformation(h, a, 2);
        k[a][i] = ji[3 * a] * frame[0][i] + ji[3 * a + 1] * frame[1][i] + ji[3 * a + 2] * frame[2][i];
      }
    for (int c = 0; c < 6; ++c) {
      const int i = kSymRow[c], j = kSymCol[c];
      for (int a = 0; a < 3; ++a)
        for (int r = 0; r < 3; ++r)
          t[c][3 * a + r] = c < 3 ? 2.0 * g[i][a] * k[r][i] : g[i][a] * k[r][j] + g[j][a] * k[r][i];
    }
  }

  /// J times the first Piola stress F⁻ᵀ M of a Mandel stress M = C S: cof F · M.
  template <class V>
  static void piola_from_mandel(const V* h, const V (*m)[3], V* piola) {
    for (int a = 0; a < 3; ++a) {
      const int b = (a + 1) % 3, c = (a + 2) % 3;
      V cofactor[3];
      for (int i = 0; i < 3; ++i) {
        const int j = (i + 1) % 3, k = (i + 2) % 3;
        cofactor[i] =
            deformation(h, b, j) * deformation(h, c, k) - deformation(h, b, k) * deformation(h, c, j);
      }
      for (int i = 0; i < 3; ++i)
        piola[3 * a + i] = cofactor[0] * m[0][i] + cofactor[1] * m[1][i] + cofactor[2] * m[2][i];
    }
  }

  /// ∂Y_c/∂H_aI = F_ak δ_lI + F_al δ_kI for c = (k, l).
  static void strain_gradient(const double* h, double (*b)[9]) {
    for (int c = 0; c < 6; ++c) {
      const int k = kSymRow[c], l = kSymCol[c];
      for (int z = 0; z < 9; ++z) b[c][z] = 0;
      for (int a = 0; a < 3; ++a) {
        b[c][3 * a + l] += h[3 * a + k] + (a == k);
        b[c][3 * a + k] += h[3 * a + l] + (a == l);
      }
    }
  }
  /// Adds σ·∂²e/∂z²: δ_ab S_IJ.
  static void add_geometric(const double* sigma, double (*a)[9]) {
    for (int i = 0; i < 3; ++i)
      for (int j = 0; j < 3; ++j) {
        const double s = i == j ? 2 * sigma[i] : sigma[kSym[i][j]];
        for (int c = 0; c < 3; ++c) a[3 * c + i][3 * c + j] += s;
      }
  }
  /// z in natural directions (a, r) from nodal sums, and back: H_aI = Σ_r h_ar ∂ξ_r/∂X_I.
  template <class V>
  static void to_point(const V* natural, const V* ji, V* h) {
    for (int a = 0; a < 3; ++a)
      for (int i = 0; i < 3; ++i)
        h[3 * a + i] =
            natural[3 * a] * ji[i] + natural[3 * a + 1] * ji[3 + i] + natural[3 * a + 2] * ji[6 + i];
  }
  template <class V>
  static void from_point(const V* p, const V* ji, V weight, V* natural) {
    for (int a = 0; a < 3; ++a)
      for (int r = 0; r < 3; ++r)
        natural[3 * a + r] =
            weight * (p[3 * a] * ji[3 * r] + p[3 * a + 1] * ji[3 * r + 1] + p[3 * a + 2] * ji[3 * r + 2]);
  }
};

/// Kinematics of a surface point: e = z = u.
struct SurfaceKinematics {
  static constexpr int rows = 1, nz = 3, ne = 3;
  static void strain(const double* u, double* e) { std::memcpy(e, u, 3 * sizeof(double)); }
  static bool feasible(const double*) { return true; }
  static void strain_gradient(const double*, double (*b)[3]) {
    for (int i = 0; i < 3; ++i)
      for (int j = 0; j < 3; ++j) b[i][j] = i == j;
  }
  static void add_geometric(const double*, double (*)[3]) {}
  template <class V>
  static void to_point(const V* natural, const V*, V* u) {
    for (int a = 0; a < 3; ++a) u[a] = natural[a];
  }
  template <class V>
  static void from_point(const V* p, const V*, V weight, V* natural) {
    for (int a = 0; a < 3; ++a) natural[a] = weight * p[a];
  }
};

}  // namespace RHYTID_ISA
}  // namespace rhytid
