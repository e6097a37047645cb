// The record of a fit comes back from its files bit for bit, and damaged files are refused.
#include "fitting/fit_result.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <filesystem>
#include <limits>

#include "fitting/fit_summary.h"
#include "fitting/measured_unit.h"
#include "fitting/median.h"
#include "sim/core/error.h"
#include "sim/output/atomic_file.h"

namespace rhytid::fitting {
namespace {

using ::testing::HasSubstr;

constexpr double nan_value = std::numeric_limits<double>::quiet_NaN();
constexpr double infinity = std::numeric_limits<double>::infinity();

std::string fresh_folder(const std::string& name) {
  const std::string folder = testing::TempDir() + "/rhytid_fit_result_" + name;
  std::filesystem::remove_all(folder);
  std::filesystem::create_directories(folder);
  return folder;
}

FitResult example() {
  FitResult r;
  r.case_name = "drag \"quoted\" <b> µ";
  r.optimiser = "ceres";
  r.status = "converged";
  r.converged = true;
  r.parameters.resize(2);
  r.parameters[0] = {"/a/b",    "film E", "MPa", "log", 0.1,  1. / 3, 1e-300,
                     0.1 + 0.2, 1e-17,    0.3,   0.35,  true, true,   0.34};
  r.parameters[1] = {"/c",     "b of left", "1/mm",    "none",    5,     nan_value, -infinity,
                     infinity, nan_value,   nan_value, nan_value, false, false,     {}};
  r.derived = {{"ratio", "", 50.25, 40, 60.125, {}}, {"nothing", "mm", nan_value, 0, 0, nan_value}};
  r.gauge = "held";
  r.initial_cost = 1e5 / 7;
  r.num_observations = 12345;
  r.further_views = {{"up", {0.5, nan_value}}};
  r.measured = {{1, 3, "force_finger_x", 0.25, 1. / 3, 0.3}};
  r.systematic = {{"plane", "order 4", "", 0.25, 1.5, {0.1, -1. / 3}},
                  {"steps", "finer", "no end", 0, 2, {}}};
  r.systematic[0].signature = {{"finger path x", "mm", 0.25, 1. / 3, 1e-17}};
  r.systematic[0].explained = 100. / 3;
  r.systematic[0].left = {1. / 7};
  r.misfit = {"the model misses something"};
  r.history = {{0, 1, 10, 1, 0, 0.5, {1, 2}}, {1, 3, 1. / 7, 1e-3, 0.2, 1.5, {1.1, nan_value}}};
  r.singular_values = VectorXd::LinSpaced(2, 3.3, 0.1);
  r.right_vectors = MatrixXd::Identity(2, 2);
  r.right_vectors(0, 1) = -0.25;
  r.correlation = MatrixXd::Identity(2, 2);
  r.cannot_tell = {"the modulus alone", "line\nbreak"};
  r.notes = {"seed 1"};
  r.residuals = {{3, 7, 1. / 3, 2, 0.1 + 0.2, nan_value, 1}, {4, 7, 1, 2, -3, 4, 0.5}};
  r.starts.resize(2);
  r.starts[0] = {{1, 2}, 1. / 3, "", "converged", 0.1, {1.5, 2.5}, 7, 1, {1, 3}, {9, 0.1 + 0.2}};
  r.starts[1].failure = "a run that failed";
  r.profiles.resize(2);
  r.profiles[0] = {"/a/b", 0.1, 1. / 3, true, false, 0.2, 0.3, 1e-17, 1.25, 1.96, 9, "lower", {}};
  r.profiles[0].points = {{0.1, 12, 4.5, "converged", 3, {0.1, nan_value}},
                          {0.2, 10, 0, "optimum", 0, {0.2, 1}}};
  r.profiles[1].sigma = nan_value;
  r.tracks_file = "tracks.csv";
  return r;
}

bool same(double a, double b) {
  return a == b || (std::isnan(a) && std::isnan(b));
}

TEST(FitResult, ReadsBackBitForBit) {
  const std::string folder = fresh_folder("round_trip");
  const FitResult r = example();
  write_fit_result(r, folder);
  const FitResult s = read_fit_result(folder);
  EXPECT_EQ(s.case_name, r.case_name);
  EXPECT_EQ(s.status, r.status);
  EXPECT_TRUE(s.converged);
  ASSERT_EQ(s.parameters.size(), 2u);
  for (size_t i = 0; i < 2; ++i) {
    const FittedParameter &p = r.parameters[i], &q = s.parameters[i];
    EXPECT_EQ(q.address, p.address);
    EXPECT_EQ(q.transform, p.transform);
    EXPECT_TRUE(same(q.value, p.value) && same(q.lower, p.lower) && same(q.upper, p.upper)) << i;
    EXPECT_TRUE(same(q.sigma, p.sigma) && same(q.low95, p.low95) && same(q.high95, p.high95)) << i;
    EXPECT_EQ(q.at_bound, p.at_bound);
    EXPECT_EQ(q.determined, p.determined);
    EXPECT_EQ(q.truth, p.truth);
  }
  EXPECT_FALSE(s.derived[0].truth.has_value());
  ASSERT_TRUE(s.derived[1].truth.has_value());  // known to be not a number is not the same as unknown
  EXPECT_TRUE(std::isnan(*s.derived[1].truth));
  EXPECT_EQ(s.initial_cost, r.initial_cost);
  EXPECT_EQ(s.num_observations, 12345);
  ASSERT_EQ(s.further_views.size(), 1u);
  EXPECT_EQ(s.further_views[0].ratios[0], 0.5);
  EXPECT_TRUE(std::isnan(s.further_views[0].ratios[1]));
  ASSERT_EQ(s.measured.size(), 1u);
  EXPECT_EQ(s.measured[0].quantity, "force_finger_x");
  EXPECT_EQ(s.measured[0].sigma, 1. / 3);
  ASSERT_EQ(s.systematic.size(), 2u);
  EXPECT_EQ(s.systematic[0].shift, r.systematic[0].shift);
  EXPECT_EQ(s.systematic[0].change, "order 4");
  ASSERT_EQ(s.systematic[0].signature.size(), 1u);
  EXPECT_EQ(s.systematic[0].signature[0].name, "finger path x");
  EXPECT_EQ(s.systematic[0].signature[0].unit, "mm");
  EXPECT_EQ(s.systematic[0].signature[0].amount, 0.25);
  EXPECT_EQ(s.systematic[0].signature[0].estimate, 1. / 3);
  EXPECT_EQ(s.systematic[0].signature[0].sigma, 1e-17);
  EXPECT_EQ(s.systematic[0].explained, 100. / 3);
  EXPECT_EQ(s.systematic[0].left, r.systematic[0].left);
  EXPECT_TRUE(s.systematic[1].signature.empty());
  EXPECT_EQ(s.misfit, r.misfit);
  EXPECT_EQ(s.systematic[1].failure, "no end");
  EXPECT_TRUE(s.systematic[1].shift.empty());
  EXPECT_EQ(s.history[1].cost, 1. / 7);
  EXPECT_TRUE(std::isnan(s.history[1].values[1]));
  EXPECT_EQ(s.singular_values, r.singular_values);
  EXPECT_EQ(s.right_vectors, r.right_vectors);
  EXPECT_EQ(s.cannot_tell, r.cannot_tell);
  ASSERT_EQ(s.profiles.size(), 2u);
  EXPECT_EQ(s.profiles[0].high95, 1. / 3);
  EXPECT_FALSE(s.profiles[0].bounded_above);
  EXPECT_EQ(s.profiles[0].points[1].status, "optimum");
  EXPECT_TRUE(std::isnan(s.profiles[0].points[0].values[1]) && std::isnan(s.profiles[1].sigma));
  ASSERT_EQ(s.starts.size(), 2u);
  EXPECT_EQ(s.starts[0].values, r.starts[0].values);
  EXPECT_EQ(s.starts[0].costs, r.starts[0].costs);
  EXPECT_EQ(s.starts[0].evaluations, r.starts[0].evaluations);
  EXPECT_EQ(s.starts[0].optimum, 1);
  EXPECT_EQ(s.starts[1].failure, r.starts[1].failure);
  EXPECT_TRUE(std::isnan(s.starts[1].screened_cost) && std::isnan(s.starts[1].final_cost));
  ASSERT_EQ(s.residuals.size(), 2u);
  EXPECT_EQ(s.residuals[0].x_px, 1. / 3);
  EXPECT_EQ(s.residuals[0].predicted_x_px, 0.1 + 0.2);
  EXPECT_TRUE(std::isnan(s.residuals[0].predicted_y_px));
  EXPECT_EQ(s.residuals[1].track, 7);
  EXPECT_EQ(s.residuals[1].weight, 0.5);

  // The second trip writes the same bytes: nothing was lost that the checks above do not look at.
  const std::string again = fresh_folder("round_trip_again");
  write_fit_result(s, again);
  for (const char* name : {"/fit.json", "/residuals.csv"}) {
    EXPECT_EQ(read_file(again + name), read_file(folder + name));
  }
}

TEST(FitResult, HeadersCarryUnits) {
  const std::string folder = fresh_folder("units");
  write_fit_result(example(), folder);
  const std::string csv = read_file(folder + "/residuals.csv");
  EXPECT_EQ(csv.substr(0, csv.find('\n')), "frame,track,x_px,y_px,predicted_x_px,predicted_y_px,weight");
}

TEST(FitResult, QuantitiesHaveUnitsAndListsAMedian) {
  EXPECT_STREQ(measured_unit("force_finger_z"), "N");
  EXPECT_STREQ(measured_unit("wrinkle_amplitude"), "mm");
  EXPECT_STREQ(measured_unit("waves_amplitude_left"), "px");
  EXPECT_STREQ(measured_unit("waves_direction"), "°");
  EXPECT_EQ(median({}), 0);
  EXPECT_EQ(median({3, 1, 2}), 2);
  EXPECT_EQ(median({4, 1, 3, 2}), 3);
}

// Of a ratio whose other modulus is held, the profile is that of the one that is fitted.
TEST(FitResult, RatiosHaveTheProfileOfTheirModulus) {
  FitResult r;
  r.parameters.resize(1);
  r.parameters[0].address = "/film", r.parameters[0].value = 0.1;
  r.derived.resize(3);
  r.derived[0].value = 5, r.derived[0].follows = "/film";
  r.derived[1].value = 0.2, r.derived[1].follows = "/film", r.derived[1].power = -1;
  r.derived[2].value = 3;
  ParameterProfile profile;
  profile.address = "/film", profile.low95 = 0.05, profile.high95 = 0.4, profile.bounded_above = false;
  profile.linear_low95 = 0.08, profile.linear_high95 = 0.12;
  const std::vector<DerivedProfile> found = derived_profiles(r, profile);
  ASSERT_EQ(found.size(), 2u);
  EXPECT_DOUBLE_EQ(found[0].low95, 2.5);
  EXPECT_DOUBLE_EQ(found[0].high95, 20);
  EXPECT_FALSE(found[0].bounded_above);
  EXPECT_DOUBLE_EQ(found[1].low95, 0.05);
  EXPECT_DOUBLE_EQ(found[1].high95, 0.4);
  EXPECT_FALSE(found[1].bounded_below);
  EXPECT_DOUBLE_EQ(found[1].linear_high95, 0.25);
}

TEST(FitResult, AnEmptyResultIsAllowed) {
  const std::string folder = fresh_folder("empty");
  write_fit_result({}, folder);
  const FitResult s = read_fit_result(folder);
  EXPECT_TRUE(s.parameters.empty());
  EXPECT_EQ(s.correlation.size(), 0);
}

std::string message_after(const std::string& file, const std::string& from, const std::string& to) {
  const std::string folder = fresh_folder("damage");
  write_fit_result(example(), folder);
  std::string text = read_file(folder + file);
  const size_t at = text.find(from);
  EXPECT_NE(at, std::string::npos) << from;
  write_file(folder + file, text.replace(at, from.size(), to));
  try {
    read_fit_result(folder);
  } catch (const InputError& e) {
    return e.what();
  }
  return "accepted";
}

TEST(FitResult, DamagedFilesAreRefusedByName) {
  EXPECT_THAT(message_after("/fit.json", "rhytid fit 1", "other"), HasSubstr("fit.json:/format"));
  EXPECT_THAT(message_after("/fit.json", "\"num_tracks\": 0", "\"num_tracks\": 0.5"),
              HasSubstr("/num_tracks"));
  EXPECT_THAT(message_after("/fit.json", "\"gauge\"", "\"gouge\""), HasSubstr("/gauge"));
  EXPECT_THAT(message_after("/fit.json", "\"unit\": \"MPa\"", "\"unit\": 3"),
              HasSubstr("/parameters/0/unit"));
  EXPECT_THAT(message_after("/fit.json", "\"costs\": [\n", "\"costs\": [\n 3,\n"), HasSubstr("starts/0"));
  EXPECT_THAT(message_after("/fit.json", "{", "["), HasSubstr("not readable as JSON"));
  EXPECT_THAT(message_after("/fit.json", "\"num_residuals\": 2", "\"num_residuals\": 3"),
              HasSubstr("residuals.csv"));
  EXPECT_THAT(message_after("/residuals.csv", "weight", "weigh"), HasSubstr("residuals.csv:1"));
  EXPECT_THAT(message_after("/residuals.csv", "4,7,1", "4,7,one"), HasSubstr("residuals.csv:3"));
  EXPECT_THROW(read_fit_result(fresh_folder("missing")), InputError);
}

TEST(FitResult, OneSentenceForAllParametersThatTheSameThingMoves) {
  FitResult r;
  for (const char* name : {"left strength", "right strength", "film modulus", "friction"}) {
    FittedParameter p;
    p.name = name;
    p.sigma = 1;
    r.parameters.push_back(p);
  }
  const auto shift = [](const char* name, const char* change, std::vector<double> by) {
    SystematicShift s;
    s.name = name;
    s.change = change;
    s.shift = std::move(by);
    return s;
  };
  r.systematic = {shift("plane", "finer elements", {0.1, 0.8, 0.1, 0.1}),
                  shift("steps", "shorter steps", {0.1, 0.1, 0.1, 0.8}),
                  shift("thickness", "more elements", {0, 0.1, 0.1, 0}),
                  shift("held finger path offset", "", {0.8, 0.2, 0.9, 0.1}),
                  shift("held soft modulus", "", {0.2, 0.1, 0.1, 0.1})};
  r.systematic[3].axes = {r.systematic[3].shift};
  add_systematic_notes(FitCase{}, r);
  EXPECT_EQ(
      r.cannot_tell,
      (std::vector<std::string>{
          "left strength and film modulus hang on how well the finger path offset is known: the table says "
          "what it moves. Measure it better, or fit it (/fit/path_deviations fit).",
          "The discretisation, not the footage, limits right strength, most of all this: finer elements "
          "would move it as the table says.",
          "The discretisation, not the footage, limits friction, most of all this: shorter steps would "
          "move it as the table says."}));
  r.cannot_tell.clear();
  r.systematic[0].shift[3] = 0.9;
  r.systematic[3].failure = "it did not converge";
  add_systematic_notes(FitCase{}, r);
  EXPECT_EQ(r.cannot_tell,
            (std::vector<std::string>{
                "The discretisation, not the footage, limits right strength and friction, most of "
                "all this: finer elements would move them as the table says."}));
}

}  // namespace
}  // namespace rhytid::fitting
