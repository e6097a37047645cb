// Runs that dropped their histories: recomputed to the same bits, under any budget of memory, with as few
// recomputed steps as there can be.
#include <gtest/gtest.h>

#include <cstring>

#include "adjoint/checkpoint_schedule.h"
#include "adjoint/output_values.h"
#include "adjoint/resultant_force.h"
#include "adjoint/stored_energy.h"
#include "tests/adjoint/certified_case.h"
#include "tests/support/small_scenes.h"

namespace rhytid::adjoint {
namespace {

// Against all ways to place checkpoints, by dynamic programming.
TEST(Checkpoints, DistanceTakesTheFewestAdvances) {
  constexpr int most = 60, slots = 9;
  std::vector<std::vector<long>> fewest(slots + 1, std::vector<long>(most + 1, 0));
  for (int s = 0; s <= slots; ++s)
    for (int n = 1; n <= most; ++n) {
      long best = static_cast<long>(n) * (n + 1) / 2;
      if (s > 0)
        for (int m = 1; m < n; ++m) best = std::min(best, m + fewest[s - 1][n - m] + fewest[s][m - 1]);
      fewest[s][n] = n == 1 ? 1 : best;
      EXPECT_EQ(checkpoint_advances(n, s), fewest[s][n]) << n << " states, " << s << " slots";
    }
  EXPECT_EQ(checkpoint_advances(1000, 999), 1000);
  EXPECT_EQ(checkpoint_advances(1000, 0), 500500);
  EXPECT_LT(checkpoint_advances(1000, 10), 5000);
  EXPECT_THROW((void)checkpoint_distance(0, 1), ContractError);
}

bool same_bits(const VectorXd& a, const VectorXd& b) {
  return a.size() == b.size() && std::memcmp(a.data(), b.data(), sizeof(double) * a.size()) == 0;
}

/// A run with all histories and the same without any.
struct TwoRuns {
  CertifiedCase kept;
  Trajectory dropped;
  std::shared_ptr<const Output> output;
  std::vector<VectorXd> weights;

  explicit TwoRuns(const std::vector<std::string>& more) : kept(test::drag_scene(2, 12), settings(more)) {
    RunOptions options = kept.options;
    options.keep_histories = false;
    dropped = simulate(kept.model(), native(), options);
    // Outputs that read histories and the old state, too.
    output = std::make_shared<CombinedOutput>(std::vector<std::shared_ptr<const Output>>{
        kept.output, std::make_shared<StoredEnergy>(kept.model()),
        std::make_shared<ResultantForce>(collider_force(kept.model(), "finger"))});
    weights = random_weights(*output, kept.run.frames(), 5);
  }
  static std::vector<std::string> settings(std::vector<std::string> more) {
    more.insert(more.begin(), {"/skin/surface/grid/cells=[3,2]", "/skin/layers/soft/order=1"});
    return more;
  }
  VectorXd native() const { return kept.scene_model.native(); }
};

class DroppedHistories : public testing::TestWithParam<std::vector<std::string>> {};

TEST_P(DroppedHistories, GiveTheSameBitsUnderAnyBudget) {
  const TwoRuns runs(GetParam());
  ASSERT_TRUE(runs.dropped.complete) << runs.dropped.failure;
  const int steps = static_cast<int>(runs.dropped.steps.size());
  for (int i = 0; i < steps; ++i) {
    ASSERT_EQ(runs.dropped.steps[i].state.history.size(), 0);
    ASSERT_TRUE(same_bits(runs.dropped.steps[i].state.u, runs.kept.run.steps[i].state.u));
  }
  const Model& model = runs.kept.model();
  const AdjointResult wanted = adjoint_sweep(model, runs.native(), runs.kept.run, *runs.output, runs.weights);
  EXPECT_EQ(wanted.checkpoints.recomputed_steps, 0);
  EXPECT_EQ(wanted.checkpoints.held_bytes, 0u);
  const std::size_t one = wanted.checkpoints.state_bytes;
  ASSERT_GT(model.history_size(), 0u);
  for (const std::size_t states : {0u, 3u, 4u, 6u, 1000u}) {
    const AdjointResult got =
        adjoint_sweep_within(states * one, model, runs.native(), runs.dropped, *runs.output, runs.weights);
    EXPECT_TRUE(same_bits(got.native_bar, wanted.native_bar)) << states;
    EXPECT_EQ(got.residual_error, wanted.residual_error);
    const CheckpointReport& report = got.checkpoints;
    EXPECT_EQ(report.slots, states == 0 ? 0 : std::min<long>(static_cast<long>(states) - 2, steps));
    EXPECT_EQ(report.recomputed_steps, checkpoint_advances(steps, report.slots));
    EXPECT_LE(report.held_bytes, std::max<std::size_t>(states, 2) * one);
    std::printf("%d steps, %ld kept: %ld recomputed, %zu bytes held\n", steps, report.slots,
                report.recomputed_steps, report.held_bytes);
  }
  const MatrixXd direction = wanted.native_bar;
  const auto tangent = tangent_sweep(model, runs.native(), runs.kept.run, *runs.output, direction);
  const auto again = tangent_sweep(model, runs.native(), runs.dropped, *runs.output, direction);
  const auto values = output_values(model, runs.native(), runs.kept.run, *runs.output);
  const auto same = output_values(model, runs.native(), runs.dropped, *runs.output);
  for (int f = 1; f <= runs.kept.run.frames(); ++f) {
    EXPECT_TRUE(same_bits(tangent.frames[f].col(0), again.frames[f].col(0))) << f;
    EXPECT_TRUE(same_bits(values[f], same[f])) << f;
  }
}

INSTANTIATE_TEST_SUITE_P(
    Checkpoints, DroppedHistories,
    testing::Values(std::vector<std::string>{"/time/damper=exponential"},
                    std::vector<std::string>{"/time/damper=literal", "/time/lag_passes=3", "/time/frames=5"},
                    std::vector<std::string>{"/skin/pre_stretch={\"stretch\":1.1}", "/time/frames=6"}));

TEST(Checkpoints, ARunMayKeepSomeHistories) {
  const TwoRuns runs({"/time/frames=8"});
  Trajectory some = runs.kept.run;
  for (const int i : {0, 1, 3, 4, 5, 7}) some.steps[static_cast<std::size_t>(i)].state.history.resize(0);
  const Model& model = runs.kept.model();
  const AdjointResult wanted = adjoint_sweep(model, runs.native(), runs.kept.run, *runs.output, runs.weights);
  const AdjointResult got = adjoint_sweep_within(0, model, runs.native(), some, *runs.output, runs.weights);
  EXPECT_TRUE(same_bits(got.native_bar, wanted.native_bar));
  EXPECT_EQ(got.checkpoints.recomputed_steps, 1 + (3 + 2 + 1) + (2 + 1));
}

}  // namespace
}  // namespace rhytid::adjoint
