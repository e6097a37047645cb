// Runs that dropped their histories: recomputed to the same bits, under any budget of memory, with as few
// recomputed steps as there can be.
#include <gtest/gtest.h>

#include <array>
#include <atomic>
#include <cstdlib>
#include <cstring>

#include "adjoint/checkpoint_schedule.h"
#include "adjoint/output_values.h"
#include "adjoint/resultant_force.h"
#include "adjoint/stored_energy.h"
#include "adjoint/taylor.h"
#include "tests/adjoint/certified_case.h"
#include "tests/support/memory_limit.h"
#include "tests/support/small_scenes.h"

// Blocks of memory of one size, counted where the program gets them: what is held, whoever says what.
namespace rhytid::test {
namespace {

std::atomic<bool> is_watching = false;
std::atomic<std::size_t> watched_bytes = 0;
std::atomic<int> live_blocks = 0, most_blocks = 0;
std::array<std::atomic<void*>, 4096> known_blocks;

void note_block(void* block, std::size_t bytes) {
  constexpr std::size_t alignment = 64;  // what Eigen may ask for beyond the numbers
  if (block == nullptr || bytes < watched_bytes || bytes > watched_bytes + alignment) return;
  for (std::atomic<void*>& known : known_blocks) {
    void* none = nullptr;
    if (!known.compare_exchange_strong(none, block)) continue;
    const int now = ++live_blocks;
    if (now > most_blocks) most_blocks = now;
    return;
  }
}
void forget_block(void* block) {
  for (std::atomic<void*>& known : known_blocks) {
    void* expected = block;
    if (!known.compare_exchange_strong(expected, nullptr)) continue;
    --live_blocks;
    return;
  }
}

/// Counts the blocks of `bytes` that are got while it lives.
class BlockWatch {
 public:
#if defined(__GLIBC__) && !defined(RHYTID_TEST_IS_SANITIZED)
  static constexpr bool is_effective = true;
#else
  static constexpr bool is_effective = false;
#endif
  explicit BlockWatch(std::size_t bytes) {
    for (std::atomic<void*>& known : known_blocks) known = nullptr;
    watched_bytes = bytes, live_blocks = 0, most_blocks = 0, is_watching = true;
  }
  ~BlockWatch() {
    is_watching = false;
  }
  BlockWatch(const BlockWatch&) = delete;
  BlockWatch& operator=(const BlockWatch&) = delete;
  int most() const {
    return most_blocks;
  }
};

}  // namespace
}  // namespace rhytid::test

#if defined(__GLIBC__) && !defined(RHYTID_TEST_IS_SANITIZED)
extern "C" {
void* __libc_malloc(std::size_t bytes);
void* __libc_calloc(std::size_t count, std::size_t bytes);
void __libc_free(void* block);
void* malloc(std::size_t bytes) noexcept {
  void* const block = __libc_malloc(bytes);
  if (rhytid::test::is_watching) rhytid::test::note_block(block, bytes);
  return block;
}
void* calloc(std::size_t count, std::size_t bytes) noexcept {  // what compilers make of zeros
  void* const block = __libc_calloc(count, bytes);
  if (rhytid::test::is_watching) rhytid::test::note_block(block, count * bytes);
  return block;
}
void free(void* block) noexcept {
  if (rhytid::test::is_watching && block != nullptr) rhytid::test::forget_block(block);
  __libc_free(block);
}
}
#endif

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
  std::size_t in_use =
      3;  // the caller's, the one before a recomputed step and the one after it, of passes more
  for (const StepRecord& record : runs.dropped.steps)
    in_use = std::max(in_use, 3 + record.earlier_passes.size());
  for (const std::size_t states : {std::size_t{0}, in_use + 1, in_use + 2, in_use + 4, std::size_t{1000}}) {
    const AdjointResult got =
        adjoint_sweep_within(states * one, model, runs.native(), runs.dropped, *runs.output, runs.weights);
    EXPECT_TRUE(same_bits(got.native_bar, wanted.native_bar)) << states;
    EXPECT_EQ(got.residual_error, wanted.residual_error);
    const CheckpointReport& report = got.checkpoints;
    EXPECT_EQ(report.slots, states == 0 ? 0 : std::min<long>(static_cast<long>(states - in_use), steps));
    EXPECT_EQ(report.recomputed_steps, checkpoint_advances(steps, report.slots));
    EXPECT_LE(report.held_bytes, std::max(states, in_use) * one);
    if (!test::BlockWatch::is_effective) continue;
    // The same walk without the sweep, which has vectors of that size itself.
    const test::BlockWatch watch(sizeof(double) * model.history_size());
    const VectorXd native = runs.native();
    ReverseStates walk(model, native, runs.dropped, states * one);
    SharedState state = walk.after(steps);
    for (int i = steps - 1; i >= 0; --i) {
      SharedState old = walk.after(i);
      const StepRecord& record = runs.dropped.steps[static_cast<std::size_t>(i)];
      StepPasses passes(model, native, record.step, *old, record.earlier_passes);
      state = std::move(old);
    }
    EXPECT_EQ(static_cast<std::size_t>(watch.most()) * one, report.held_bytes) << states;
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
                    std::vector<std::string>{"/time/damper=exponential", "/time/lag=extrapolated"},
                    std::vector<std::string>{"/skin/pre_stretch={\"stretch\":1.1}", "/time/frames=6"}));

// Of a run without histories the certificate is that of the run with them.
TEST(Checkpoints, TaylorTestsTakeARunWithoutHistories) {
  const TwoRuns runs({"/time/damper=exponential", "/time/lag_passes=2", "/time/frames=4"});
  const MinimiserOptions minimiser = certificate_minimiser(runs.kept.options.minimiser);
  const FunctionalDifference kept(runs.kept.scene_model, runs.kept.run, *runs.output, runs.weights,
                                  minimiser),
      dropped(runs.kept.scene_model, runs.dropped, *runs.output, runs.weights, minimiser);
  EXPECT_EQ(kept.regimes(), dropped.regimes());
  EXPECT_EQ(dropped.difference(runs.kept.run), 0);
  const VectorXd nearby = runs.native() * 1.001;
  EXPECT_EQ(kept.evaluate(nearby).difference, dropped.evaluate(nearby).difference);
  CertificateOptions options;
  options.addresses = {"/skin/layers/soft/youngs_modulus"};
  const CertificateReport report =
      certify(runs.kept.scene_model, runs.dropped, *runs.kept.output, runs.kept.weights, options);
  EXPECT_TRUE(report.passed());
  print(report);
}

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
