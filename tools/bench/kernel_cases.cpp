#include "tools/bench/kernel_cases.h"

#include <cmath>

#include "sim/scene/scene.h"
#include "sim/scene/skin_rule.h"
#include "sim/terms/contact_law.h"
#include "sim/terms/geometry.h"
#include "sim/terms/ligament_law.h"

namespace rhytid::tools {
namespace {

constexpr double size = 24, thickness = 2, radius = 1000;  // mm

/// Waves of some 12 mm in the plane, no two components alike.
VectorXd waves(const SkinMesh& mesh, double amplitude, double phase) {
  VectorXd u(3 * mesh.num_nodes());
  for (int i = 0; i < mesh.num_nodes(); ++i) {
    const Vec3 x = mesh.rest.row(i).transpose();
    for (int a = 0; a < 3; ++a)
      u[3 * i + a] = amplitude * std::sin(0.5 * x[0] + 0.7 * a + phase) *
                     std::cos(0.4 * x[1] - 0.3 * x[2] + 1.1 * a - phase);
  }
  return u;
}

SkinMesh patch(int order, int thickness_order, int cells) {
  ExtrusionOptions options;
  options.order = order;
  options.layers = {{thickness, 1, thickness_order}};
  return extrude(grid_surface(size, size, cells, cells, GridPattern::diagonal_plus), options);
}

}  // namespace

KernelCases::KernelCases(int order, int thickness_order, int cells)
    : mesh_(patch(order, thickness_order, cells)),
      thickness_order_(thickness_order),
      shape_(radius),
      step_{1, 1. / 24, 2. / 24},
      u_old_(waves(mesh_, 0.35, 0.4)),
      u_(u_old_ + waves(mesh_, 0.05, 1.3)) {}

std::string KernelCases::element() const {
  return "P" + std::to_string(mesh_.order) + " x P" + std::to_string(thickness_order_);
}

KernelCase KernelCases::make(const std::string& name, const KernelTable& kernels, Term term, TermGroup group,
                             const std::vector<double>& theta) const {
  for (const double value : theta) group.theta.push_back({.kind = ThetaSlot::Kind::fixed, .value = value});
  term.add_group(std::move(group));
  // The old state is that after a step from rest.
  const StepInfo before{0, 0, step_.t_old};
  const VectorXd native, rest = VectorXd::Zero(u_.size());
  std::vector<double> history(term.history_size(), 0.0);
  TermStepData data;
  term.prepare(before, native, rest, history.data(), data);
  if (kernels.ns > 0) term.update(before, data, u_old_, history.data());
  term.prepare(step_, native, u_old_, history.data(), data);
  return {name, std::move(term), std::move(data)};
}

KernelCase KernelCases::skin(const KernelTable& kernels) const {
  SkinScene scene;
  scene.order = mesh_.order;
  return make("skin", kernels, Term("skin", kernels, skin_law()),
              prism_group(mesh_, 0, mesh_.element_layers[0].slabs[0], skin_rule(scene, thickness_order_)),
              {0.003, 2, 0.16, 0.004, 0.1});
}

KernelCase KernelCases::ligaments() const {
  return make("ligaments", ligament_kernels(), Term("ligaments", ligament_kernels(), LigamentLaw{}),
              surface_group(mesh_, SkinSide::inner, triangle_rule(10)), {5e-4, 0.05, 2});
}

KernelCase KernelCases::contact() const {
  // The outer surface lies at z = 0, the sphere's lowest point 0.8 mm below.
  return make("contact", contact_kernels(), Term("contact", contact_kernels(), ContactLaw{&shape_, onset}),
              surface_group(mesh_, SkinSide::outer, triangle_rule(10)),
              {0.1, 0, 0, 0, radius - 0.8, 1, 0, 0, 0});
}

KernelCase KernelCases::friction() const {
  return make(
      "friction", friction_kernels(),
      Term("friction", friction_kernels(), FrictionLaw{&shape_, onset, slip_speed, Mollifier::quintic}),
      surface_group(mesh_, SkinSide::outer, triangle_rule(10)),
      {0.1, 0, 0.6, 0, 0, radius - 0.8, 0, 0, radius - 0.8, 1, 0, 0, 0, 1, 0, 0, 0});
}

ImlsCase imls_case(int cells) {
  ImlsCase c;
  const int side = 2 * cells + 1, points = side * side;
  c.points.resize(points, 3);
  c.normals.resize(points, 3);
  c.places.resize(points, 3);
  for (int i = 0; i < points; ++i) {
    const double x = i % side, y = i / side;
    const Vec3 normal = Vec3(-0.2 * std::cos(0.4 * x), 0.3 * std::sin(0.3 * y), 1).normalized();
    c.points.row(i) << x, y, 0.5 * std::sin(0.4 * x) + std::cos(0.3 * y);
    c.normals.row(i) = normal.transpose();
    c.places.row(i) = c.points.row(i) + std::sin(1.7 * i) * normal.transpose();
  }
  c.surface = std::make_unique<const ImlsSurface>(c.points, c.normals, ImlsOptions{.support = 3});
  return c;
}

}  // namespace rhytid::tools
