// Reverse-mode numbers: derivatives of one scalar by all inputs, for about the price of a few evaluations.
//
//   forward   every operation z = f(x, y) records ∂z/∂x and ∂z/∂y
//   backward  from the last to the first:  x̄ += z̄ ∂z/∂x,   ȳ += z̄ ∂z/∂y
//
// V is a double or a pack of them, one lane per material point. Matrix functions are one record each, with the
// Fréchet derivative of sym3.h as its partial derivatives. Laws are templates and need not know; dual.h is the
// forward mode, which the tests compare this with. Eigen-free: compiled once per instruction set.
//
// Source   Griewank, Walther, Evaluating Derivatives; Daleckii-Krein
// Tests    tests/sim/math/reverse_test.cpp
#pragma once

#include <cmath>
#include <memory>
#include <stdexcept>

#include "sim/math/spectral3.h"

namespace rhytid {
inline namespace RHYTID_ISA {

/// The record of a computation. One per thread and V; begin() starts anew.
template <class V>
class ReverseTape {
 public:
  /// Outputs and inputs of a block at most.
  static constexpr int kBlockOutputs = 6, kBlockInputs = 7;

  /// Records that one computation may have, and matrix functions among them.
  static constexpr int kCapacity = 4096, kBlocks = 64;

  /// The calling thread's tape.
  static ReverseTape& mine() {
    static thread_local const std::unique_ptr<ReverseTape> tape(new ReverseTape);
    return *tape;
  }
  /// Forgets everything recorded.
  void begin() {
    count_ = 1;  // node 0 stands for all constants
    num_blocks_ = 0;
  }
  int input() { return record(0, V{}, 0, V{}); }
  int record(int a, const V& da, int b, const V& db) {
    if (count_ == kCapacity) throw std::length_error("ReverseTape: the computation is too long");
    partial_[2 * count_] = da;
    partial_[2 * count_ + 1] = db;
    parent_[2 * count_] = a;
    parent_[2 * count_ + 1] = b;
    return count_++;
  }
  /// Records outputs first … first + 5 with the derivatives partial[output][input]; returns `first`.
  int record_block(const int* inputs, int num_inputs, const V (*partial)[kBlockInputs]) {
    if (num_blocks_ == kBlocks) throw std::length_error("ReverseTape: too many matrix functions");
    Block& block = blocks_[num_blocks_];
    block.num_inputs = num_inputs;
    for (int i = 0; i < num_inputs; ++i) block.inputs[i] = inputs[i];
    for (int o = 0; o < kBlockOutputs; ++o)
      for (int i = 0; i < num_inputs; ++i) block.partial[o][i] = partial[o][i];
    const int first = record(-1, V{}, num_blocks_++, V{});
    for (int o = 1; o < kBlockOutputs; ++o) (void)record(0, V{}, 0, V{});
    return first;
  }

  /// Before seeding outputs: all derivatives zero.
  void clear_bars() {
    for (int k = 0; k < count_; ++k) bar_[k] = V{};
  }
  V& bar(int node) { return bar_[node]; }
  /// Carries the derivatives back to the inputs.
  void sweep() {
    for (int k = count_ - 1; k > 0; --k) {
      const int a = parent_[2 * k], b = parent_[2 * k + 1];
      if (a < 0) {
        const Block& block = blocks_[b];
        for (int i = 0; i < block.num_inputs; ++i) {
          V sum = bar_[block.inputs[i]];
          for (int o = 0; o < kBlockOutputs; ++o) sum += bar_[k + o] * block.partial[o][i];
          bar_[block.inputs[i]] = sum;
        }
        continue;
      }
      const V z = bar_[k];
      bar_[a] += z * partial_[2 * k];
      bar_[b] += z * partial_[2 * k + 1];
    }
  }

 private:
  struct Block {
    int num_inputs, inputs[kBlockInputs];
    V partial[kBlockOutputs][kBlockInputs];
  };
  ReverseTape() = default;
  // Arrays, not vectors: what the standard library compiles for a vector of numbers carries no instruction set in
  // its name (isa.h).
  V partial_[2 * kCapacity], bar_[kCapacity];
  int parent_[2 * kCapacity];
  Block blocks_[kBlocks];
  int count_ = 1, num_blocks_ = 0;
};

/// A number whose history is on the thread's tape; node 0 is a constant.
template <class V>
struct Reverse {
  V v;
  int node;

  Reverse() = default;
  Reverse(double value) : v(broadcast<V>(value)), node(0) {}  // NOLINT: a constant has no history
  static Reverse constant(const V& value) { return make(value, 0); }
  static Reverse input(const V& value) { return make(value, ReverseTape<V>::mine().input()); }

  static Reverse make(const V& value, int node) {
    Reverse r;
    r.v = value;
    r.node = node;
    return r;
  }
  static Reverse unary(const Reverse& a, const V& f, const V& df) {
    return make(f, a.node == 0 ? 0 : ReverseTape<V>::mine().record(a.node, df, 0, V{}));
  }
  static Reverse binary(const Reverse& a, const Reverse& b, const V& f, const V& da, const V& db) {
    return make(f, a.node == 0 && b.node == 0 ? 0 : ReverseTape<V>::mine().record(a.node, da, b.node, db));
  }

  friend Reverse operator+(const Reverse& a, const Reverse& b) {
    return binary(a, b, a.v + b.v, broadcast<V>(1), broadcast<V>(1));
  }
  friend Reverse operator-(const Reverse& a, const Reverse& b) {
    return binary(a, b, a.v - b.v, broadcast<V>(1), broadcast<V>(-1));
  }
  friend Reverse operator*(const Reverse& a, const Reverse& b) { return binary(a, b, a.v * b.v, b.v, a.v); }
  friend Reverse operator/(const Reverse& a, const Reverse& b) {
    const V inverse = 1.0 / b.v, f = a.v * inverse;
    return binary(a, b, f, inverse, -f * inverse);
  }
  friend Reverse operator-(const Reverse& a) { return unary(a, -a.v, broadcast<V>(-1)); }
  friend Reverse operator+(const Reverse& a, double b) { return make_sum(a, b); }
  friend Reverse operator+(double b, const Reverse& a) { return make_sum(a, b); }
  friend Reverse operator-(const Reverse& a, double b) { return make_sum(a, -b); }
  friend Reverse operator-(double a, const Reverse& b) { return unary(b, a - b.v, broadcast<V>(-1)); }
  friend Reverse operator*(const Reverse& a, double b) { return unary(a, a.v * b, broadcast<V>(b)); }
  friend Reverse operator*(double b, const Reverse& a) { return a * b; }
  friend Reverse operator/(const Reverse& a, double b) { return a * (1.0 / b); }
  friend Reverse operator/(double a, const Reverse& b) {
    const V inverse = 1.0 / b.v;
    return unary(b, a * inverse, -a * inverse * inverse);
  }
  Reverse& operator+=(const Reverse& b) { return *this = *this + b; }
  Reverse& operator-=(const Reverse& b) { return *this = *this - b; }
  Reverse& operator*=(const Reverse& b) { return *this = *this * b; }

  friend Reverse exp(const Reverse& a) {
    const V f = map_lanes([](double x) { return std::exp(x); }, a.v);
    return unary(a, f, f);
  }
  friend Reverse expm1(const Reverse& a) {
    const V f = map_lanes([](double x) { return std::expm1(x); }, a.v);
    return unary(a, f, f + 1.0);
  }
  friend Reverse log1p(const Reverse& a) {
    return unary(a, map_lanes([](double x) { return std::log1p(x); }, a.v), 1.0 / (1.0 + a.v));
  }
  friend Reverse sqrt(const Reverse& a) {
    const V f = lane_sqrt(a.v);
    return unary(a, f, 0.5 / f);
  }
  friend Reverse relative_expm1(const Reverse& a) {
    return unary(a, map_lanes([](double x) { return relative_expm1(x); }, a.v),
                 map_lanes([](double x) { return relative_expm1_slope(x); }, a.v));
  }

 private:
  /// a + b with the history of a: the derivative is one, so no record is needed.
  static Reverse make_sum(const Reverse& a, double b) { return make(a.v + b, a.node); }
};

/// Eigenvectors and logarithms of the eigenvalues of I + Y, and what rotates there and back.
template <class V>
struct PackedSpectrum {
  V q[3][3], log_eigenvalue[3];

  explicit PackedSpectrum(const V* y) {
    V e[3];
    eigen_sym3_packed(y, e, q);
    for (int i = 0; i < 3; ++i) log_eigenvalue[i] = map_lanes([](double x) { return std::log1p(x); }, e[i]);
  }
  /// partial[o][i] = ∂out_o/∂Y_i of the matrix function with divided differences f (symmetric storage).
  void frechet(const V* f, V (*partial)[ReverseTape<V>::kBlockInputs]) const {
    V there[6][6];
    rotation_of_symmetric(q, there);
    // Back: Q M Qᵀ takes the same products, halved for the rows off the diagonal and doubled for the columns.
    for (int o = 0; o < 6; ++o)
      for (int e = 0; e < 6; ++e) {
        V sum = {};
        for (int c = 0; c < 6; ++c) {
          const double share = (o < 3 ? 1. : 0.5) * (c < 3 ? 1. : 2.);
          sum += share * (there[c][o] * f[c]) * there[c][e];
        }
        partial[o][e] = sum;
      }
  }
};

/// sinh(z)/z of a pack.
template <class V>
V packed_sinhc(const V& z) {
  return map_lanes([](double x) { return sinhc(x); }, z);
}

template <class V>
void record_matrix_function(const Reverse<V>* y, const Reverse<V>* t, const V* value,
                            const V (*partial)[ReverseTape<V>::kBlockInputs], Reverse<V>* out) {
  int inputs[ReverseTape<V>::kBlockInputs], any = t ? t->node : 0;
  for (int c = 0; c < 6; ++c) {
    inputs[c] = y[c].node;
    any |= inputs[c];
  }
  if (t) inputs[6] = t->node;
  const int first = any ? ReverseTape<V>::mine().record_block(inputs, t ? 7 : 6, partial) : 0;
  for (int c = 0; c < 6; ++c) out[c] = Reverse<V>::make(value[c], first ? first + c : 0);
}

/// out = log(I + Y), as sym3.h.
template <class V>
void log_one_plus(const Reverse<V>* y, Reverse<V>* out) {
  V y0[6], value[6], f[6], partial[6][ReverseTape<V>::kBlockInputs];
  for (int c = 0; c < 6; ++c) y0[c] = y[c].v;
  const PackedSpectrum<V> s(y0);
  compose(s.q, s.log_eigenvalue, value);
  for (int c = 0; c < 6; ++c) {
    const V a = s.log_eigenvalue[kSymRow[c]], b = s.log_eigenvalue[kSymCol[c]];
    f[c] =
        map_lanes([](double x) { return std::exp(x); }, V(-0.5 * (a + b))) / packed_sinhc(V(0.5 * (a - b)));
  }
  s.frechet(f, partial);
  record_matrix_function<V>(y, nullptr, value, partial, out);
}

/// out = (I + Y)^t − I, as sym3.h.
template <class V>
void power_one_plus(const Reverse<V>* y, const Reverse<V>& t, Reverse<V>* out) {
  const auto exp_of = [](const V& x) { return map_lanes([](double z) { return std::exp(z); }, x); };
  V y0[6], g[3], value[6], by_t[6], f[6], partial[6][ReverseTape<V>::kBlockInputs];
  for (int c = 0; c < 6; ++c) y0[c] = y[c].v;
  const PackedSpectrum<V> s(y0);
  for (int i = 0; i < 3; ++i)
    g[i] = map_lanes([](double x) { return std::expm1(x); }, V(t.v * s.log_eigenvalue[i]));
  compose(s.q, g, value);
  for (int i = 0; i < 3; ++i) g[i] = (g[i] + 1.0) * s.log_eigenvalue[i];
  compose(s.q, g, by_t);
  for (int c = 0; c < 6; ++c) {
    const V a = s.log_eigenvalue[kSymRow[c]], b = s.log_eigenvalue[kSymCol[c]], delta = 0.5 * (a - b);
    f[c] = t.v * exp_of(V(0.5 * (t.v - 1.0) * (a + b))) * packed_sinhc(V(t.v * delta)) / packed_sinhc(delta);
  }
  s.frechet(f, partial);
  for (int c = 0; c < 6; ++c) partial[c][6] = by_t[c];
  record_matrix_function<V>(y, &t, value, partial, out);
}

}  // namespace RHYTID_ISA
}  // namespace rhytid
