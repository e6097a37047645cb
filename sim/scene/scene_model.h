// From a scene to a model: mesh, the terms the scene needs (and no others), native parameters; and the map
// between scene parameters (addresses) and native ones.
//
// Native parameters, in this order: per layer "layer/<name>": μ∞, C, K, μ_m, τ; "ligaments": k, ε;
// "ligaments/b": b per column; "base": κ, inflation, centre [3]; per collider "collider/<name>": κ,
// inflation, μ, then its path knots [3] each.
#pragma once

#include <memory>
#include <string>
#include <vector>

#include "sim/scene/scene.h"
#include "sim/time/model.h"
#include "sim/time/simulate.h"

namespace rhytid {

/// A term of the scene and whether it is there, with the reason when not: what `check` prints.
struct FeatureNote {
  std::string feature;
  bool present;
  std::string detail;
};

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

  /// Ligament parameter b per column for a scene, 1/mm; empty without ligaments.
  VectorXd ligament_map(const Scene& scene) const;
  /// Where each source sits on the inner surface, mm, after projection.
  const std::vector<Vec3>& source_positions() const { return source_positions_; }
  /// Triangles of the P1 refinement through all columns.
  const std::vector<std::array<int, 3>>& column_triangles() const { return column_triangles_; }

 private:
  struct HeatCache;
  void build_mesh();
  void build_native();
  void build_skin();
  void build_ligaments();
  void build_contacts();
  void build_constraints();
  const struct HeatMapWeights& heat(double time) const;

  Scene scene_;
  Model model_;
  std::vector<FeatureNote> features_;
  std::vector<Vec3> source_positions_;
  std::vector<std::array<int, 3>> column_triangles_;
  std::shared_ptr<HeatCache> heat_cache_;
};

}  // namespace rhytid
