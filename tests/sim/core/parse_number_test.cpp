#include "sim/core/parse_number.h"

#include <gtest/gtest.h>

namespace rhytid {
namespace {

TEST(ParseNumber, TakesOneSignAndTheWholeWord) {
  double real = 0;
  int whole = 0;
  EXPECT_TRUE(parse("+1.5e2", real) && real == 150);
  EXPECT_TRUE(parse("-0.25", real) && real == -0.25);
  EXPECT_TRUE(parse("+7", whole) && whole == 7);
  for (const char* word : {"", "+", "-", "+-1", "++1", "-+1", "--1", "1x", " 1", "1 ", "+ 1"}) {
    EXPECT_FALSE(parse(word, real)) << word;
    EXPECT_FALSE(parse(word, whole)) << word;
  }
  EXPECT_FALSE(parse("1.5", whole));
}

}  // namespace
}  // namespace rhytid
