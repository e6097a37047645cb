// Energy of a whole drag: what the colliders do is stored, dissipated by damper and friction, or taken by the
// implicit rule, to the residual of the steps; what the rule takes vanishes with dt.
#include "sim/time/energy_account.h"

#include <gtest/gtest.h>

#include <cmath>
#include <cstdio>
#include <map>

#include "sim/scene/load.h"
#include "sim/scene/scene_model.h"
#include "tests/support/small_scenes.h"

namespace rhytid {
namespace {

/// Sums over a run.
struct Totals {
  double work = 0, dissipated = 0, numerical = 0, stored = 0, imbalance = 0, rim_work = 0;
  double largest_stored = 0, worst_step = 0;
  std::map<std::string, double> dissipated_by, numerical_by, work_by, least_dissipated, least_numerical;
};

Totals drag(std::vector<std::string> settings, int substeps) {
  settings.push_back("/skin/surface/grid/cells=[4,3]");
  settings.push_back("/skin/layers/soft/order=1");
  // Press, drag with slip and stick, retreat until nothing touches.
  settings.push_back(R"(/colliders/finger/path=[{"time": 0, "position": [-2, 0, 5.02]},
    {"time": 0.125, "position": [-2, 0, 4.5]}, {"time": 0.375, "position": [1, 0.5, 4.5]},
    {"time": 0.5, "position": [1, 0.5, 5.6]}])");
  settings.push_back("/time/substeps=" + std::to_string(substeps));
  const SceneModel m(parse_scene_text(test::drag_scene(2, 13), "drag.json", settings));
  RunOptions options = m.run_options();
  options.keep_states = false;
  options.account_energies = true;
  options.minimiser.polish = true;
  const Trajectory run = simulate(m.model(), m.native(), options);
  EXPECT_TRUE(run.complete) << run.failure;
  Totals t;
  for (const StepRecord& step : run.steps) {
    const EnergyAccount& e = step.energies;
    t.work += e.work;
    t.rim_work += e.rim_work;
    t.dissipated += e.dissipated;
    t.numerical += e.numerical;
    t.imbalance += e.imbalance;
    t.worst_step = std::max(t.worst_step, std::fabs(e.imbalance));
    t.stored = e.stored;
    t.largest_stored = std::max(t.largest_stored, e.stored);
    for (const TermAccount& one : e.terms) {
      t.dissipated_by[one.term] += one.dissipated;
      t.numerical_by[one.term] += one.numerical;
      t.work_by[one.term] += one.work;
      t.least_dissipated[one.term] = std::min(t.least_dissipated[one.term], one.dissipated);
      t.least_numerical[one.term] = std::min(t.least_numerical[one.term], one.numerical);
    }
  }
  return t;
}

// N is the remainder of each term, so that this sum closes whatever E, W and D are: it sees that the steps converged
// and that terms and rim are summed. What E, W and D are worth is judged in energy_quadrature_test.cpp.
TEST(EnergyBalance, WholeDragClosesToTheResidual) {
  std::printf("drag: work, stored at the end, viscous, friction, numerical [mJ], imbalance/work\n");
  for (const char* damper : {"exponential", "backward_euler"}) {
    const Totals t = drag({std::string("/time/damper=") + damper}, 1);
    std::printf("  %-14s %.6f %.6f %.6f %.6f %.6f  %.1e\n", damper, t.work, t.stored,
                t.dissipated_by.at("skin"), t.dissipated_by.at("friction finger"), t.numerical,
                t.imbalance / t.work);
    EXPECT_GT(t.work, 0.01);
    EXPECT_LT(std::fabs(t.imbalance), 1e-8 * t.work);
    EXPECT_LT(t.worst_step, 1e-8 * t.work);
    // The parts add up by themselves: ΔE = W − D − N from rest.
    EXPECT_NEAR(t.stored, t.work + t.rim_work - t.dissipated - t.numerical, 1e-8 * t.work);
    EXPECT_GT(t.dissipated_by.at("friction finger"), 0.01 * t.work);
    EXPECT_GT(t.dissipated_by.at("skin"), 0.01 * t.work);
    EXPECT_GE(t.least_dissipated.at("friction finger"), 0);
    EXPECT_GE(t.least_dissipated.at("skin"), -1e-15);
    EXPECT_LT(std::fabs(t.rim_work), 1e-20) << "a clamped rim does not move";
    EXPECT_EQ(t.work_by.at("base contact"), 0);
    EXPECT_LT(t.stored, 0.9 * t.largest_stored) << "the finger has let go";
  }
}

// Only if work, storage and dissipation are all those of the same motion does the remainder vanish with dt.
// It does so term by term at first order. Their sum is small beside them, since all forces balance at both
// ends of a step: what the finger is charged too little the skin is charged too much. Each has a second-order
// part of its own, and these do not cancel as well, so the sum shows its order one or two halvings later than
// the terms.
TEST(EnergyBalance, NumericalDissipationIsOfFirstOrder) {
  double numerical[3], friction[3], viscous[3], work[3];
  std::map<std::string, double> by_term[3];
  for (int level = 0; level < 3; ++level) {
    const Totals t = drag({"/time/lag_passes=2"}, 4 << level);
    numerical[level] = t.numerical;
    work[level] = t.work;
    friction[level] = t.dissipated_by.at("friction finger");
    viscous[level] = t.dissipated_by.at("skin");
    by_term[level] = t.numerical_by;
    std::printf("  %d substeps: work %.6f, viscous %.6f, friction %.6f, numerical %.6f (%.2f %%)\n",
                4 << level, work[level], viscous[level], friction[level], numerical[level],
                100 * numerical[level] / work[level]);
    EXPECT_LT(std::fabs(t.imbalance), 1e-8 * t.work);
  }
  for (const auto& [term, coarse] : by_term[0]) {
    const double middle = by_term[1].at(term), fine = by_term[2].at(term);
    if (term == "friction finger") {
      EXPECT_LT(std::fabs(fine), 1e-12 * work[2]);
      continue;
    }
    std::printf("    %-16s %+.6f %+.6f %+.6f, orders %.2f %.2f\n", term.c_str(), coarse, middle, fine,
                std::log2(coarse / middle), std::log2(middle / fine));
    EXPECT_NEAR(std::log2(middle / fine), 1, 0.08) << term;
  }
  std::printf("    %-16s orders %.2f %.2f\n", "all", std::log2(numerical[0] / numerical[1]),
              std::log2(numerical[1] / numerical[2]));
  EXPECT_GT(std::log2(numerical[0] / numerical[1]), 0.6);
  EXPECT_GT(std::log2(numerical[1] / numerical[2]), 0.8);
  EXPECT_LT(numerical[2], 0.01 * work[2]);
  EXPECT_NEAR(friction[1], friction[2], 0.02 * friction[2]);
  EXPECT_NEAR(viscous[1], viscous[2], 0.02 * viscous[2]);
}

// Without damper and friction nothing is dissipated. Each convex term that no body moves charges a surplus,
// never a deficit; over all terms the surpluses cancel to second order, since all forces balance at both
// ends.
TEST(EnergyBalance, ElasticDragGivesBackItsWork) {
  double numerical[3];
  for (int level = 0; level < 3; ++level) {
    const Totals t = drag({"/skin/layers/soft/relaxing_fraction=0", "/skin/layers/film/relaxing_fraction=0",
                           "/colliders/finger/friction/coefficient=0"},
                          1 << level);
    EXPECT_EQ(t.dissipated, 0);
    EXPECT_LT(std::fabs(t.imbalance), 1e-8 * t.largest_stored);
    EXPECT_GE(t.least_numerical.at("ligaments"), -1e-15);
    EXPECT_NEAR(t.work, t.numerical + t.stored, 1e-8 * t.largest_stored);
    numerical[level] = std::fabs(t.numerical) / t.largest_stored;
    std::printf("  elastic, %d substeps: lost to the rule %.1e of the largest stored energy\n", 1 << level,
                numerical[level]);
  }
  EXPECT_LT(numerical[2], 0.25 * numerical[0]);
  EXPECT_LT(numerical[2], 0.02);
}

}  // namespace
}  // namespace rhytid
