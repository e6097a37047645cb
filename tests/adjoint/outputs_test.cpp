// Outputs beyond positions: force on a collider, stored energy, wrinkles. What they are, and that tangent and
// adjoint sweeps differentiate them, paths past the state included.
#include "adjoint/outputs.h"

#include <gtest/gtest.h>

#include <numbers>

#include "adjoint/ligament_gradient.h"
#include "adjoint/output_values.h"
#include "adjoint/resultant_force.h"
#include "adjoint/stored_energy.h"
#include "adjoint/wrinkle_output.h"
#include "tests/adjoint/gradient_checks.h"
#include "tests/support/small_scenes.h"

namespace rhytid::adjoint {
namespace {

std::vector<std::string> settings(std::vector<std::string> more = {}) {
  more.insert(more.begin(), {"/skin/surface/grid/cells=[3,2]", "/skin/layers/soft/order=1"});
  return more;
}

const CertifiedCase& drag() {
  static const CertifiedCase c(test::drag_scene(2, 6), settings());
  return c;
}

std::vector<VectorXd> values_of(const CertifiedCase& c, const Output& output) {
  return output_values(c.model(), c.scene_model.native(), c.run, output);
}

// Lifted and dragged along x: pushed up, and back along the way it goes, by less than friction allows.
TEST(ColliderForce, PushesBack) {
  const CertifiedCase& c = drag();
  const ResultantForce contact(c.model(), {"contact finger"}), friction(c.model(), {"friction finger"}),
      both = collider_force(c.model(), "finger");
  const auto pushed = values_of(c, contact), rubbed = values_of(c, friction), force = values_of(c, both);
  EXPECT_EQ(force[0].size(), 0);
  for (int f = 2; f <= c.run.frames(); ++f) {
    EXPECT_GT(pushed[f][2], 0.01);
    EXPECT_NEAR((pushed[f] + rubbed[f] - force[f]).norm(), 0, 1e-14);
  }
  const VectorXd& last = rubbed.back();
  EXPECT_LT(last[0], 0);
  EXPECT_GT(last.norm(), 0.1 * pushed.back().norm());
  EXPECT_THROW((void)collider_force(c.model(), "thumb"), ContractError);
}

// Newton's third law on the whole: everything that holds the skin balances, so that the forces on finger,
// base, ligaments and rim sum to zero; with the rim free only the first three are there.
TEST(ColliderForce, BalancesLigamentsAndBase) {
  const CertifiedCase c(test::drag_scene(2, 4), settings({"/skin/rim=free"}));
  ASSERT_TRUE(c.run.complete) << c.run.failure;
  const auto finger = values_of(c, collider_force(c.model(), "finger"));
  const auto rest = values_of(c, ResultantForce(c.model(), {"ligaments", "base contact"}));
  EXPECT_GT(finger.back().norm(), 0.01);
  EXPECT_LT((finger.back() + rest.back()).norm(), 1e-9 * finger.back().norm());
}

TEST(StoredEnergy, IsThatOfTheAccount) {
  RunOptions options = drag().options;
  options.account_energies = true;
  const Trajectory run = simulate(drag().model(), drag().scene_model.native(), options);
  const StoredEnergy all(drag().model()), ligaments(drag().model(), {"ligaments"});
  const auto energy = output_values(drag().model(), drag().scene_model.native(), run, all),
             own = output_values(drag().model(), drag().scene_model.native(), run, ligaments);
  for (int f = 1; f <= run.frames(); ++f) {
    const EnergyAccount& account = run.steps[static_cast<std::size_t>(run.frame_end[f] - 1)].energies;
    EXPECT_NEAR(energy[f][0], account.stored, 1e-13 * account.stored);
    for (const TermAccount& term : account.terms)
      if (term.term == "ligaments") {
        EXPECT_NEAR(own[f][0], term.stored[0].energy, 1e-13 * term.stored[0].energy);
      }
    EXPECT_GT(own[f][0], 0);
    EXPECT_GT(energy[f][0], own[f][0]);
  }
  EXPECT_THROW(StoredEnergy(drag().model(), {"sinew"}), ContractError);
}

TEST(StepOutputs, AreRefusedAtRest) {
  const StoredEnergy output(drag().model(), {}, 0);
  EXPECT_THROW((void)output.values(0, drag().run.initial), ContractError);
}

class OutputVariant : public testing::TestWithParam<std::vector<std::string>> {};

TEST_P(OutputVariant, ForceAndEnergyHaveRightGradients) {
  const CertifiedCase c(test::drag_scene(2, 8), settings(GetParam()));
  ASSERT_TRUE(c.run.complete) << c.run.failure;
  const int first = c.run.frame_end.front() == 0 ? 1 : 0;  // a settled frame 0 has a step
  const auto force = std::make_shared<ResultantForce>(collider_force(c.model(), "finger", first));
  const auto energy = std::make_shared<StoredEnergy>(c.model(), std::vector<std::string>{}, first);
  for (const auto& output : {std::shared_ptr<const Output>(force), std::shared_ptr<const Output>(energy)})
    expect_right_gradient(c, *output, random_weights(*output, c.run.frames(), 11), 1e-3);
}

INSTANTIATE_TEST_SUITE_P(
    Outputs, OutputVariant,
    testing::Values(std::vector<std::string>{"/time/damper=exponential"},
                    std::vector<std::string>{"/time/damper=literal", "/time/lag_passes=2", "/time/frames=5",
                                             "/colliders/finger/friction/mollifier=quadratic"},
                    std::vector<std::string>{"/time/substeps=2", "/time/frames=6",
                                             "/skin/layers/film/relaxing_fraction=0",
                                             "/ligaments/law=fung_quadratic"},
                    std::vector<std::string>{"/skin/pre_stretch={\"stretch\":1.1}", "/time/frames=5",
                                             "/skin/quadrature/volume=reduced"}));

constexpr double kWave = 4, kTurn = 0.4;  // mm, rad

/// Displacement of a train of waves of unit height along a direction.
VectorXd waves(const SkinMesh& mesh) {
  VectorXd u = VectorXd::Zero(3 * mesh.num_nodes());
  const Eigen::Vector2d k = 2 * std::numbers::pi / kWave * Eigen::Vector2d(std::cos(kTurn), std::sin(kTurn));
  for (int n = 0; n < mesh.num_nodes(); ++n)
    u[3 * n + 2] = 0.3 * std::sin(k[0] * mesh.rest(n, 0) + k[1] * mesh.rest(n, 1));
  return u;
}

TEST(WrinkleDescription, IsThatOfTheForwardMeasureOnAWave) {
  const SceneModel fine(parse_scene_text(test::drag_scene(4, 1), "waves.json",
                                         {"/skin/surface/grid/cells=[16,12]", "/skin/layers/soft/order=1"}));
  const SurfaceSamples window(fine.model().mesh, SampleWindow{.size = {13, 10}}, 0.2);
  const WrinkleBand band{1, 12};
  const WrinkleDescription output(window, band);
  State state = fine.model().rest_state();
  EXPECT_EQ(output.values(1, state), VectorXd::Zero(4)) << "flat skin has no wrinkles";
  state.u = waves(fine.model().mesh);
  const VectorXd v = output.values(1, state);
  const WrinkleDescriptors d =
      describe(wrinkle_sums(band_pass(window.heights(state.u), window.spacing(), band), window.spacing()));
  EXPECT_EQ(v[0], d.amplitude);
  EXPECT_EQ(v[1], d.wavelength);
  EXPECT_NEAR(std::hypot(v[2], v[3]), d.coherence, 1e-12);
  EXPECT_NEAR(0.5 * std::atan2(v[3], v[2]), d.direction, 1e-12);
  std::printf("amplitude %.4f (0.3 before the band), wavelength %.4f (4), turn %.4f (0.4), coherence %.4f\n",
              v[0], v[1], 0.5 * std::atan2(v[3], v[2]), std::hypot(v[2], v[3]));
  EXPECT_NEAR(v[1], kWave, 0.03 * kWave);
  EXPECT_NEAR(0.5 * std::atan2(v[3], v[2]), kTurn, 0.03);
}

// Transposes of the linear parts, holes included.
TEST(WrinkleDescription, BandPassAndSamplesHaveTransposes) {
  std::mt19937 rng(5);
  std::normal_distribution<double> normal;
  const auto random = [&](Eigen::Index rows, Eigen::Index cols) {
    return MatrixXd(MatrixXd::NullaryExpr(rows, cols, [&] { return normal(rng); }));
  };
  const auto dot = [](const MatrixXd& a, const MatrixXd& b) {
    double sum = 0;
    for (Eigen::Index i = 0; i < a.size(); ++i)
      if (!std::isnan(a(i)) && !std::isnan(b(i))) sum += a(i) * b(i);
    return sum;
  };
  for (const WrinkleBand band : {WrinkleBand{1.5, 6}, WrinkleBand{0, 5}, WrinkleBand{2}}) {
    MatrixXd h = random(19, 14), w = random(19, 14);
    for (const auto& [i, j] : {std::pair{0, 0}, {7, 5}, {7, 6}, {18, 13}})
      h(i, j) = w(i, j) = std::numeric_limits<double>::quiet_NaN();
    const double forward = dot(band_pass(h, 0.5, band), w);
    EXPECT_NEAR(dot(h, band_pass_transpose(w, 0.5, band)), forward, 1e-11 * h.size());
    const VectorXd line = random(25, 1), weights = random(25, 1);
    EXPECT_NEAR(dot(line, band_pass_transpose(weights, 0.5, band)), dot(band_pass(line, 0.5, band), weights),
                1e-12);
    // The sums: by central differences, of fourth powers at most.
    const MatrixXd direction = random(19, 14);
    WrinkleSums bar;
    bar.square = 0.7;
    bar.fourth = -0.3;
    bar.gradient << 0.2, 0.5, -0.1, 0.9;
    const auto value = [&](const WrinkleSums& s) {
      return s.square * bar.square + s.fourth * bar.fourth + s.gradient.cwiseProduct(bar.gradient).sum();
    };
    const double e = 1e-3;
    const double difference = (value(wrinkle_sums(MatrixXd(h + e * direction), 0.5)) -
                               value(wrinkle_sums(MatrixXd(h - e * direction), 0.5))) /
                              (2 * e);
    EXPECT_NEAR(dot(wrinkle_sums_transpose(h, 0.5, bar), direction), difference,
                1e-5 * std::fabs(difference) + 1e-4);
    // One column is a line, in the sums and in their transpose.
    const MatrixXd column = line, along = weights;
    EXPECT_EQ(wrinkle_sums(column, 0.5).square, wrinkle_sums(line, 0.5).square);
    EXPECT_EQ(band_pass(column, 0.5, band), band_pass(line, 0.5, band));
    const double of_line = (value(wrinkle_sums(MatrixXd(column + e * along), 0.5)) -
                            value(wrinkle_sums(MatrixXd(column - e * along), 0.5))) /
                           (2 * e);
    EXPECT_NEAR(dot(wrinkle_sums_transpose(column, 0.5, bar), along), of_line,
                1e-5 * std::fabs(of_line) + 1e-4);
    EXPECT_GT(std::fabs(of_line), 0.1);
  }
  const SurfaceSamples window(drag().model().mesh, SampleWindow{.size = {18, 10}}, 1);
  ASSERT_GT(window.missing(), 0);
  const VectorXd u = random(drag().run.initial.u.size(), 1);
  const MatrixXd w = random(window.rows(), window.columns());
  VectorXd bar = VectorXd::Zero(u.size());
  window.add_transpose(w, bar);
  EXPECT_NEAR(bar.dot(u), dot(window.heights(u), w), 1e-12);
}

TEST(WrinkleDescription, HasARightGradient) {
  const CertifiedCase& c = drag();
  const SampleLine line{{-6, 0.4, 1.65}, {6, -0.5, 1.65}};
  const CombinedOutput output(
      {std::make_shared<WrinkleDescription>(
           SurfaceSamples(c.model().mesh, SampleWindow{.size = {12, 9}}, 0.5), WrinkleBand{2, 14}, 2),
       std::make_shared<WrinkleDescription>(SurfaceSamples(c.model().mesh, line, 31), WrinkleBand{1.5, 20},
                                            2)});
  EXPECT_EQ(output.size(1), 0);
  ASSERT_EQ(output.size(2), 6);
  const auto values = values_of(c, output);
  std::printf(
      "window: amplitude %.3g, wavelength %.3g, c %.3g, s %.3g; line: amplitude %.3g, wavelength "
      "%.3g\n",
      values.back()[0], values.back()[1], values.back()[2], values.back()[3], values.back()[4],
      values.back()[5]);
  EXPECT_GT(values.back()[0], 1e-3);
  expect_right_gradient(c, output, random_weights(output, c.run.frames(), 4));
}

// b of every vertex from one adjoint, against runs with b changed at random at all of them.
TEST(LigamentGradient, IsThatOfEveryVertex) {
  const CertifiedCase& c = drag();
  const VectorXd native = c.scene_model.native();
  const VectorXd bar = adjoint_sweep(c.model(), native, c.run, *c.output, c.weights).native_bar;
  const VectorXd gradient = ligament_gradient_by_vertex(c.model(), bar);
  ASSERT_EQ(gradient.size(), c.model().mesh.surface.vertices.rows());
  EXPECT_GT(ligament_gradient(c.model(), bar).size(), gradient.size());
  std::mt19937 rng(8);
  std::normal_distribution<double> normal;
  const VectorXd v = VectorXd::NullaryExpr(gradient.size(), [&] { return 0.3 * normal(rng); });
  const NativeBlock& b = c.model().native_block("ligaments/b");
  VectorXd direction = VectorXd::Zero(native.size());
  direction.segment(b.offset, b.size) = interpolate_vertices(c.model().mesh, v);
  const FunctionalDifference functional(c.scene_model, c.run, *c.output, c.weights,
                                        certificate_minimiser({}));
  const double h = 1e-3;
  const double difference = (functional.evaluate(native + h * direction).difference -
                             functional.evaluate(native - h * direction).difference) /
                            (2 * h);
  EXPECT_NEAR(gradient.dot(v), difference, 1e-5 * std::fabs(difference));
}

}  // namespace
}  // namespace rhytid::adjoint
