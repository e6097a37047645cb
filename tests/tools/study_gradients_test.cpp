// Sensitivity and plan of a tiny scene through the verb, and the judgement of responses that are known.
#include <gmock/gmock.h>

#include <cmath>
#include <map>
#include <nlohmann/json.hpp>

#include "sim/scene/load.h"
#include "sim/scene/scene_model.h"
#include "tests/tools/study_call.h"
#include "tools/study/sensitivity.h"
#include "tools/study/study_page.h"

namespace rhytid::tools {
namespace {

using testing::HasSubstr;
using testing::Not;

ParameterSpec named(const std::string& address, const std::string& name, double value) {
  return {.address = address,
          .name = name,
          .unit = "",
          .dimension = {},
          .lower = 0,
          .upper = 1,
          .transform = ParameterTransform::log,
          .value = value};
}

TEST(SensitivityJudgement, OfAKnownResponse) {
  Sensitivity s;
  s.parameters = {named("/skin/layers/a/youngs_modulus", "a", 2),
                  named("/skin/layers/b/youngs_modulus", "b", 1), named("/c", "c", 1)};
  s.coordinates.assign(3, {ParameterTransform::log, 0});
  // Positions feel ln a − ln b with 3 mm and ln c with 0.02 mm; a and b together are the gauge.
  s.response.root = MatrixXd::Zero(3, 3);
  s.response.root(0, 0) = 3, s.response.root(0, 1) = -3, s.response.root(2, 2) = 0.02;
  SensitivityOptions options;
  options.tracks.noise = 0.1, options.tracks.count = 4;
  judge(s, options, VectorXd(Vec3(1, 1, 0)));
  EXPECT_TRUE(s.has_gauge);
  EXPECT_EQ(s.directions.rank, 2);
  EXPECT_NEAR(s.directions.singular_values[0], 20 * 3 * std::sqrt(2), 1e-10);
  EXPECT_TRUE(std::isinf(s.deviations[0]) && std::isinf(s.deviations[1]));
  EXPECT_NEAR(s.deviations[2], 1 / (20 * 0.02), 1e-12);
  EXPECT_EQ(s.held, 1);  // the softer of the layers
  EXPECT_NEAR(s.held_deviations[0], 1 / 60., 1e-12);
  EXPECT_EQ(s.held_deviations[1], 0);
  EXPECT_NEAR(s.correlation(0, 2), 0, 1e-12);
  EXPECT_TRUE(std::isnan(s.correlation(0, 1)));
  ASSERT_EQ(s.sentences.size(), 2u);
  EXPECT_THAT(s.sentences[0], HasSubstr("All stiffnesses together"));
  EXPECT_THAT(s.sentences[1],
              HasSubstr("c is not determined: changing it by 10 % changes all tracks together by 0.04"));
  // Without the gauge the same null vector goes by its names.
  judge(s, options, std::nullopt);
  EXPECT_EQ(s.held, -1);
  EXPECT_THAT(s.sentences[0], HasSubstr("a, b go together: raising all of them moves nothing."));
  // A tenth of a place is a length, of a fraction a tenth of its odds.
  s.parameters[2].unit = "mm";
  s.coordinates[2] = {ParameterTransform::none, 5};
  judge(s, options, std::nullopt);
  EXPECT_THAT(s.sentences[1], HasSubstr("c is not determined: changing it by 0.5 mm changes all tracks"));
  s.response.root << 3, 0, 0, 0, 0.02, -0.02, 0, 0, 0.001;
  s.coordinates[1] = {ParameterTransform::logit, 0};
  judge(s, options, std::nullopt);
  ASSERT_FALSE(s.sentences.empty());
  EXPECT_THAT(s.sentences[0], HasSubstr("raising all of them by 10 % ("));
  EXPECT_THAT(s.sentences[0], HasSubstr("c by 0.5 mm"));
  EXPECT_THAT(s.sentences[0], HasSubstr("b by 10 % of its odds"));
}

TEST(Deviations, AreReadInTheUnitOfTheirCoordinate) {
  const adjoint::Coordinate log{ParameterTransform::log, 0}, logit{ParameterTransform::logit, 0},
      knot{ParameterTransform::none, 5};
  EXPECT_EQ(deviation_text(0.03, log, "MPa"), "3 %");
  EXPECT_EQ(deviation_text(1, log, "MPa"), "factor 2.7");
  EXPECT_EQ(deviation_text(9, log, "MPa"), "factor > 20");
  EXPECT_EQ(deviation_text(0.03, logit, ""), "odds 3 %");
  EXPECT_EQ(deviation_text(1, logit, ""), "odds factor 2.7");
  EXPECT_EQ(deviation_text(0.03, knot, "mm"), "0.15 mm");
  EXPECT_EQ(deviation_text(1, knot, "mm"), "5 mm");
  EXPECT_EQ(deviation_text(INFINITY, knot, "mm"), "open");
  EXPECT_EQ(coordinate_text(knot, "mm"), "5 mm");
}

// Sources whose names make the same file name, seen along a direction and not.
TEST(Sensitivity, ResponsesHaveFilesOfTheirOwnAndDoNotDependOnTheView) {
  const StudyPlace place;
  const std::vector<std::string> arguments = {
      "--set",       "/ligaments/sources/0/name=a b",      "--set",       "/ligaments/sources/1/name=a_b",
      "--parameter", "/ligaments/sources/0/strength",      "--parameter", "/ligaments/sources/1/strength",
      "--parameter", "/colliders/finger/path/1/position/0"};
  const Outcome call = place.call("sensitivity", "scene.json", arguments);
  ASSERT_EQ(call.code, 0) << call.err;
  EXPECT_TRUE(place.has("out/response_a_b_strength.png"));
  EXPECT_TRUE(place.has("out/response_a_b_strength_2.png"));
  const std::string map = place.text("out/map.vtp");
  EXPECT_THAT(map, HasSubstr("\"response_a_b_strength_mm\""));
  EXPECT_THAT(map, HasSubstr("\"response_a_b_strength_2_mm\""));
  // The deviation of a place is a length.
  EXPECT_THAT(call.out, testing::ContainsRegex("finger path 1 position x .* 5 mm .* [0-9.e-]+ mm"));
  const auto whole = nlohmann::json::parse(place.text("out/sensitivity.json"));
  EXPECT_TRUE(whole["view"].is_null());
  EXPECT_EQ(whole["parameters"][2]["coordinate_unit"], "5 mm");
  auto along = arguments;
  along.insert(along.end(), {"--view", "0", "0", "-3"});
  const Outcome seen_call = place.call("sensitivity", "scene.json", along);
  EXPECT_THAT(seen_call.out, HasSubstr("seen along (0, 0, -1)"));
  const auto seen = nlohmann::json::parse(place.text("out/sensitivity.json"));
  EXPECT_EQ(seen["view"], nlohmann::json({0.0, 0.0, -1.0}));
  for (int k = 0; k < 3; ++k) {
    for (const char* figure : {"rms_mm", "max_mm"})
      EXPECT_EQ(seen["parameters"][k][figure], whole["parameters"][k][figure]) << k;
    EXPECT_GT(seen["parameters"][k]["deviation"], whole["parameters"][k]["deviation"]) << k;
  }
}

TEST(Sensitivity, OfASceneThroughTheVerb) {
  const StudyPlace place;
  const Outcome call = place.call("sensitivity", "scene.json");
  ASSERT_EQ(call.code, 0) << call.err;
  EXPECT_THAT(call.out, HasSubstr("All stiffnesses together"));
  for (const char* file :
       {"parameters.csv", "frames.csv", "figures.csv", "singular_values.csv", "correlation.csv", "map.csv",
        "map.png", "map.vtp", "map.ply", "rms.svg", "sensitivity.txt", "index.html"})
    EXPECT_TRUE(place.has(std::string("out/") + file)) << file;
  const auto json = nlohmann::json::parse(place.text("out/sensitivity.json"));
  EXPECT_TRUE(json["gauge"]);
  EXPECT_EQ(json["held"], "/skin/layers/soft/youngs_modulus");
  EXPECT_LT(json["rank"], json["parameters"].size());
  EXPECT_EQ(place.text("out/sensitivity.txt") + "written to " + place.at("out") +
                ": index.html, parameters.csv and more\n",
            call.out);

  // The map adds up to the derivative by a factor on all b, which differences of runs tell.
  const std::string path = place.at("out/map.csv");
  std::istringstream lines(place.text("out/map.csv"));
  std::string line;
  std::getline(lines, line);
  double by_log_b = 0;
  for (; std::getline(lines, line);) {
    std::istringstream cells(line);
    std::vector<double> row;
    for (std::string cell; std::getline(cells, cell, ',');) row.push_back(std::stod(cell));
    by_log_b += row[4] * row[6];
  }
  const auto figure_at = [&](double factor) {
    const StudyPlace other;
    const std::string left = std::to_string(0.5 * factor), right = std::to_string(3 * factor);
    const Outcome run = other.call(
        "sensitivity", "scene.json",
        {"--parameter", "/ligaments/stiffness", "--set", "/ligaments/sources/left/strength=" + left, "--set",
         "/ligaments/sources/right/strength=" + right});
    EXPECT_EQ(run.code, 0) << run.err;
    return nlohmann::json::parse(other.text("out/sensitivity.json"))["figure"]["mm2"].get<double>();
  };
  const double difference = (figure_at(1.02) - figure_at(0.98)) / std::log(1.02 / 0.98);
  EXPECT_NEAR(by_log_b, difference, 0.01 * std::abs(difference));
  EXPECT_LT(by_log_b, 0);  // stiffer ligaments hold the skin
}

/// What a sensitivity study says of the last frame: figure -> (value, derivatives).
std::map<std::string, std::pair<double, std::vector<double>>> last_frame(const StudyPlace& place) {
  std::map<std::string, std::pair<double, std::vector<double>>> found;
  const auto json = nlohmann::json::parse(place.text("out/sensitivity.json"));
  for (const auto& figure : json["last_frame"])
    found[figure["figure"]] = {figure["value"], figure["derivatives"].get<std::vector<double>>()};
  return found;
}

// Forces, energy and wrinkles: every derivative against differences of runs.
TEST(Sensitivity, OfForcesEnergyAndWrinkles) {
  const std::string film = "/skin/layers/film/youngs_modulus", knot = "/colliders/finger/path/2/position/0";
  const auto study = [&](double factor, double shift) {
    const StudyPlace place;
    write_file(place.at("experiment.json"), R"({"name": "figures", "scene": "scene.json",
      "measure": {"wavelengths": ["1 mm", "12 mm"], "line": {"from": [-7, 0, 0], "to": [7, 0, 0]},
                  "window": {"centre": [0, 0, 0], "size": [14, 10]}},
      "variants": [{"name": "one", "settings": []}]})");
    const Outcome call = place.call(
        "sensitivity", "experiment.json",
        {"--parameter", film, "--parameter", knot, "--set", film + "=" + std::to_string(1 * factor) + " MPa",
         "--set", knot + "=" + std::to_string(8 + shift) + " mm"});
    EXPECT_EQ(call.code, 0) << call.err;
    EXPECT_THAT(call.out, HasSubstr("window_coherence"));
    return last_frame(place);
  };
  const auto here = study(1, 0);
  const double h = 0.01;
  // Places are counted in units of half of what a fit may move them.
  const double unit = 5;
  const auto more = study(std::exp(h), 0), less = study(std::exp(-h), 0), ahead = study(1, h * unit),
             behind = study(1, -h * unit);
  for (const char* name : {"force_finger", "stored_energy", "line_amplitude", "line_wavelength",
                           "window_amplitude", "window_wavelength", "window_direction", "window_coherence"}) {
    ASSERT_TRUE(here.contains(name)) << name;
    const auto& [value, derivatives] = here.at(name);
    const double by_film = (more.at(name).first - less.at(name).first) / (2 * h),
                 by_knot = (ahead.at(name).first - behind.at(name).first) / (2 * h);
    const double scale = 1e-3 * std::abs(value);
    EXPECT_NEAR(derivatives[0], by_film, 0.01 * std::abs(by_film) + scale) << name;
    EXPECT_NEAR(derivatives[1], by_knot, 0.01 * std::abs(by_knot) + scale) << name;
  }
}

TEST(Sensitivity, RefusesInOneLine) {
  const StudyPlace place;
  const auto error_of = [&](const std::vector<std::string>& more) {
    const Outcome call = place.call("sensitivity", "scene.json", more);
    EXPECT_EQ(call.code, 2) << call.err;
    EXPECT_EQ(std::count(call.err.begin(), call.err.end(), '\n'), 1) << call.err;
    EXPECT_FALSE(place.has("out"));
    return call.err;
  };
  EXPECT_THAT(error_of({"--parameter", "/base/stifness"}), HasSubstr("/base/stiffness"));
  EXPECT_THAT(error_of({"--parameter", "/base/stiffness", "--parameter", "/base/stiffness"}),
              HasSubstr("a second time"));
  EXPECT_THAT(error_of({"--parameter", "/base/stiffness", "--hold", "/ligaments/stiffness"}),
              HasSubstr("--hold"));
  EXPECT_THAT(error_of({"--noise", "0"}), HasSubstr("--noise"));
  for (const char* noise : {"nan", "inf", "-1", "1e-300"})
    EXPECT_THAT(error_of({"--noise", noise}), HasSubstr("--noise: got '" + std::string(noise) + "'"));
  EXPECT_THAT(error_of({"--view", "0", "0", "0"}), HasSubstr("--view: got 0 0 0, expected a direction"));
  EXPECT_THAT(error_of({"--view", "1", "nan", "0"}), HasSubstr("--view: got 1 nan 0, expected a direction"));
  EXPECT_THAT(error_of({"--view", "inf", "2", "0"}), HasSubstr("--view: got inf 2 0"));
  EXPECT_THAT(error_of({"--set", "/time/frames=0"}), HasSubstr("frames"));
}

TEST(Sensitivity, HoldsOnlyWhatHasAnEffect) {
  const StudyPlace place;
  std::vector<std::string> arguments = {"--hold", "/base/stiffness"};
  for (const char* knot : {"0", "1", "2"})  // the finger never touches
    arguments.insert(arguments.end(),
                     {"--set", std::string("/colliders/finger/path/") + knot + "/position/2=90"});
  const Outcome call = place.call("sensitivity", "scene.json", arguments);
  EXPECT_EQ(call.code, 2);
  EXPECT_THAT(call.err, HasSubstr("--hold: got '/base/stiffness', expected a parameter that has an effect"));
}

std::string swipes(const std::string& more = "") {
  return R"({"name": "swipes", "scene": "scene.json", "settings": ["/skin/surface/grid/cells=[4,3]"], "variants": [
    {"name": "along", "settings": []},
    {"name": "across", "settings": ["/colliders/finger/path/2/position=[-2, 8, 4.5]"]})" +
         more + "]}";
}

const std::vector<std::string> kUnknowns = {"--parameter", "/ligaments/sources/left/strength", "--parameter",
                                            "/ligaments/sources/right/strength"};

TEST(PlanStudy, RanksSwipesAndKeepsThem) {
  const StudyPlace place;
  write_file(place.at("swipes.json"), swipes());
  const Outcome call = place.call("plan", "swipes.json", kUnknowns);
  ASSERT_EQ(call.code, 0) << call.err;
  for (const char* file : {"swipes.csv", "pairs.csv", "order.csv", "posterior.svg", "plan.txt", "index.html",
                           "along/variant.json"})
    EXPECT_TRUE(place.has(std::string("out/") + file)) << file;
  EXPECT_THAT(call.out, HasSubstr("film next"));
  EXPECT_THAT(place.text("out/pairs.csv"), HasSubstr("D,along,across,"));
  // Less noise, the same runs: deviations fall in every swipe.
  auto sharper = kUnknowns;
  // What text and page say of a parameter they say from one table.
  for (const char* said : {"information [bits]", "factor "}) {
    EXPECT_THAT(call.out, HasSubstr(said));
    EXPECT_THAT(place.text("out/index.html"), HasSubstr(said));
  }
  EXPECT_THAT(call.out, HasSubstr(place.text("out/plan.txt")));
  sharper.insert(sharper.end(), {"--noise", "0.001", "--prior-of", "/ligaments/sources/left/strength=0.5"});
  const std::string before = place.text("out/swipes.csv");
  const Outcome again = place.call("plan", "swipes.json", sharper);
  EXPECT_EQ(again.code, 0) << again.err;
  EXPECT_THAT(again.err, HasSubstr("along: complete before, kept"));
  EXPECT_THAT(again.err, Not(HasSubstr("runs")));
  EXPECT_NE(place.text("out/swipes.csv"), before);
  auto filmed = kUnknowns;
  filmed.insert(filmed.end(), {"--filmed", "along"});
  const Outcome next = place.call("plan", "swipes.json", filmed);
  EXPECT_THAT(next.out, HasSubstr("film next across ("));
  // Named twice it is filmed once.
  const std::string once =
      place.text("out/swipes.csv") + place.text("out/pairs.csv") + place.text("out/order.csv");
  filmed.insert(filmed.end(), {"--filmed", "along"});
  EXPECT_EQ(place.call("plan", "swipes.json", filmed).code, 0);
  EXPECT_EQ(place.text("out/swipes.csv") + place.text("out/pairs.csv") + place.text("out/order.csv"), once);
}

TEST(PlanStudy, OfPlacesHasLengths) {
  const StudyPlace place;
  write_file(place.at("swipes.json"), swipes());
  const Outcome call = place.call("plan", "swipes.json",
                                  {"--parameter", "/ligaments/sources/left/position/0", "--parameter",
                                   "/skin/layers/soft/poissons_ratio"});
  ASSERT_EQ(call.code, 0) << call.err;
  EXPECT_THAT(call.out, testing::ContainsRegex("left position x +10 mm +[0-9.e-]+ mm"));
  EXPECT_THAT(call.out, testing::ContainsRegex("soft poissons_ratio +odds factor 2.7"));
}

TEST(PlanStudy, RefusesInOneLine) {
  const StudyPlace place;
  const auto error_of = [&](const std::string& experiment, const std::vector<std::string>& more) {
    write_file(place.at("swipes.json"), experiment);
    const Outcome call = place.call("plan", "swipes.json", more);
    EXPECT_EQ(call.code, 2) << call.err;
    EXPECT_EQ(std::count(call.err.begin(), call.err.end(), '\n'), 1) << call.err;
    EXPECT_FALSE(place.has("out"));
    return call.err;
  };
  EXPECT_THAT(error_of(swipes(), {"--filmed", "alng"}),
              HasSubstr("--filmed: got 'alng', expected one of along, across"));
  EXPECT_THAT(error_of(swipes(), {"--prior-of", "/base/stiffness"}), HasSubstr("--prior-of"));
  for (const char* prior : {"-1", "nan", "inf"}) {
    EXPECT_THAT(error_of(swipes(), {"--prior", prior}), HasSubstr("--prior: got '" + std::string(prior)));
    EXPECT_THAT(error_of(swipes(), {"--prior-of", "/base/stiffness=" + std::string(prior)}),
                HasSubstr("--prior-of: got '/base/stiffness=" + std::string(prior)));
  }
  EXPECT_THAT(error_of(swipes(), {"--prior-of", "/ligaments/sources/0/strength=1", "--prior-of",
                                  "/ligaments/sources/left/strength=2"}),
              HasSubstr("--prior-of: got '/ligaments/sources/left/strength=2', that address a second time"));
  EXPECT_THAT(error_of(swipes(R"(, {"name": "still", "settings": ["/time/frames=0"]})"), {}),
              HasSubstr("variant still: /time/frames: got 0, expected at least one frame"));
  EXPECT_THAT(error_of(swipes(R"(, {"name": "firm", "settings": ["/base/stiffness=0.3"]})"),
                       {"--parameter", "/base/stiffness"}),
              HasSubstr("variant firm: /base/stiffness: got 0.3, expected 0.1, as in the other swipes"));
}

}  // namespace
}  // namespace rhytid::tools
