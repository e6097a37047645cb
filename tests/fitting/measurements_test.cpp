// Forces and wrinkles beside pixels: the file, derivatives, and what forces tell that pixels do not.
#include "fitting/measurements.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <unistd.h>

#include <cmath>
#include <cstdio>
#include <filesystem>
#include <random>

#include "adjoint/output_values.h"
#include "sim/core/error.h"
#include "sim/output/atomic_file.h"
#include "tests/fitting/synthetic_tracks.h"

namespace rhytid::fitting {
namespace {

namespace fs = std::filesystem;
using testing::AllOf;
using testing::HasSubstr;

constexpr int kFrames = 4;

/// Message of the InputError that `act` throws; "" when it throws none.
template <class Act>
std::string message_of(Act&& act) {
  try {
    act();
  } catch (const InputError& error) {
    return error.what();
  }
  return {};
}

std::string file_with(const std::string& text) {
  const std::string path =
      (fs::temp_directory_path() / ("rhytid_measurements_" + std::to_string(getpid()) + ".csv")).string();
  write_file(path, text);
  return path;
}

TEST(Measurements, AreReadAndRefused) {
  const std::string path = file_with(
      "frame,quantity,value,sigma\n# of the sensor\n1, force_finger_z, -0.2, "
      "0.01\n2,wrinkle_amplitude,0.1,1e-3\n");
  const std::vector<Measurement> list = read_measurements(path);
  ASSERT_EQ(list.size(), 2u);
  EXPECT_EQ(list[0].quantity, "force_finger_z");
  EXPECT_EQ(list[0].value, -0.2);
  EXPECT_EQ(list[1].frame, 2);
  EXPECT_EQ(list[1].sigma, 1e-3);
  const auto refused = [](const std::string& text) {
    const std::string file = file_with(text);
    return message_of([&] { read_measurements(file); });
  };
  const std::string header = "frame,quantity,value,sigma\n";
  EXPECT_THAT(refused("frame,what,value\n"),
              AllOf(HasSubstr(".csv:1"), HasSubstr("frame,quantity,value,sigma")));
  EXPECT_THAT(refused(header), HasSubstr("no measurement"));
  EXPECT_THAT(refused(header + "0,a,1,1\n"), AllOf(HasSubstr(".csv:2"), HasSubstr("frame 0")));
  EXPECT_THAT(refused(header + "1.5,a,1,1\n"), HasSubstr("1.5"));
  EXPECT_THAT(refused(header + "1,a,nan,1\n"), HasSubstr("nan"));
  EXPECT_THAT(refused(header + "1,a,1,0\n"), HasSubstr("sigma 0"));
  EXPECT_THAT(refused(header + "1,a,1\n"), HasSubstr(".csv:2"));
  EXPECT_THAT(refused(header + "1,a,1,1\n1,a,2,1\n"), AllOf(HasSubstr(".csv:3"), HasSubstr("second time")));
  EXPECT_THAT(message_of([] { read_measurements("/no/such.csv"); }), HasSubstr("/no/such.csv"));
  fs::remove(path);
}

/// What sensors would read in a run of the scene, with seeded noise of so many per cent of the largest value.
std::vector<Measurement> measure(const Scene& scene, const std::vector<std::string>& quantities,
                                 const std::optional<WrinkleLine>& line, double noise, unsigned seed) {
  const SceneModel model(scene);
  std::vector<Measurement> wanted;
  for (int f = 1; f <= kFrames; ++f)
    for (const std::string& quantity : quantities) wanted.push_back({f, quantity, 0, 1, "here"});
  const MeasuredQuantities measured(model.model(), wanted, line, kFrames);
  RunOptions options = model.run_options();
  options.keep_states = true;
  const Trajectory run = simulate(model.model(), model.native(), options);
  const auto values = adjoint::output_values(model.model(), model.native(), run, *measured.output());
  std::mt19937 rng(seed);
  std::normal_distribution<double> normal;
  std::map<std::string, double> largest;
  const auto value_of = [&](std::size_t i) {
    const MeasuredQuantities::Value& v = measured.values()[i];
    return values[static_cast<std::size_t>(v.measurement.frame)][v.row];
  };
  for (std::size_t i = 0; i < wanted.size(); ++i)
    largest[wanted[i].quantity] = std::max(largest[wanted[i].quantity], std::fabs(value_of(i)));
  for (std::size_t i = 0; i < wanted.size(); ++i) {
    wanted[i].sigma = noise * largest[wanted[i].quantity];
    wanted[i].value = value_of(i) + wanted[i].sigma * normal(rng);
  }
  return wanted;
}

FitClip make_clip(double noise) {
  const Scene scene = test::drag_scene(kFrames);
  const Camera camera = test::make_camera();
  return {"",
          "",
          scene,
          {camera},
          test::make_tracks(scene, camera, 3, 0.02, 4),
          measure(scene, {"force_finger_x", "force_finger_z"}, {}, noise, 9)};
}

TEST(Measurements, DerivativesMatchDifferences) {
  FitCase fit = test::three_parameters();
  fit.parameters.push_back(test::fitted("/skin/layers/soft/youngs_modulus", 0.025));
  fit.wrinkles = WrinkleLine{{Vec3(-4, 0.5, 2), Vec3(4, 0.5, 2)}, 40, {1, 12}};
  FitClip clip = make_clip(0.05);
  for (const Measurement& m :
       measure(clip.scene, {"wrinkle_amplitude", "wrinkle_wavelength"}, fit.wrinkles, 0.05, 3))
    clip.measured.push_back(m);
  JointProblem problem({clip}, fit);
  EXPECT_EQ(problem.num_measured(), 4 * kFrames);
  EXPECT_TRUE(problem.has_forces());
  const VectorXd t = problem.initial() + Eigen::Vector4d(0.03, -0.02, 0.04, 0.05);
  const ObjectiveEvaluation at = problem.evaluate(t);
  ASSERT_FALSE(at.failed) << at.failure;
  EXPECT_NEAR(at.cost, 0.5 * at.residuals.squaredNorm(), 1e-12 * at.cost);
  const auto jacobian = problem.jacobian(t);
  const auto gradient = problem.gradient(t);
  ASSERT_TRUE(jacobian && gradient);
  EXPECT_LT((jacobian->transpose() * at.residuals - *gradient).norm(), 1e-8 * gradient->norm());
  const Eigen::Index rows = 4 * kFrames;
  EXPECT_EQ(problem.linearised(t)->jacobian.bottomRows(rows), jacobian->bottomRows(rows));
  const Eigen::Vector4d direction(1, -0.5, 0.7, 0.3);
  const double h = 1e-4;
  const VectorXd plus = problem.evaluate(t + h * direction).residuals,
                 minus = problem.evaluate(t - h * direction).residuals;
  const VectorXd difference = (plus - minus) / (2 * h), linear = *jacobian * direction;
  EXPECT_LT((linear - difference).norm(), 1e-4 * difference.norm());
  EXPECT_LT((linear - difference).tail(rows).norm(), 1e-4 * difference.tail(rows).norm());
  EXPECT_GT(difference.tail(rows).norm(), 0.1);
}

// Pixels tell ratios of stiffnesses; a force sensor on the finger tells the scale.
TEST(Measurements, ForcesTellTheScaleOfStiffness) {
  FitCase fit = test::three_parameters();
  fit.parameters = {test::fitted("/skin/layers/film/youngs_modulus", 0.8),
                    test::fitted("/skin/layers/soft/youngs_modulus", 0.027),
                    test::fitted("/ligaments/stiffness", 0.0007)};
  const FitClip with = make_clip(0.02);
  FitClip without = with;
  without.measured.clear();
  JointFitInput input{.clips = {with}, .options = fit};
  const FitResult found = run_fit(input);
  std::printf("%s", answer_text(found).c_str());
  ASSERT_TRUE(found.converged) << found.status;
  for (const FittedParameter& p : found.parameters) {
    const double truth = get_parameter(with.scene, p.address);
    EXPECT_TRUE(p.determined) << p.name;
    EXPECT_LT(p.sigma, 0.05) << p.name;
    EXPECT_LT(std::fabs(std::log(p.value / truth)), 3.5 * p.sigma) << p.name;
  }
  EXPECT_THAT(found.gauge, HasSubstr("measured forces set the scale"));
  EXPECT_NEAR(found.reduced_chi_square, 1, 0.2);
  ASSERT_EQ(found.measured.size(), with.measured.size());
  for (std::size_t i = 0; i < with.measured.size(); ++i) {
    EXPECT_EQ(found.measured[i].quantity, with.measured[i].quantity);
    EXPECT_EQ(found.measured[i].value, with.measured[i].value);
    EXPECT_LT(std::fabs(found.measured[i].predicted - found.measured[i].value), 4 * with.measured[i].sigma);
  }
  EXPECT_THAT(answer_text(found), HasSubstr("force_finger_z: 4 values, off by "));
  input.clips = {without};
  const FitResult pixels = run_fit(input);
  EXPECT_FALSE(pixels.parameters[1].determined) << "nothing tells the scale";
}

TEST(Measurements, UnknownQuantitiesAreNamed) {
  FitClip clip = make_clip(0.05);
  clip.measured[0].quantity = "force_fingr_x";
  clip.measured[0].place = "sensor.csv:7";
  EXPECT_THAT(
      message_of([&] { JointProblem({clip}, test::three_parameters()); }),
      AllOf(HasSubstr("sensor.csv:7"), HasSubstr("force_fingr_x"), HasSubstr("nearest is 'force_finger_x'")));
  clip.measured[0].quantity = "wrinkle_amplitude";
  EXPECT_THAT(message_of([&] { JointProblem({clip}, test::three_parameters()); }),
              HasSubstr("/fit/wrinkles"));
  FitCase beside = test::three_parameters();
  beside.wrinkles = WrinkleLine{{Vec3(-40, 0, 2), Vec3(40, 0, 2)}, 40, {1, 12}};
  EXPECT_THAT(message_of([&] { JointProblem({clip}, beside); }), HasSubstr("beside the skin"));
}

}  // namespace
}  // namespace rhytid::fitting
