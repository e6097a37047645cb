#include "sim/scene/parts/collider_part.h"

#include <cstdio>

#include "sim/core/error.h"
#include "sim/scene/collider_motion.h"
#include "sim/surface/shapes.h"
#include "sim/terms/extrapolated_friction_law.h"
#include "sim/terms/geometry.h"

namespace rhytid {

namespace {

bool has_friction(const ColliderScene& c) {
  return c.friction && c.friction->coefficient > 0;
}

int first_orientation(const ColliderScene& c) {
  return 3 + 3 * static_cast<int>(c.path.size());
}

/// Of the semi-axes in the block, behind the orientations.
int first_size(const ColliderScene& c, const ColliderMotion& motion) {
  return first_orientation(c) + 4 * static_cast<int>(motion.quaternions().size());
}

int num_sizes(const ColliderScene& c) {
  return c.shape == ShapeKind::ellipsoid ? 3 : 0;
}

Term contact_term(const ColliderScene& c, const ImplicitShape* shape) {
  const std::string name = "contact " + c.name;
  if (num_sizes(c) > 0) return {name, ellipsoid_contact_kernels(), EllipsoidContactLaw{shape, c.onset}};
  return {name, contact_kernels(), ContactLaw{shape, c.onset}};
}

Term friction_term(const ColliderScene& c, FrictionLag lag, const ImplicitShape* shape) {
  const std::string name = "friction " + c.name;
  const double speed = c.friction->slip_speed;
  const Mollifier mollifier =
      c.friction->mollifier == "quadratic" ? Mollifier::quadratic : Mollifier::quintic;
  const bool extrapolates = lag == FrictionLag::extrapolated;
  if (num_sizes(c) > 0) {
    const EllipsoidFrictionLaw law{shape, c.onset, speed, mollifier};
    if (extrapolates)
      return {name, extrapolated_ellipsoid_friction_kernels(), ExtrapolatedEllipsoidFrictionLaw{law}};
    return {name, ellipsoid_friction_kernels(), law};
  }
  const FrictionLaw law{shape, c.onset, speed, mollifier};
  if (extrapolates) return {name, extrapolated_friction_kernels(), ExtrapolatedFrictionLaw{law}};
  return {name, friction_kernels(), law};
}

/// Slots of the centre now or at the start of the step; `offset` is the collider's native block.
void add_centre_slots(const ColliderMotion& motion, ThetaSlot::Kind kind, int offset, TermGroup& g) {
  for (int axis = 0; axis < 3; ++axis) g.theta.push_back({kind, offset + 3 + axis, motion.positions()});
}

/// The same of the orientation.
void add_orientation_slots(const ColliderScene& c, const ColliderMotion& motion, ThetaSlot::Kind kind,
                           int offset, TermGroup& g) {
  if (!motion.orientations()) return add_upright_slots(g);
  for (int part = 0; part < 4; ++part)
    g.theta.push_back({kind, offset + first_orientation(c) + part, motion.orientations(), 4});
}

}  // namespace

ColliderPart::ColliderPart(const Scene& scene) {
  for (const ColliderScene& c : scene.colliders) {
    built_radii_.push_back(collider_radius(c));
    built_friction_.push_back(has_friction(c));
  }
}

void ColliderPart::add_native_blocks(const Scene& scene, Model& model) const {
  for (const ColliderScene& c : scene.colliders) {
    add_native_block(model, "collider/" + c.name,
                     first_size(c, ColliderMotion(c, scene.time.offset)) + num_sizes(c), {0});
  }
}

void ColliderPart::add_terms(const Scene& scene, Model& model, std::vector<FeatureNote>& features) const {
  const TriangleRule& rule = triangle_rule(contact_degree(scene));
  FeatureNote contact{
      "contact", !scene.colliders.empty(),
      scene.colliders.empty() ? "no colliders" : std::to_string(scene.colliders.size()) + " colliders"};
  FeatureNote friction{"friction", false, "no collider has friction"};
  for (const ColliderScene& c : scene.colliders) {
    model.shapes.push_back(collider_shape(c));
    const ImplicitShape* shape = model.shapes.back().get();
    const int base = model.native_block("collider/" + c.name).offset;
    const ColliderMotion motion(c, scene.time.offset);
    using enum ThetaSlot::Kind;
    const auto add_size_slots = [&](TermGroup& g) {
      for (int k = 0; k < num_sizes(c); ++k)
        g.theta.push_back(constant_slot(base + first_size(c, motion) + k));
    };
    {
      Term term = contact_term(c, shape);
      TermGroup g = surface_group(model.mesh, SkinSide::outer, rule);
      g.theta = {constant_slot(base), constant_slot(base + 1)};
      add_centre_slots(motion, path_now, base, g);
      add_orientation_slots(c, motion, path_now, base, g);
      add_size_slots(g);
      term.add_group(std::move(g));
      term.set_clock(model.clock);
      contact.terms.push_back(static_cast<int>(model.terms.size()));
      contact.shapes.push_back(static_cast<int>(model.shapes.size()) - 1);
      model.terms.push_back(std::move(term));
    }
    if (has_friction(c)) {
      friction.present = true;
      friction.detail = scene.time.lag == FrictionLag::extrapolated
                            ? "extrapolated pressure and normal at every contact point"
                            : "lagged pressure and normal at every contact point";
      Term term = friction_term(c, scene.time.lag, shape);
      TermGroup g = surface_group(model.mesh, SkinSide::outer, rule);
      g.theta = {constant_slot(base), constant_slot(base + 1), constant_slot(base + 2)};
      for (const ThetaSlot::Kind kind : {path_now, path_old}) add_centre_slots(motion, kind, base, g);
      for (const ThetaSlot::Kind kind : {path_now, path_old}) add_orientation_slots(c, motion, kind, base, g);
      add_size_slots(g);
      term.add_group(std::move(g));
      term.set_clock(model.clock);
      friction.terms.push_back(static_cast<int>(model.terms.size()));
      model.terms.push_back(std::move(term));
    }
  }
  features.push_back(std::move(contact));
  features.push_back(std::move(friction));
}

void ColliderPart::set_native(const Scene& scene, const Model& model, VectorXd& native) const {
  for (std::size_t k = 0; k < scene.colliders.size(); ++k) {
    const ColliderScene& c = scene.colliders[k];
    if (has_friction(c) && !built_friction_[k])
      throw InputError(scene.file + ": /colliders/" + c.name + "/friction/coefficient",
                       std::to_string(c.friction->coefficient), "0, with which this model was built");
    const int at = model.native_block("collider/" + c.name).offset;
    native[at] = c.stiffness;
    native[at + 1] = collider_radius(c) - built_radii_[k];
    native[at + 2] = c.friction ? c.friction->coefficient : 0;
    for (std::size_t i = 0; i < c.path.size(); ++i)
      native.segment<3>(static_cast<Eigen::Index>(at + 3 + 3 * i)) = c.path[i].position;
    const ColliderMotion motion(c, scene.time.offset);
    for (std::size_t i = 0; i < motion.quaternions().size(); ++i)
      native.segment<4>(static_cast<Eigen::Index>(at + first_orientation(c)) +
                        4 * static_cast<Eigen::Index>(i)) = motion.quaternions()[i];
    if (num_sizes(c) > 0) {
      const Vec3& e = c.semi_axes;
      if (!(e.minCoeff() > 0) || e.maxCoeff() > Ellipsoid::largest_ratio * e.minCoeff())
        throw InputError(scene.file + ": /colliders/" + c.name + "/semi_axes",
                         std::to_string(e.minCoeff()) + " to " + std::to_string(e.maxCoeff()) + " mm",
                         "lengths > 0, none longer than 1000 times the shortest");
      native.segment<3>(at + first_size(c, motion)) = e;
    }
  }
}

bool ColliderPart::add_derivative(const Scene& scene, const Model& model, const std::string& address,
                                  VectorXd& d) const {
  for (const ColliderScene& c : scene.colliders) {
    const std::string key = key_after(address, "colliders", c.name);
    const int slot = key == "stiffness" ? 0 : key == "radius" ? 1 : key == "friction/coefficient" ? 2 : -1;
    int knot = 0, axis = 0, end = 0;
    if (std::sscanf(key.c_str(), "path/%d/position/%d%n", &knot, &axis, &end) == 2 &&
        end == static_cast<int>(key.size())) {
      d[model.native_block("collider/" + c.name).offset + 3 + 3 * knot + axis] = 1;
      return true;
    }
    if (std::sscanf(key.c_str(), "semi_axes/%d%n", &axis, &end) == 1 && end == static_cast<int>(key.size())) {
      d[model.native_block("collider/" + c.name).offset +
        first_size(c, ColliderMotion(c, scene.time.offset)) + axis] = 1;
      return true;
    }
    if (slot < 0) continue;
    d[model.native_block("collider/" + c.name).offset + slot] = 1;
    return true;
  }
  return false;
}

}  // namespace rhytid
