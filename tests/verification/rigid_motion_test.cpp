// Rigid motion changes no energy, turns forces and carries history along: of the deformed skin with the
// bodies that touch it (its rest shape stays behind), and of the whole scene, rest shape, anchors and bone
// included.
//
// Bounds. A turn about the origin moves no point further out: 1e-12 of the energy, of the largest nodal force
// and of the history. After a shift by s a position is known to half a unit in the last place of |x| + |s|
// only, whoever computes it. With δ = 2 ε (|x| + |s|), ε = 2⁻⁵²,
//
//   force  |ΔR|∞ ≤ ‖K‖∞ δ,   energy  |ΔW| ≤ |R|₁ δ,   C^v  |ΔC^v| ≤ 2 δ max Σ_i |∇N_i|,
//   lag    |Δf_n| ≤ 2 δ κ,  |Δn| ≤ 2 δ/r  (r the radius of the finger),
//
// each with the 1e-12 of a turn added, since a shift is tried together with a turn as well. ‖K‖∞ and Σ_i
// |∇N_i| are the term's own, measured.
#include <gtest/gtest.h>

#include <Eigen/Geometry>
#include <cstdio>
#include <limits>
#include <memory>
#include <numbers>

#include "sim/core/parallel.h"
#include "tests/verification/skin_in_place.h"

namespace rhytid {
namespace {

using test::BaseShape;
using test::distorted_mesh;
using test::kFingerRadius;
using test::kNative;
using test::kStep;
using test::Place;
using test::place;
using test::Slots;

constexpr double kTurnTolerance = 1e-12;

struct Motion {
  Mat3 turn = Mat3::Identity();
  Eigen::Quaterniond quaternion = Eigen::Quaterniond::Identity();
  Vec3 shift = Vec3::Zero();

  Motion(const Vec3& axis, double angle, const Vec3& by)
      : turn(Eigen::AngleAxisd(angle, axis.normalized()).toRotationMatrix()),
        quaternion(Eigen::AngleAxisd(angle, axis.normalized())),
        shift(by) {}
  Vec3 of(const Vec3& x) const { return turn * x + shift; }
};

std::vector<Motion> turns() {
  using std::numbers::pi;
  return {{{1, 2, -1}, 2.9, {0, 0, 0}}, {{0, 0, 1}, 0.3, {0, 0, 0}}, {{1, 0, 0}, pi / 2, {0, 0, 0}}};
}
std::vector<Motion> shifts() {
  return {{{1, 0, 0}, 0, {100, 0, 0}}, {{0, 1, 0}, 0, {0.7, -11, 3}}, {{1, 2, -1}, 2.9, {3, -50, 20}}};
}

/// What a term says of a step from u_old to u, with a history that a step before left.
struct Answer {
  double energy = 0;
  VectorXd force, history;
};

Answer answer(const Term& term, const VectorXd& native, const VectorXd& u_old, const VectorXd& u) {
  Answer a;
  const VectorXd start = VectorXd::Zero(static_cast<Eigen::Index>(term.history_size()));
  VectorXd between = start;
  a.history = start;
  TermStepData data;
  const StepInfo before{0, -kStep.t, 0};
  term.prepare(before, native, u_old, start.data(), data);
  term.update(before, data, u_old, between.data());
  term.prepare(kStep, native, u_old, between.data(), data);
  a.force = VectorXd::Zero(u.size());
  a.energy = term.energy(kStep, data, u, &a.force, nullptr);
  term.update(kStep, data, u, a.history.data());
  return a;
}

/// ‖K‖∞, N/mm: element matrices added without regard to sign.
double stiffness(const Term& term, const VectorXd& native, const VectorXd& u_old, const VectorXd& u) {
  struct RowSums final : Term::MatrixSink {
    VectorXd sums;
    void add(const TermGroup& g, int element, double* dense) override {
      const int n3 = 3 * g.num_nodes;
      const auto rows = Eigen::Map<MatrixXd>(dense, n3, n3).cwiseAbs().colwise().sum();
      for (int i = 0; i < n3; ++i)
        sums[3 * g.nodes[static_cast<std::size_t>(element) * g.num_nodes + i / 3] + i % 3] += rows[i];
    }
  } sink;
  sink.sums = VectorXd::Zero(u.size());
  VectorXd history = VectorXd::Zero(static_cast<Eigen::Index>(term.history_size()));
  TermStepData data;
  const StepInfo before{0, -kStep.t, 0};
  term.prepare(before, native, u_old, history.data(), data);
  VectorXd between = history;
  term.update(before, data, u_old, between.data());
  term.prepare(kStep, native, u_old, between.data(), data);
  term.hessian(kStep, data, u, false, sink);
  return sink.sums.maxCoeff();
}

/// Largest Σ_i |∇N_i| over the points of a term, 1/mm.
double gradient_sum(const Term& term) {
  double largest = 0;
  if (term.kernels().rows != 3) return largest;
  for (const TermGroup& g : term.groups())
    for (int e = 0; e < g.num_elements; ++e)
      for (int q = 0; q < g.num_points; ++q) {
        const auto at = static_cast<std::size_t>(e) * g.num_points + q;
        const Eigen::Map<const Eigen::Matrix<double, 3, 3, Eigen::RowMajor>> inverse(
            &g.inverse_jacobian[9 * at]);
        double sum = 0;
        for (int i = 0; i < g.num_nodes; ++i) {
          Vec3 natural;
          for (int r = 0; r < 3; ++r)
            natural[r] = g.node_by_row[(3 * static_cast<std::size_t>(q) + r) * g.padded_nodes + i];
          sum += (inverse.transpose() * natural).norm();
        }
        largest = std::max(largest, sum);
      }
  return largest;
}

/// How far a term's answers may go wrong with its nodes.
struct Sensitivity {
  double stiffness, gradient_sum;
};
std::vector<Sensitivity> sensitivities(const Place& p, const VectorXd (&u)[2]) {
  std::vector<Sensitivity> list;
  for (const Term& t : p.terms) list.push_back({stiffness(t, p.native, u[0], u[1]), gradient_sum(t)});
  return list;
}

/// Terms of these few elements take microseconds; meeting a second thread takes longer when cores are shared.
class OneThread {
 public:
  OneThread() { set_num_threads(1); }
  ~OneThread() { set_num_threads(before_); }
  OneThread(const OneThread&) = delete;
  OneThread& operator=(const OneThread&) = delete;

 private:
  int before_ = num_threads();
};

/// A shift's tolerance beside a turn's: everything above it is a finding, so the worst quotients are printed.
class Errors {
 public:
  explicit Errors(const char* what) : what_(what) {}
  ~Errors() {
    std::printf(
        "%s: energy, force, history: turns %.1e, %.1e, %.1e; shifts %.1e, %.1e, %.1e, of their bounds "
        "%.2f, %.2f, %.2f\n",
        what_, turn_[0], turn_[1], turn_[2], shift_[0], shift_[1], shift_[2], of_bound_[0], of_bound_[1],
        of_bound_[2]);
  }
  Errors(const Errors&) = delete;
  Errors& operator=(const Errors&) = delete;

  /// `kind`: 0 energy, 1 force, 2 history. `scale`: what 1e-12 refers to.
  void check(int kind, double error, double scale, double shift_bound, bool shifted) {
    const double turn_bound = kTurnTolerance * scale;
    if (shifted) {
      shift_[kind] = std::max(shift_[kind], error / scale);
      of_bound_[kind] = std::max(of_bound_[kind], error / (turn_bound + shift_bound));
      EXPECT_LE(error, turn_bound + shift_bound) << "kind " << kind << ", bound of the shift " << shift_bound;
    } else {
      turn_[kind] = std::max(turn_[kind], error / scale);
      EXPECT_LE(error, turn_bound) << "kind " << kind;
    }
  }

 private:
  const char* what_;
  double turn_[3] = {}, shift_[3] = {}, of_bound_[3] = {};
};

VectorXd turned(const Mat3& turn, const VectorXd& v) {
  VectorXd w(v.size());
  for (Eigen::Index i = 0; i < v.size(); i += 3) w.segment<3>(i) = turn * v.segment<3>(i);
  return w;
}

/// C^v − I of every point in the turned frame of reference: R (C^v − I) Rᵀ.
VectorXd turned_strains(const Mat3& turn, const VectorXd& history) {
  VectorXd w(history.size());
  for (Eigen::Index k = 0; k < history.size(); k += 6) {
    Mat3 m;
    for (int i = 0; i < 3; ++i)
      for (int j = 0; j < 3; ++j) m(i, j) = history[k + kSym[i][j]];
    m = turn * m * turn.transpose();
    for (int i = 0; i < 3; ++i)
      for (int j = i; j < 3; ++j) w[k + kSym[i][j]] = m(i, j);
  }
  return w;
}

/// Compares a term in two places. `reference_turn`: how the frame of rest, in which C^v is kept, has turned.
void compare(const Term& here, const Term& there, const Place& from, const Place& to, const Sensitivity& s,
             const VectorXd (&u)[2], const VectorXd (&u_there)[2], const Motion& motion,
             const Mat3& reference_turn, Errors& errors) {
  const Answer a = answer(here, from.native, u[0], u[1]),
               b = answer(there, to.native, u_there[0], u_there[1]);
  const bool shifted = motion.shift.norm() > 0;
  double reach = 0;
  for (int i = 0; i < from.mesh.num_nodes(); ++i)
    reach = std::max(reach, (from.mesh.rest.row(i).transpose() + u[1].segment<3>(3 * i)).norm());
  const double delta = 2 * std::numeric_limits<double>::epsilon() * (reach + motion.shift.norm());
  ASSERT_GT(a.energy, 0);
  ASSERT_GT(a.force.norm(), 0);
  errors.check(0, std::fabs(b.energy - a.energy), a.energy, delta * a.force.lpNorm<1>(), shifted);
  double largest = 0;
  for (Eigen::Index i = 0; i < a.force.size(); i += 3)
    largest = std::max(largest, a.force.segment<3>(i).norm());
  errors.check(1, (b.force - turned(motion.turn, a.force)).lpNorm<Eigen::Infinity>(), largest,
               delta * s.stiffness, shifted);
  if (a.history.size() == 0) return;
  if (here.name() == "skin, none") {  // nothing relaxes: nothing to remember
    EXPECT_EQ(a.history.norm() + b.history.norm(), 0);
    return;
  }
  ASSERT_GT(a.history.norm(), 0);
  if (here.name() != "friction") {
    const double error = (b.history - turned_strains(reference_turn, a.history)).lpNorm<Eigen::Infinity>();
    errors.check(2, error, 1, 2 * delta * s.gradient_sum, shifted);
    return;
  }
  double pressure = 0;
  for (Eigen::Index k = 0; k < a.history.size(); k += 4) pressure = std::max(pressure, a.history[k]);
  ASSERT_GT(pressure, 0);
  for (Eigen::Index k = 0; k < a.history.size(); k += 4) {
    const bool pressed = a.history[k] > 0 && b.history[k] > 0;
    errors.check(2, std::fabs(b.history[k] - a.history[k]), pressure, 2 * delta * from.native[Slots::contact],
                 shifted);
    const Vec3 normal = a.history.segment<3>(k + 1);
    const Vec3 expected = pressed ? Vec3(motion.turn * normal) : normal;  // a point without load keeps e_z
    if (pressed || (a.history[k] == 0 && b.history[k] == 0))
      errors.check(2, (b.history.segment<3>(k + 1) - expected).norm(), 1, 2 * delta / kFingerRadius, shifted);
  }
}

VectorXd moved_native(const VectorXd& native, const Motion& motion) {
  VectorXd moved = native;
  for (int k = 0; k < 3; ++k) {
    moved.segment<3>(Slots::centres + 3 * k) = motion.of(native.segment<3>(Slots::centres + 3 * k));
    const Eigen::Vector4d own = native.segment<4>(Slots::quaternions + 4 * k);
    const Eigen::Quaterniond q = motion.quaternion * Eigen::Quaterniond(own[0], own[1], own[2], own[3]);
    moved.segment<4>(Slots::quaternions + 4 * k) << q.w(), q.x(), q.y(), q.z();
  }
  return moved;
}

struct Case {
  int p, q;
  bool composite, bent;
  BaseShape base;
};
const Case kCases[] = {{3, 2, false, true, BaseShape::plane},
                       {3, 3, true, true, BaseShape::sphere},
                       {2, 2, false, false, BaseShape::imls},
                       {4, 2, false, true, BaseShape::imls}};

std::string text(const Case& c) {
  return "p " + std::to_string(c.p) + " q " + std::to_string(c.q) +
         (c.composite ? " composite" : " stacked") + (c.bent ? " bent" : " flat");
}

/// Old and new displacement: pressed onto the bone, and no node like the next.
void displace(const SkinMesh& mesh, VectorXd (&u)[2]) {
  std::mt19937 rng(4);
  std::uniform_real_distribution<double> d(-1, 1);
  u[0].resize(3 * mesh.num_nodes());
  for (double& x : u[0]) x = 0.01 * d(rng);
  for (Eigen::Index i = 2; i < u[0].size(); i += 3) u[0][i] -= 0.03;
  u[1] = u[0];
  for (double& x : u[1]) x += 0.01 * d(rng);
}

/// Skin, bone and finger move together; the rest shape, to which strains refer, does not.
TEST(RigidMotion, DeformedSkinWithFingerAndBone) {
  const OneThread one_thread;
  Errors errors("deformed skin with finger and bone");
  for (const Case& c : kCases) {
    const SkinMesh mesh = distorted_mesh(c.p, c.q, c.composite, c.bent);
    const Place here = place(mesh, test::native_values(mesh, c.base), Mat3::Identity(), c.base);
    VectorXd u[2];
    displace(mesh, u);
    const std::vector<Sensitivity> allowed = sensitivities(here, u);
    for (const auto& motions : {turns(), shifts()})
      for (const Motion& motion : motions) {
        Place there = here;
        there.native = moved_native(here.native, motion);
        there.native.segment<3>(Slots::base + 2) = motion.of(here.native.segment<3>(Slots::base + 2));
        const Eigen::Quaterniond& q = motion.quaternion;
        there.native.segment<4>(Slots::base + 5) << q.w(), q.x(), q.y(), q.z();
        VectorXd u_there[2] = {u[0], u[1]};
        for (int k = 0; k < 2; ++k)
          for (int i = 0; i < mesh.num_nodes(); ++i) {
            const Vec3 x = mesh.rest.row(i).transpose();
            u_there[k].segment<3>(3 * i) = motion.of(x + u[k].segment<3>(3 * i)) - x;
          }
        for (std::size_t t = 0; t < here.terms.size(); ++t) {
          const Term& term = here.terms[t];
          SCOPED_TRACE(text(c) + ", " + term.name() + ", shift " + std::to_string(motion.shift.norm()));
          compare(term, term, here, there, allowed[t], u, u_there, motion, Mat3::Identity(), errors);
        }
      }
  }
}

/// The whole scene elsewhere: rest shape, anchors of the ligaments, points of the bone, finger.
TEST(RigidMotion, WholeScene) {
  const OneThread one_thread;
  Errors errors("whole scene");
  for (const Case& c : kCases) {
    const SkinMesh mesh = distorted_mesh(c.p, c.q, c.composite, c.bent);
    Place here = place(mesh, test::native_values(mesh, c.base), Mat3::Identity(), c.base);
    test::add_ligaments(here);
    VectorXd u[2];
    displace(mesh, u);
    const std::vector<Sensitivity> allowed = sensitivities(here, u);
    for (const auto& motions : {turns(), shifts()})
      for (const Motion& motion : motions) {
        SkinMesh moved = mesh;
        for (int i = 0; i < mesh.num_nodes(); ++i)
          moved.rest.row(i) = motion.of(mesh.rest.row(i).transpose()).transpose();
        moved.column_normals = mesh.column_normals * motion.turn.transpose();
        VectorXd native = moved_native(here.native, motion);
        if (c.base != BaseShape::imls)  // its points have moved already
          native.segment<3>(Slots::base + 2) = motion.of(here.native.segment<3>(Slots::base + 2));
        Place there = place(moved, native, motion.turn, c.base);
        test::add_ligaments(there);
        const VectorXd u_there[2] = {turned(motion.turn, u[0]), turned(motion.turn, u[1])};
        for (std::size_t t = 0; t < here.terms.size(); ++t) {
          SCOPED_TRACE(text(c) + ", " + here.terms[t].name() + ", shift " +
                       std::to_string(motion.shift.norm()));
          compare(here.terms[t], there.terms[t], here, there, allowed[t], u, u_there, motion, motion.turn,
                  errors);
        }
      }
  }
}

}  // namespace
}  // namespace rhytid
