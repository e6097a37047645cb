// Waves of tracked points by wave vector: what they are in trains that are known, derivatives, and what they lead to where
// points are out of phase.
#include "fitting/wave_spectrum.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <numbers>
#include <random>

#include "tests/fitting/synthetic_tracks.h"

namespace rhytid::fitting {
namespace {

constexpr double kPi = std::numbers::pi;

/// 300 points on a patch of 24 x 16 mm that have moved by a dent, a train of waves along `angle` and noise.
struct Train {
  double amplitude = 0.8, wavelength = 4, angle = 0, phase = 0;
};
Vec2 moved(const Train& train, const Vec3& x) {
  const double s = x.x() * std::cos(train.angle) + x.y() * std::sin(train.angle);
  const Vec2 dent(3 - 0.01 * x.x() * x.x(), 2 + 0.02 * x.y());
  return dent + Vec2(0.6, -0.8) * train.amplitude * std::sin(2 * kPi * s / train.wavelength + train.phase);
}
std::vector<WavePoint> points_of(const Train& train, double noise, unsigned seed = 1) {
  std::mt19937 rng(seed);
  std::uniform_real_distribution<double> uniform(-1, 1);
  std::normal_distribution<double> normal;
  std::vector<WavePoint> points;
  for (int i = 0; i < 300; ++i) {
    WavePoint& p = points.emplace_back();
    p.rest = Vec3(12 * uniform(rng), 8 * uniform(rng), 5);
    p.frames = {1};
    p.moved = moved(train, p.rest) + noise * Vec2(normal(rng), normal(rng));
    p.variances = {noise * noise};
  }
  return points;
}
/// Observed − predicted.
std::vector<VectorXd> differences(const std::vector<WavePoint>& points, const Train& predicted) {
  std::vector<VectorXd> r;
  for (const WavePoint& p : points) r.emplace_back(p.moved - moved(predicted, p.rest));
  return r;
}

TEST(WaveSpectrum, DescribesATrainThatIsKnown) {
  for (const double angle : {0.0, kPi / 4, -kPi / 4, kPi / 2}) {
    const Train train{0.8, 4, angle, 1};
    const std::vector<WaveDescription> found = WaveSpectrum(points_of(train, 0.05), {2, 8}).tracked();
    ASSERT_EQ(found.size(), 1u);
    std::printf("amplitude %.3f ± %.3f px, length %.3f ± %.3f mm, direction %.1f ± %.1f degrees\n",
                found[0].amplitude, found[0].amplitude_sigma, found[0].wavelength, found[0].wavelength_sigma,
                180 / kPi * found[0].direction, 180 / kPi * found[0].direction_sigma);
    EXPECT_NEAR(found[0].amplitude, 0.8, 0.3);
    EXPECT_NEAR(found[0].wavelength, 4, 0.3);
    EXPECT_LT(std::fabs(std::remainder(found[0].direction - angle, kPi)), 0.1);
  }
  const std::vector<WaveDescription> flat = WaveSpectrum(points_of({0, 4, 0, 0}, 0.05), {2, 8}).tracked();
  EXPECT_LT(flat[0].amplitude, 4 * flat[0].amplitude_sigma + 0.05) << "the dent is none";
}

// A right wave of another phase costs what noise does; one of another length or height does not, whatever its phase.
TEST(WaveSpectrum, CostsDoNotAskForThePhase) {
  const Train truth{0.8, 4, 0, 0};
  const std::vector<WavePoint> points = points_of(truth, 0.05);
  const WaveSpectrum spectrum(points, {2, 8, 0.05});
  const auto cost = [&](const Train& t) {
    return spectrum.residuals(differences(points, t)).squaredNorm() / spectrum.size();
  };
  EXPECT_LT(cost(truth), 2);
  EXPECT_LT(cost({0.8, 4, 0, kPi}), 4);
  EXPECT_GT(cost({0.8, 5, 0, 0}), 10);
  EXPECT_GT(cost({0.4, 4, 0, 0}), 5);
  EXPECT_GT(cost({0.8, 4, kPi / 2, 0}), 10);
}

// The film of E_f on a soft base buckles at 2π h (E_f / 3 E_s)^⅓: a quarter of a wave off, points lead elsewhere.
TEST(WaveSpectrum, LeadsTheFilmsModulusToTheRightWavelength) {
  const double soft = 0.02, thickness = 0.15;
  const auto wavelength = [&](double film) { return 2 * kPi * thickness * std::cbrt(film / (3 * soft)); };
  const Train truth{0.8, wavelength(3), 0, 0};
  const std::vector<WavePoint> points = points_of(truth, 0.05);
  const WaveSpectrum spectrum(points, {2, 8, 0.05});
  double best[2] = {0, 0}, least[2] = {1e300, 1e300};
  for (double film = 1; film < 10; film *= 1.01) {
    const std::vector<VectorXd> r = differences(points, {0.8, wavelength(film), 0, 0.75 * kPi});
    double of_points = 0;
    for (const VectorXd& of_one : r) of_points += of_one.squaredNorm();
    const double costs[2] = {of_points, spectrum.residuals(r).squaredNorm()};
    for (const int which : {0, 1})
      if (costs[which] < least[which]) least[which] = costs[which], best[which] = film;
  }
  std::printf("film of 3 MPa: %.3f MPa by points out of phase, %.3f MPa by waves\n", best[0], best[1]);
  EXPECT_NEAR(std::log(best[1] / 3), 0, 0.05);
  EXPECT_GT(std::fabs(std::log(best[0] / 3)), 0.2);
}

TEST(WaveSpectrum, RefusesWhatTellsNoWave) {
  std::vector<WavePoint> points = points_of({}, 0.05);
  EXPECT_THROW(WaveSpectrum(points, {4, 2}), InputError);
  EXPECT_THAT(
      [&] {
        WaveSpectrum(points, {1e-6, 8});
      },
      testing::ThrowsMessage<InputError>(testing::HasSubstr("/fit/waves/shortest")));
  points.resize(20);
  EXPECT_THROW(WaveSpectrum(points, {2, 8}), InputError);
}

// Answer, intervals and profiles are of one and the same cost.
TEST(WaveSpectrum, WavesLeadAndPointsDecide) {
  const Camera camera = test::make_camera();
  const Scene scene = test::drag_scene(2);
  FitCase fit = test::three_parameters();
  fit.parameters.pop_back();
  FitInput input{scene, camera, test::make_tracks(scene, camera, 4, 0.05, 4), fit, {}};
  const FitResult plain = run_fit(input);
  input.options.waves = WaveBand{3, 8, 0.001};
  const FitResult led = run_fit(input);
  ASSERT_TRUE(plain.converged && led.converged) << led.status;
  EXPECT_NEAR(led.final_cost / plain.final_cost, 1, 1e-4) << "that of the points";
  for (std::size_t k = 0; k < plain.parameters.size(); ++k) {
    const FittedParameter &a = led.parameters[k], &b = plain.parameters[k];
    EXPECT_LT(std::fabs(std::log(a.value / b.value)), 0.15 * b.sigma) << a.name;
    EXPECT_NEAR(a.sigma / b.sigma, 1, 0.02) << a.name;
  }
  ASSERT_EQ(led.stages.size(), 1u);
  EXPECT_GT(led.stages[0].forward_runs, 0);
  EXPECT_THAT(led.notes, testing::Contains(testing::HasSubstr("of its deviations")));
  const auto is_waves = [](const auto& m) { return m.quantity.starts_with("waves_amplitude"); };
  EXPECT_TRUE(std::any_of(led.measured.begin(), led.measured.end(), is_waves));
  for (const FittedMeasurement& m : led.measured)
    EXPECT_TRUE(!m.quantity.starts_with("waves_length") || m.value > 0)
        << "a frame without waves has no length";
  double most = 0;  // else this test says nothing
  for (std::size_t k = 0; k < plain.parameters.size(); ++k)
    most = std::max(most, std::fabs(std::log(led.stages[0].values[k] / plain.parameters[k].value)) /
                              plain.parameters[k].sigma);
  std::printf("waves alone would have moved the answer by %.2f deviations\n", most);
  EXPECT_GT(most, 0.3);
}

TEST(WaveSpectrum, DerivativesOfAFitMatchDifferences) {
  FitCase fit = test::three_parameters();
  fit.waves = WaveBand{3, 8, 0.05};
  FitClip clip;
  clip.scene = test::drag_scene(2), clip.cameras = {test::make_camera()};
  clip.tracks = test::make_tracks(clip.scene, clip.cameras[0], 4, 0.02, 4);
  JointProblem problem({clip}, fit);
  FitCase without = fit;
  without.waves.reset();
  JointProblem points({clip}, without);
  EXPECT_EQ(problem.num_residuals(), points.num_residuals() + problem.clip(0).waves()->size());
  EXPECT_EQ(problem.degrees_of_freedom(), points.degrees_of_freedom());
  const VectorXd t = problem.initial();
  const ObjectiveEvaluation at = problem.evaluate(t);
  ASSERT_FALSE(at.failed) << at.failure;
  const auto jacobian = problem.jacobian(t);
  const auto gradient = problem.gradient(t);
  ASSERT_TRUE(jacobian && gradient);
  EXPECT_LT((jacobian->transpose() * at.residuals - *gradient).norm(), 1e-8 * gradient->norm());
  const Vec3 direction(1, -0.5, 0.7);
  const double h = 1e-4;
  const VectorXd plus = problem.evaluate(t + h * direction).residuals,
                 minus = problem.evaluate(t - h * direction).residuals;
  const VectorXd difference = (plus - minus) / (2 * h);
  const VectorXd linear = *jacobian * direction;
  const Eigen::Index rows = problem.clip(0).waves()->size();
  EXPECT_GT(difference.tail(rows).norm(), 0.1);
  EXPECT_LT((linear - difference).tail(rows).norm(), 1e-3 * difference.tail(rows).norm());
  EXPECT_NEAR(problem.linearised(t)->jacobian.squaredNorm() / points.linearised(t)->jacobian.squaredNorm(), 1,
              1e-9)
      << "intervals are those of the points";
}

}  // namespace
}  // namespace rhytid::fitting
