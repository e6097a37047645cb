// Damaged scenes either parse or are refused with one line; nothing else ever happens.
#include <gtest/gtest.h>

#include <random>

#include "scene_texts.h"
#include "schema_checker.h"
#include "sim/core/error.h"
#include "sim/scene/load.h"
#include "sim/scene/parameter.h"

namespace rhytid {
namespace {

using testing::full_scene;
using testing::minimal_scene;

class Mutator {
 public:
  explicit Mutator(unsigned seed) : random_(seed) {}

  size_t below(size_t n) { return n == 0 ? 0 : random_() % n; }

  std::string mutated(std::string text) {
    static const std::vector<std::string> tokens = {"{",
                                                    "}",
                                                    "[",
                                                    "]",
                                                    ",",
                                                    ":",
                                                    "\"",
                                                    "\\",
                                                    "null",
                                                    "true",
                                                    "-1",
                                                    "0",
                                                    "1e999",
                                                    "1e308",
                                                    "-0.0",
                                                    "\"20 kPa\"",
                                                    "\"name\"",
                                                    "\"extends\"",
                                                    "\"\"",
                                                    "18446744073709551615",
                                                    "\xff",
                                                    "\xc2\xb5",
                                                    "\n",
                                                    "//",
                                                    "/*",
                                                    "\\u0000",
                                                    "[[[[[[[[",
                                                    "4e-320",
                                                    "\"1 mm^9/mm^9\"",
                                                    "nan",
                                                    "0.5",
                                                    "\"-\"",
                                                    std::string(1, '\0')};
    for (size_t count = 1 + below(2); count > 0; --count) {
      const size_t at = below(text.size() + 1), length = below(12);
      switch (below(6)) {
        case 0:
          if (at < text.size()) text[at] = static_cast<char>(random_() % 256);
          break;
        case 1:
          text.erase(std::min(at, text.size()), length);
          break;
        case 2:
          text.insert(at, tokens[below(tokens.size())]);
          break;
        case 3:
          text.insert(at, text.substr(below(text.size() + 1), 4 * length));
          break;
        case 4:
          text = text.substr(0, text.size() - below(std::min<size_t>(text.size(), 40)));
          break;
        case 5:
          replace_value(text, tokens[below(tokens.size())]);
          break;
      }
    }
    return text;
  }

 private:
  /// Puts a token in the place of a value, which keeps the text valid JSON more often than random bytes.
  void replace_value(std::string& text, const std::string& token) {
    const size_t colon = text.find(':', below(text.size()));
    if (colon == std::string::npos) return;
    const size_t end = text.find_first_of(",}]\n", colon);
    if (end != std::string::npos) text.replace(colon + 1, end - colon - 1, token);
  }

  std::mt19937 random_;
};

TEST(SceneFuzz, DamagedTextsParseOrAreRefusedInOneLine) {
  Mutator mutator(20240607);
  const auto schema = scene_schema();
  int parsed = 0, refused = 0;
  for (int i = 0; i < 6000; ++i) {
    const std::string text = mutator.mutated(i % 4 == 0 ? minimal_scene : full_scene);
    try {
      const Scene scene = parse_scene_text(text, "fuzz.json");
      ++parsed;
      // What is accepted must also write, read, describe and warn.
      const auto written = scene_to_json(scene);
      EXPECT_EQ(scene_to_json(parse_scene(written, "fuzz.json")), written) << text;
      EXPECT_TRUE(testing::satisfies(written, schema, schema)) << text;
      all_parameters(scene);
      scene_warnings(scene);
    } catch (const InputError& error) {
      ++refused;
      const std::string line = error.what();
      EXPECT_EQ(line.find('\n'), std::string::npos) << line;
      EXPECT_EQ(line.rfind("fuzz.json:", 0), 0u) << line;
    }  // anything else ends the test
  }
  // Both branches are exercised.
  EXPECT_GT(parsed, 150);
  EXPECT_GT(refused, 3000);
}

TEST(SceneFuzz, DamagedOverridesParseOrAreRefusedInOneLine) {
  Mutator mutator(7);
  const std::vector<std::string> overrides = {
      "/skin/layers/film/youngs_modulus=8 MPa", "/colliders/finger/path/1/position/2=6.5",
      "/ligaments/sources/0/strength=\"0.3 1/mm\"", "/base={\"shape\": \"plane\", \"normal\": [0, 0, 1]}",
      "/base=null"};
  int parsed = 0, refused = 0;
  for (int i = 0; i < 3000; ++i) {
    const std::string assignment = mutator.mutated(overrides[mutator.below(overrides.size())]);
    try {
      parse_scene_text(full_scene, "fuzz.json", {assignment});
      ++parsed;
    } catch (const InputError& error) {
      ++refused;
      EXPECT_EQ(std::string(error.what()).find('\n'), std::string::npos) << error.what();
    }
  }
  EXPECT_GT(parsed, 100);
  EXPECT_GT(refused, 1000);
}

}  // namespace
}  // namespace rhytid
