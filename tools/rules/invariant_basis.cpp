#include "tools/rules/invariant_basis.h"

#include <algorithm>
#include <cmath>

namespace rhytid::rules {

Quad square_root(Quad x) {
  Quad root = std::sqrt(static_cast<double>(x));
  for (int i = 0; i < 3; ++i) root = (root + x / root) / 2;
  return root;
}

namespace {

// s = |z|² and t = Re z³ as polynomials of the barycentric coordinates, which avoids the √3 of Cartesian
// ones: with e₁ = a + b + c = 1, e₂ = ab + bc + ca, e₃ = abc:  s = 1 − 3 e₂,  t = 1 − 9/2 e₂ + 27/2 e₃.
template <typename T>
struct Generators {
  T s, s_a, s_b, t, t_a, t_b;
  Generators(T a, T b) {
    const T c = T(1) - a - b;
    const T e2 = a * b + (a + b) * c, e3 = a * b * c;
    const T e2_a = c - a, e2_b = c - b;  // ∂e₂/∂a − ∂e₂/∂c
    const T e3_a = b * (c - a), e3_b = a * (c - b);
    s = T(1) - 3 * e2;
    s_a = -3 * e2_a;
    s_b = -3 * e2_b;
    t = T(1) - T(9) / 2 * e2 + T(27) / 2 * e3;
    t_a = -T(9) / 2 * e2_a + T(27) / 2 * e3_a;
    t_b = -T(9) / 2 * e2_b + T(27) / 2 * e3_b;
  }
};

struct Node {
  Quad a, b, weight;
};

// Gauss-Legendre collapsed onto the triangle; weights sum to 1. Exact to total degree 2n − 2.
std::vector<Node> collapsed_gauss(int n) {
  std::vector<Quad> x(n), w(n);
  for (int i = 0; i < n; ++i) {
    Quad root = std::cos(3.14159265358979324 * (i + 0.75) / (n + 0.5)), slope = 1;
    for (int iteration = 0; iteration < 8; ++iteration) {
      Quad previous = 0, current = 1;
      for (int m = 0; m < n; ++m) {
        const Quad next = ((2 * m + 1) * root * current - m * previous) / (m + 1);
        previous = current;
        current = next;
      }
      slope = n * (previous - root * current) / (1 - root * root);
      root -= current / slope;
    }
    x[i] = (1 + root) / 2;
    w[i] = 1 / ((1 - root * root) * slope * slope);
  }
  std::vector<Node> nodes;
  for (int i = 0; i < n; ++i)
    for (int j = 0; j < n; ++j) nodes.push_back({x[i], x[j] * (1 - x[i]), 2 * w[i] * w[j] * (1 - x[i])});
  return nodes;
}

}  // namespace

int InvariantBasis::count(int degree) {
  int number = 0;
  for (int t = 0; 3 * t <= degree; ++t) number += (degree - 3 * t) / 2 + 1;
  return number;
}

InvariantBasis::InvariantBasis(int degree) {
  for (int t = 0; 3 * t <= degree; ++t)
    for (int s = 0; 2 * s + 3 * t <= degree; ++s) powers_.push_back({s, t});
  std::stable_sort(powers_.begin(), powers_.end(),
                   [](const Power& l, const Power& r) { return 2 * l.s + 3 * l.t < 2 * r.s + 3 * r.t; });

  const std::vector<Node> nodes = collapsed_gauss(degree + 2);
  const int n = size(), m = static_cast<int>(nodes.size());
  std::vector<std::vector<Quad>> samples(n, std::vector<Quad>(m));
  coefficients_.assign(n, std::vector<Quad>(n, Quad(0)));
  for (int k = 0; k < n; ++k) {
    coefficients_[k][k] = 1;
    for (int i = 0; i < m; ++i) {
      const Generators<Quad> g(nodes[i].a, nodes[i].b);
      Quad monomial = 1;
      for (int e = 0; e < powers_[k].s; ++e) monomial *= g.s;
      for (int e = 0; e < powers_[k].t; ++e) monomial *= g.t;
      samples[k][i] = monomial;
    }
    // Twice is enough: the second pass removes what cancellation left in the first.
    for (int pass = 0; pass < 2; ++pass) {
      for (int l = 0; l < k; ++l) {
        Quad inner = 0;
        for (int i = 0; i < m; ++i) inner += nodes[i].weight * samples[k][i] * samples[l][i];
        for (int i = 0; i < m; ++i) samples[k][i] -= inner * samples[l][i];
        for (int j = 0; j <= l; ++j) coefficients_[k][j] -= inner * coefficients_[l][j];
      }
    }
    Quad norm = 0;
    for (int i = 0; i < m; ++i) norm += nodes[i].weight * samples[k][i] * samples[k][i];
    const Quad scale = 1 / square_root(norm);
    for (Quad& sample : samples[k]) sample *= scale;
    for (Quad& coefficient : coefficients_[k]) coefficient *= scale;
  }
}

template <typename T>
void InvariantBasis::evaluate(T a, T b, InvariantValues<T>& out) const {
  const Generators<T> g(a, b);
  const int n = size();
  std::vector<T> power_s(n + 1, T(1)), power_t(n + 1, T(1));
  for (int e = 1; e <= n; ++e) {
    power_s[e] = power_s[e - 1] * g.s;
    power_t[e] = power_t[e - 1] * g.t;
  }
  out.value.assign(n, T(0));
  out.d_da.assign(n, T(0));
  out.d_db.assign(n, T(0));
  for (int l = 0; l < n; ++l) {
    const auto [es, et] = powers_[l];
    const T value = power_s[es] * power_t[et];
    const T by_s = es > 0 ? T(es) * power_s[es - 1] * power_t[et] : T(0);
    const T by_t = et > 0 ? T(et) * power_s[es] * power_t[et - 1] : T(0);
    for (int k = l; k < n; ++k) {
      const T c = static_cast<T>(coefficients_[k][l]);
      out.value[k] += c * value;
      out.d_da[k] += c * (by_s * g.s_a + by_t * g.t_a);
      out.d_db[k] += c * (by_s * g.s_b + by_t * g.t_b);
    }
  }
}

template void InvariantBasis::evaluate(double, double, InvariantValues<double>&) const;
#ifdef __SIZEOF_FLOAT128__
template void InvariantBasis::evaluate(Quad, Quad, InvariantValues<Quad>&) const;
#else
template void InvariantBasis::evaluate(long double, long double, InvariantValues<long double>&) const;
#endif

}  // namespace rhytid::rules
