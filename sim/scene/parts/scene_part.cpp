#include "sim/scene/parts/scene_part.h"

#include <algorithm>

#include "sim/scene/located_json.h"

namespace rhytid {

void add_native_block(Model& model, std::string name, int size, std::vector<int> stiffness_like) {
  int offset = 0;
  for (const NativeBlock& block : model.native_blocks) offset = std::max(offset, block.offset + block.size);
  for (int& i : stiffness_like) i += offset;
  model.native_blocks.push_back({std::move(name), offset, size, std::move(stiffness_like)});
}

ThetaSlot constant_slot(int offset) {
  return {ThetaSlot::Kind::constant, offset, {}};
}

void add_upright_slots(TermGroup& group) {
  for (const double component : {1.0, 0.0, 0.0, 0.0})
    group.theta.push_back({.kind = ThetaSlot::Kind::fixed, .value = component});
}

MatrixX3 inner_rest_nodes(const SkinMesh& mesh) {
  MatrixX3 inner(mesh.num_columns, 3);
  for (int c = 0; c < mesh.num_columns; ++c) inner.row(c) = mesh.rest.row(mesh.node(c, 0));
  return inner;
}

int contact_degree(const Scene& scene) {
  const int wanted = scene.skin.contact_degree;
  return std::min(12, wanted > 0 ? wanted : std::max(10, 2 * scene.skin.order + 2));
}

std::string key_after(const std::string& address, const std::string& list, const std::string& name) {
  const std::string prefix = "/" + list + "/" + escape_key(name) + "/";
  return address.starts_with(prefix) ? address.substr(prefix.size()) : std::string();
}

}  // namespace rhytid
