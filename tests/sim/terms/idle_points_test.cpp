// Tangent and adjoint blocks of friction, which leave out points that take no part, against the same blocks from every
// point: sticking, slipping, without pressure, apart from the shape, and next to where these meet.
#include <gtest/gtest.h>

#include "sim/terms/element_loop.h"
#include "sim/terms/extrapolated_friction_law.h"
#include "sim/terms/point_kernel.h"
#include "term_cases.h"

namespace rhytid::test {
namespace {

constexpr int D = kDirections;

/// The law without what says where it does nothing.
template <class Law>
struct EveryPoint {
  static constexpr int ne = Law::ne, ns = Law::ns, np = Law::np, ntheta = Law::ntheta, nrest = Law::nrest;
  Law law;
  template <class T>
  void prepare(const T* e, const T* s, const T* th, const double* rest, double dt, T* p) const {
    law.template prepare<T>(e, s, th, rest, dt, p);
  }
  template <class T>
  T stress(const T* e, const T* p, const T* th, const double* rest, double dt, T* sigma) const {
    return law.template stress<T>(e, p, th, rest, dt, sigma);
  }
  template <class T>
  void update(const T* e, const T* p, const T* th, const double* rest, double dt, T* s) const {
    law.template update<T>(e, p, th, rest, dt, s);
  }
};

/// How many points of each kind were seen.
struct Seen {
  int stick = 0, slip = 0, unloaded = 0, touching = 0, apart = 0, idle = 0;
};

/// All blocks of one element, one after the other; results are added to `noise`, or written over it.
template <class Law>
std::vector<VectorXd> blocks(const Law& law, const TermElement& e, const double* prepared, const VectorXd& u,
                             const VectorXd& u_old, const VectorXd& s_old, const VectorXd& s_bar,
                             const VectorXd& noise, bool by_force) {
  using K = DualKernel<Law, SurfaceKinematics>;
  const int n3 = static_cast<int>(u.size()), nq = e.view.num_points, nh = nq * Law::ns, nt = nq * Law::ntheta;
  VectorXd u_bar = noise.head(n3), u_old_bar = noise.segment(n3, n3), s_old_bar = noise.head(nh),
           theta_bar = noise.head(nt), df = noise.head(n3 * D), ds = noise.head(nh * D);
  K::adjoint_update_by_points(law, e.view, u.data(), prepared, s_bar.data(), u_bar.data());
  const VectorXd adj = noise.tail(n3);
  K::adjoint_step_by_points(law, e.view, u.data(), u_old.data(), s_old.data(), prepared, adj.data(),
                            s_bar.data(), u_old_bar.data(), s_old_bar.data(), theta_bar.data());
  const VectorXd du = noise.segment(7, n3 * D), du_old = noise.segment(9, n3 * D),
                 ds_old = noise.segment(5, nh * D), dtheta = noise.segment(3, nt * D);
  K::tangent_by_points(law, e.view, u.data(), u_old.data(), s_old.data(), prepared, du.data(), du_old.data(),
                       ds_old.data(), dtheta.data(), by_force ? df.data() : nullptr,
                       by_force ? nullptr : ds.data());
  return {u_bar, u_old_bar, s_old_bar, theta_bar, df, ds};
}

template <class Law>
void expect_same_blocks(const TermCase& c, const Law& law, unsigned seed, Seen& seen) {
  Rng rng(seed);
  TermStepData data;
  c.term().prepare(c.step, c.native, c.u_old, c.history.data(), data);
  const TermGroup& g = c.term().groups().front();
  const int n3 = 3 * g.num_nodes, nq = g.num_points, nh = nq * Law::ns, nt = nq * Law::ntheta;
  const VectorXd noise = uniform(rng, D * std::max({n3, nh, nt}) + 10);
  for (int i = 0; i < g.num_elements; ++i) {
    const TermElement e = term_element(c.term().kernels(), g, i, c.step.dt(), data.theta.front());
    const auto at = static_cast<Eigen::Index>(e.point);
    const VectorXd u = Eigen::Map<const VectorXd>(e.gather(c.u).data(), n3),
                   u_old = Eigen::Map<const VectorXd>(e.gather(c.u_old).data(), n3),
                   s_old = c.history.segment(at * Law::ns, nh);
    VectorXd s_bar = uniform(rng, nh);
    // Of some points nobody asks for the history.
    for (int q = 0; q < nq; ++q)
      if (rng() % 2) s_bar.segment(q * Law::ns, Law::ns).setZero();
    const double* prepared = data.prepared.data() + e.point * Law::np;
    for (const bool by_force : {true, false}) {
      const auto left_out = blocks(law, e, prepared, u, u_old, s_old, s_bar, noise, by_force),
                 all = blocks(EveryPoint<Law>{law}, e, prepared, u, u_old, s_old, s_bar, noise, by_force);
      for (std::size_t k = 0; k < all.size(); ++k)
        EXPECT_EQ((left_out[k] - all[k]).norm(), 0) << c.name << ", result " << k;
    }
    double natural[3][kMaxRows];
    gather<1>(e.view, u.data(), natural);
    for (int q = 0; q < nq; ++q) {
      const double x[3] = {natural[0][q], natural[1][q], natural[2][q]}, *p = prepared + q * Law::np;
      const double* rest = e.view.rest + q * Law::nrest;
      const int regime = law.regime(x, p, e.view.theta, rest, e.view.dt);
      ++(regime == 0 ? seen.unloaded : regime == 1 ? seen.stick : seen.slip);
      const bool touching = static_cast<const FrictionLaw&>(law).remembers(x, e.view.theta, rest);
      ++(touching ? seen.touching : seen.apart);
      seen.idle += !law.acts(x, p, e.view.theta, rest) && s_bar.segment(q * Law::ns, Law::ns).isZero(0);
    }
  }
}

template <class Law>
void expect_idle_points_change_nothing(const std::string& kind) {
  Seen seen;
  unsigned seed = 51;
  for (const ShapeChoice& choice : shapes())
    for (const Mollifier mollifier : {Mollifier::quintic, Mollifier::quadratic})
      for (const double apart :
           {0.0, 0.7, 0.8, 0.9, 1.5}) {  // mm by which the shape is moved off the skin, which was 0.8 deep
        TermCase c = surface_case(kind, choice, 2, mollifier);
        for (int knot = 0; knot < 3; ++knot) c.native.segment<3>(3 + 3 * knot) -= apart * choice.normal;
        const Eigen::Index ns = c.term().kernels().ns;
        for (Eigen::Index q = 0; ns * q < c.history.size(); ++q)
          c.history[ns * q] = q % 4 == 0 ? 0 : q % 4 == 1 ? 1e-12 : 0.3;
        const Law law{FrictionLaw{choice.shape.get(), 0.05, 5, mollifier}};
        expect_same_blocks(c, law, ++seed, seen);
      }
  EXPECT_GT(seen.stick, 100) << kind;
  EXPECT_GT(seen.slip, 100) << kind;
  EXPECT_GT(seen.unloaded, 100) << kind;
  EXPECT_GT(seen.touching, 100) << kind;
  EXPECT_GT(seen.apart, 100) << kind;
  EXPECT_GT(seen.idle, 100) << kind;
}

TEST(IdlePoints, ChangeNothingOfFrictionsBlocks) {
  expect_idle_points_change_nothing<FrictionLaw>("friction");
  expect_idle_points_change_nothing<ExtrapolatedFrictionLaw>("extrapolated friction");
}

/// Where a point begins to touch, where its pressure is zero, and where stick turns into slip: what the law says and what
/// dual numbers give meet on both sides.
TEST(IdlePoints, EndWhereDerivativesDo) {
  int idle = 0, busy = 0;
  const std::vector<ShapeChoice> choices = shapes();  // laws point to them
  for (const LawCase<FrictionLaw>& c : friction_cases(choices))
    for (const LawState& s : c.states) {
      const GapAt at = gap_at<0>(*c.law.shape, s.e.data(), s.rest.data(), s.theta.data() + 3,
                                 s.theta.data() + 9, static_cast<const double*>(nullptr));
      for (const double depth : {-1e-3, -1e-15, 0.0, 1e-15, 1e-3})
        for (const double pressure : {0.0, 1e-300, 0.3}) {
          VectorXd theta = s.theta, prepared(7);
          theta[1] = at.jet.gap - s.rest[3] + depth;  // the inflation that makes it so deep
          prepared << pressure, s.history.tail(3), s.e_old;
          Dual<27> u[3], p[7], th[17], sigma[3], lag[4];
          for (int k = 0; k < 3; ++k) u[k] = Dual<27>::variable(s.e[k], k);
          for (int k = 0; k < 7; ++k) p[k] = Dual<27>::variable(prepared[k], 3 + k);
          for (int k = 0; k < 17; ++k) th[k] = Dual<27>::variable(theta[k], 10 + k);
          (void)c.law.stress<Dual<27>>(u, p, th, s.rest.data(), s.dt, sigma);
          c.law.update<Dual<27>>(u, p, th, s.rest.data(), s.dt, lag);
          double by_stress = 0, by_lag = 0;
          for (int k = 0; k < 27; ++k) {
            for (const Dual<27>& x : sigma) by_stress += std::abs(x.d[k]);
            for (const Dual<27>& x : lag) by_lag += std::abs(x.d[k]);
          }
          const bool acts = c.law.acts(s.e.data(), prepared.data(), theta.data(), s.rest.data()),
                     remembers = c.law.remembers(s.e.data(), theta.data(), s.rest.data());
          EXPECT_EQ(acts, by_stress > 0) << c.name << " pressure " << pressure;
          EXPECT_EQ(remembers, by_lag > 0) << c.name << " depth " << depth;
          ++(acts || remembers ? busy : idle);
        }
    }
  EXPECT_GT(idle, 50);
  EXPECT_GT(busy, 50);
}

}  // namespace
}  // namespace rhytid::test
