// Skin with everything that acts on it, where one pleases: on its bone, under a finger, tied by ligaments.
#pragma once

#include <memory>

#include "sim/surface/imls.h"
#include "sim/surface/shapes.h"
#include "sim/terms/contact_law.h"
#include "sim/terms/ligament_law.h"
#include "tests/verification/distorted_mesh.h"

namespace rhytid::test {

inline constexpr double kFingerRadius = 1.5;  // mm

/// Where things are in the native vector.
struct Slots {
  static constexpr int contact = 5, centres = 8, quaternions = 17, base = 29, ligaments = 38, b = 40;
};

enum class BaseShape { plane, sphere, imls };

/// Skin and all that acts on it, in one place.
struct Place {
  SkinMesh mesh;
  VectorXd native;
  std::vector<std::shared_ptr<const ImplicitShape>> shapes;
  std::vector<Term> terms;
};

inline ThetaSlot constant_slot(int offset) {
  return {ThetaSlot::Kind::constant, offset, {}};
}

inline Term finger_term(const SkinMesh& mesh, const ImplicitShape& finger, bool friction) {
  const auto knots = std::make_shared<KnotPath>(std::vector{0.0, kStep.t, 1.0});
  using enum ThetaSlot::Kind;
  Term t = friction ? Term("friction", friction_kernels(), FrictionLaw{&finger, 1e-2, 2, Mollifier::quintic})
                    : Term("contact", contact_kernels(), ContactLaw{&finger, 1e-2});
  TermGroup g = surface_group(mesh, SkinSide::outer, triangle_rule(10));
  for (int k = 0; k < (friction ? 3 : 2); ++k) g.theta.push_back(constant_slot(Slots::contact + k));
  for (int old = 0; old < (friction ? 2 : 1); ++old)
    for (int a = 0; a < 3; ++a) g.theta.push_back({old ? path_old : path_now, Slots::centres + a, knots});
  for (int old = 0; old < (friction ? 2 : 1); ++old)
    for (int a = 0; a < 4; ++a)
      g.theta.push_back({old ? path_old : path_now, Slots::quaternions + a, knots, 4});
  t.add_group(std::move(g));
  return t;
}

/// The gap at rest is subtracted, as scenes do it: at the bone's pose in `native`.
inline Term base_term(const SkinMesh& mesh, const VectorXd& native, const ImplicitShape& bone) {
  Term t("base", contact_kernels(), ContactLaw{&bone, 1e-2});
  TermGroup g = surface_group(mesh, SkinSide::inner, triangle_rule(10));
  const Vec3 centre = native.segment<3>(Slots::base + 2);
  for (std::size_t q = 0; q < g.weight.size(); ++q)
    g.rest[4 * q + 3] = bone.evaluate(Eigen::Map<const Vec3>(&g.rest[4 * q]) - centre).gap;
  for (int k = 0; k < 9; ++k) g.theta.push_back(constant_slot(Slots::base + k));
  t.add_group(std::move(g));
  return t;
}

template <class Law>
Term ligament_term(const SkinMesh& mesh, const char* name, const KernelTable& kernels) {
  Term t(name, kernels, Law{});
  TermGroup g = surface_group(mesh, SkinSide::inner, triangle_rule(10));
  g.rest.clear();
  g.theta = {constant_slot(Slots::ligaments),
             constant_slot(Slots::ligaments + 1),
             {ThetaSlot::Kind::field, Slots::b, {}}};
  t.add_group(std::move(g));
  return t;
}

inline MatrixX3 inner_nodes(const SkinMesh& mesh) {
  MatrixX3 x(mesh.num_columns, 3);
  for (int c = 0; c < mesh.num_columns; ++c) x.row(c) = mesh.rest.row(mesh.node(c, 0));
  return x;
}

/// Skin on its bone with a finger that presses, drags and turns over it; `turn` is that of the bone's shape.
inline Place place(const SkinMesh& mesh, const VectorXd& native, const Mat3& turn, BaseShape base) {
  Place p{mesh, native, {}, {}};
  p.shapes.push_back(std::make_shared<Sphere>(kFingerRadius));
  if (base == BaseShape::plane) p.shapes.push_back(std::make_shared<Plane>(turn * Vec3(0.1, -0.2, 1)));
  if (base == BaseShape::sphere) p.shapes.push_back(std::make_shared<Sphere>(5));
  if (base == BaseShape::imls)
    p.shapes.push_back(std::make_shared<ImlsSurface>(inner_nodes(mesh), mesh.column_normals));
  for (const auto& [scheme, name] : {std::pair{DamperScheme::exponential, "skin, exponential"},
                                     {DamperScheme::literal, "skin, literal"},
                                     {DamperScheme::none, "skin, none"}})
    p.terms.push_back(skin_term(mesh, name, skin_kernels(), SkinLaw{scheme}));
  p.terms.push_back(skin_term(mesh, "skin, elastic", elastic_skin_kernels(), ElasticSkinLaw{1}));
  p.terms.push_back(base_term(mesh, native, *p.shapes[1]));
  p.terms.push_back(finger_term(mesh, *p.shapes[0], false));
  p.terms.push_back(finger_term(mesh, *p.shapes[0], true));
  return p;
}

/// Ligaments pull towards where the skin was at rest: they follow when the rest shape does.
inline void add_ligaments(Place& p) {
  p.terms.push_back(ligament_term<LigamentLaw>(p.mesh, "ligaments", ligament_kernels()));
  p.terms.push_back(ligament_term<FungLigamentLaw>(p.mesh, "ligaments, Fung", fung_ligament_kernels()));
}

inline VectorXd native_values(const SkinMesh& mesh, BaseShape base) {
  Vec3 top = Vec3::Zero();
  for (int c = 0; c < mesh.num_columns; ++c)
    if (mesh.rest(mesh.node(c, mesh.num_levels - 1), 2) > top[2])
      top = mesh.rest.row(mesh.node(c, mesh.num_levels - 1)).transpose();
  VectorXd native(Slots::b + mesh.num_columns);
  const Vec3 centre = top + Vec3(0, 0, 1.2), centre_old = centre + Vec3(-0.1, 0.05, 0.02);
  const Eigen::Vector4d q_old(1, 0, 0, 0), q_now(1, 0.02, -0.01, 0.015);  // 0.05 rad in the step
  const Vec3 bone = base == BaseShape::imls ? Vec3(0, 0, 0) : Vec3(0.2, 0.1, -4.5);
  native.head(Slots::b) << kNative, 0.7, 0.02, 0.5, centre_old, centre, centre, q_old, q_now, q_now, 0.9, 0,
      bone, 1, 0, 0, 0, 5e-2, 1e-2;
  for (int c = 0; c < mesh.num_columns; ++c) native[Slots::b + c] = 1 + 0.3 * mesh.rest(c, 0);
  return native;
}

}  // namespace rhytid::test
