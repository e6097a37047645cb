#include "sim/surface/imls.h"

#include <gtest/gtest.h>

#include <Eigen/Geometry>
#include <algorithm>
#include <cstring>
#include <numbers>
#include <random>

#include "hyper_dual.h"
#include "sim/core/error.h"
#include "sim/surface/point_lattice.h"

namespace rhytid {
namespace {

using testing::exact_jet;
using testing::ExactJet;
using testing::HyperDual;

struct Cloud {
  MatrixX3 points, normals;
};

Vec3 random_vector(std::mt19937& random) {
  std::uniform_real_distribution<double> uniform(-1, 1);
  return {uniform(random), uniform(random), uniform(random)};
}

/// Points of equal area on the sphere of radius R (golden spiral), outward normals.
Cloud sphere_cloud(int count, double radius) {
  Cloud cloud{MatrixX3(count, 3), MatrixX3(count, 3)};
  for (int i = 0; i < count; ++i) {
    const double z = 1 - (2 * i + 1.0) / count, r = std::sqrt(1 - z * z);
    const double angle = i * std::numbers::pi * (3 - std::sqrt(5.0));
    cloud.normals.row(i) << r * std::cos(angle), r * std::sin(angle), z;
  }
  cloud.points = radius * cloud.normals;
  return cloud;
}

Cloud random_cloud(std::mt19937& random, int count) {
  Cloud cloud{MatrixX3(count, 3), MatrixX3(count, 3)};
  for (int i = 0; i < count; ++i) {
    cloud.points.row(i) = random_vector(random).transpose();
    cloud.normals.row(i) = (random_vector(random) + Vec3(0, 0, 2)).normalized().transpose();
  }
  return cloud;
}

/// The printed formula, all points, no tricks.
ExactJet printed_imls(const Cloud& cloud, double h, ImlsKernel kernel, double epsilon, const Vec3& x) {
  return exact_jet(x, [&](const HyperDual(&v)[3]) {
    HyperDual numerator, denominator;
    for (Eigen::Index i = 0; i < cloud.points.rows(); ++i) {
      HyperDual d2, s;
      for (int k = 0; k < 3; ++k) {
        const HyperDual d = v[k] - HyperDual(cloud.points(i, k));
        d2 = d2 + d * d;
        s = s + HyperDual(cloud.normals(i, k)) * d;
      }
      const HyperDual one(1);
      const HyperDual u = kernel == ImlsKernel::smooth
                              ? one - d2 / HyperDual(h * h)
                              : one - sqrt(d2 + HyperDual(epsilon * epsilon)) / HyperDual(h);
      if (u.f <= 0) continue;
      const HyperDual theta = u * u * u * u;
      numerator = numerator + theta * s;
      denominator = denominator + theta;
    }
    return numerator / denominator;
  });
}

bool same_bits(const GapJet& a, const GapJet& b) {
  return a.supported == b.supported && std::memcmp(&a.gap, &b.gap, sizeof a.gap) == 0 &&
         std::memcmp(a.gradient.data(), b.gradient.data(), sizeof(double) * 3) == 0 &&
         std::memcmp(a.hessian.data(), b.hessian.data(), sizeof(double) * 9) == 0;
}

TEST(Imls, JetIsThatOfThePrintedFormula) {
  std::mt19937 random(21);
  const Cloud cloud = random_cloud(random, 300);
  const double h = 0.5, epsilon = 0.02;
  for (const ImlsKernel kernel : {ImlsKernel::smooth, ImlsKernel::literal}) {
    const ImlsSurface surface(cloud.points, 3 * cloud.normals, {h, kernel, epsilon});
    for (int trial = 0; trial < 100; ++trial) {
      // Every fourth query sits exactly on a point, where the printed kernel has its cone.
      const Vec3 x = trial % 4 == 0 ? Vec3(cloud.points.row(trial)) : random_vector(random);
      const ExactJet exact = printed_imls(cloud, h, kernel, epsilon, x);
      const GapJet jet = surface.evaluate(x);
      ASSERT_TRUE(jet.supported);
      EXPECT_NEAR(jet.gap, exact.value, 1e-14);
      EXPECT_LT((jet.gradient - exact.gradient).norm(), 1e-13 * (1 + exact.gradient.norm()));
      EXPECT_LT((jet.hessian - exact.hessian).norm(), 1e-12 * (1 + exact.hessian.norm()));
      EXPECT_EQ(jet.hessian, jet.hessian.transpose().eval());
    }
  }
}

TEST(Imls, FiniteDifferencesConvergeAtSecondOrder) {
  std::mt19937 random(22);
  const Cloud cloud = random_cloud(random, 300);
  for (const ImlsKernel kernel : {ImlsKernel::smooth, ImlsKernel::literal}) {
    const ImlsSurface surface(cloud.points, cloud.normals, {0.7, kernel, 0.2});
    const Vec3 x(0.1, -0.2, 0.15), direction = Vec3(1, 2, -1).normalized();
    const GapJet jet = surface.evaluate(x);
    double slope_error[2], curve_error[2];
    for (int k = 0; k < 2; ++k) {
      const double step = 4e-4 / (1 << k);
      const GapJet up = surface.evaluate(x + step * direction), down = surface.evaluate(x - step * direction);
      slope_error[k] = std::abs((up.gap - down.gap) / (2 * step) - jet.gradient.dot(direction));
      curve_error[k] = ((up.gradient - down.gradient) / (2 * step) - jet.hessian * direction).norm();
    }
    EXPECT_NEAR(std::log2(slope_error[0] / slope_error[1]), 2, 0.05);
    EXPECT_NEAR(std::log2(curve_error[0] / curve_error[1]), 2, 0.05);
  }
}

TEST(Imls, ReproducesAPlaneExactly) {
  std::mt19937 random(23);
  const Vec3 normal = Vec3(1, -2, 3).normalized(), u = normal.unitOrthogonal(), v = normal.cross(u);
  const Vec3 origin(40, -70, 25);
  Cloud plane{MatrixX3(900, 3), MatrixX3(900, 3)};
  for (int i = 0; i < 900; ++i) {
    const Vec3 r = 10 * random_vector(random);
    plane.points.row(i) = (origin + r[0] * u + r[1] * v).transpose();
    plane.normals.row(i) = normal.transpose();
  }
  for (const ImlsKernel kernel : {ImlsKernel::smooth, ImlsKernel::literal}) {
    const ImlsSurface surface(plane.points, plane.normals, {2.5, kernel, 0});
    for (int trial = 0; trial < 300; ++trial) {
      const Vec3 r = random_vector(random);
      const Vec3 x = origin + 8 * r[0] * u + 8 * r[1] * v + 1.5 * r[2] * normal;
      const GapJet jet = surface.evaluate(x);
      ASSERT_TRUE(jet.supported);
      EXPECT_NEAR(jet.gap, 1.5 * r[2], 5e-14);
      EXPECT_LT((jet.gradient - normal).norm(), 1e-12);
      EXPECT_LT(jet.hessian.norm(), 1e-11);
    }
  }
}

TEST(Imls, SphereOffsetIsTheKernelMoment) {
  // On the sphere s = −d²/2R, so g = −c h²/R with c = ½ ∫θ q³ / ∫θ q: 1/12 (smooth), 3/56 (literal).
  const double radius = 80, h = 8;
  const Cloud cloud = sphere_cloud(60000, radius);
  for (const auto& [kernel, moment] :
       {std::pair{ImlsKernel::smooth, 1.0 / 12}, std::pair{ImlsKernel::literal, 3.0 / 56}}) {
    const ImlsSurface surface(cloud.points, cloud.normals, {h, kernel, 1e-6});
    for (int i = 1000; i < 60000; i += 7919) {
      const Vec3 n = cloud.normals.row(i).transpose();
      const GapJet jet = surface.evaluate(Vec3(cloud.points.row(i)));
      EXPECT_NEAR(jet.gap / (-moment * h * h / radius), 1, 0.03);
      EXPECT_LT((jet.gradient.normalized() - n).norm(), 2e-3);
      // Curvature of the level set: the tangential Hessian is |∇g|/R times the identity.
      const Vec3 t = n.unitOrthogonal();
      if (kernel == ImlsKernel::smooth) {
        EXPECT_NEAR(t.dot(jet.hessian * t) * radius, 1, 0.1);
      }
    }
  }
}

TEST(Imls, SmoothKernelIsTwiceDifferentiableAcrossAPointAndTheSupportEdge) {
  std::mt19937 random(24);
  const Cloud cloud = random_cloud(random, 300);
  const double h = 0.5;
  const ImlsSurface surface(cloud.points, cloud.normals, {h, ImlsKernel::smooth, 0});
  const Vec3 point = cloud.points.row(17).transpose(), direction = Vec3(2, -1, 1).normalized();
  for (const Vec3& place : {point, Vec3(point + h * direction)}) {
    double jump[2];
    for (int k = 0; k < 2; ++k) {
      const double step = 1e-4 / (1 << k);
      jump[k] = (surface.evaluate(place + step * direction).hessian -
                 surface.evaluate(place - step * direction).hessian)
                    .norm();
    }
    EXPECT_NEAR(jump[0] / jump[1], 2, 0.05);  // a discontinuous Hessian would give 1
  }
}

TEST(Imls, LiteralKernelKeepsItsConeDownToEpsilon) {
  const Cloud cloud = sphere_cloud(2000, 1);
  const double h = 0.18, epsilon = 1e-6;
  const ImlsSurface literal(cloud.points, cloud.normals, {h, ImlsKernel::literal, epsilon});
  const ImlsSurface smooth(cloud.points, cloud.normals, {h, ImlsKernel::smooth, 0});
  const Vec3 point = cloud.points.row(900).transpose(), t = point.unitOrthogonal();
  const auto jump = [&](const ImlsSurface& surface) {
    const double step = 1e-4;
    return (surface.evaluate(point + step * t).gradient - surface.evaluate(point - step * t).gradient).norm();
  };
  EXPECT_GT(jump(literal), 50 * jump(smooth));
  EXPECT_GT(literal.evaluate(point).hessian.norm(), 1e3);
  EXPECT_LT(smooth.evaluate(point).hessian.norm(), 3);
}

TEST(Imls, SaysWhereItDoesNotExist) {
  const Cloud cloud = sphere_cloud(2000, 1);
  const ImlsSurface surface(cloud.points, cloud.normals, {0.18, ImlsKernel::smooth, 0});
  for (const Vec3& x : {Vec3(0, 0, 1.2), Vec3(0, 0, 0), Vec3(1e6, 0, 0)}) {
    const GapJet jet = surface.evaluate(x);
    EXPECT_FALSE(jet.supported);
    EXPECT_EQ(jet.gap, 0);
    EXPECT_EQ(jet.gradient, Vec3::Zero().eval());
    EXPECT_EQ(jet.hessian, Mat3::Zero().eval());
  }
  // Which side such a point is on decides whether a trial state is refused or merely free of contact.
  EXPECT_TRUE(surface.behind(Vec3(0, 0, 0.1)));
  EXPECT_FALSE(surface.behind(Vec3(0, 0, 1.3)));
  // A single point in reach, up to the very edge of its support, gives its tangent plane.
  const MatrixX3 point = MatrixX3::Zero(1, 3);
  const MatrixX3 normal = Vec3::UnitZ().transpose();
  const ImlsSurface single(point, normal, {1, ImlsKernel::smooth, 0});
  for (const double distance : {0.5, 0.999999, 1 - 1e-12, std::nextafter(1.0, 0.0)}) {
    const GapJet jet = single.evaluate(Vec3(0, 0, distance));
    ASSERT_TRUE(jet.supported);
    EXPECT_DOUBLE_EQ(jet.gap, distance);
    EXPECT_LT((jet.gradient - Vec3::UnitZ()).norm(), 1e-15);
    EXPECT_TRUE(jet.hessian.allFinite());
  }
  EXPECT_FALSE(single.evaluate(Vec3(0, 0, 1)).supported);
}

TEST(Imls, CachedNeighboursDoNotChangeABit) {
  std::mt19937 random(25);
  Cloud cloud = random_cloud(random, 3000);
  cloud.points.rowwise() += Vec3(70, -40, 25).transpose();
  const double h = 0.3;
  int unsupported = 0;
  for (const ImlsKernel kernel : {ImlsKernel::smooth, ImlsKernel::literal}) {
    const ImlsSurface cached(cloud.points, cloud.normals, {h, kernel, 0});
    const ImlsSurface searched(cloud.points, cloud.normals, {h, kernel, 0, false});
    const auto compare = [&](const Vec3& x) {
      const GapJet plain = searched.evaluate(x);
      unsupported += !plain.supported;
      ASSERT_TRUE(same_bits(plain, cached.evaluate(x))) << x.transpose();
      const GapJet value = cached.evaluate(x, JetOrder::gap), slope = cached.evaluate(x, JetOrder::gradient);
      EXPECT_EQ(value.gap, plain.gap);
      EXPECT_EQ(slope.gap, plain.gap);
      EXPECT_EQ(slope.gradient, plain.gradient);
    };
    for (int trial = 0; trial < 1000; ++trial) {
      // All around and far beyond the cloud, on its points, and on the very edge of a point's support.
      const Vec3 p = cloud.points.row(trial).transpose(), direction = random_vector(random).normalized();
      compare(Vec3(70, -40, 25) + 1.5 * random_vector(random));
      compare(p);
      for (const double distance : {h, std::nextafter(h, 0.0), std::nextafter(h, 1.0), 1.2 * h})
        compare(p + distance * direction);
    }
    for (const Vec3& x : {Vec3(1e9, 0, 0), Vec3(-1e300, 1e300, 0), Vec3(0, 0, 0)}) compare(x);
  }
  EXPECT_GT(unsupported, 100);
}

TEST(PointLattice, HoldsEveryPointInReachAndFewMore) {
  std::mt19937 random(27);
  const Cloud cloud = sphere_cloud(5000, 10);
  const double h = 1;
  const PointLattice lattice(cloud.points, h);
  ASSERT_TRUE(lattice.usable());
  double held = 0, in_reach = 0;
  for (int trial = 0; trial < 500; ++trial) {
    const Vec3 x = (10 + 0.3 * random_vector(random)[0]) * random_vector(random).normalized();
    const auto near = lattice.near(x);
    EXPECT_TRUE(std::is_sorted(near.begin(), near.end()));
    EXPECT_EQ(std::adjacent_find(near.begin(), near.end()), near.end());
    for (int i = 0; i < 5000; ++i)
      if ((cloud.points.row(i).transpose() - x).norm() < h) {
        ++in_reach;
        EXPECT_TRUE(std::binary_search(near.begin(), near.end(), i));
      }
    held += static_cast<double>(near.size());
  }
  EXPECT_LT(held / in_reach, 2.2);
  EXPECT_TRUE(lattice.near(Vec3(std::nan(""), 0, 0)).empty());
  // A support far below the spacing has more cells than can be numbered; the surface then searches its tree.
  EXPECT_FALSE(PointLattice(cloud.points, 1e-7).usable());
  const ImlsSurface needles(cloud.points, cloud.normals, {1e-7, ImlsKernel::smooth, 0});
  EXPECT_TRUE(needles.evaluate(Vec3(cloud.points.row(7))).supported);
}

TEST(Imls, ThreadsShareOneSurface) {
  std::mt19937 random(26);
  const Cloud cloud = random_cloud(random, 2000);
  const ImlsSurface surface(cloud.points, cloud.normals, {0.3, ImlsKernel::smooth, 0});
  std::vector<Vec3> queries;
  for (int i = 0; i < 2000; ++i) queries.push_back(random_vector(random));
  std::vector<GapJet> alone(queries.size()), together(queries.size());
  for (std::size_t i = 0; i < queries.size(); ++i) alone[i] = surface.evaluate(queries[i]);
#pragma omp parallel for num_threads(4) schedule(dynamic)
  for (std::size_t i = 0; i < queries.size(); ++i) together[i] = surface.evaluate(queries[i]);
  for (std::size_t i = 0; i < queries.size(); ++i) EXPECT_TRUE(same_bits(alone[i], together[i]));
}

TEST(Imls, DefaultSupportIsThreeSpacingsAlsoWithRepeatedPoints) {
  MatrixX3 grid(400, 3);
  for (int i = 0; i < 200; ++i) grid.row(i) << 0.7 * (i % 20), 0.7 * (i / 20), 0;
  grid.bottomRows(200) = grid.topRows(200);
  EXPECT_NEAR(default_imls_support(grid), 2.1, 1e-12);
  const MatrixX3 normals = Vec3::UnitZ().transpose().replicate(400, 1);
  EXPECT_NEAR(ImlsSurface(grid, normals).support(), 2.1, 1e-12);
}

TEST(Imls, RefusesWhatIsNoSurface) {
  const MatrixX3 points = MatrixX3::Random(5, 3), normals = MatrixX3::Random(5, 3);
  EXPECT_THROW(ImlsSurface(MatrixX3(0, 3), MatrixX3(0, 3)), ContractError);
  EXPECT_THROW(ImlsSurface(points, normals.topRows(4)), ContractError);
  EXPECT_THROW(ImlsSurface(points, normals, {-1, ImlsKernel::smooth, 0}), ContractError);
  EXPECT_THROW(ImlsSurface(points, normals, {1, ImlsKernel::literal, 2}), ContractError);
  EXPECT_THROW(ImlsSurface(points, MatrixX3::Zero(5, 3)), ContractError);
  EXPECT_THROW(ImlsSurface(MatrixX3::Ones(5, 3), normals), ContractError);  // no spacing to choose h from
  MatrixX3 broken = points;
  broken(2, 1) = std::numeric_limits<double>::quiet_NaN();
  EXPECT_THROW(ImlsSurface(broken, normals), ContractError);
}

}  // namespace
}  // namespace rhytid
