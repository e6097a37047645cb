// Every kind of mistake in a scene gives one line: file and line, key, value, what was expected.
#include <gmock/gmock.h>

#include <string>

#include "scene_texts.h"
#include "sim/core/error.h"
#include "sim/scene/load.h"

namespace rhytid {
namespace {

using testing::full_scene;

std::string error_of(const std::string& text) {
  try {
    parse_scene_text(text, "a.json");
  } catch (const InputError& error) {
    return error.what();
  }
  return "no error";
}

/// The error after one replacement in the full scene.
std::string error_after(const std::string& from, const std::string& to) {
  std::string text = full_scene;
  const size_t at = text.find(from);
  if (at == std::string::npos) return "test is wrong: " + from;
  return error_of(text.replace(at, from.size(), to));
}

struct Mistake {
  const char *from, *to, *message;
};

TEST(SceneErrors, NameFileKeyValueAndExpectation) {
  const Mistake mistakes[] = {
      // Unknown keys.
      {"\"thickness\": \"2 mm\"", "\"thicknes\": \"2 mm\"",
       "a.json:11: /skin/layers/soft/thicknes: got the unknown key \"thicknes\", expected a known key, "
       "nearest is "
       "\"thickness\""},
      {"\"time\": {", "\"tiem\": {",
       "a.json:30: /tiem: got the unknown key \"tiem\", expected a known key, nearest is \"time\""},
      {"\"order\": 4", "\"Order\": 4",
       "a.json:7: /skin/Order: got the unknown key \"Order\", expected a known key, nearest is \"order\""},
      // Wrong types.
      {"\"order\": 4", "\"order\": 2.5", "a.json:7: /skin/order: got 2.5, expected an integer from 1 to 4"},
      {"\"order\": 4", "\"order\": \"4\"",
       "a.json:7: /skin/order: got \"4\", expected an integer from 1 to 4"},
      {"\"order\": 4", "\"order\": true", "a.json:7: /skin/order: got true, expected an integer from 1 to 4"},
      {"\"vtu\": false", "\"vtu\": 0", "a.json:33: /output/vtu: got 0, expected true or false"},
      {"\"name\": \"drag\"", "\"name\": 3", "a.json:3: /name: got 3, expected a string"},
      {"\"rim\": \"sliding\"", "\"rim\": \"slidng\"",
       "a.json:9: /skin/rim: got \"slidng\", expected one of \"clamped\", \"sliding\", \"free\""},
      {"[1, 2, \"0.3 cm\"]", "[1, 2]",
       "a.json:19: /ligaments/sources/cheek/position: got [1,2], expected a list of 3 numbers (plain numbers "
       "in mm)"},
      {"[1, 2, \"0.3 cm\"]", "[1, 2, null]",
       "a.json:19: /ligaments/sources/cheek/position/2: got null, expected a list of 3 numbers (plain "
       "numbers in "
       "mm)"},
      {"{\"time\": 0, \"position\": [0, 0, 9]}", "7",
       "a.json:27: /colliders/finger/path/0: got 7, expected an object {...}"},
      {"\"cells\": [8, 4]", "\"cells\": [8, 4.5]",
       "a.json:5: /skin/surface/grid/cells/1: got 4.5, expected a list of 2 integers from 1 to 10000"},
      // Dimensions and units.
      {"\"20 kPa\"", "\"20 mm\"",
       "a.json:11: /skin/layers/soft/youngs_modulus: got \"20 mm\" (a length), expected a pressure, e.g. "
       "\"20 kPa\""},
      {"\"20 kPa\"", "\"20 kPaa\"",
       "a.json:11: /skin/layers/soft/youngs_modulus: got \"20 kPaa\" (kPaa is no unit), expected a pressure, "
       "e.g. \"20 kPa\""},
      {"\"80 %\"", "\"80 deg\"",
       "a.json:13: /skin/layers/film/relaxing_fraction: got \"80 deg\" (an angle), expected a plain number, "
       "e.g. "
       "\"0.5\""},
      {"\"0.8 1/mm\"", "\"0.8 mm\"",
       "a.json:19: /ligaments/sources/cheek/strength: got \"0.8 mm\" (a length), expected a number per "
       "length, e.g. "
       "\"0.8 1/mm\""},
      // Ranges.
      {"\"poissons_ratio\": 0.45", "\"poissons_ratio\": 0.5",
       "a.json:11: /skin/layers/soft/poissons_ratio: got 0.5, expected a number from 0 to 0.49999"},
      {"\"2 mm\"", "\"-2 mm\"",
       "a.json:11: /skin/layers/soft/thickness: got \"-2 mm\", expected a length > 0 mm, e.g. \"8 mm\""},
      {"\"80 %\"", "1",
       "a.json:13: /skin/layers/film/relaxing_fraction: got 1, expected a number >= 0 and < 1"},
      {"\"frames\": 12", "\"frames\": 1e30",
       "a.json:30: /time/frames: got 1e+30, expected an integer from 0 to 1000000"},
      {"\"vertex\": 7", "\"vertex\": -1",
       "a.json:20: /ligaments/sources/jaw/vertex: got -1, expected an integer from 0 to 1000000000"},
      // Missing and excluding keys.
      {"\"thickness\": \"2 mm\", ", "",
       "a.json:11: /skin/layers/soft: got neither \"thickness\" nor \"thickness_map\", expected one of the "
       "two"},
      {"\"vertex\": 7", "\"vertex\": 7, \"position\": [0, 0, 0]",
       "a.json:20: /ligaments/sources/jaw/position: got both \"position\" and \"vertex\", expected one of "
       "the two"},
      {"\"vertex\": 7, ", "",
       "a.json:20: /ligaments/sources/jaw: got neither \"position\" nor \"vertex\", expected one of the two"},
      {"\"side\":", "\"file\": \"a.obj\", \"side\":",
       "a.json:6: /skin/surface/file: got both \"file\" and \"grid\", expected one of the two"},
      {"\"side\":", "\"unit\": \"cm\", \"side\":",
       "a.json:6: /skin/surface/unit: got \"cm\", expected nothing, since it only has a meaning together "
       "with "
       "\"file\""},
      // What spans several keys.
      {"\"name\": \"film\"", "\"name\": \"soft\"",
       "a.json:12: /skin/layers/1/name: got \"soft\" a second time, expected a name of its own for each "
       "item"},
      {"\"name\": \"jaw\"", "\"name\": \"cheek\"",
       "a.json:20: /ligaments/sources/1/name: got \"cheek\" a second time, expected a name of its own for "
       "each item"},
      {"\"name\": \"table\"", "\"name\": \"finger\"",
       "a.json:28: /colliders/1/name: got \"finger\" a second time, expected a name of its own for each "
       "item"},
      {"\"name\": \"jaw\"", "\"name\": \"12\"",
       "a.json:20: /ligaments/sources/1/name: got \"12\", expected a name (a string, not only digits, "
       "without / ~ = "
       "and control characters)"},
      {"\"0.5 s\"", "0",
       "a.json:27: /colliders/finger/path/1/time: got 0.0, expected a time later than that of the knot "
       "before, 0.0 s"},
      {"[0, 0, 2]", "[0, 0, 0]",
       "a.json:28: /colliders/1/normal: got [0.0,0.0,0.0], expected a vector that is not zero"},
      {"\"radius\": \"5 cm\"", "\"radius\": 0",
       "a.json:23: /base/radius: got 0.0, expected a length > 0 mm, since the base is a sphere"},
      // Syntax: file, line and column.
      {"\"order\": 4,", "\"order\": 4",
       "a.json:7:16: syntax error while parsing object - unexpected string literal; expected ',' or '}'"},
      {"\"order\": 4", "\"order\": 4, \"order\": 3",
       "a.json:7: got the key \"order\" twice, expected each key once"},
  };
  for (const Mistake& mistake : mistakes) {
    const std::string message = error_after(mistake.from, mistake.to);
    EXPECT_EQ(message, mistake.message) << mistake.from << " -> " << mistake.to;
    EXPECT_EQ(message.find('\n'), std::string::npos);
  }
}

TEST(SceneErrors, EmptyAndForeignTexts) {
  using ::testing::StartsWith;
  EXPECT_THAT(error_of(""), StartsWith("a.json:1:1: "));
  EXPECT_THAT(error_of("{\n\"skin\": {"), StartsWith("a.json:2:10: "));
  EXPECT_THAT(error_of("[]"), StartsWith("a.json:1: /: got [], expected an object"));
  EXPECT_THAT(error_of("null"), StartsWith("a.json:1: /: got null, expected an object"));
  EXPECT_THAT(error_of("{}"), StartsWith("a.json:1: /skin: got nothing, expected an object"));
  EXPECT_THAT(error_of("{\"extends\": \"b.json\"}"), StartsWith("a.json:1: /extends: got extends"));
  EXPECT_THAT(error_of("{\"a\": 1e999}"), StartsWith("a.json:1:"));
  EXPECT_THAT(error_of("{\"\xff\": 1}"), StartsWith("a.json:1:"));
  EXPECT_THAT(error_of(std::string(100000, '[')),
              StartsWith("a.json:1: got brackets nested more than 64 deep"));
  EXPECT_THAT(error_of("{\"" + std::string(100000, 'x') + "\": 1}"), StartsWith("a.json:1: /xxx"));
}

TEST(SceneErrors, ExtrapolatedLagHasOnePass) {
  const auto error_with = [](const std::vector<std::string>& overrides) -> std::string {
    try {
      parse_scene_text(full_scene, "a.json", overrides);
    } catch (const InputError& error) {
      return error.what();
    }
    return "no error";
  };
  EXPECT_EQ(error_with({"/time/lag=extrapolated"}), "no error");
  EXPECT_EQ(error_with({"/time/lag=previous", "/time/lag_passes=2"}), "no error");
  EXPECT_EQ(error_with({"/time/lag=extrapolated", "/time/lag_passes=2"}),
            "a.json (--set): /time/lag_passes: got 2, expected 1, since /time/lag is extrapolated: later "
            "passes would "
            "have a lag of their own");
  EXPECT_EQ(error_with({"/time/lag=next"}),
            "a.json (--set): /time/lag: got \"next\", expected one of \"previous\", \"extrapolated\"");
}

TEST(SceneErrors, ListsMayNotBeEmpty) {
  std::string text = testing::minimal_scene;
  const size_t begin = text.find("[{"), end = text.find("}]");
  text.replace(begin, end + 2 - begin, "[]");
  EXPECT_EQ(error_of(text), "a.json:4: /skin/layers: got [], expected a list of at least 1 item");
}

TEST(SceneErrors, ParsedJsonIsNamedByItsFile) {
  const auto json = nlohmann::json::parse(R"({"skin": {"layers": 1}})");
  try {
    parse_scene(json, "b.json");
    FAIL();
  } catch (const InputError& error) {
    EXPECT_EQ(std::string(error.what()),
              "b.json: /skin/surface: got nothing, expected an object {...} (required)");
  }
}

TEST(SceneWarnings, NameWhatIsDoubtful) {
  using ::testing::AllOf;
  using ::testing::Each;
  using ::testing::ElementsAre;
  using ::testing::HasSubstr;
  using ::testing::SizeIs;
  const auto warnings = [](const std::vector<std::string>& overrides) {
    return scene_warnings(parse_scene_text(full_scene, "a.json", overrides));
  };
  EXPECT_THAT(warnings({}), ElementsAre());
  EXPECT_THAT(warnings({"/skin/layers/film/stiffening=0.2"}),
              ElementsAre(HasSubstr("/skin/layers/film/stiffening: 0.2 is below 0.25")));
  EXPECT_THAT(warnings({"/skin/layers/film/relaxation_time=1 s"}),
              ElementsAre(HasSubstr(
                  "/skin/layers/film/relaxation_time: frame interval / relaxation time = 0.04167")));
  EXPECT_THAT(warnings({"/skin/layers/film/relaxation_time=8 ms"}),
              ElementsAre(HasSubstr("hardly be identified")));
  // An elastic layer has no relaxation time to identify.
  EXPECT_THAT(warnings({"/skin/layers/film/relaxation_time=8 ms", "/skin/layers/film/relaxing_fraction=0"}),
              ElementsAre());
  EXPECT_THAT(warnings({"/skin/layers/soft/order=2", "/skin/quadrature/thickness_points=0"}), ElementsAre());
  EXPECT_THAT(warnings({"/skin/layers/soft/order=2"}),
              ElementsAre(HasSubstr("delays wrinkling"), HasSubstr("/skin/layers/soft/order: 2 locks")));
  EXPECT_THAT(warnings({"/skin/layers/soft/order=2"}),
              Each(HasSubstr("take 2 for /skin/quadrature/thickness_points, or order 3")));
  EXPECT_THAT(warnings({"/skin/layers/soft/order=2", "/skin/quadrature/thickness_points=0",
                        "/skin/quadrature/rule=full"}),
              Each(HasSubstr("take \"product\" for /skin/quadrature/rule, or order 3")));
  EXPECT_THAT(warnings({"/skin/layers/soft/order=1", "/skin/quadrature/thickness_points=0"}),
              AllOf(SizeIs(2), Each(HasSubstr("take order 2 or 3"))));
  EXPECT_THAT(warnings({"/skin/layers/soft/order=2", "/skin/quadrature/volume=reduced"}), ElementsAre());
  EXPECT_THAT(warnings({"/skin/scheme=composite", "/skin/composite_order=2"}),
              ElementsAre(HasSubstr("3 or 4")));
  // What another shape would read.
  EXPECT_THAT(warnings({"/colliders/finger/length=3", "/colliders/finger/semi_axes=[1, 2, 3]"}),
              ElementsAre("/colliders/finger/length: is not used, since the shape is sphere",
                          "/colliders/finger/semi_axes: is not used, since the shape is sphere"));
  EXPECT_THAT(warnings({"/colliders/finger/path/1/position/0=100 mm"}),
              ElementsAre(HasSubstr("moves 4.167 mm in one step")));
  EXPECT_THAT(warnings({"/colliders/table/path/0/time=9"}), ElementsAre(HasSubstr("never moves")));
  EXPECT_THAT(warnings({"/time/damper=literal"}), ::testing::SizeIs(2));
  EXPECT_THAT(warnings({"/time/frames=0"}), ElementsAre(HasSubstr("/time/frames: 0")));
}

}  // namespace
}  // namespace rhytid
