// One random, smooth state per law, for property tests that know no law: old strain, history, parameters,
// strain.
#pragma once

#include <Eigen/Geometry>
#include <cmath>
#include <memory>
#include <random>
#include <string>
#include <vector>

#include "sim/core/types.h"
#include "sim/surface/imls.h"
#include "sim/surface/shapes.h"
#include "sim/terms/extrapolated_friction_law.h"
#include "sim/terms/kinematics.h"
#include "sim/terms/ligament_law.h"
#include "sim/terms/pre_stretch_law.h"
#include "sim/terms/skin_law.h"

namespace rhytid::test {

using Rng = std::mt19937;

inline VectorXd uniform(Rng& rng, int n, double amount = 1) {
  std::uniform_real_distribution<double> d(-amount, amount);
  VectorXd v(n);
  for (double& x : v) x = d(rng);
  return v;
}

/// C − I of F = I + random.
inline VectorXd random_strain(Rng& rng, double amount) {
  const VectorXd h = uniform(rng, 9, amount);
  VectorXd y(6);
  PrismKinematics::strain(h.data(), y.data());
  return y;
}

/// Where a law is evaluated, and how far each input may be moved for a difference quotient.
struct LawState {
  VectorXd e_old, history, theta, rest, e;
  VectorXd theta_scale;
  double dt = 1. / 24;
  double step = 1e-3;  ///< of strain or displacement, in its own unit
  Vec3 origin = Vec3::Zero();
};

template <class Law>
struct LawCase {
  std::string name;
  Law law;
  std::vector<LawState> states;
};

inline std::vector<LawCase<SkinLaw>> skin_cases() {
  std::vector<LawCase<SkinLaw>> cases;
  for (const auto& [name, scheme] :
       {std::pair{"exponential", DamperScheme::exponential}, std::pair{"literal", DamperScheme::literal},
        std::pair{"strang", DamperScheme::strang},
        std::pair{"backward_euler", DamperScheme::backward_euler}}) {
    Rng rng(11);
    LawCase<SkinLaw> c{name, SkinLaw{scheme}, {}};
    for (double amount : {0.3, 0.1, 0.01})
      for (double tau : {1. / 12, 1e-3, 50.}) {
        LawState s;
        s.e_old = random_strain(rng, amount);
        s.history = random_strain(rng, amount);
        s.e = random_strain(rng, amount);
        s.theta = VectorXd(5);
        s.theta << 0.2, 1.3, 30, 0.8, tau;
        s.theta_scale = s.theta;
        s.rest = VectorXd::Zero(1);
        s.step = 0.02;
        c.states.push_back(s);
      }
    cases.push_back(c);
  }
  return cases;
}

inline std::vector<LawCase<ElasticSkinLaw>> elastic_cases() {
  Rng rng(12);
  LawCase<ElasticSkinLaw> c{"elastic", {}, {}};
  for (double amount : {0.3, 0.1, 0.01})
    for (double stiffening : {0.0, 0.25, 5.0}) {
      LawState s;
      s.e_old = s.e = random_strain(rng, amount);
      s.history = VectorXd::Zero(0);
      s.theta = Vec3(0.2, stiffening, 30);
      s.theta_scale = Vec3(0.2, std::max(stiffening, 0.0), 30);
      s.rest = VectorXd::Zero(1);
      s.step = 0.02;
      c.states.push_back(s);
    }
  return {c};
}

inline std::vector<LawCase<VolumeLaw>> volume_cases() {
  Rng rng(16);
  LawCase<VolumeLaw> c{"volume", {}, {}};
  for (double amount : {0.3, 0.1, 0.01}) {
    LawState s;
    s.e_old = s.e = random_strain(rng, amount);
    s.history = VectorXd::Zero(0);
    s.theta = s.theta_scale = VectorXd::Constant(1, 30);
    s.rest = VectorXd::Zero(1);
    s.step = 0.02;
    c.states.push_back(s);
  }
  return {c};
}

/// The same states as `cases`, under tension λ₁ = 1.1, λ₂ = 0.95 or almost none, in a random frame.
template <class Law>
std::vector<LawCase<PreStretchedLaw<Law>>> pre_stretched(const std::vector<LawCase<Law>>& cases) {
  Rng rng(17);
  std::vector<LawCase<PreStretchedLaw<Law>>> result;
  for (const LawCase<Law>& c : cases) {
    LawCase<PreStretchedLaw<Law>> p{"pre-stretched " + c.name, {c.law}, c.states};
    for (std::size_t k = 0; k < p.states.size(); ++k) {
      LawState& s = p.states[k];
      const Vec3 n = Vec3(uniform(rng, 3)).normalized(), t = n.unitOrthogonal();
      s.rest = VectorXd(6);
      s.rest << t, n;
      VectorXd theta(s.theta.size() + 2), scale(theta.size());
      theta << s.theta, k % 2 ? 1.1 : 1 + 1e-9, k % 2 ? 0.95 : 1;
      scale << s.theta_scale, 0.2, 0.2;
      s.theta = theta;
      s.theta_scale = scale;
    }
    result.push_back(p);
  }
  return result;
}

/// For either law: k, ε, b. A Fung exponent is b d², so it reaches the continuation earlier.
template <class Law>
std::vector<LawCase<Law>> ligament_cases() {
  Rng rng(13);
  LawCase<Law> c{Law::name, {}, {}};
  // |u| from far below ε to far beyond, and past the continuation at b s = 50.
  for (double size : {1e-3, 0.05, 0.5, 3.0, 9.0})
    for (double b : {0.3, 4.0, 10.0}) {
      LawState s;
      s.e = uniform(rng, 3).normalized() * size;
      s.e_old = s.e;
      s.history = VectorXd::Zero(0);
      s.theta = Vec3(5e-4, 0.02, b);
      s.theta_scale = s.theta;
      s.rest = VectorXd::Zero(1);
      s.step = std::min(0.1 * std::max(size, 0.02), 0.1 / (b * std::max(size, 1.0)));
      c.states.push_back(s);
    }
  return {c};
}

/// A patch of samples on a paraboloid, as a bone.
inline std::shared_ptr<ImlsSurface> bone() {
  std::vector<Vec3> p, n;
  for (int i = -6; i <= 6; ++i)
    for (int j = -6; j <= 6; ++j) {
      const double x = i, y = j;
      p.emplace_back(x, y, -0.02 * (x * x + 0.5 * y * y));
      n.emplace_back(0.04 * x, 0.02 * y, 1);
    }
  MatrixX3 points(p.size(), 3), normals(p.size(), 3);
  for (std::size_t k = 0; k < p.size(); ++k) points.row(k) = p[k], normals.row(k) = n[k];
  return std::make_shared<ImlsSurface>(points, normals, ImlsOptions{});
}

struct ShapeChoice {
  std::string name;
  std::shared_ptr<const ImplicitShape> shape;
  Vec3 surface_point, normal;  ///< a point on the surface, in the shape's frame
};

inline std::vector<ShapeChoice> shapes() {
  const Vec3 n = Vec3(0.2, -0.5, 0.8).normalized();
  const Vec3 axes(5, 3, 7), foot = axes.cwiseProduct(axes).cwiseProduct(n);
  return {{"sphere", std::make_shared<Sphere>(5.0), 5 * n, n},
          {"plane", std::make_shared<Plane>(n), Vec3(n.unitOrthogonal()), n},
          {"capsule", std::make_shared<Capsule>(5.0, 8.0, n.unitOrthogonal() + 0.1 * n),
           5 * n + n.unitOrthogonal(), n},
          {"ellipsoid", std::make_shared<Ellipsoid>(axes), foot / std::sqrt(n.dot(foot)), n},
          {"imls", bone(), Vec3(0.3, -0.4, 0), Vec3::UnitZ()}};
}

/// The orientation of a body as an unnormalised quaternion, up to `amount` rad from none.
inline Eigen::Vector4d random_turn(Rng& rng, double amount) {
  const Vec3 v = uniform(rng, 3, 0.5 * amount);
  return 1.1 * Eigen::Vector4d(1, v[0], v[1], v[2]);
}
inline Mat3 rotation_of(const Eigen::Vector4d& q) {
  return Eigen::Quaterniond(q[0], q[1], q[2], q[3]).normalized().toRotationMatrix();
}

inline std::vector<LawCase<ContactLaw>> contact_cases(const std::vector<ShapeChoice>& choices) {
  Rng rng(14);
  std::vector<LawCase<ContactLaw>> cases;
  for (const ShapeChoice& choice : choices)
    for (double onset : {0.2, 0.0}) {
      LawCase<ContactLaw> c{
          choice.name + (onset > 0 ? " smooth" : " plain"), {choice.shape.get(), onset}, {}};
      for (double depth : {0.1, 0.35, 0.6}) {
        LawState s;
        const Vec3 centre = uniform(rng, 3, 3), x_rest = uniform(rng, 3, 2);
        const Eigen::Vector4d turn = random_turn(rng, 1);
        s.e = rotation_of(turn) * (choice.surface_point - depth * choice.normal) + centre - x_rest;
        s.e_old = s.e;
        s.history = VectorXd::Zero(0);
        s.theta = VectorXd(9);
        s.theta << 0.7, 0.01, centre, turn;
        s.theta_scale = VectorXd::Constant(9, 0.02);
        s.theta_scale[0] = 0.7;
        s.rest = VectorXd(4);
        s.rest << x_rest, 0.005;
        s.step = 0.02;
        c.states.push_back(s);
      }
      cases.push_back(c);
    }
  return cases;
}

inline std::vector<LawCase<FrictionLaw>> friction_cases(const std::vector<ShapeChoice>& choices) {
  Rng rng(15);
  std::vector<LawCase<FrictionLaw>> cases;
  for (const ShapeChoice& choice : choices)
    for (Mollifier mollifier : {Mollifier::quintic, Mollifier::quadratic}) {
      LawCase<FrictionLaw> c{choice.name + (mollifier == Mollifier::quintic ? " quintic" : " quadratic"),
                             {choice.shape.get(), 0.2, 24.0, mollifier},  // ε_v dt = 1 mm
                             {}};
      for (double slip : {0.02, 0.5, 3.0}) {  // deep stick, stick, slip
        LawState s;
        const Vec3 centre = uniform(rng, 3, 3), x_rest = uniform(rng, 3, 2);
        const Eigen::Vector4d turn = random_turn(rng, 1), turn_old = turn + 0.05 * random_turn(rng, 1);
        const Mat3 rotation = rotation_of(turn);
        const Vec3 n = rotation * choice.normal, along = n.unitOrthogonal();
        const Vec3 from_centre = rotation * (choice.surface_point - 0.4 * choice.normal);
        s.e = from_centre + centre - x_rest;
        const Vec3 centre_old = centre - Vec3(0.1, 0.05, 0);
        // Where the point was: slipped back along the surface, then carried back with the body.
        s.e_old = rotation_of(turn_old) * rotation.transpose() * (from_centre - slip * along - 0.3 * n) +
                  centre_old - x_rest;
        s.history = VectorXd(4);
        s.history << 0.3, n;
        s.theta = VectorXd(17);
        s.theta << 0.7, 0.01, 0.4, centre, centre_old, turn, turn_old;
        s.theta_scale = VectorXd::Constant(17, 0.02);
        s.theta_scale[0] = 0.7;
        s.theta_scale[2] = 0.4;
        s.rest = VectorXd(4);
        s.rest << x_rest, 0.005;
        s.step = 0.2 * std::min(slip, 0.1);
        c.states.push_back(s);
      }
      cases.push_back(c);
    }
  return cases;
}

/// The same states, with a pressure that rises and falls in turn and a normal that turns.
inline std::vector<LawCase<ExtrapolatedFrictionLaw>> extrapolated_friction_cases(
    const std::vector<ShapeChoice>& choices) {
  Rng rng(18);
  std::vector<LawCase<ExtrapolatedFrictionLaw>> cases;
  for (const LawCase<FrictionLaw>& c : friction_cases(choices)) {
    LawCase<ExtrapolatedFrictionLaw> e{c.name, {c.law}, c.states};
    for (std::size_t k = 0; k < e.states.size(); ++k) {
      VectorXd history(8);
      history << c.states[k].history, k % 2 ? -5 : 3, uniform(rng, 3, 2);
      e.states[k].history = history;
    }
    cases.push_back(e);
  }
  return cases;
}

}  // namespace rhytid::test
