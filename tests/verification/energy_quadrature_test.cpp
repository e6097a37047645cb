// The energy account against sums that do not use it: stored energy from steps of no duration, work of finger and
// held skin from nodal forces and the trapezoidal rule, dissipation from the Maxwell flow dE/dt = −2E/τ. With these,
//
//   B = E(T) − E(0) − W + D
//
// is zero for the continuous motion and vanishes with dt at the order of the damper. A wrong factor in a stored
// energy, a force or the viscous flow leaves a B that does not vanish. (EnergyAccount::imbalance cannot show that:
// its N is defined as the remainder, so it is the residual times the step whatever E, W and D are.)
#include <gtest/gtest.h>

#include <cmath>
#include <cstdio>
#include <memory>
#include <string>
#include <vector>

#include "sim/scene/load.h"
#include "sim/scene/scene_model.h"
#include "tests/support/small_scenes.h"

namespace rhytid {
namespace {

constexpr double kTau = 0.1;  // s, of both layers

/// What a run did, by sums of its own and by its account. mJ.
struct Sums {
  double stored = 0;                                         ///< at the end
  double contact_work = 0, friction_work = 0, rim_work = 0;  ///< trapezoidal
  double slip_loss = 0, viscous_loss = 0;                    ///< trapezoidal
  double told_contact_work = 0, told_friction_work = 0, told_rim_work = 0, told_slip_loss = 0,
         told_viscous_loss = 0;
  double balance() const {
    return stored - contact_work - friction_work - rim_work + slip_loss + viscous_loss;
  }
};

/// Watches a run with one finger that is only shifted (no turns), or none.
class Watch {
 public:
  explicit Watch(const SceneModel& m) : model_(m.model()), native_(m.native()) {
    for (std::size_t k = 0; k < model_.terms.size(); ++k) {
      const std::string& name = model_.terms[k].name();
      if (name == "skin") skin_ = static_cast<int>(k);
      if (name == "contact finger") contact_ = static_cast<int>(k);
      if (name == "friction finger") friction_ = static_cast<int>(k);
    }
    contact_force_ = friction_force_ = reaction_ = VectorXd::Zero(3 * model_.num_nodes());
  }

  /// `finger`: its displacement over the step.
  void step(const StepEvent& event, const Vec3& finger) {
    const State &old = event.problem.old(), &end = event.state;
    const VectorXd du = end.u - old.u;
    const double dt = event.problem.step().dt();
    const VectorXd contact = force(event.problem, contact_, end.u),
                   friction = force(event.problem, friction_, end.u);
    // Reactions: all of R that is not free.
    const VectorXd residual = event.problem.residual(end.u);
    const VectorXd reaction = residual - model_.to_displacement(model_.to_unknowns(residual));
    sums.contact_work -= 0.5 * total(contact + contact_force_).dot(finger);
    sums.friction_work -= 0.5 * total(friction + friction_force_).dot(finger);
    sums.slip_loss +=
        0.5 * (friction + friction_force_).dot(du) - 0.5 * total(friction + friction_force_).dot(finger);
    sums.rim_work += 0.5 * (reaction + reaction_).dot(du);
    const double maxwell = still(end, 1e-12 * kTau)[skin_] - still(end, 1e9)[skin_];
    sums.viscous_loss += dt * (maxwell + maxwell_) / kTau;
    sums.stored = 0;
    const std::vector<double> energies = still(end, 1e-12 * kTau);
    for (std::size_t k = 0; k < energies.size(); ++k)
      if (static_cast<int>(k) != friction_) sums.stored += energies[k];
    scale = std::max(scale, sums.stored);

    // The account, step by step: its own quadrature points against sums over nodes.
    const EnergyAccount& account = event.record.energies;
    EXPECT_NEAR(account.stored, sums.stored, 1e-9 * scale);
    EXPECT_NEAR(account.rim_work, reaction.dot(du), 1e-12 * scale);
    for (const TermAccount& one : account.terms) {
      if (one.term == "contact finger") {
        EXPECT_NEAR(one.work, -0.5 * total(contact + contact_force_).dot(finger), 1e-9 * scale);
        sums.told_contact_work += one.work;
      } else if (one.term == "friction finger") {
        EXPECT_NEAR(one.work, -total(friction).dot(finger), 1e-9 * scale);
        EXPECT_NEAR(one.dissipated, friction.dot(du) - total(friction).dot(finger), 1e-9 * scale);
        sums.told_friction_work += one.work;
        sums.told_slip_loss += one.dissipated;
      } else if (one.term == "skin") {
        sums.told_viscous_loss += one.dissipated;
      } else {
        EXPECT_EQ(one.work, 0) << one.term;
        EXPECT_EQ(one.dissipated, 0) << one.term;
      }
    }
    sums.told_rim_work += account.rim_work;
    contact_force_ = contact;
    friction_force_ = friction;
    reaction_ = reaction;
    maxwell_ = maxwell;
  }

  Sums sums;
  double scale = 1e-30;  ///< largest stored energy
  bool has_finger() const { return contact_ >= 0; }

 private:
  VectorXd force(const StepProblem& problem, int term, const VectorXd& u) const {
    VectorXd r = VectorXd::Zero(u.size());
    if (term >= 0)
      (void)model_.terms[static_cast<std::size_t>(term)].energy(problem.step(), problem.data(term), u, &r,
                                                                nullptr);
    return r;
  }
  /// Sum over nodes: the shape functions add up to 1.
  static Vec3 total(const VectorXd& force) {
    Vec3 sum = Vec3::Zero();
    for (Eigen::Index i = 0; i < force.size(); i += 3) sum += force.segment<3>(i);
    return sum;
  }
  /// Energy of each term in a step from `s` that stays where it is: with dt → 0 what is stored, with dt → ∞ the
  /// skin without its Maxwell springs.
  std::vector<double> still(const State& s, double dt) const {
    return StepProblem(model_, native_, {0, s.time, s.time + dt}, s).term_energies(s.u);
  }

  const Model& model_;
  VectorXd native_;
  int skin_ = -1, contact_ = -1, friction_ = -1;
  VectorXd contact_force_, friction_force_, reaction_;
  double maxwell_ = 0;
};

Sums watched(const std::vector<std::string>& settings, int substeps) {
  std::vector<std::string> all = {"/skin/surface/grid/cells=[3,2]", "/skin/layers/soft/order=1",
                                  "/skin/layers/soft/relaxation_time=" + std::to_string(kTau),
                                  "/skin/layers/film/relaxation_time=" + std::to_string(kTau),
                                  "/time/substeps=" + std::to_string(substeps)};
  all.insert(all.end(), settings.begin(), settings.end());
  const SceneModel m(parse_scene_text(test::drag_scene(1, 6), "drag.json", all));
  RunOptions options = m.run_options();
  options.keep_states = false;
  options.account_energies = true;
  options.minimiser.polish = true;
  Watch watch(m);
  std::unique_ptr<KnotPath> path;
  const std::vector<ColliderScene>& colliders = m.scene().colliders;
  if (!colliders.empty()) {
    std::vector<double> times;
    for (const PathKnot& k : colliders[0].path) times.push_back(k.time);
    path = std::make_unique<KnotPath>(times, colliders[0].interpolation);
  }
  EXPECT_EQ(watch.has_finger(), path != nullptr) << "terms have other names";
  const auto place = [&](double t) {
    Vec3 p = Vec3::Zero();
    if (path)
      for (const KnotWeight& w : path->weights(t)) p += w.weight * colliders[0].path[w.knot].position;
    return p;
  };
  RunObserver observer;
  observer.step = [&](const StepEvent& event) {
    watch.step(event, place(event.record.step.t) - place(event.record.step.t_old));
  };
  const Trajectory run = simulate(m.model(), m.native(), options, observer);
  EXPECT_TRUE(run.complete) << run.failure;
  return watch.sums;
}

/// Settings of a drag whose motion has two derivatives, so that orders can be seen.
std::vector<std::string> smooth_drag(const std::string& damper) {
  return {"/time/damper=" + damper,
          "/colliders/finger/onset=0.2",
          "/base/onset=0.2",
          "/colliders/finger/friction/coefficient=0.2",
          "/colliders/finger/interpolation=clamped_spline",
          R"(/colliders/finger/path=[{"time": 0, "position": [-2, 0, 5.2]},
            {"time": 0.1, "position": [-1.8, 0.05, 4.5]}, {"time": 0.18, "position": [-1.4, 0.1, 4.2]},
            {"time": 0.25, "position": [-1.2, 0.15, 4.4]}])"};
}

/// Three halvings of a run: the true balance, and what the account calls dissipated by the dampers less the
/// trapezoidal sum over 2E/τ.
struct Halvings {
  double balance[3], flow[3];
  Sums finest;
};

Halvings halved(const char* name, const std::vector<std::string>& settings, int substeps) {
  Halvings h;
  for (int level = 0; level < 3; ++level) {
    const Sums s = h.finest = watched(settings, substeps << level);
    h.balance[level] = s.balance();
    h.flow[level] = s.told_viscous_loss - s.viscous_loss;
    std::printf(
        "  %-12s %2d substeps: E %.6f, work %.6f + %.6f + %.6f, slip %.6f, viscous %.6f mJ; B %+.2e, "
        "account's viscous less that %+.2e\n",
        name, substeps << level, s.stored, s.contact_work, s.friction_work, s.rim_work, s.slip_loss,
        s.viscous_loss, h.balance[level], h.flow[level]);
  }
  return h;
}

void expect_order(const double (&error)[3], double order, const char* what) {
  const double coarse = std::log2(error[0] / error[1]), fine = std::log2(error[1] / error[2]);
  std::printf("    %-24s orders %.2f, %.2f\n", what, coarse, fine);
  EXPECT_NEAR(fine, order, 0.1) << what;
}

TEST(EnergyQuadrature, TrueBalanceOfADragVanishesWithDt) {
  const Halvings exponential = halved("exponential", smooth_drag("exponential"), 4),
                 strang = halved("strang", smooth_drag("strang"), 4),
                 literal = halved("literal", smooth_drag("literal"), 4);
  expect_order(exponential.balance, 2, "B, exponential");
  expect_order(strang.balance, 2, "B, strang");
  // Most of the literal scheme's B is that of the motion, of second order; its own part is what it has beyond strang.
  double own[3];
  for (int level = 0; level < 3; ++level) own[level] = literal.balance[level] - strang.balance[level];
  expect_order(own, 1, "B, literal beyond strang");
  expect_order(exponential.flow, 2, "viscous, exponential");
  expect_order(strang.flow, 2, "viscous, strang");
  expect_order(literal.flow, 1, "viscous, literal");
  for (const Halvings* h : {&exponential, &strang, &literal}) {
    const double work = h->finest.contact_work + h->finest.friction_work;
    EXPECT_LT(std::fabs(h->balance[2]), 2e-3 * work);
    EXPECT_GT(h->finest.slip_loss, 0.3 * work);
    EXPECT_GT(h->finest.viscous_loss, 0.03 * work);
    EXPECT_GT(h->finest.stored, 0.3 * work);
  }
}

TEST(EnergyQuadrature, WorkOfHeldSkinIsStoredOrDissipated) {
  for (const auto& [damper, order] :
       {std::pair{"exponential", 2.0}, {"strang", 2.0}, {"literal", 1.0}, {"backward_euler", 1.0}}) {
    const Halvings h =
        halved(damper,
               {std::string("/time/damper=") + damper, "/colliders=[]", "/base=null",
                R"(/skin/held=[{"name": "side", "box": {"low": [-8, -6, 0], "high": [-8, 6, 0]},
                   "path": [{"time": 0, "displacement": [0, 0, 0]},
                            {"time": 0.25, "displacement": [0.8, 0.3, 0]}]}])"},
               2);
    if (std::string(damper) == "exponential") {
      // Almost exact at a constant rate: what is left is too little to have one order.
      EXPECT_LT(std::fabs(h.balance[2]), 2e-6 * h.finest.rim_work);
      EXPECT_GT(std::log2(h.balance[1] / h.balance[2]), 1.8);
    } else {
      expect_order(h.balance, order, "B");
    }
    expect_order(h.flow, order, "viscous");
    EXPECT_GT(h.finest.viscous_loss, 0.01 * h.finest.rim_work);
    EXPECT_LT(std::fabs(h.balance[2]), 2e-3 * h.finest.rim_work);
    // The account charges the force at the end for the whole step.
    EXPECT_NEAR(h.finest.told_rim_work / h.finest.rim_work, 1, 0.05);
    EXPECT_GT(h.finest.told_rim_work, h.finest.rim_work);
  }
}

}  // namespace
}  // namespace rhytid
