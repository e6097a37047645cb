// The sandwich over neighbours: what it is on average, and how often its intervals hold the truth.
#include "fitting/spatial_misfit.h"

#include <gtest/gtest.h>

#include <Eigen/Eigenvalues>
#include <Eigen/QR>
#include <cmath>
#include <random>

#include "fitting/identifiability.h"
#include "log_variables.h"

namespace rhytid::fitting {
namespace {

using testing::log_variables;

/// About 196 points on a grid over 1 × height.
std::vector<Vec2> points(double height) {
  const int across = static_cast<int>(std::lround(std::sqrt(196 / height)));
  const int up = std::max(2, static_cast<int>(std::lround(across * height)));
  std::vector<Vec2> list;
  for (int i = 0; i < across * up; ++i)
    list.emplace_back((i % across + 0.5) / across, height * (i / across + 0.5) / up);
  return list;
}

class Fields {
 public:
  explicit Fields(unsigned seed) : rng_(seed) {}
  /// Gaussian field of variance 1 and covariance exp(−d²/2L²), as a sum of random waves.
  VectorXd smooth(const std::vector<Vec2>& at, double length) {
    constexpr int waves = 40;
    VectorXd values = VectorXd::Zero(static_cast<Eigen::Index>(at.size()));
    for (int w = 0; w < waves; ++w) {
      const Vec2 wave(normal_(rng_) / length, normal_(rng_) / length);
      const double shift = phase_(rng_);
      for (std::size_t i = 0; i < at.size(); ++i)
        values[static_cast<Eigen::Index>(i)] += std::sqrt(2. / waves) * std::cos(wave.dot(at[i]) + shift);
    }
    return values;
  }
  VectorXd white(Eigen::Index count) {
    VectorXd values(count);
    for (double& x : values) x = normal_(rng_);
    return values;
  }

 private:
  std::mt19937 rng_;
  std::normal_distribution<double> normal_;
  std::uniform_real_distribution<double> phase_{0, 2 * 3.141592653589793};
};

std::vector<WhitenedTrack> one_row_each(const std::vector<Vec2>& at, const MatrixXd& j, const VectorXd& z) {
  std::vector<WhitenedTrack> tracks;
  for (std::size_t i = 0; i < at.size(); ++i)
    tracks.push_back({Vec3(at[i].x(), at[i].y(), 0),
                      {0},
                      j.row(static_cast<Eigen::Index>(i)),
                      VectorXd::Constant(1, z[static_cast<Eigen::Index>(i)])});
  return tracks;
}

struct Coverage {
  double by_noise = 0, by_both = 0;
};

/// A linear problem whose sensitivities vary over a quarter of the longer side and whose model errs by a
/// field of one standard deviation (`size`) of the noise over `length` of that side.
Coverage coverage(double height, double length, double size, int parameters, int repeats) {
  Fields fields(6);
  const std::vector<Vec2> at = points(height);
  const auto n = static_cast<Eigen::Index>(at.size());
  Coverage found;
  for (int repeat = 0; repeat < repeats; ++repeat) {
    MatrixXd j(n, parameters);
    for (int k = 0; k < parameters; ++k) j.col(k) = fields.smooth(at, 0.25);
    const VectorXd z = size * fields.smooth(at, length) + fields.white(n);
    const VectorXd t = j.householderQr().solve(z);  // the truth is 0
    const VectorXd left = z - j * t;
    const int dof = static_cast<int>(n) - parameters;
    const double widening = interval_widening(left.squaredNorm() / dof, 0);
    const Identifiability noise(j, log_variables(std::vector<std::string>(parameters, "p")), widening, dof),
        both(j, log_variables(std::vector<std::string>(parameters, "p")), widening, dof,
             one_row_each(at, j, left));
    for (int k = 0; k < parameters; ++k) {
      found.by_noise += std::fabs(t[k]) <= noise.half_width(k) ? 1. / (repeats * parameters) : 0;
      found.by_both += std::fabs(t[k]) <= both.half_width(k) ? 1. / (repeats * parameters) : 0;
    }
  }
  std::printf(
      "1 x %.2f, errors over %.2f of size %.1f, %d parameters: %.1f %% from the noise alone hold the truth, "
      "%.1f %% with neighbours\n",
      height, length, size, parameters, 100 * found.by_noise, 100 * found.by_both);
  return found;
}

// The table of fitting/README.md. The last patches hold four and two lengths of the field: little is left to
// learn from residuals there, and much of it was fitted away.
TEST(SpatialMisfit, IntervalsHoldTheTruthOnSquareAndNarrowPatches) {
  struct Row {
    double height, length, at_least;
  };
  for (const Row& row : {Row{1, 0.12, 0.93}, Row{1, 0.25, 0.89}, Row{0.25, 0.12, 0.89}, Row{0.25, 0.25, 0.87},
                         Row{0.1, 0.12, 0.86}, Row{0.1, 0.25, 0.79}}) {
    const Coverage found = coverage(row.height, row.length, 1, 3, 200);
    EXPECT_LT(found.by_noise, 0.75);
    EXPECT_GT(found.by_both, row.at_least);
  }
}

// Where there is nothing but noise, intervals are hardly wider.
TEST(SpatialMisfit, CostsLittleWithoutErrorsOfTheModel) {
  for (const int parameters : {3, 6}) {
    const Coverage found = coverage(1, 0.12, 0, parameters, 200);
    EXPECT_GT(found.by_both, 0.94);
    EXPECT_LT(found.by_both, 0.99);
  }
}

/// Tracks of four rows each, a third of them missing, with sensitivities that vary over a quarter of the
/// side; `basis` makes their normal matrix 1. Residuals are left to solve().
std::vector<WhitenedTrack> tracks_at(const std::vector<Vec2>& at, int parameters, Fields& fields,
                                     MatrixXd& basis) {
  std::vector<WhitenedTrack> tracks(at.size());
  MatrixXd normal = MatrixXd::Zero(parameters, parameters);
  std::vector<MatrixXd> sensitivities;
  for (int row = 0; row < 4; ++row) {
    sensitivities.emplace_back(at.size(), parameters);
    for (int k = 0; k < parameters; ++k) sensitivities.back().col(k) = fields.smooth(at, 0.25);
  }
  for (std::size_t i = 0; i < at.size(); ++i) {
    WhitenedTrack& track = tracks[i];
    track.place << at[i], 0;
    for (int row = 0; row < 4; ++row)
      if ((i + row) % 3 != 0) track.rows.push_back(row);
    track.jacobian.resize(track.rows.size(), parameters);
    for (std::size_t r = 0; r < track.rows.size(); ++r)
      track.jacobian.row(r) = sensitivities[track.rows[r]].row(i);
    normal += track.jacobian.transpose() * track.jacobian;
  }
  basis = Eigen::SelfAdjointEigenSolver<MatrixXd>(normal).operatorInverseSqrt();
  return tracks;
}

/// Sets the residuals of the least squares problem with the errors [4][tracks] and returns what it errs, in
/// the coordinates of the basis.
VectorXd solve(const std::vector<VectorXd>& errors, const MatrixXd& basis,
               std::vector<WhitenedTrack>& tracks) {
  VectorXd y = VectorXd::Zero(basis.cols());
  for (std::size_t i = 0; i < tracks.size(); ++i) {
    WhitenedTrack& track = tracks[i];
    track.residuals.resize(track.rows.size());
    for (std::size_t r = 0; r < track.rows.size(); ++r) track.residuals[r] = errors[track.rows[r]][i];
    y += basis.transpose() * (track.jacobian.transpose() * track.residuals);
  }
  for (WhitenedTrack& track : tracks) track.residuals -= track.jacobian * (basis * y);
  return y;
}

// Errors of a known kind, over and over: the variance that is found is that of the answers on average, where
// the plain sandwich has a fraction of it, and scatters as its degrees of freedom say.
TEST(SpatialMisfit, IsRightOnAverageAndKnowsItsScatter) {
  constexpr int kParameters = 3, kRepeats = 200;
  Fields fields(3);
  MatrixXd basis;
  const std::vector<Vec2> at = points(0.5);
  auto tracks = tracks_at(at, kParameters, fields, basis);
  double actual = 0, plain = 0, scatter = 0;
  VectorXd mean = VectorXd::Zero(kParameters), squares = mean;
  for (int repeat = 0; repeat < kRepeats; ++repeat) {
    std::vector<VectorXd> errors;
    for (int row = 0; row < 4; ++row) errors.push_back(fields.smooth(at, 0.15) + fields.white(at.size()));
    actual += solve(errors, basis, tracks).squaredNorm() / kRepeats;
    const SpatialMisfit misfit(tracks, basis);
    const VectorXd variances = misfit.covariance().diagonal();
    mean += variances / kRepeats;
    squares += variances.cwiseAbs2() / kRepeats;
    for (int k = 0; k < kParameters; ++k)
      scatter += 2 / misfit.degrees(VectorXd::Unit(kParameters, k)) / (kRepeats * kParameters);
    std::vector<VectorXd> scores;
    for (const WhitenedTrack& track : tracks)
      scores.emplace_back(basis.transpose() * (track.jacobian.transpose() * track.residuals));
    for (std::size_t i = 0; i < at.size(); ++i)
      for (std::size_t j = 0; j < at.size(); ++j)
        plain += scores[i].dot(scores[j]) / kRepeats *
                 std::exp(-0.5 * (at[i] - at[j]).squaredNorm() / std::pow(misfit.kernel_width(), 2));
  }
  const double found_scatter = (squares.cwiseQuotient(mean.cwiseAbs2()).array() - 1).mean();
  std::printf("variance %.2f, found %.2f, plain sandwich %.2f; scatter %.3f, expected %.3f\n", actual,
              mean.sum(), plain, found_scatter, scatter);
  EXPECT_NEAR(mean.sum() / actual, 1, 0.2);
  EXPECT_LT(plain / actual, 0.7);
  EXPECT_GT(found_scatter / scatter, 0.6);
  EXPECT_LT(found_scatter / scatter, 2);
}

TEST(SpatialMisfit, DoesNotDependOnTheCoordinatesOrTheUnitOfThePicture) {
  Fields fields(4);
  MatrixXd basis;
  const std::vector<Vec2> at = points(1);
  auto tracks = tracks_at(at, 3, fields, basis);
  std::vector<VectorXd> errors;
  for (int row = 0; row < 4; ++row) errors.push_back(fields.smooth(at, 0.2) + fields.white(at.size()));
  solve(errors, basis, tracks);
  const SpatialMisfit misfit(tracks, basis);
  EXPECT_GE(misfit.covariance().selfadjointView<Eigen::Lower>().eigenvalues().minCoeff(), 0);
  const MatrixXd turn = MatrixXd(Eigen::HouseholderQR<MatrixXd>(MatrixXd::Random(3, 3)).householderQ());
  const SpatialMisfit turned(tracks, basis * turn);
  EXPECT_LT((turned.covariance() - turn.transpose() * misfit.covariance() * turn).norm(), 1e-6);
  EXPECT_NEAR(turned.degrees(turn.transpose() * Vec3(1, 2, -1)), misfit.degrees(Vec3(1, 2, -1)), 1e-4);
  for (WhitenedTrack& track : tracks) track.place *= 640;
  const SpatialMisfit larger(tracks, basis);
  EXPECT_NEAR(larger.kernel_width(), 640 * misfit.kernel_width(), 1e-9);
  EXPECT_LT((larger.covariance() - misfit.covariance()).norm(), 1e-6);
}

TEST(SpatialMisfit, SaysNothingWhereItCannot) {
  Fields fields(4);
  MatrixXd basis;
  auto tracks = tracks_at(points(1), 3, fields, basis);
  for (WhitenedTrack& track : tracks) track.residuals = fields.white(track.jacobian.rows());
  for (WhitenedTrack& track : tracks) track.place = Vec3(5, 5, 0);
  EXPECT_EQ(SpatialMisfit(tracks, basis).covariance().norm(), 0);
  tracks.resize(3);
  for (int i = 0; i < 3; ++i) tracks[i].place = Vec3(i, i * i, 0);
  EXPECT_EQ(SpatialMisfit(tracks, basis).covariance().norm(), 0);
  EXPECT_EQ(SpatialMisfit({}, basis).covariance().norm(), 0);
  EXPECT_EQ(SpatialMisfit(tracks, basis).degrees(Vec3(1, 0, 0)), 1);
}

// Of many tracks every second is used: of white residuals, half the information.
TEST(SpatialMisfit, ThinsManyTracks) {
  Fields fields(5);
  std::vector<Vec2> at;
  for (int i = 0; i < 1600; ++i) at.emplace_back(i % 40, i / 40);
  double mean = 0;
  constexpr int kRepeats = 4;
  for (int repeat = 0; repeat < kRepeats; ++repeat) {
    MatrixXd j(1600, 2);
    for (int k = 0; k < 2; ++k) j.col(k) = fields.white(1600);
    const VectorXd z = fields.white(1600), left = z - j * j.householderQr().solve(z);
    const Identifiability noise(j, log_variables({"p", "p"}), 1, 1598);
    const SpatialMisfit misfit(one_row_each(at, j, left), noise.basis());
    mean += misfit.covariance().trace() / (2 * kRepeats);
    EXPECT_GT(misfit.degrees(Vec2(1, 0)), 50);
  }
  EXPECT_NEAR(mean, 2, 0.4);
}

}  // namespace
}  // namespace rhytid::fitting
