// The fast subset of `rhytid bench stability`: every case converges or is refused as its demand says, and no
// state contradicts its report. The whole sweep: rhytid bench stability.
#include <gtest/gtest.h>

#include <cctype>
#include <cmath>
#include <set>

#include "sim/core/parallel.h"
#include "tools/bench/stability_run.h"

namespace rhytid::tools {
namespace {

std::vector<StabilityCase> quick_cases() {
  std::vector<StabilityCase> quick;
  for (const StabilityCase& one : stability_cases())
    if (one.is_quick) quick.push_back(one);
  return quick;
}

/// One thread: the scenes are too small to share.
class Stability : public testing::TestWithParam<StabilityCase> {
 protected:
  void SetUp() override { set_num_threads(1); }
};

TEST_P(Stability, ComesOutAsItMust) {
  const StabilityResult result = run_stability_case(GetParam(), 60);
  EXPECT_TRUE(result.as_demanded) << name(result.outcome) << ": " << result.message;
  if (result.outcome != StabilityOutcome::converged) return;
  EXPECT_LE(result.residual, 1);
  EXPECT_GT(result.smallest_jacobian, 0);
  EXPECT_TRUE(std::isfinite(result.largest_displacement));
}

INSTANTIATE_TEST_SUITE_P(Quick, Stability, testing::ValuesIn(quick_cases()), [](const auto& chosen) {
  std::string text = std::to_string(chosen.index) + "_" + chosen.param.sweep + "_" + chosen.param.value;
  for (char& c : text)
    if (!std::isalnum(static_cast<unsigned char>(c))) c = '_';
  return text;
});

TEST(StabilityCases, AreDistinct) {
  std::set<std::string> seen;
  for (const StabilityCase& one : stability_cases())
    EXPECT_TRUE(seen.insert(one.sweep + " " + one.value).second) << one.sweep << " " << one.value;
}

// The judge must be able to say no.
TEST(StabilityCases, AJudgementCanFail) {
  StabilityCase one{"none", "refused though it runs", {"/time/frames=1"}, false, StabilityDemand::refused};
  EXPECT_FALSE(run_stability_case(one, 60).as_demanded);
  one = {"none", "too slow", {}, false, StabilityDemand::clear_outcome};
  const StabilityResult slow = run_stability_case(one, 1e-9);
  EXPECT_EQ(slow.outcome, StabilityOutcome::time_limit);
  EXPECT_FALSE(slow.as_demanded);
}

}  // namespace
}  // namespace rhytid::tools
