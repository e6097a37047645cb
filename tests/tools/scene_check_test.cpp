// What check says of a scene: bundled scenes rest in equilibrium, what a scene does not need is not there,
// and doubtful settings are named.
#include <gmock/gmock.h>

#include <ctime>
#include <filesystem>
#include <nlohmann/json.hpp>
#include <numbers>

#include "sim/core/parallel.h"
#include "sim/scene/load.h"
#include "tests/support/paths.h"
#include "tests/support/real_data.h"
#include "tests/support/small_scenes.h"
#include "tools/model_size.h"
#include "tools/scene_review.h"

namespace rhytid::tools {
namespace {

using testing::AnyOf;
using testing::Contains;
using testing::Each;
using testing::ElementsAre;
using testing::HasSubstr;
using testing::IsEmpty;
using testing::Not;

/// Bundled scenes that need no file from elsewhere.
std::vector<std::string> bundled_scenes() {
  std::vector<std::string> files;
  for (const auto& entry : std::filesystem::directory_iterator(source_dir() + "/data/scenes")) {
    const auto file = entry.path() / "scene.json";
    const bool needs_head = entry.path().filename().string().starts_with("head_");
    if (!std::filesystem::exists(file) || needs_head) continue;
    files.push_back(file.string());
  }
  std::sort(files.begin(), files.end());
  return files;
}

Scene small_scene(const std::vector<std::string>& changes = {}) {
  return parse_scene_text(test::drag_scene(2, 4), "small.json", changes);
}

std::vector<std::string> review(const std::vector<std::string>& changes) {
  const SceneModel scene_model(small_scene(changes));
  return review_scene(scene_model, measure_step_cost(scene_model));
}

TEST(SceneWarnings, offset_past_all_motion) {
  const auto warnings = [](const std::string& offset) {
    return scene_warnings(small_scene({"/time/offset=" + offset}));
  };
  EXPECT_THAT(warnings("2 s"), Contains(HasSubstr("/time/offset: with 2 s the run covers 2 s to 2.1")));
  EXPECT_THAT(warnings("-0.2 s"), Contains(HasSubstr("where nothing moves")));
  EXPECT_THAT(warnings("-0.1 s"), Not(Contains(HasSubstr("/time/offset"))));
  EXPECT_THAT(warnings("0.9 s"), Not(Contains(HasSubstr("/time/offset"))));
}

TEST(BundledScenes, rest_in_equilibrium) {
  const std::vector<std::string> files = bundled_scenes();
  ASSERT_GE(files.size(), 3u);
  for (const std::string& file : files) {
    SCOPED_TRACE(file);
    const SceneModel scene_model(load_scene(file));
    const StepCost cost = measure_step_cost(scene_model);
    // Colliders stand off the skin at time 0, so every force is a product with an exact zero. What is pre-stretched
    // settles first.
    if (scene_model.scene().skin.pre_stretch)
      EXPECT_GT(cost.rest_residual, 0);
    else
      EXPECT_EQ(cost.rest_residual, 0);
    EXPECT_TRUE(cost.positive_definite);
    const std::vector<std::string> warnings = review_scene(scene_model, cost);
    EXPECT_THAT(warnings, Not(Contains(HasSubstr("into the skin at time 0"))));
    EXPECT_THAT(warnings, Not(Contains(HasSubstr("never touches"))));
    // Nothing that is not read, and no element that locks where it is squeezed.
    EXPECT_THAT(scene_warnings(scene_model.scene()),
                Each(Not(AnyOf(HasSubstr("is not used"), HasSubstr("locks")))));
  }
}

TEST(BundledScenes, head_rests_in_equilibrium) {
  RHYTID_REAL_FILE_OR_SKIP(head, kHeadFile);
  for (const std::string name : {"head_forehead", "head_fit", "head_forehead_drag", "head_temple_drag"}) {
    const SceneModel scene_model(
        load_scene(source_dir() + "/data/scenes/" + name + "/scene.json", {"/skin/surface/file=" + head}));
    const StepCost cost = measure_step_cost(scene_model);
    EXPECT_EQ(cost.rest_residual, 0) << name;
    if (name == "head_forehead") {
      EXPECT_THAT(review_scene(scene_model, cost), Each(HasSubstr("too coarse to wrinkle")));
    }
  }
}

TEST(SceneReview, says_when_bone_and_skin_are_apart_at_rest) {
  const auto sphere = [](const std::string& height) {
    return std::vector<std::string>{R"(/base={"shape": "sphere", "radius": "200 mm", "centre": [0, 0, )" +
                                    height + "]}"};
  };
  EXPECT_THAT(review(sphere("-206")),
              Contains(HasSubstr("below the inner surface at rest; the gap at rest is")));
  EXPECT_THAT(review(sphere("-200.5")), Contains(HasSubstr("into the skin at rest")));
  EXPECT_THAT(review({}), Not(Contains(HasSubstr("the gap at rest is subtracted"))));
}

TEST(BundledScenes, residual_is_seen_when_the_rest_state_is_none) {
  const SceneModel scene_model(small_scene({"/colliders/finger/path/0/position=[-2, 0, 4.5]"}));
  const StepCost cost = measure_step_cost(scene_model);
  EXPECT_GT(cost.rest_residual, 1e-3);
  EXPECT_THAT(review_scene(scene_model, cost), Contains(HasSubstr("into the skin at time 0")));
}

TEST(LeftOut, a_minimal_scene_neither_allocates_nor_computes_what_it_lacks) {
  const SceneModel minimal(parse_scene_text(R"({
    "name": "minimal",
    "skin": {"surface": {"grid": {"size": [8, 8], "cells": [2, 2]}}, "order": 2,
             "layers": [{"name": "a", "thickness": 1, "youngs_modulus": 0.1, "relaxing_fraction": 0}]},
    "time": {"frames": 1}
  })",
                                            "minimal.json"));
  const Model& model = minimal.model();
  ASSERT_EQ(model.terms.size(), 1u);
  EXPECT_EQ(model.terms[0].name(), "skin (elastic)");
  EXPECT_EQ(model.history_size(), 0u);
  EXPECT_THAT(model.shapes, IsEmpty());
  EXPECT_EQ(model.native_blocks.size(), 1u);
  EXPECT_THAT(minimal.source_positions(), IsEmpty());
  EXPECT_THAT(minimal.column_triangles(), IsEmpty());
  for (const FeatureNote& note : minimal.features()) EXPECT_FALSE(note.present) << note.feature;
  const Trajectory run = simulate(model, minimal.native(), minimal.run_options());
  EXPECT_TRUE(run.complete);
  EXPECT_EQ(run.steps[0].state.history.size(), 0);
  EXPECT_EQ(run.steps[0].state.u.norm(), 0);
}

TEST(LeftOut, every_feature_adds_its_own_term_and_work) {
  const auto names = [](const SceneModel& s) {
    std::vector<std::string> list;
    for (const Term& t : s.model().terms) list.push_back(t.name());
    return list;
  };
  const SceneModel full(small_scene());
  EXPECT_THAT(names(full),
              ElementsAre("skin", "ligaments", "base contact", "contact finger", "friction finger"));
  measure_step_cost(full);
  for (const Term& term : full.model().terms) {
    EXPECT_GT(term.counters().gradient + term.counters().energy, 0) << term.name();
    EXPECT_GT(term.counters().hessian, 0) << term.name();
  }
  const SceneModel frictionless(small_scene({"/colliders/finger/friction/coefficient=0"}));
  EXPECT_THAT(names(frictionless), ElementsAre("skin", "ligaments", "base contact", "contact finger"));
  EXPECT_LT(frictionless.model().history_size(), full.model().history_size());
}

TEST(WrinkleScale, is_the_film_on_a_half_space) {
  // h = 0.1 mm, ratio 200, equal Poisson's ratios: 25.5 h and 1.52 % (Chen and Hutchinson).
  const SceneModel scene_model(
      small_scene({"/skin/layers/film/thickness=0.1", "/skin/layers/film/youngs_modulus=4",
                   "/skin/layers/soft/youngs_modulus=0.02", "/skin/surface/grid/cells=[8, 6]"}));
  const auto scale = wrinkle_scale(scene_model);
  ASSERT_TRUE(scale);
  EXPECT_NEAR(scale->wavelength, 2.548, 0.001);
  EXPECT_NEAR(scale->critical_strain, 0.015206, 1e-5);
  // Cells of 2 × 2 mm: edges 2, 2, 2√2 with half of the boundary's edges counted once; order 2 halves them.
  EXPECT_NEAR(scale->node_spacing, (2 + 2 + 2 * std::numbers::sqrt2) / 3 / 2, 1e-12);
  EXPECT_THAT(review_scene(scene_model, measure_step_cost(scene_model)),
              Contains(HasSubstr("too coarse to wrinkle")));
  EXPECT_FALSE(wrinkle_scale(SceneModel(small_scene({"/skin/layers/film/youngs_modulus=0.02"}))));
}

TEST(Review, names_what_holds_nothing) {
  EXPECT_THAT(review({"/skin/rim=free"}), Not(Contains(HasSubstr("a free rim"))));  // the ligaments hold it
  Scene loose = small_scene({"/skin/rim=free"});
  loose.ligaments.reset();
  const SceneModel on_base(loose);
  EXPECT_THAT(review_scene(on_base, measure_step_cost(on_base)), Contains(HasSubstr("the base only pushes")));
  loose.base.reset();
  const SceneModel nothing(loose);
  EXPECT_THAT(review_scene(nothing, measure_step_cost(nothing)),
              Contains(HasSubstr("neither ligaments nor base")));
}

// Processor time on one thread, which does not know what else the machine does. A factor of two was seen; twice that
// is left for iterations and for caches that others use.
TEST(Estimate, tells_what_a_run_takes) {
  const int threads = num_threads();
  set_num_threads(1);
  const SceneModel scene_model(small_scene());
  const StepCost cost = measure_step_cost(scene_model);
  const std::clock_t before = std::clock();
  const Trajectory run = simulate(scene_model.model(), scene_model.native(), scene_model.run_options());
  const double seconds = static_cast<double>(std::clock() - before) / CLOCKS_PER_SEC;
  set_num_threads(threads);
  ASSERT_TRUE(run.complete);
  const double expected = cost.analysis_seconds + static_cast<double>(run.steps.size()) * cost.step_seconds();
  EXPECT_GT(expected, seconds / 4);
  EXPECT_LT(expected, seconds * 4);
}

// Without a term that lags there is one pass, whatever the scene says.
TEST(Estimate, later_passes_cost_what_they_do) {
  StepCost cost;
  cost.residual_seconds = 3;
  cost.hessian_seconds = cost.factor_seconds = cost.solve_seconds = 1;
  cost.direction_seconds = 2;
  cost.state_seconds = 5;
  // Four evaluations for three steps; Hessians and factors are shared by the passes.
  EXPECT_DOUBLE_EQ(cost.step_seconds(1), 5 + expected_iterations * 5 + expected_factors * 4);
  EXPECT_DOUBLE_EQ(cost.step_seconds(3), 5 + 3 * expected_iterations * 5 + expected_factors * 4);
}

const std::string kHeldSide =
    R"(/skin/held=[{"name":"side","box":{"low":[-8,-6,-9],"high":[-7.9,6,9]},"path":[)"
    R"({"time":0,"displacement":[0,0,0]},{"time":0.5,"displacement":[16,3,1]}]}])";

TEST(Review, held_parts_that_jump_with_the_clock) {
  const auto jumps = Contains(HasSubstr("held parts rest in frame 0 and are 8 mm away"));
  EXPECT_THAT(review({kHeldSide, "/time/offset=0.25"}), jumps);
  EXPECT_THAT(review({kHeldSide}), Not(jumps));
  EXPECT_THAT(review({kHeldSide, "/time/offset=-0.25"}), Not(jumps));
}

// Frame 0 is the rest state also then; its residual is that of the colliders alone.
TEST(Rest, is_at_rest_whatever_the_clock_of_held_parts) {
  const SceneModel ahead(small_scene({kHeldSide, "/time/offset=0.25", "/colliders=[]"}));
  const StepCost cost = measure_step_cost(ahead);
  EXPECT_EQ(cost.rest_residual, 0);
  EXPECT_TRUE(cost.positive_definite);
}

// A part that is far away at once inverts elements: no residual, and no zero for it.
TEST(Rest, has_no_residual_outside_the_domain) {
  const SceneModel torn(
      small_scene({R"(/skin/held=[{"name":"side","box":{"low":[-8,-6,-9],"high":[-7.9,6,9]},"path":[)"
                   R"({"time":0,"displacement":[30,0,0]},{"time":1,"displacement":[31,0,0]}]}])"}));
  const StepCost cost = measure_step_cost(torn);
  EXPECT_TRUE(std::isinf(cost.rest_residual));
  EXPECT_FALSE(cost.positive_definite);
}

TEST(Review, doubts_moduli_that_no_skin_has) {
  const auto doubt = HasSubstr("/skin/layers/film/youngs_modulus: 60 MPa is far from skin's");
  EXPECT_THAT(review({"/skin/layers/film/youngs_modulus=60"}), Contains(doubt));
  EXPECT_THAT(review({"/skin/layers/film/youngs_modulus=60 kPa"}), Each(Not(HasSubstr("far from"))));
  EXPECT_THAT(review({"/skin/layers/soft/youngs_modulus=20 Pa"}),
              Contains(HasSubstr("/skin/layers/soft/youngs_modulus: 20 Pa is far from")));
}

TEST(Review, names_colliders_and_sources_that_miss) {
  EXPECT_THAT(review({"/colliders/finger/path/1/position=[-2, 0, 5.5]",
                      "/colliders/finger/path/2/position=[-2, 0, 5.5]"}),
              Contains(HasSubstr("never touches the skin")));
  EXPECT_THAT(review({"/colliders/finger/path/1/position=[-6, 0, 4.5]"}),
              Contains(HasSubstr("from the rim")));
  EXPECT_THAT(review({"/ligaments/sources/left/position=[-5, 1, 40]"}), Contains(HasSubstr("was moved by")));
  EXPECT_THAT(review({"/ligaments/sources/left/radius=0.05"}), Contains(HasSubstr("contains no node")));
}

}  // namespace
}  // namespace rhytid::tools
