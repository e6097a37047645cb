// What a scene does not have costs nothing: every feature's counts of work and memory are zero without it,
// and none of those that matter is zero with it, over a run and both sweeps of derivatives.
#include "sim/scene/feature_work.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <functional>

#include "adjoint/sweeps.h"
#include "sim/surface/heat_map.h"
#include "sim/surface/point_lattice.h"
#include "tests/adjoint/certified_case.h"
#include "tests/support/small_scenes.h"

namespace rhytid::adjoint {
namespace {

/// Everything at once, the base an IMLS surface.
Scene full_scene() {
  return parse_scene_text(test::drag_scene(1, 2), "full.json",
                          {"/skin/surface/grid/cells=[4,3]", "/skin/layers/soft/order=1", "/base/shape=imls",
                           R"(/skin/pre_stretch={"stretch": 1.02})"});
}

/// Builds, simulates, sweeps: all that a fit does. `heat_maps` and `lattices`: of the process, by this.
struct Worked {
  std::vector<FeatureWork> features;
  long heat_maps = 0, lattices = 0;

  explicit Worked(const Scene& scene) {
    const long maps_before = heat_maps_solved(), lattices_before = PointLattice::made();
    const SceneModel scene_model(scene);
    const Model& model = scene_model.model();
    RunOptions options = scene_model.run_options();
    options.minimiser = certificate_minimiser(options.minimiser);
    const Trajectory run = simulate(model, scene_model.native(), options);
    EXPECT_TRUE(run.complete) << run.failure;
    const auto output = default_output(model, 10);
    const auto weights = random_weights(*output, run.frames(), 7);
    const VectorXd gradient = adjoint_sweep(model, scene_model.native(), run, *output, weights).native_bar;
    (void)tangent_sweep(model, scene_model.native(), run, *output, gradient);
    features = feature_work(scene_model);
    heat_maps = heat_maps_solved() - maps_before;
    lattices = PointLattice::made() - lattices_before;
    // Every term but the skin's own is some feature's, so that none works unseen.
    std::vector<int> owners(model.terms.size(), 0);
    for (const FeatureNote& note : scene_model.features())
      for (const int t : note.terms) ++owners[static_cast<std::size_t>(t)];
    for (std::size_t t = 0; t < owners.size(); ++t)
      if (model.terms[t].name().find("skin") != 0) {
        EXPECT_EQ(owners[t], 1) << model.terms[t].name();
      }
  }
  const FeatureWork& of(const std::string& feature) const {
    for (const FeatureWork& w : features)
      if (w.feature == feature) return w;
    throw ContractError("no feature " + feature);
  }
};

void expect_work(const FeatureWork& w) {
  SCOPED_TRACE(w.feature);
  EXPECT_TRUE(w.present);
  EXPECT_FALSE(w.is_nothing());
  for (const long calls : {w.prepared, w.energies, w.gradients, w.hessians, w.tangents, w.adjoints, w.points})
    EXPECT_GT(calls, 0);
  EXPECT_GT(w.bytes, 0u);
}

void expect_nothing(const FeatureWork& w) {
  SCOPED_TRACE(w.feature);
  EXPECT_FALSE(w.present);
  EXPECT_TRUE(w.is_nothing());
  EXPECT_EQ(w.prepared + w.energies + w.gradients + w.hessians + w.updates + w.tangents + w.adjoints, 0);
  EXPECT_EQ(w.heat_maps + w.points, 0);
  EXPECT_EQ(w.history + w.shapes + w.neighbours + w.bytes, 0u);
}

TEST(FeatureWork, IsCountedForAllThatTheSceneHas) {
  const Worked full(full_scene());
  ASSERT_EQ(full.features.size(), 6u);
  for (const FeatureWork& w : full.features) expect_work(w);
  EXPECT_GT(full.of("viscosity").history, 0u);
  EXPECT_GT(full.of("viscosity").updates, 0);
  EXPECT_GT(full.of("friction").history, 0u);
  EXPECT_GT(full.of("friction").updates, 0);
  EXPECT_EQ(full.of("ligaments").heat_maps, 1);
  EXPECT_EQ(full.heat_maps, 1);
  EXPECT_EQ(full.of("base contact").shapes, 1u);
  EXPECT_GT(full.of("base contact").neighbours, 0u);
  EXPECT_EQ(full.lattices, 1);
  EXPECT_EQ(full.of("contact").shapes, 1u);
  EXPECT_EQ(full.of("contact").neighbours, 0u) << "a sphere has no neighbour lists";
}

TEST(FeatureWork, IsZeroForWhatASceneLacksAndNothingElse) {
  const std::vector<std::pair<std::vector<std::string>, std::function<void(Scene&)>>> removals = {
      {{"viscosity"},
       [](Scene& s) {
         for (LayerScene& l : s.skin.layers) l.relaxing_fraction = 0;
       }},
      {{"viscosity"}, [](Scene& s) { s.time.damper = DamperScheme::none; }},
      {{"pre-stretch"}, [](Scene& s) { s.skin.pre_stretch.reset(); }},
      {{"ligaments"}, [](Scene& s) { s.ligaments.reset(); }},
      {{"base contact"}, [](Scene& s) { s.base.reset(); }},
      {{"friction"}, [](Scene& s) { s.colliders[0].friction.reset(); }},
      {{"friction"}, [](Scene& s) { s.colliders[0].friction->coefficient = 0; }},
      {{"contact", "friction"}, [](Scene& s) { s.colliders.clear(); }}};
  for (const auto& [absent, remove] : removals) {
    SCOPED_TRACE("without " + absent[0]);
    Scene scene = full_scene();
    remove(scene);
    const Worked worked(scene);
    ASSERT_EQ(worked.features.size(), 6u);
    for (const FeatureWork& w : worked.features)
      if (std::find(absent.begin(), absent.end(), w.feature) != absent.end()) {
        expect_nothing(w);
      } else {
        expect_work(w);
      }
    EXPECT_EQ(worked.heat_maps, absent[0] == "ligaments" ? 0 : 1);
    EXPECT_EQ(worked.lattices, absent[0] == "base contact" ? 0 : 1);
  }
}

TEST(FeatureWork, MinimalSceneHasNone) {
  const Worked minimal(parse_scene_text(R"({
    "name": "minimal",
    "skin": {"surface": {"grid": {"size": [8, 8], "cells": [2, 2]}}, "order": 2,
             "layers": [{"name": "a", "thickness": 1, "youngs_modulus": 0.1, "relaxing_fraction": 0}]},
    "time": {"frames": 2}
  })",
                                        "minimal.json"));
  ASSERT_EQ(minimal.features.size(), 6u);
  for (const FeatureWork& w : minimal.features) expect_nothing(w);
  EXPECT_EQ(minimal.heat_maps, 0);
  EXPECT_EQ(minimal.lattices, 0);
}

}  // namespace
}  // namespace rhytid::adjoint
