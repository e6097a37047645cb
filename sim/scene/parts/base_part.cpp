#include "sim/scene/parts/base_part.h"

#include "sim/core/error.h"
#include "sim/surface/imls.h"
#include "sim/surface/shapes.h"
#include "sim/terms/contact_law.h"
#include "sim/terms/geometry.h"

namespace rhytid {

namespace {

std::shared_ptr<const ImplicitShape> base_shape(const BaseScene& base, const SkinMesh& mesh) {
  switch (base.shape) {
    case ShapeKind::plane:
      return std::make_shared<Plane>(base.normal);
    case ShapeKind::sphere:
      return std::make_shared<Sphere>(base.radius);
    case ShapeKind::imls:
      break;
  }
  ImlsOptions options;
  options.support = base.imls_support;
  return std::make_shared<ImlsSurface>(inner_rest_nodes(mesh), mesh.column_normals, options);
}

/// An IMLS surface stands where its points are; the others are moved to their centre.
Vec3 base_centre(const BaseScene& base) {
  return base.shape == ShapeKind::imls ? Vec3(Vec3::Zero()) : base.centre;
}

}  // namespace

void BasePart::add_native_blocks(const Scene&, Model& model) const {
  add_native_block(model, "base", 5, {0});
}

void BasePart::add_terms(const Scene& scene, Model& model, std::vector<FeatureNote>& features) const {
  const BaseScene& b = *scene.base;
  model.shapes.push_back(base_shape(b, model.mesh));
  const ImplicitShape* shape = model.shapes.back().get();
  const Vec3 centre = base_centre(b);
  Term term("base contact", contact_kernels(), ContactLaw{shape, b.onset});
  TermGroup g = surface_group(model.mesh, SkinSide::inner, triangle_rule(contact_degree(scene)));
  // Rest gap subtracted: the rest state is an exact equilibrium whatever the shape makes of the rest nodes.
  for (std::size_t q = 0; q < g.weight.size(); ++q) {
    const Vec3 x(g.rest[4 * q], g.rest[4 * q + 1], g.rest[4 * q + 2]);
    const GapJet jet = shape->evaluate(x - centre);
    if (!jet.supported)
      throw InputError(scene.file + ": /base/imls_support", std::to_string(b.imls_support) + " mm",
                       "a support that reaches every point of the inner surface");
    g.rest[4 * q + 3] = jet.gap;
  }
  const int base = model.native_block("base").offset;
  for (int s = 0; s < 5; ++s) g.theta.push_back(constant_slot(base + s));
  term.add_group(std::move(g));
  model.terms.push_back(std::move(term));
  features.push_back({"base contact", true, "inner surface"});
}

void BasePart::set_native(const Scene& scene, const Model& model, VectorXd& native) const {
  const int at = model.native_block("base").offset;
  native[at] = scene.base->stiffness;
  native.segment<3>(at + 2) = base_centre(*scene.base);
}

bool BasePart::add_derivative(const Scene&, const Model& model, const std::string& address,
                              VectorXd& d) const {
  if (address != "/base/stiffness") return false;
  d[model.native_block("base").offset] = 1;
  return true;
}

}  // namespace rhytid
