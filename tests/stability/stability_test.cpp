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
  // Converged, where a refusal was due, and the same the other way round.
  one = {"none", "runs though it must be refused", {"/time/frames=0"}, false, StabilityDemand::refused};
  EXPECT_FALSE(run_stability_case(one, 60).as_demanded);
  one = {"none", "refused though it must run", {"/skin/order=9"}, false, StabilityDemand::converges};
  EXPECT_FALSE(run_stability_case(one, 60).as_demanded);
  one = {"none", "too slow", {}, false, StabilityDemand::clear_outcome};
  const StabilityResult slow = run_stability_case(one, 1e-9);
  EXPECT_EQ(slow.outcome, StabilityOutcome::time_limit);
  EXPECT_FALSE(slow.as_demanded);
}

// A message must say something, not only be there.
TEST(StabilityCases, AMessageMustTellWhatHappened) {
  using enum StabilityOutcome;
  const StabilityCase one{"none", "", {"/skin/order=9"}};
  EXPECT_TRUE(is_clear(one, converged, ""));
  EXPECT_TRUE(is_clear(one, refused, "base.json (--set): /skin/order: got 9, expected a whole number 1..4"));
  for (const char* text : {"", "bad input", "base.json: got 9, expected 1..4", "/skin/order: 9 is too large",
                           "/skin/rim: got 9, expected a word"})
    EXPECT_FALSE(is_clear(one, refused, text)) << text;
  const std::string report =
      "frame 1, t = 0.0130208 s: stagnated after 15 iterations and 4 bisections (residual 1.02e-16 N, wanted "
      "1e-30 N)";
  EXPECT_TRUE(is_clear(one, not_converged, report));
  for (const std::string& text :
       {std::string(), std::string("did not converge"), report.substr(report.find("stagnated")),
        report.substr(0, report.find(", wanted"))})
    EXPECT_FALSE(is_clear(one, not_converged, text)) << text;
  EXPECT_FALSE(is_clear(one, time_limit, report));
  EXPECT_FALSE(is_clear(one, broken, report));
  // And as the simulator says it.
  const StabilityResult result = run_stability_case(one, 60);
  EXPECT_EQ(result.outcome, refused);
  EXPECT_TRUE(is_clear(one, result.outcome, result.message)) << result.message;
}

}  // namespace
}  // namespace rhytid::tools