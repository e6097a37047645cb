// Whole terms on a small curved patch with random states: two element layers, shared nodes, every kind of
// parameter slot.
#pragma once

#include <memory>
#include <utility>

#include "law_cases.h"
#include "sim/core/error.h"
#include "sim/element/quadrature.h"
#include "sim/mesh/skin_mesh.h"
#include "sim/terms/geometry.h"
#include "sim/terms/term.h"

namespace rhytid::test {

/// 2 × 1 mm, two faces, bent, bottom and top nodes moved at random: truly curved elements.
inline SkinMesh curved_patch(int order, int thickness_order, Rng& rng) {
  ExtrusionOptions o;
  o.order = order;
  o.layers = {{0.5, 1, thickness_order}, {0.2, 1, 1}};
  o.bend_radius = 4;
  SkinMesh mesh = extrude(grid_surface(2, 1, 1, 1, GridPattern::diagonal_plus), o);
  std::uniform_real_distribution<double> d(-0.03 / (order * order), 0.03 / (order * order));
  for (Eigen::Index i = 0; i < mesh.rest.rows(); ++i)
    for (int a = 0; a < 3; ++a) mesh.rest(i, a) += d(rng);
  return mesh;
}

/// A term with an old state, a state, and native parameters.
struct TermCase {
  std::string name;
  SkinMesh mesh;
  std::vector<Term> terms;  ///< one; a vector because a Term has no default
  std::shared_ptr<const ImplicitShape> shape;
  VectorXd native, native_scale;
  StepInfo step{3, 0.10, 0.14};
  VectorXd u_old, u, history;
  const Term& term() const { return terms.front(); }
};

inline VectorXd smooth_displacement(const SkinMesh& mesh, Rng& rng, double amount) {
  const VectorXd c = uniform(rng, 18, amount);
  VectorXd u(3 * mesh.num_nodes());
  for (int i = 0; i < mesh.num_nodes(); ++i) {
    const Vec3 x = mesh.rest.row(i).transpose();
    for (int a = 0; a < 3; ++a)
      u[3 * i + a] = c[6 * a] * x[0] + c[6 * a + 1] * x[1] + c[6 * a + 2] * x[2] +
                     c[6 * a + 3] * x[0] * x[1] + c[6 * a + 4] * x[0] * x[0] + c[6 * a + 5] * x[1] * x[2];
  }
  return u + uniform(rng, static_cast<int>(u.size()), 0.02 * amount / (mesh.order * mesh.order));
}

inline TermCase skin_case(const KernelTable& kernels, bool viscous, DamperScheme scheme, int order,
                          int thickness_order, double amount = 0.2) {
  Rng rng(21);
  TermCase c;
  c.name = viscous ? "skin" : "elastic skin";
  c.mesh = curved_patch(order, thickness_order, rng);
  c.terms.push_back(viscous ? Term("skin", kernels, SkinLaw{scheme})
                            : Term("elastic", kernels, ElasticSkinLaw{}));
  for (int layer = 0; layer < 2; ++layer) {
    const ElementLayer& e = c.mesh.element_layers[layer];
    TermGroup g =
        prism_group(c.mesh, layer, e.slabs.front(), triangle_rule(std::min(12, 2 * order + 2)), e.order + 1);
    for (int s = 0; s < kernels.ntheta; ++s)
      g.theta.push_back({ThetaSlot::Kind::constant, 5 * layer + s, {}});
    c.terms.front().add_group(std::move(g));
  }
  c.native = VectorXd(10);
  c.native << 0.2, 1.3, 5, 0.8, 0.09, 2, 0.7, 40, 6, 0.05;
  c.native_scale = c.native;
  c.u_old = smooth_displacement(c.mesh, rng, amount);
  c.u = c.u_old + smooth_displacement(c.mesh, rng, amount);
  c.history.resize(static_cast<Eigen::Index>(c.term().history_size()));
  for (Eigen::Index k = 0; 6 * k < c.history.size(); ++k)
    c.history.segment<6>(6 * k) = random_strain(rng, amount);
  return c;
}

/// Either skin law under tension λ₁ = 1.1, λ₂ = 0.96 along frames that turn from point to point.
inline TermCase pre_stretched_case(const KernelTable& kernels, bool viscous, int order, int thickness_order) {
  TermCase c = skin_case(viscous ? skin_kernels() : elastic_skin_kernels(), viscous,
                         DamperScheme::exponential, order, thickness_order, 0.15);
  c.name = "pre-stretched " + c.name;
  c.terms.clear();
  if (viscous)
    c.terms.emplace_back("skin", kernels, PreStretchedLaw<SkinLaw>{});
  else
    c.terms.emplace_back("elastic", kernels, PreStretchedLaw<ElasticSkinLaw>{});
  Rng rng(23);
  for (int layer = 0; layer < 2; ++layer) {
    const ElementLayer& e = c.mesh.element_layers[layer];
    TermGroup g =
        prism_group(c.mesh, layer, e.slabs.front(), triangle_rule(std::min(12, 2 * order + 2)), e.order + 1);
    for (int s = 0; s < c.term().kernels().ntheta - 2; ++s)
      g.theta.push_back({ThetaSlot::Kind::constant, 5 * layer + s, {}});
    for (int s = 0; s < 2; ++s) g.theta.push_back({ThetaSlot::Kind::constant, 10 + s, {}});
    g.rest.clear();
    for (std::size_t q = 0; q < g.weight.size(); ++q) {
      const Vec3 n = (Vec3(0, 0, 1) + Vec3(uniform(rng, 3, 0.3))).normalized(), t = n.unitOrthogonal();
      g.rest.insert(g.rest.end(), {t[0], t[1], t[2], n[0], n[1], n[2]});
    }
    c.terms.front().add_group(std::move(g));
  }
  c.native.conservativeResize(12);
  c.native.tail(2) << 1.1, 0.96;
  c.native_scale = c.native;
  c.native_scale.tail(2).setConstant(0.3);
  return c;
}

/// The volumetric term alone, with one Gauss point fewer through each layer.
inline TermCase volume_case(const KernelTable& kernels, int order, int thickness_order) {
  TermCase c = skin_case(elastic_skin_kernels(), false, DamperScheme::none, order, thickness_order);
  c.name = "volume";
  c.terms.clear();
  c.terms.emplace_back("volume", kernels, VolumeLaw{});
  for (int layer = 0; layer < 2; ++layer) {
    const ElementLayer& e = c.mesh.element_layers[layer];
    TermGroup g =
        prism_group(c.mesh, layer, e.slabs.front(), triangle_rule(std::min(12, 2 * order + 2)), e.order);
    g.theta.push_back({ThetaSlot::Kind::constant, layer, {}});
    c.terms.front().add_group(std::move(g));
  }
  c.native = c.native_scale = Vec2(5, 40);
  return c;
}

/// Contact, friction (of either lag) or ligaments (of either law); parameters by constants, a field and a path with a knot
/// inside the step.
inline TermCase surface_case(const std::string& kind, const ShapeChoice& choice, int order,
                             Mollifier mollifier = Mollifier::quintic) {
  Rng rng(22);
  TermCase c;
  c.name = kind + " " + choice.name;
  c.mesh = curved_patch(order, 2, rng);
  c.shape = choice.shape;
  const bool inner = kind == "ligaments" || kind == "fung ligaments";
  const bool extrapolates = kind == "extrapolated friction", rubs = extrapolates || kind == "friction";
  TermGroup g = surface_group(c.mesh, inner ? SkinSide::inner : SkinSide::outer, triangle_rule(10));
  c.u_old = smooth_displacement(c.mesh, rng, 0.05);
  c.u = c.u_old + smooth_displacement(c.mesh, rng, 0.1);
  const auto constant = [](int at) { return ThetaSlot{ThetaSlot::Kind::constant, at, {}}; };
  const auto knots = std::make_shared<KnotPath>(std::vector{0.05, 0.12, 0.3}, PathKind::spline);
  const auto path = [&](ThetaSlot::Kind k, int axis) { return ThetaSlot{k, 3 + axis, knots}; };
  const auto turn = [&](ThetaSlot::Kind k, int part) { return ThetaSlot{k, 12 + part, knots, 4}; };
  if (inner) {
    g.rest.clear();
    if (kind == "ligaments")
      c.terms.emplace_back("ligaments", ligament_kernels(), LigamentLaw{});
    else
      c.terms.emplace_back("ligaments", fung_ligament_kernels(), FungLigamentLaw{});
    g.theta = {constant(0), constant(1), {ThetaSlot::Kind::field, 2, {}}};
    c.native = VectorXd::Constant(2 + c.mesh.num_columns, 3) + uniform(rng, 2 + c.mesh.num_columns, 2);
    c.native[0] = 5e-4;
    c.native[1] = 0.02;
    c.native_scale = c.native;
  } else {
    for (std::size_t q = 0; q < g.weight.size(); ++q) g.rest[4 * q + 3] = 0.001 * (q % 7);
    // The shape's surface point about 0.4 mm above the middle of the patch: everything is in contact.
    Vec3 middle = Vec3::Zero();
    for (std::size_t q = 0; q < g.weight.size(); ++q)
      middle +=
          Vec3(g.rest[4 * q], g.rest[4 * q + 1], g.rest[4 * q + 2]) / static_cast<double>(g.weight.size());
    const Vec3 centre = middle - choice.surface_point + 0.8 * choice.normal;
    c.native = VectorXd(24);
    c.native << 0.7, 0.01, 0.4, centre - Vec3(0.1, 0.1, 0), centre + Vec3(0.05, 0, 0),
        centre + Vec3(0.3, 0.4, 0), Eigen::Vector4d(1, 0.01, 0, 0), Eigen::Vector4d(1, 0, 0.02, 0.01),
        Eigen::Vector4d(1, 0.02, -0.03, 0.05);
    c.native_scale = VectorXd::Constant(24, 0.05);
    c.native_scale[0] = 0.7;
    c.native_scale[2] = 0.4;
    g.theta = {constant(0), constant(1)};
    if (rubs) g.theta.push_back(constant(2));
    for (int axis = 0; axis < 3; ++axis) g.theta.push_back(path(ThetaSlot::Kind::path_now, axis));
    if (rubs)
      for (int axis = 0; axis < 3; ++axis) g.theta.push_back(path(ThetaSlot::Kind::path_old, axis));
    for (int part = 0; part < 4; ++part) g.theta.push_back(turn(ThetaSlot::Kind::path_now, part));
    if (rubs) {
      for (int part = 0; part < 4; ++part) g.theta.push_back(turn(ThetaSlot::Kind::path_old, part));
      const FrictionLaw law{choice.shape.get(), 0.0, 3.0, mollifier};
      if (extrapolates)
        c.terms.emplace_back("friction", extrapolated_friction_kernels(), ExtrapolatedFrictionLaw{law});
      else
        c.terms.emplace_back("friction", friction_kernels(), law);
    } else {
      c.terms.emplace_back("contact", contact_kernels(), ContactLaw{choice.shape.get(), 0.0});
    }
  }
  c.terms.front().add_group(std::move(g));
  c.history.resize(static_cast<Eigen::Index>(c.term().history_size()));
  const Eigen::Index ns = c.term().kernels().ns;
  for (Eigen::Index k = 0; ns * k < c.history.size(); ++k) {
    c.history.segment<4>(ns * k) << 0.3, (choice.normal + uniform(rng, 3, 0.2)).normalized();
    if (extrapolates) c.history.segment<4>(ns * k + 4) << (k % 2 ? -1.5 : 1), uniform(rng, 3, 0.5);
  }
  return c;
}

/// Dense global matrix of a term.
class DenseSink final : public Term::MatrixSink {
 public:
  explicit DenseSink(int n) : matrix(MatrixXd::Zero(n, n)) {}
  void add(const TermGroup& g, int element, double* dense) override {
    const int n3 = 3 * g.num_nodes;
    Eigen::Map<Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>> k(dense, n3, n3);
    elements.emplace_back(k);
    for (int i = 0; i < n3; ++i)
      for (int j = 0; j < n3; ++j)
        matrix(3 * g.nodes[static_cast<std::size_t>(element) * g.num_nodes + i / 3] + i % 3,
               3 * g.nodes[static_cast<std::size_t>(element) * g.num_nodes + j / 3] + j % 3) += k(i, j);
  }
  MatrixXd matrix;
  std::vector<MatrixXd> elements;
};

}  // namespace rhytid::test
