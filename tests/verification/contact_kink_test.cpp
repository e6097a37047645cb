// Derivatives where points begin to touch (T14): a plain penalty has a jump in its Hessian, so
// the derivative of any result by any parameter jumps whenever a point touches; a C² onset takes the jumps
// away.
#include <gtest/gtest.h>

#include <cmath>
#include <cstdio>
#include <map>

#include "adjoint/resimulate.h"
#include "adjoint/sweeps.h"
#include "sim/scene/load.h"
#include "sim/scene/scene_model.h"
#include "tests/support/small_scenes.h"

namespace rhytid {
namespace {

/// An elastic patch with a finger on few contact points; the result is its mean depression.
class PressedPatch {
 public:
  explicit PressedPatch(double onset) : model_(scene(onset)) {
    std::vector<adjoint::MaterialPoint> points;
    for (int face = 0; face < model_.model().mesh.num_faces; ++face) points.push_back({face, 1. / 3, 1. / 3});
    output_ = std::make_unique<adjoint::MeanNormalDisplacement>(model_.model().mesh, points);
  }

  /// d(depression)/d ln E of the soft layer at E · e^x, and how many points are touched.
  std::pair<double, int> slope(double x) const {
    const NativeBlock& soft = model_.model().native_block("layer/soft");
    VectorXd native = model_.native();
    VectorXd direction = VectorXd::Zero(native.size());
    for (const int i : soft.stiffness_like) {
      native[i] *= std::exp(x);
      direction[i] = native[i];
    }
    RunOptions options = model_.run_options();
    options.minimiser.relative_tolerance = 1e-11;
    options.minimiser.polish = true;
    int touched = 0;
    RunObserver observer;
    observer.step = [&](const StepEvent& event) {
      for (const signed char r : adjoint::step_regimes(event.problem, event.state.u)) touched += r > 0;
    };
    const Trajectory run = simulate(model_.model(), native, options, observer);
    EXPECT_TRUE(run.complete) << run.failure;
    return {adjoint::tangent_sweep(model_.model(), native, run, *output_, direction).frames[1](0, 0),
            touched};
  }

 private:
  static Scene scene(double onset) {
    Scene s = parse_scene_text(
        test::drag_scene(2, 1), "kink.json",
        {"/skin/surface/grid/cells=[6,4]", "/skin/layers/soft/order=1", "/skin/quadrature/contact_degree=4",
         "/skin/layers/soft/relaxing_fraction=0", "/skin/layers/film/relaxing_fraction=0"});
    s.base.reset();
    s.ligaments.reset();
    s.colliders[0].friction.reset();
    s.colliders[0].onset = onset;
    s.colliders[0].path = {{0, Vec3(-2, 0.3, 5.5)}, {1. / 24, Vec3(-2, 0.3, 4.4)}};
    return s;
  }
  SceneModel model_;
  std::unique_ptr<const adjoint::Output> output_;
};

TEST(ContactKink, DerivativesJumpAtAPlainPenaltyAndNotAtAnOnset) {
  double largest[2];
  for (const double onset : {0.0, 0.05}) {
    const PressedPatch patch(onset);
    constexpr int kSteps = 16;
    std::vector<std::pair<double, int>> scan;
    for (int k = 0; k <= kSteps; ++k) scan.push_back(patch.slope(0.8 * k / kSteps - 0.4));
    int events = 0, steepest = 0;
    double change = 0;
    for (int k = 0; k < kSteps; ++k) {
      events += scan[k].second != scan[k + 1].second;
      const double c = std::fabs(scan[k + 1].first - scan[k].first);
      if (c > change) change = c, steepest = k;
    }
    // Does the largest change between neighbours stay as the parameters close up?
    double low = 0.8 * steepest / kSteps - 0.4, high = low + 0.8 / kSteps;
    double at_low = scan[steepest].first, at_high = scan[steepest + 1].first;
    for (int halving = 0; halving < 20; ++halving) {
      const double middle = 0.5 * (low + high), at_middle = patch.slope(middle).first;
      if (std::fabs(at_middle - at_low) > std::fabs(at_high - at_middle)) {
        high = middle, at_high = at_middle;
      } else {
        low = middle, at_low = at_middle;
      }
    }
    largest[onset > 0] = std::fabs(at_high / at_low - 1);
    std::printf(
        "onset %.2f mm: %d events over ln E = -0.4..0.4, touched %d .. %d; largest change of the derivative "
        "%.1e between neighbours, %.1e as they close up to %.0e\n",
        onset, events, scan.front().second, scan.back().second, change / std::fabs(at_low),
        largest[onset > 0], high - low);
    EXPECT_GE(events, 1);
  }
  EXPECT_GT(largest[0], 1e-3);
  EXPECT_LT(largest[1], 1e-4 * largest[0]);
}

}  // namespace
}  // namespace rhytid
