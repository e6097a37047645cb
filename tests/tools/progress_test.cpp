// Progress lines: how often they come and what they say, on a clock under the test's control.
#include "tools/progress.h"

#include <gmock/gmock.h>

#include <cmath>
#include <nlohmann/json.hpp>
#include <sstream>

namespace rhytid::tools {
namespace {

using testing::HasSubstr;
using testing::Not;

std::vector<std::string> lines_of(const std::string& text) {
  std::istringstream stream(text);
  std::vector<std::string> lines;
  for (std::string line; std::getline(stream, line);) lines.push_back(line);
  return lines;
}

struct Fixture {
  double now = 100;
  std::ostringstream out;
  Progress progress;
  explicit Fixture(ProgressStyle style) : progress(style, out, [this] { return now; }) {}
};

TEST(Progress, plain_lines_come_at_most_once_a_second_and_for_the_last_step) {
  Fixture f(ProgressStyle::plain_lines);
  f.progress.stage("simulate", 100);
  for (int step = 1; step <= 100; ++step) {
    f.now += 0.03;
    f.progress.iteration(5, 1e-7);
    f.progress.step_done(step);
  }
  const auto lines = lines_of(f.out.str());
  // Heading, step 1, one per second of the 3 s, the last step.
  EXPECT_GE(lines.size(), 4u);
  EXPECT_LE(lines.size(), 6u);
  EXPECT_THAT(lines.back(), HasSubstr("simulate 100/100"));
  EXPECT_THAT(f.out.str(), Not(HasSubstr("\r")));
}

TEST(Progress, time_left_is_proportional) {
  Fixture f(ProgressStyle::plain_lines);
  f.progress.stage("fit", 10);
  f.now += 30;
  f.progress.step_done(2);
  EXPECT_THAT(f.out.str(), HasSubstr("fit 2/10, 30 s, 2 min 00 s left"));
}

TEST(Progress, status_line_rewrites_itself_and_keeps_notes) {
  Fixture f(ProgressStyle::status_line);
  f.progress.stage("simulate", 10);
  f.now += 1;
  f.progress.iteration(3, 2.5e-4);
  EXPECT_THAT(f.out.str(), HasSubstr("\rsimulate 0/10, iteration 3, residual 2.5e-04"));
  const auto before = f.out.str().size();
  f.now += 0.01;  // too soon to redraw
  f.progress.iteration(4, 2.5e-5);
  EXPECT_EQ(f.out.str().size(), before);
  f.progress.warning("thin\nlayer");
  EXPECT_THAT(f.out.str(), HasSubstr("rhytid: warning: thin layer\n\rsimulate 0/10, iteration 4"));
  f.progress.finish();
  f.progress.finish();
  EXPECT_EQ(lines_of(f.out.str()).size(), 2u);
}

TEST(Progress, json_lines_all_parse_and_have_every_step) {
  Fixture f(ProgressStyle::json_lines);
  f.progress.stage("simulate", 3);
  f.progress.note("bytes \xff and \"quotes\"\nare safe");
  for (int step = 1; step <= 3; ++step) {
    f.now += 0.01;
    f.progress.iteration(1, std::nan(""));
    f.progress.step_done(step);
  }
  int steps = 0;
  for (const std::string& line : lines_of(f.out.str())) {
    const auto object = nlohmann::json::parse(line);
    ASSERT_TRUE(object.contains("event"));
    EXPECT_FALSE(object.contains("residual"));  // NaN is not JSON
    if (object["event"] != "step") continue;
    EXPECT_EQ(object["step"], ++steps);
  }
  EXPECT_EQ(steps, 3);
}

TEST(Progress, texts) {
  EXPECT_EQ(duration_text(-1), "0 s");
  EXPECT_EQ(duration_text(59.4), "59 s");
  EXPECT_EQ(duration_text(59.6), "1 min 00 s");
  EXPECT_EQ(duration_text(7620), "2 h 07 min");
  EXPECT_EQ(one_line("a\n\n\tb \n"), "a b");
  EXPECT_GT(resident_memory_mb(), 1);
}

}  // namespace
}  // namespace rhytid::tools
