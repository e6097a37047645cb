#include "sim/scene/parts/base_part.h"

#include <algorithm>
#include <limits>

#include "sim/core/error.h"
#include "sim/core/units.h"
#include "sim/surface/imls.h"
#include "sim/surface/point_cloud.h"
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
    case ShapeKind::capsule:  // of colliders only
    case ShapeKind::ellipsoid:
      break;
  }
  ImlsOptions options;
  options.support = base.imls_support;
  options.kernel = base.imls_kernel == "literal" ? ImlsKernel::literal : ImlsKernel::smooth;
  if (!base.points)
    return std::make_shared<ImlsSurface>(inner_rest_nodes(mesh), mesh.column_normals, options);
  const PointCloud cloud = read_point_cloud(base.points->file, base.points->mm_per_unit);
  return std::make_shared<ImlsSurface>(cloud.points, cloud.normals, options);
}

/// Bone whose normals point away from the skin would pull instead of push: refused.
void refuse_inside_out(const ImplicitShape& shape, const SkinMesh& mesh, const Vec3& centre,
                       const Scene& scene) {
  const BaseScene& base = *scene.base;
  const MatrixX3 inner = inner_rest_nodes(mesh);
  int towards = 0, away = 0;
  for (int column = 0; column < mesh.num_columns; ++column) {
    const Vec3 x = inner.row(column), n = mesh.column_normals.row(column);
    const GapJet jet = shape.evaluate(x - centre);
    const double facing = jet.gradient.dot(n);
    if (jet.supported && facing != 0) ++(facing > 0 ? towards : away);
  }
  if (away <= towards) return;
  if (base.points)
    throw InputError(base.points->file, "normals that point away from the skin",
                     "normals out of the bone, towards the skin");
  const std::string file = scene.file.empty() ? "" : scene.file + ": ",
                    expected = "bone under the inner surface, facing it";
  if (base.shape == ShapeKind::plane)
    throw InputError(file + "/base/normal", "a plane that faces away from the skin", expected);
  if (base.shape == ShapeKind::sphere)
    throw InputError(file + "/base/centre", "a sphere whose far side the skin is on", expected);
  throw InputError(file + "/base", "an inner surface whose own bone faces away from it", expected);
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
  refuse_inside_out(*shape, model.mesh, centre, scene);
  Term term("base contact", contact_kernels(), ContactLaw{shape, b.onset});
  TermGroup g = surface_group(model.mesh, SkinSide::inner, triangle_rule(contact_degree(scene)));
  // Rest gap subtracted: the rest state is an exact equilibrium whatever the shape makes of the rest nodes.
  for (std::size_t q = 0; q < g.weight.size(); ++q) {
    const Vec3 x(g.rest[4 * q], g.rest[4 * q + 1], g.rest[4 * q + 2]);
    const GapJet jet = shape->evaluate(x - centre);
    if (!jet.supported)
      throw InputError(
          scene.file + ": /base/imls_support",
          format_quantity(dynamic_cast<const ImlsSurface&>(*shape).support(), dimension::length) +
              (b.imls_support > 0 ? "" : " (three times the spacing of the points)"),
          "a support that reaches every point of the inner surface" +
              std::string(b.points ? "; do unit and place of the points agree with the skin's?" : ""));
    g.rest[4 * q + 3] = jet.gap;
  }
  const int base = model.native_block("base").offset;
  for (int s = 0; s < 5; ++s) g.theta.push_back(constant_slot(base + s));
  add_upright_slots(g);
  term.add_group(std::move(g));
  model.terms.push_back(std::move(term));
  features.push_back({"base contact",
                      true,
                      b.points ? "inner surface on the points of " + b.points->file : "inner surface",
                      {static_cast<int>(model.terms.size()) - 1},
                      {static_cast<int>(model.shapes.size()) - 1}});
}

void BasePart::set_native(const Scene& scene, const Model& model, VectorXd& native) const {
  const int at = model.native_block("base").offset;
  native[at] = scene.base->stiffness;
  native.segment<3>(at + 2) = base_centre(*scene.base);
}

std::pair<double, double> base_rest_gaps(const Model& model) {
  std::pair<double, double> range{std::numeric_limits<double>::infinity(),
                                  -std::numeric_limits<double>::infinity()};
  for (const Term& term : model.terms) {
    if (term.name() != "base contact") continue;
    for (const TermGroup& g : term.groups())
      for (std::size_t q = 0; q < g.weight.size(); ++q) {
        range.first = std::min(range.first, g.rest[4 * q + 3]);
        range.second = std::max(range.second, g.rest[4 * q + 3]);
      }
  }
  require(range.first <= range.second, "base_rest_gaps: the model has no base");
  return range;
}

bool BasePart::add_derivative(const Scene&, const Model& model, const std::string& address,
                              VectorXd& d) const {
  if (address != "/base/stiffness") return false;
  d[model.native_block("base").offset] = 1;
  return true;
}

}  // namespace rhytid
