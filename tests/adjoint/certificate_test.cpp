// The certificate on a scene with contact, slip, stick, viscosity and ligaments over ten steps, for every
// class of parameters; and that it notices wrong gradients.
#include "adjoint/certificate.h"

#include <gtest/gtest.h>

#include "adjoint/certificate_report.h"
#include "sim/core/parallel.h"
#include "tests/adjoint/gradient_checks.h"
#include "tests/support/small_scenes.h"

namespace rhytid::adjoint {
namespace {

/// Sources, diffusion time, k; per layer Young's modulus and relaxation time; μ and K apart (Poisson's ratio
/// and the relaxing fraction move them separately); friction.
const std::vector<ParameterGroup> kClasses = {
    {"source strengths", {"/ligaments/sources/left/strength", "/ligaments/sources/right/strength"}},
    {"diffusion time", {"/ligaments/diffusion_time"}},
    {"ligament k", {"/ligaments/stiffness"}},
    {"Young's moduli", {"/skin/layers/soft/youngs_modulus", "/skin/layers/film/youngs_modulus"}},
    {"soft modulus", {"/skin/layers/soft/youngs_modulus"}},
    {"film modulus", {"/skin/layers/film/youngs_modulus"}},
    {"relaxation times", {"/skin/layers/soft/relaxation_time", "/skin/layers/film/relaxation_time"}},
    {"bulk and shear", {"/skin/layers/soft/poissons_ratio", "/skin/layers/soft/relaxing_fraction"}},
    {"friction", {"/colliders/finger/friction/coefficient"}},
    {"places of sources",
     {"/ligaments/sources/left/position/0", "/ligaments/sources/left/position/1",
      "/ligaments/sources/right/position/0", "/ligaments/sources/right/position/1"}},
    {"path knots",
     {"/colliders/finger/path/0/position/2", "/colliders/finger/path/1/position/0",
      "/colliders/finger/path/1/position/2", "/colliders/finger/path/2/position/0",
      "/colliders/finger/path/2/position/1", "/colliders/finger/path/2/position/2"}},
};

std::vector<std::string> required_addresses() {
  std::vector<std::string> all;
  for (const ParameterGroup& g : kClasses)
    if (g.name != "soft modulus" && g.name != "film modulus")
      all.insert(all.end(), g.addresses.begin(), g.addresses.end());
  return all;
}

void expect_all_features(const CertifiedCase& c, const CertificateReport& report) {
  ASSERT_GE(c.run.steps.size(), 10u);
  EXPECT_GT(points_in(report, "contact finger", "pressed"), 50);
  EXPECT_GT(points_in(report, "contact finger", "onset"), 5);
  EXPECT_GT(points_in(report, "friction finger", "slip"), 50);
  EXPECT_GT(points_in(report, "friction finger", "stick"), 10);
  EXPECT_GT(points_in(report, "base contact", "pressed"), 50);
  // C^v − I of the skin: the first slices of the history.
  ASSERT_EQ(c.model().terms[0].name(), "skin");
  const auto skin = static_cast<Eigen::Index>(c.model().terms[0].history_size());
  EXPECT_GT(c.run.steps.back().state.history.head(skin).cwiseAbs().maxCoeff(), 1e-3);
}

void expect_sharp(const CertificateReport& report) {
  EXPECT_TRUE(report.passed());
  ASSERT_FALSE(report.taylor.empty());
  for (const TaylorSeries& s : report.taylor) {
    const std::string what = s.group + ", " + s.direction;
    EXPECT_TRUE(s.passed) << what << ": " << s.sentence;
    EXPECT_NE(s.linear, 0) << what;
    ASSERT_GE(s.slopes.size(), 3u) << what;
    for (std::size_t k = s.slopes.size() - 3; k < s.slopes.size(); ++k) {
      EXPECT_GT(s.slopes[k], 1.95) << what;
      EXPECT_LT(s.slopes[k], 2.05) << what;
    }
    // The noise must not have decided.
    EXPECT_GT(std::fabs(s.remainders.back()), 10 * report.noise) << what;
    EXPECT_LT(s.first_order_error, 1e-6) << what;
  }
  for (const CertificateCheck& c : report.checks) {
    if (c.name == "duality") {
      EXPECT_LT(c.figure, 1e-13);
    } else if (c.name == "gauge identity") {
      EXPECT_LT(c.figure, 1e-12);
    }
  }
}

TEST(Certificate, StackedClampedEveryParameterClass) {
  CertifiedCase c(test::drag_scene(2, 10), test::coarse());
  ASSERT_TRUE(c.run.complete) << c.run.failure;
  CertificateOptions options;
  options.addresses = required_addresses();
  options.groups = kClasses;
  const CertificateReport report = certify(c.scene_model, c.run, *c.output, c.weights, options);
  print(report);
  expect_all_features(c, report);
  expect_sharp(report);
  EXPECT_EQ(report.parameters.size(), options.addresses.size());
  // Two directions for groups of several parameters, one for the others.
  EXPECT_EQ(report.taylor.size(), 2u + 6 * 2 + 5);
}

TEST(Certificate, CompositeSlidingAllParameters) {
  CertifiedCase c(test::drag_scene(3, 10, "composite", "sliding"),
                  {"/skin/surface/grid/cells=[3,2]", "/skin/composite_order=2"});
  ASSERT_TRUE(c.run.complete) << c.run.failure;
  const CertificateReport report = certify(c.scene_model, c.run, *c.output, c.weights);
  print(report);
  expect_all_features(c, report);
  expect_sharp(report);
  EXPECT_EQ(report.without_effect, heights_of_sources(c.scene_model.scene()));
  // The finger turns at frame 3.
  EXPECT_EQ(report.not_smooth, std::vector<std::string>{"/time/offset"});
  EXPECT_EQ(report.parameters.size(),
            all_parameters(c.scene_model.scene()).size() - report.without_effect.size() - 1);
}

/// A small case for what needs no fine mesh, run once.
const CertifiedCase& small_case() {
  static const CertifiedCase c(test::drag_scene(2, 6),
                               {"/skin/surface/grid/cells=[3,2]", "/skin/layers/soft/order=1"});
  return c;
}

const CertificateCheck& check(const CertificateReport& report, const std::string& name) {
  for (const CertificateCheck& c : report.checks)
    if (c.name == name) return c;
  throw std::runtime_error("no check " + name);
}

const NativeBlock& model_block(const CertifiedCase& c, const std::string& name) {
  return c.model().native_block(name);
}

// A certificate that cannot fail says nothing: one block of the gradient off by a thousandth.
TEST(Certificate, NoticesAWrongAdjoint) {
  const CertifiedCase& c = small_case();
  ASSERT_TRUE(c.run.complete) << c.run.failure;
  for (const char* block : {"layer/soft", "ligaments/b", "collider/finger"}) {
    CertificateOptions options;
    options.adjoint = [block](const Model& model, const auto&... rest) {
      AdjointResult result = adjoint_sweep(model, rest...);
      const NativeBlock& b = model.native_block(block);
      result.native_bar.segment(b.offset, b.size) *= 1.001;
      return result;
    };
    const CertificateReport report = certify(c.scene_model, c.run, *c.output, c.weights, options);
    EXPECT_FALSE(report.passed()) << block;
    EXPECT_EQ(check(report, "duality").verdict, Verdict::fail) << block;
    // The random direction gives every parameter a like share; the gradient is that of the finger's radius.
    for (const TaylorSeries& s : report.taylor)
      EXPECT_EQ(s.passed, s.direction == "gradient" && std::string(block) != "collider/finger") << block;
    const bool has_stiffness = !model_block(c, block).stiffness_like.empty();
    EXPECT_EQ(check(report, "gauge identity").verdict, has_stiffness ? Verdict::fail : Verdict::pass)
        << block;
  }
}

// A run may end at a residual far above those of the runs that the noise was measured from; a gradient that is a
// hundred thousandth off leaves as little, but in proportion to the step.
TEST(Certificate, ADeepRemainderThatIsNoiseIsNoErrorOfTheGradient) {
  const CertifiedCase& c = small_case();
  const FunctionalDifference functional(c.scene_model, c.run, *c.output, c.weights, c.options.minimiser);
  const ParameterSpace space(c.scene_model, {"/skin/layers/soft/youngs_modulus"});
  const AdjointResult adjoint = adjoint_sweep(c.model(), c.scene_model.native(), c.run, *c.output, c.weights);
  const VectorXd gradient = space.jacobian().transpose() * adjoint.native_bar, v = VectorXd::Ones(1);
  constexpr double told = 1e-30;
  TaylorOptions options;
  options.first_step = 1e-4;  // a thousandth of its eighth is far below what rounding allows
  const TaylorSeries right = taylor_test(functional, space, v, gradient, told, options);
  EXPECT_TRUE(right.passed) << right.sentence;
  EXPECT_GT(right.noise, told) << "no run's residual showed: this test tests nothing";
  const TaylorSeries wrong = taylor_test(functional, space, v, 1.00001 * gradient, told, options);
  EXPECT_FALSE(wrong.passed) << wrong.sentence;

  // An error that the parabola half hides at the deepest step is no noise either: its remainders are smooth.
  const double noise = measure_noise(functional, space, v);
  const TaylorSeries deep = taylor_test(functional, space, v, gradient, noise, {});
  ASSERT_TRUE(deep.passed) << deep.sentence;
  const std::size_t last = deep.steps.size() - 1;
  ASSERT_LT(deep.steps[last], deep.steps[last - 1] / 8);
  const double curvature = deep.remainders[last - 1] / (deep.steps[last - 1] * deep.steps[last - 1]);
  for (const double share : {-1.5, -0.5, 0.5}) {
    const VectorXd off = gradient - share * curvature * deep.steps[last] * v;
    const TaylorSeries hidden = taylor_test(functional, space, v, off, noise, {});
    EXPECT_FALSE(hidden.passed) << share << ": " << hidden.sentence;
    EXPECT_EQ(hidden.noise, noise) << share;
  }
}

TEST(Certificate, WhatIsNoNumberDoesNotPass) {
  const CertifiedCase& c = small_case();
  CertificateOptions options;
  options.adjoint = [](const Model& model, const auto&... rest) {
    AdjointResult result = adjoint_sweep(model, rest...);
    result.native_bar[model.native_block("collider/finger").offset] = std::nan("");
    return result;
  };
  const CertificateReport report = certify(c.scene_model, c.run, *c.output, c.weights, options);
  EXPECT_EQ(check(report, "duality").verdict, Verdict::fail);
  EXPECT_FALSE(report.passed());
}

// A tighter run does not help an error bar that is wrong, though it helps one that only lacks second order.
TEST(Certificate, NoticesAWrongErrorBar) {
  const CertifiedCase& c = small_case();
  CertificateOptions options;
  int calls = 0;
  options.adjoint = [&calls](const Model& model, const auto&... rest) {
    ++calls;
    AdjointResult result = adjoint_sweep(model, rest...);
    result.residual_error *= 3;
    return result;
  };
  const CertificateReport report = certify(c.scene_model, c.run, *c.output, c.weights, options);
  EXPECT_EQ(check(report, "error bar").verdict, Verdict::fail);
  EXPECT_GT(check(report, "error bar").figure, 1.5);
  EXPECT_GE(calls, 4);  // of the gradient, of its repetition and of two loose runs at the least
}

// A tighter run that cannot be compared leaves figure, verdict and what they are of.
TEST(Certificate, AnErrorBarThatATighterRunCannotTestKeepsItsSentence) {
  const CertifiedCase& c = small_case();
  CertificateOptions options;
  int loose = 0;
  options.adjoint = [&](const Model& model, const VectorXd& native, const Trajectory& run,
                        const auto&... rest) {
    AdjointResult result = adjoint_sweep(model, native, run, rest...);
    if (&run == &c.run) return result;
    if (++loose == 2) throw GradientError("no factor");
    result.residual_error *= 3;
    return result;
  };
  const CertificateReport report = certify(c.scene_model, c.run, *c.output, c.weights, options);
  EXPECT_EQ(loose, 2);
  const CertificateCheck& bar = check(report, "error bar");
  EXPECT_EQ(bar.verdict, Verdict::fail);
  EXPECT_GT(bar.figure, 1.5);
  EXPECT_NE(bar.sentence.find("adjoint times residual says"), std::string::npos) << bar.sentence;
  EXPECT_NE(bar.sentence.find("a tighter run has no gradient: no factor"), std::string::npos) << bar.sentence;
}

// Both sweeps wrong in the same way: duality cannot see it, the Taylor test must.
TEST(Certificate, NoticesConsistentlyWrongSweeps) {
  const CertifiedCase& c = small_case();
  for (const char* block : {"ligaments/b", "layer/film"}) {
    CertificateOptions options;
    options.each_parameter = true;
    options.addresses = {"/ligaments/sources/left/strength", "/skin/layers/film/relaxation_time"};
    options.adjoint = [block](const Model& model, const auto&... rest) {
      AdjointResult result = adjoint_sweep(model, rest...);
      const NativeBlock& b = model.native_block(block);
      result.native_bar.segment(b.offset, b.size) *= 0.99;
      return result;
    };
    options.tangent = [block](const Model& model, const VectorXd& native, const Trajectory& run,
                              const Output& output, MatrixXd directions) {
      const NativeBlock& b = model.native_block(block);
      directions.middleRows(b.offset, b.size) *= 0.99;
      return tangent_sweep(model, native, run, output, directions);
    };
    const CertificateReport report = certify(c.scene_model, c.run, *c.output, c.weights, options);
    EXPECT_FALSE(report.passed()) << block;
    EXPECT_EQ(check(report, "duality").verdict, Verdict::pass) << block;
    const std::string own = block == std::string("ligaments/b") ? "left strength" : "film relaxation_time";
    for (const TaylorSeries& s : report.taylor)
      if (s.group == own) {
        EXPECT_FALSE(s.passed) << own;
        EXPECT_LT(s.slopes.back(), 1.5) << own;
        EXPECT_NEAR(s.first_order_error, 0.01, 0.002) << own;
      }
  }
}

// Whoever is under test may not decide what is left out of the test.
TEST(Certificate, NoticesAMissingDerivative) {
  const CertifiedCase& c = small_case();
  CertificateOptions options;
  options.addresses = {"/ligaments/sources/left/strength", "/skin/layers/film/youngs_modulus"};
  options.adjoint = [](const Model& model, const auto&... rest) {
    AdjointResult result = adjoint_sweep(model, rest...);
    const NativeBlock& b = model.native_block("ligaments/b");
    result.native_bar.segment(b.offset, b.size).setZero();
    return result;
  };
  options.tangent = [](const Model& model, const VectorXd& native, const Trajectory& run,
                       const Output& output, MatrixXd directions) {
    const NativeBlock& b = model.native_block("ligaments/b");
    directions.middleRows(b.offset, b.size).setZero();
    return tangent_sweep(model, native, run, output, directions);
  };
  const CertificateReport report = certify(c.scene_model, c.run, *c.output, c.weights, options);
  EXPECT_EQ(report.without_effect, std::vector<std::string>{"/ligaments/sources/left/strength"});
  EXPECT_EQ(check(report, "duality").verdict, Verdict::pass);
  EXPECT_EQ(check(report, "no effect").verdict, Verdict::fail);
  EXPECT_FALSE(report.passed());
}

TEST(Certificate, NoticesSweepsThatDoNotRepeat) {
  const CertifiedCase& c = small_case();
  CertificateOptions options;
  options.addresses = {"/ligaments/stiffness"};
  int calls = 0;
  options.adjoint = [&calls](const auto&... arguments) {
    AdjointResult result = adjoint_sweep(arguments...);
    result.native_bar[0] *= 1 + 1e-15 * calls++;
    return result;
  };
  const CertificateReport report = certify(c.scene_model, c.run, *c.output, c.weights, options);
  EXPECT_EQ(check(report, "repeatability").verdict, Verdict::fail);
}

TEST(Certificate, StopsWhenAskedAndSaysSo) {
  const CertifiedCase& c = small_case();
  const auto stop = [](const std::string& part, int done, int) {
    return part != "Taylor test of joint, random" || done < 3;
  };
  const CertificateReport report = certify(c.scene_model, c.run, *c.output, c.weights, {}, stop);
  EXPECT_TRUE(report.interrupted);
  EXPECT_FALSE(report.passed());
  EXPECT_EQ(check(report, "duality").verdict, Verdict::pass);
  EXPECT_TRUE(report.taylor.empty());
}

TEST(Certificate, ParametersWithoutEffectAreNamed) {
  CertifiedCase c(test::drag_scene(2, 2),
                  {"/skin/surface/grid/cells=[3,2]", "/skin/layers/film/relaxing_fraction=0"});
  ASSERT_TRUE(c.run.complete) << c.run.failure;
  const CertificateReport report = certify(c.scene_model, c.run, *c.output, c.weights);
  EXPECT_THAT(report.without_effect, testing::Contains("/skin/layers/film/relaxation_time"));
  EXPECT_EQ(check(report, "no effect").verdict, Verdict::pass);
  // Zero leaves the branch out: there is no such parameter, and a scene that has one is another model.
  EXPECT_THROW((void)describe_parameter(c.scene_model.scene(), "/skin/layers/film/relaxing_fraction"),
               InputError);
  Scene other = c.scene_model.scene();
  other.skin.layers[1].relaxing_fraction = 0.5;
  EXPECT_THROW((void)c.scene_model.native(other), InputError);
  CertificateOptions nothing;
  nothing.addresses = {"/skin/layers/film/relaxation_time"};
  EXPECT_FALSE(certify(c.scene_model, c.run, *c.output, c.weights, nothing).passed());
  CertificateOptions unknown;
  unknown.addresses = {"/ligaments/stiffnes"};
  EXPECT_THROW((void)certify(c.scene_model, c.run, *c.output, c.weights, unknown), InputError);
}

/// A bar of one elastic layer, bent by its ends, under a ball that never touches it.
CertifiedCase bar_case(const std::vector<std::string>& settings = {}) {
  return CertifiedCase(R"({
    "name": "bar",
    "skin": {"surface": {"grid": {"size": [20, 4], "cells": [4, 1]}}, "order": 2, "rim": "free",
      "layers": [{"name": "rubber", "thickness": 1, "order": 2, "youngs_modulus": "1 MPa", "poissons_ratio": 0.3,
                  "relaxing_fraction": 0}],
      "held": [{"name": "left", "box": {"low": [-10, -2, 0], "high": [-10, 2, 0]}},
               {"name": "right", "box": {"low": [10, -2, 0], "high": [10, 2, 0]},
                "path": [{"time": 0, "displacement": [0, 0, 0]}, {"time": 1, "displacement": [1, 0.5, 1.5]}]}]},
    "colliders": [{"name": "ball", "shape": "sphere", "radius": 2, "path": [{"time": 0, "position": [0, 0, 90]}]}],
    "time": {"frame_rate": 2, "frames": 2}
  })",
                       settings);
}

// Displacements that are given leave a single modulus without effect: its derivative is rounding, not zero.
TEST(Certificate, ADerivativeThatIsRoundingIsNone) {
  const CertifiedCase c = bar_case();
  ASSERT_TRUE(c.run.complete) << c.run.failure;
  CertificateOptions thorough;
  thorough.each_parameter = true;
  const CertificateReport report = certify(c.scene_model, c.run, *c.output, c.weights, thorough);
  print(report);
  EXPECT_TRUE(report.passed());
  EXPECT_THAT(report.without_effect, testing::Contains("/skin/layers/rubber/youngs_modulus"));
  EXPECT_EQ(report.parameters.size(), 2u);  // Poisson's ratio and stiffening
  EXPECT_EQ(check(report, "no effect").verdict, Verdict::pass);
}

// With nothing to test there is no certificate; that no derivative is missing can be said all the same.
TEST(Certificate, NothingWithAnEffectIsNoMissingDerivative) {
  const CertifiedCase c = bar_case({"/skin/layers/rubber/relaxing_fraction=0.5", "/time/frames=4"});
  CertificateOptions options;
  options.addresses = {"/colliders/ball/radius", "/colliders/ball/stiffness"};
  const CertificateReport report = certify(c.scene_model, c.run, *c.output, c.weights, options);
  print(report);
  EXPECT_EQ(report.without_effect, options.addresses);
  EXPECT_GT(report.noise, 0);
  EXPECT_LT(report.noise, 1e-12);
  for (const CertificateCheck& one : report.checks)
    EXPECT_EQ(one.verdict == Verdict::fail, one.name == "Taylor slope") << one.name;
  EXPECT_FALSE(report.passed());
}

TEST(Certificate, TextAndJsonAgree) {
  const CertifiedCase& c = small_case();
  CertificateOptions options;
  options.addresses = {"/skin/layers/film/youngs_modulus"};
  const CertificateReport report = certify(c.scene_model, c.run, *c.output, c.weights, options);
  const std::string text = certificate_text(report);
  const nlohmann::json json = nlohmann::json::parse(certificate_json(report).dump());
  EXPECT_EQ(json["passed"], report.passed());
  EXPECT_NE(text.find(report.passed() ? "is certified" : "NOT certified"), std::string::npos);
  ASSERT_EQ(json["checks"].size(), report.checks.size());
  for (const CertificateCheck& one : report.checks) EXPECT_NE(text.find(one.sentence), std::string::npos);
  EXPECT_EQ(json["taylor"][0]["remainders"].size(), report.taylor[0].steps.size());
  EXPECT_EQ(json["steps"]["smallest_pivot"].size(), c.run.steps.size());
}

}  // namespace
}  // namespace rhytid::adjoint
