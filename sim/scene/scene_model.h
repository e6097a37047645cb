// From a scene to a model: mesh, the terms the scene needs (and no others), native parameters; and the map
// between scene parameters (addresses) and native ones.
//
// The scene is made of parts (parts/scene_part.h): skin, ligaments, base, colliders, each with its native
// parameters, terms and derivatives; the native vector and the terms follow that order.
#pragma once

#include <array>
#include <memory>
#include <string>
#include <vector>

#include "sim/scene/parts/scene_part.h"
#include "sim/scene/scene.h"
#include "sim/time/model.h"
#include "sim/time/simulate.h"

namespace rhytid {

class LigamentPart;

class SceneModel {
 public:
  /// Builds everything. Throws InputError (files, meshes, sources that cannot be placed).
  explicit SceneModel(Scene scene);

  const Scene& scene() const { return scene_; }
  const Model& model() const { return model_; }
  /// Run options as the scene says.
  RunOptions run_options() const;
  /// Features used and left out.
  const std::vector<FeatureNote>& features() const { return features_; }

  /// Native values of a scene that differs from the built one in fit-able parameters only (all_parameters).
  VectorXd native(const Scene& scene) const;
  VectorXd native() const { return model_.native; }
  /// ∂native/∂p at `scene`, p at `address` in internal units. Throws InputError for an address that is not
  /// fit-able.
  VectorXd native_derivative(const Scene& scene, const std::string& address) const;
  /// Whether the results of a run of this scene are differentiable by a parameter (canonical address). They are
  /// not in /time/offset where a path has a kink and a step ends.
  bool is_smooth_in(const std::string& address, const Trajectory& run) const;

  /// Ligament parameter b per column for a scene, 1/mm; empty without ligaments.
  VectorXd ligament_map(const Scene& scene) const;
  /// Where each source sits on the inner surface, mm, after projection; empty without ligaments.
  const std::vector<Vec3>& source_positions() const;
  /// Triangles of the P1 refinement through all columns; empty without ligaments.
  const std::vector<std::array<int, 3>>& column_triangles() const;
  /// The ligaments, null without.
  const LigamentPart* ligaments() const { return ligaments_.get(); }

 private:
  Scene scene_;
  Model model_;
  std::vector<std::shared_ptr<const ScenePart>> parts_;
  std::shared_ptr<const LigamentPart> ligaments_;  // also one of parts_
  std::vector<FeatureNote> features_;
};

}  // namespace rhytid
