// One feature of a scene on its way to a model: everything that turns its part of scene.json into native
// parameters and energy terms, in one class and one file. A new feature is a new part (list it in
// scene_parts), and its parameters get their derivative beside the value they come from.
//
// A part keeps what it derived from the scene it was built from (projected sources, built radii) and no
// reference to the model or the mesh: the model may be copied.
#pragma once

#include <memory>
#include <string>
#include <vector>

#include "sim/scene/scene.h"
#include "sim/time/model.h"

namespace rhytid {

/// A feature of the scene and whether it is there, with the reason when not: what `check` prints.
struct FeatureNote {
  std::string feature;
  bool present;
  std::string detail;
  /// What the feature added to the model: indices of its terms and shapes. Empty without the feature, and for
  /// constraints (held parts, sliding rim), which remove unknowns and cost nothing.
  std::vector<int> terms = {}, shapes = {};
};

class ScenePart {
 public:
  virtual ~ScenePart() = default;

  /// Appends this part's blocks to model.native_blocks by add_native_block. The mesh is there, terms are not.
  virtual void add_native_blocks(const Scene& scene, Model& model) const = 0;
  /// Appends the terms that the scene needs (and no others) and what to say about them. All native blocks
  /// are there. Throws InputError where the scene does not fit the mesh.
  virtual void add_terms(const Scene& scene, Model& model, std::vector<FeatureNote>& features) const = 0;
  /// Writes this part's entries of the native vector for a scene that differs from the built one in fit-able
  /// parameters only.
  virtual void set_native(const Scene& scene, const Model& model, VectorXd& native) const = 0;
  /// When `address` (canonical, by names) is a parameter of this part: adds ∂native/∂p to `derivative`, which
  /// is zero before, and returns true.
  virtual bool add_derivative(const Scene& scene, const Model& model, const std::string& address,
                              VectorXd& derivative) const = 0;
};

/// Appends a block after the last one. `stiffness_like`: entries of the block, from its own first one.
void add_native_block(Model& model, std::string name, int size, std::vector<int> stiffness_like);

/// A slot of a law that reads one entry of the native vector.
ThetaSlot constant_slot(int offset);

/// Slots of the four components of a quaternion that says: not turned.
void add_upright_slots(TermGroup& group);

/// Positions of the inner-surface nodes at rest, mm, [num_columns][3].
MatrixX3 inner_rest_nodes(const SkinMesh& mesh);

/// Degree of the triangle rule on contact and ligament surfaces.
int contact_degree(const Scene& scene);

/// The rest of an address after "/<list>/<name>/" (the name escaped as in an address); empty when it does not
/// begin so. list without slashes at its ends, e.g. "skin/layers".
std::string key_after(const std::string& address, const std::string& list, const std::string& name);

}  // namespace rhytid
