// The retaining ligaments of a scene: sources on the inner surface, the heat map that spreads their
// strengths, and the term.
//
// Native blocks "ligaments": k, ε; "ligaments/b": b per column.
#pragma once

#include <array>

#include "sim/scene/parts/scene_part.h"
#include "sim/surface/heat_map.h"

namespace rhytid {

class LigamentPart final : public ScenePart {
 public:
  /// Places the sources, or reads the map at the vertices. scene.ligaments must be there. Throws InputError
  /// for a vertex outside the crop, or one without a value.
  LigamentPart(const Scene& scene, const SkinMesh& mesh);

  void add_native_blocks(const Scene& scene, Model& model) const override;
  void add_terms(const Scene& scene, Model& model, std::vector<FeatureNote>& features) const override;
  void set_native(const Scene& scene, const Model& model, VectorXd& native) const override;
  bool add_derivative(const Scene& scene, const Model& model, const std::string& address,
                      VectorXd& derivative) const override;

  /// b per column, 1/mm.
  VectorXd map(const Scene& scene) const;
  /// Where each source of the scene it was built from sits on the inner surface, mm, after projection.
  const std::vector<Vec3>& source_positions() const { return source_positions_; }
  /// Triangles of the P1 refinement through all columns.
  const std::vector<std::array<int, 3>>& column_triangles() const { return column_triangles_; }

  /// Diffused weights for the diffusion time (mm²) and source positions of a scene. Safe from several
  /// threads; the last kHeatMapsKept are kept (a line search returns to the ones before it), and a returned
  /// map lives as long as its holder.
  std::shared_ptr<const HeatMapWeights> heat(const Scene& scene) const;
  /// How many maps are kept now.
  std::size_t heat_maps_kept() const;
  static constexpr std::size_t kHeatMapsKept = 4;
  /// Heat maps solved so far, those no longer kept among them.
  long heat_maps_solved() const;
  /// Memory of the surface the maps are solved on, of the maps kept and of a given map, bytes.
  std::size_t bytes() const;

 private:
  struct HeatCache;
  /// The sources where the scene has them; one whose position is as built is where it was placed.
  std::vector<HeatSource> sources_of(const Scene& scene) const;

  MatrixX3 inner_;
  std::vector<std::array<int, 3>> column_triangles_;
  std::vector<Vec3> source_positions_;
  std::vector<HeatSource> heat_sources_;
  std::vector<Vec3> built_positions_;  ///< before projection
  std::shared_ptr<HeatCache> heat_cache_;
  VectorXd given_map_;  ///< b per column before its factor, when the scene gives a map; else empty
};

}  // namespace rhytid
