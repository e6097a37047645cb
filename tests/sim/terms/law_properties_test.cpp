// Properties that every law must have, whatever its physics: stress is the derivative of the energy, the
// tangent is symmetric, and the derivatives of prepare, stress and update by all their inputs are those of
// difference quotients.
#include <gtest/gtest.h>

#include "law_cases.h"
#include "tests/support/convergence.h"

namespace rhytid::test {
namespace {

/// [σ, history] of a whole step as a function of (e_old, history, θ, e), for any scalar.
template <class T, class Law>
void whole_step(const Law& law, const T* e_old, const T* history, const T* theta, const T* e,
                const LawState& s, T* out) {
  T prepared[Law::np + 1];
  law.template prepare<T>(e_old, history, theta, s.rest.data(), s.dt, prepared);
  (void)law.template stress<T>(e, prepared, theta, s.rest.data(), s.dt, out);
  law.template update<T>(e, prepared, theta, s.rest.data(), s.dt, out + Law::ne);
}

template <class Law>
struct Inputs {
  VectorXd values[4];  // e_old, history, θ, e
  explicit Inputs(const LawState& s) : values{s.e_old, s.history, s.theta, s.e} {}
  VectorXd evaluate(const Law& law, const LawState& s) const {
    VectorXd out = VectorXd::Zero(Law::ne + Law::ns);
    whole_step<double>(law, values[0].data(), values[1].data(), values[2].data(), values[3].data(), s,
                       out.data());
    return out;
  }
};

template <class Law>
void check_law(const std::vector<LawCase<Law>>& cases) {
  constexpr int ne = Law::ne, ns = Law::ns, nt = Law::ntheta;
  Rng rng(99);
  for (const auto& c : cases)
    for (std::size_t at = 0; at < c.states.size(); ++at) {
      SCOPED_TRACE(c.name + ", state " + std::to_string(at));
      const LawState& s = c.states[at];
      // Stress = ∂ψ/∂e and symmetric tangent, all from one dual evaluation of the energy.
      double prepared[Law::np + 1];
      c.law.template prepare<double>(s.e_old.data(), s.history.data(), s.theta.data(), s.rest.data(), s.dt,
                                     prepared);
      Dual<ne> e[ne], p[Law::np + 1], theta[nt], sigma[ne];
      for (int k = 0; k < ne; ++k) e[k] = Dual<ne>::variable(s.e[k], k);
      for (int k = 0; k < Law::np; ++k) p[k] = prepared[k];
      for (int k = 0; k < nt; ++k) theta[k] = s.theta[k];
      const Dual<ne> psi = c.law.template stress<Dual<ne>>(e, p, theta, s.rest.data(), s.dt, sigma);
      double plain[ne], scale = 0, tangent_scale = 0;
      const double psi_plain =
          c.law.template stress<double>(s.e.data(), prepared, s.theta.data(), s.rest.data(), s.dt, plain);
      EXPECT_GT(psi.v, 0) << "a state without energy tests nothing";
      EXPECT_NEAR(psi.v, psi_plain, 1e-14 * psi.v);
      for (int k = 0; k < ne; ++k) {
        scale = std::max(scale, std::fabs(plain[k]));
        for (int j = 0; j < ne; ++j) tangent_scale = std::max(tangent_scale, std::fabs(sigma[k].d[j]));
      }
      for (int k = 0; k < ne; ++k) {
        EXPECT_NEAR(psi.d[k], plain[k], 5e-13 * scale) << "stress " << k << " is not the energy's derivative";
        EXPECT_NEAR(sigma[k].v, plain[k], 1e-13 * scale);
        for (int j = 0; j < k; ++j) EXPECT_NEAR(sigma[k].d[j], sigma[j].d[k], 1e-12 * tangent_scale);
      }
      // Energy against itself by difference quotients (independent of Dual).
      const VectorXd de = uniform(rng, ne);
      VectorXd slope = VectorXd::Zero(1);
      for (int k = 0; k < ne; ++k) slope[0] += plain[k] * de[k];
      EXPECT_TRUE(derivative_converges(
          [&](double h) {
            const VectorXd moved = s.e + h * de;
            double unused[ne];
            VectorXd energy(1);
            energy[0] = c.law.template stress<double>(moved.data(), prepared, s.theta.data(), s.rest.data(),
                                                      s.dt, unused);
            return energy;
          },
          slope, s.step));
      // Every input group on its own, then all together.
      const Inputs<Law> inputs(s);
      for (int group = 0; group < 5; ++group) {
        if ((group == 1 && ns == 0) || (group == 0 && Law::np == 0)) continue;
        VectorXd direction[4] = {uniform(rng, ne) * s.step, uniform(rng, ns) * s.step,
                                 (uniform(rng, nt).array() * s.theta_scale.array() * 0.1).matrix(),
                                 uniform(rng, ne) * s.step};
        for (int k = 0; k < 4; ++k)
          if (group < 4 && k != group) direction[k].setZero();
        using D1 = Dual<1>;
        const int sizes[4] = {ne, ns, nt, ne};
        std::vector<D1> in[4];
        for (int k = 0; k < 4; ++k)
          for (int i = 0; i < sizes[k]; ++i) {
            in[k].emplace_back(inputs.values[k][i]);
            in[k].back().d[0] = direction[k][i];
          }
        D1 out[ne + ns];
        whole_step<D1>(c.law, in[0].data(), in[1].data(), in[2].data(), in[3].data(), s, out);
        VectorXd exact(ne + ns);
        for (int k = 0; k < ne + ns; ++k) exact[k] = out[k].d[0];
        EXPECT_TRUE(derivative_converges(
            [&](double h) {
              Inputs<Law> moved = inputs;
              for (int k = 0; k < 4; ++k) moved.values[k] += h * direction[k];
              return moved.evaluate(c.law, s);
            },
            exact, 1.0, 1e-11))
            << "input group " << group << " (old strain, history, theta, strain, all)";
      }
    }
}

TEST(LawProperties, Skin) {
  check_law(skin_cases());
}
TEST(LawProperties, ElasticSkin) {
  check_law(elastic_cases());
}
TEST(LawProperties, Volume) {
  check_law(volume_cases());
}
TEST(LawProperties, PreStretchedSkin) {
  check_law(pre_stretched(skin_cases()));
}
TEST(LawProperties, PreStretchedElasticSkin) {
  check_law(pre_stretched(elastic_cases()));
}
TEST(LawProperties, Ligament) {
  check_law(ligament_cases<LigamentLaw>());
}
TEST(LawProperties, FungLigament) {
  check_law(ligament_cases<FungLigamentLaw>());
}
TEST(LawProperties, Contact) {
  const auto choices = shapes();
  check_law(contact_cases(choices));
}
TEST(LawProperties, Friction) {
  const auto choices = shapes();
  check_law(friction_cases(choices));
}
TEST(LawProperties, ExtrapolatedFriction) {
  const auto choices = shapes();
  check_law(extrapolated_friction_cases(choices));
}

}  // namespace
}  // namespace rhytid::test
