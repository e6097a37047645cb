// Properties of the heat map that hold on any mesh.
#include "sim/surface/heat_map.h"

#include <gtest/gtest.h>

#include <Eigen/Geometry>
#include <limits>

#include "meshes.h"
#include "sim/core/error.h"
#include "sim/surface/heat_operator.h"

namespace rhytid {
namespace {

using testing::latitude_sphere;
using testing::Mesh;
using testing::shaken_surface;
using testing::square;

std::vector<HeatSource> random_sources(std::mt19937& random, const Mesh& mesh, int count) {
  std::uniform_real_distribution<double> uniform(0, 1);
  const double size = (mesh.nodes.colwise().maxCoeff() - mesh.nodes.colwise().minCoeff()).norm();
  std::vector<HeatSource> sources;
  for (int s = 0; s < count; ++s) {
    const auto node = static_cast<Eigen::Index>(random() % static_cast<unsigned>(mesh.nodes.rows()));
    sources.push_back({mesh.nodes.row(node).transpose(), size * std::pow(10.0, -2.5 * uniform(random))});
  }
  return sources;
}

/// Rows are convex combinations, and stay so under a change of time.
void expect_convex(const HeatMapWeights& map) {
  ASSERT_TRUE(map.weights.allFinite());
  ASSERT_TRUE(map.d_weights_d_time.allFinite());
  EXPECT_GE(map.weights.minCoeff(), 0.0);
  EXPECT_LT((map.weights.rowwise().sum().array() - 1).abs().maxCoeff(), 1e-14);
  const double rate = map.d_weights_d_time.cwiseAbs().maxCoeff();
  EXPECT_LE(map.d_weights_d_time.rowwise().sum().cwiseAbs().maxCoeff(), 1e-11 * rate);
}

TEST(HeatMap, StaysInTheHullOfTheStrengthsOnAnyMeshAtAnyTime) {
  std::mt19937 random(41);
  std::uniform_real_distribution<double> uniform(0, 1);
  int flips = 0, clamped = 0;
  for (int trial = 0; trial < 300; ++trial) {
    Mesh mesh = shaken_surface(random);
    // Damage that a scanned mesh may carry: turned, repeated, missing and flat triangles.
    if (trial % 3 == 1) {
      for (auto& triangle : mesh.triangles)
        if (random() % 5 == 0) std::swap(triangle[0], triangle[1]);
      mesh.triangles.push_back(mesh.triangles[random() % mesh.triangles.size()]);
      mesh.triangles.erase(mesh.triangles.begin() +
                           static_cast<std::ptrdiff_t>(random() % mesh.triangles.size()));
    }
    if (trial % 3 == 2) mesh.nodes.row(1) = 0.5 * (mesh.nodes.row(0) + mesh.nodes.row(2));
    if (trial % 6 == 5) mesh.nodes.row(7) = mesh.nodes.row(8);
    const auto sources = random_sources(random, mesh, 1 + trial % 5);
    const double time = trial % 20 == 0 ? 0 : std::pow(10.0, 24 * uniform(random) - 12);
    const HeatMapWeights map = diffuse_sources(mesh.nodes, mesh.triangles, sources, time);
    SCOPED_TRACE(trial);
    expect_convex(map);
    const VectorXd strength = VectorXd::NullaryExpr(static_cast<Eigen::Index>(sources.size()),
                                                    [&] { return 1 + 9 * uniform(random); });
    const VectorXd b = map.weights * strength;
    EXPECT_GE(b.minCoeff(), strength.minCoeff() * (1 - 1e-14));
    EXPECT_LE(b.maxCoeff(), strength.maxCoeff() * (1 + 1e-14));
    const HeatOperator op = assemble_heat_operator(mesh.nodes, mesh.triangles);
    flips += op.num_flips, clamped += op.num_clamped;
  }
  // The meshes were bad enough to need both cures.
  EXPECT_GT(flips, 10000);
  EXPECT_GT(clamped, 1000);
}

TEST(HeatMap, ThreeTrianglesAtOneEdgeAndAMoebiusStrip) {
  std::mt19937 random(42);
  Mesh fan;
  fan.nodes.resize(5, 3);
  fan.nodes << 0, 0, 0, 0, 0, 1, 0.1, 0, 0.5, 0, 0.1, 0.5, -0.1, -0.1, 0.5;
  fan.triangles = {{0, 1, 2}, {0, 1, 3}, {0, 1, 4}};
  Mesh strip;
  const int n = 24;
  strip.nodes.resize(2 * n, 3);
  for (int i = 0; i < n; ++i)
    for (int side = 0; side < 2; ++side) {
      const double angle = 2 * std::numbers::pi * i / n, w = side == 0 ? -0.3 : 0.3;
      strip.nodes.row(2 * i + side) << (1 + w * std::cos(angle / 2)) * std::cos(angle),
          (1 + w * std::cos(angle / 2)) * std::sin(angle), w * std::sin(angle / 2);
    }
  for (int i = 0; i < n; ++i) {
    const int a = 2 * i, b = a + 1;
    const int c = i + 1 < n ? a + 2 : 1, d = i + 1 < n ? a + 3 : 0;
    strip.triangles.push_back({a, c, b});
    strip.triangles.push_back({b, c, d});
  }
  for (const Mesh& mesh : {fan, strip})
    for (const double time : {1e-3, 0.1, 10.0}) {
      const auto sources = random_sources(random, mesh, 3);
      expect_convex(diffuse_sources(mesh.nodes, mesh.triangles, sources, time));
    }
}

TEST(HeatMap, OneSourceGivesAConstantMap) {
  std::mt19937 random(43);
  for (int trial = 0; trial < 10; ++trial) {
    const Mesh mesh = shaken_surface(random);
    const HeatMapWeights map = diffuse_sources(mesh.nodes, mesh.triangles, random_sources(random, mesh, 1),
                                               std::pow(10.0, trial - 5));
    EXPECT_EQ(map.weights, MatrixXd::Ones(mesh.nodes.rows(), 1).eval());
    EXPECT_LT(map.d_weights_d_time.cwiseAbs().maxCoeff(), 1e-13 * std::pow(10.0, 5 - trial));
  }
}

TEST(HeatMap, TimeZeroIsTheQuotientOfTheKernelsElseTheNearestSource) {
  const Mesh mesh = square(20, 10);
  const std::vector<HeatSource> sources{{Vec3(3, 5, 0), 3}, {Vec3(6, 5, 0), 2.5}};
  const HeatMapWeights map = diffuse_sources(mesh.nodes, mesh.triangles, sources, 0);
  int unreached = 0;
  for (Eigen::Index i = 0; i < mesh.nodes.rows(); ++i) {
    double theta[2];
    for (int s = 0; s < 2; ++s) {
      const HeatSource& source = sources[static_cast<std::size_t>(s)];
      const double q = (mesh.nodes.row(i).transpose() - source.position).norm() / source.radius;
      theta[s] = q < 1 ? std::pow(1 - q * q, 4) : 0;
    }
    if (theta[0] + theta[1] < 1e-200) {
      ++unreached;
      EXPECT_EQ(map.weights(i, 0), mesh.nodes(i, 0) <= 4.5 ? 1 : 0);
      EXPECT_EQ(map.d_weights_d_time.row(i).norm(), 0);
    } else {
      EXPECT_NEAR(map.weights(i, 0), theta[0] / (theta[0] + theta[1]), 1e-14);
    }
  }
  EXPECT_EQ(map.num_unreached, unreached);
  EXPECT_GT(unreached, 100);
}

TEST(HeatMap, LongTimesApproachTheMassWeightedMean) {
  std::mt19937 random(44);
  const Mesh mesh = latitude_sphere(10);
  const auto sources = random_sources(random, mesh, 4);
  const HeatOperator op = assemble_heat_operator(mesh.nodes, mesh.triangles);
  Eigen::RowVectorXd limit = Eigen::RowVectorXd::Zero(4);
  for (int s = 0; s < 4; ++s)
    for (Eigen::Index i = 0; i < mesh.nodes.rows(); ++i) {
      const HeatSource& source = sources[static_cast<std::size_t>(s)];
      const double d2 = (mesh.nodes.row(i).transpose() - source.position).squaredNorm();
      limit[s] += op.mass[i] * std::pow(std::max(0.0, 1 - d2 / (source.radius * source.radius)), 4);
    }
  limit /= limit.sum();
  double error[2];
  for (int k = 0; k < 2; ++k) {
    const double time = 1e4 * (k + 1);
    const HeatMapWeights map = diffuse_sources(mesh.nodes, mesh.triangles, sources, time);
    error[k] = (map.weights.rowwise() - limit).cwiseAbs().maxCoeff();
  }
  EXPECT_NEAR(error[0] / error[1], 2, 0.01);  // O(1/t)
  for (const double time : {1e15, 1e100, 1e300, std::numeric_limits<double>::max()}) {
    const HeatMapWeights map = diffuse_sources(mesh.nodes, mesh.triangles, sources, time);
    EXPECT_LT((map.weights.rowwise() - limit).cwiseAbs().maxCoeff(), 1e-12) << time;
    EXPECT_LT(map.d_weights_d_time.cwiseAbs().maxCoeff(), 1e-12) << time;
  }
}

TEST(HeatMap, TimeDerivativePassesTheTaylorTest) {
  std::mt19937 random(45);
  for (int trial = 0; trial < 12; ++trial) {
    const Mesh mesh = shaken_surface(random);
    const double size2 = (mesh.nodes.colwise().maxCoeff() - mesh.nodes.colwise().minCoeff()).squaredNorm();
    const auto sources = random_sources(random, mesh, 3);
    const double time = size2 * std::pow(10.0, -3 + 4 * (trial % 6) / 5.0);
    const HeatMapWeights at = diffuse_sources(mesh.nodes, mesh.triangles, sources, time);
    ASSERT_GT(at.d_weights_d_time.cwiseAbs().maxCoeff() * time, 1e-6);
    double remainder[3];
    for (int k = 0; k < 3; ++k) {
      const double step = time * 4e-3 / (1 << k);
      const HeatMapWeights moved = diffuse_sources(mesh.nodes, mesh.triangles, sources, time + step);
      remainder[k] = (moved.weights - at.weights - step * at.d_weights_d_time).norm();
    }
    EXPECT_NEAR(std::log2(remainder[0] / remainder[1]), 2, 0.05) << trial;
    EXPECT_NEAR(std::log2(remainder[1] / remainder[2]), 2, 0.05) << trial;
  }
}

TEST(HeatMap, DoesNotDependOnThePlaceInSpace) {
  std::mt19937 random(46);
  for (int trial = 0; trial < 10; ++trial) {
    Mesh mesh = trial == 0 ? square(16, 10) : shaken_surface(random);
    auto sources = random_sources(random, mesh, 3);
    const double time = std::pow(10.0, trial % 5 - 1);
    const HeatMapWeights before = diffuse_sources(mesh.nodes, mesh.triangles, sources, time);
    const Mat3 rotation = Eigen::AngleAxisd(0.3 + trial, Vec3(1, 2, -2) / 3).toRotationMatrix();
    const Vec3 shift(20, -30, 50);
    mesh.nodes = ((mesh.nodes * rotation.transpose()).rowwise() + shift.transpose()).eval();
    for (HeatSource& source : sources) source.position = rotation * source.position + shift;
    const HeatMapWeights after = diffuse_sources(mesh.nodes, mesh.triangles, sources, time);
    EXPECT_LT((before.weights - after.weights).cwiseAbs().maxCoeff(), 1e-10);
    EXPECT_LT((before.d_weights_d_time - after.d_weights_d_time).cwiseAbs().maxCoeff() * time, 1e-10);
  }
}

TEST(HeatMap, ReportsSourcesTooSmallForTheMeshAndNodesOutOfReach) {
  Mesh mesh = square(10, 10);
  // A second sheet that nothing connects to the first, and a node of no triangle.
  const Eigen::Index first = mesh.nodes.rows();
  mesh.nodes.conservativeResize(first + 4, 3);
  mesh.nodes.bottomRows(4) << 100, 0, 0, 101, 0, 0, 100, 1, 0, 5, 5, 3;
  mesh.triangles.push_back(
      {static_cast<int>(first), static_cast<int>(first) + 1, static_cast<int>(first) + 2});
  const std::vector<HeatSource> sources{{Vec3(2, 2, 0), 3}, {Vec3(7.3, 7.3, 0), 0.01}};
  const HeatMapWeights map = diffuse_sources(mesh.nodes, mesh.triangles, sources, 4);
  expect_convex(map);
  EXPECT_EQ(map.num_unreached, 4);
  EXPECT_EQ(map.unresolved_sources, std::vector<int>{1});
  EXPECT_EQ(map.weights(first, 1), 1);       // nearest of the two
  EXPECT_GT(map.weights(7 * 11 + 7, 1), 0);  // the unresolved source still acts
  EXPECT_GT(map.weights(10 * 11 + 10, 1), map.weights(0, 1));
}

TEST(HeatMap, RefusesWhatItCannotDiffuse) {
  const Mesh mesh = square(2, 1);
  const std::vector<HeatSource> good{{Vec3(0.5, 0.5, 0), 1}};
  EXPECT_THROW(diffuse_sources(mesh.nodes, mesh.triangles, {}, 1), ContractError);
  EXPECT_THROW(diffuse_sources(mesh.nodes, mesh.triangles, good, -1), ContractError);
  EXPECT_THROW(diffuse_sources(mesh.nodes, mesh.triangles, good, std::nan("")), ContractError);
  EXPECT_THROW(diffuse_sources(mesh.nodes, mesh.triangles, {{Vec3(0, 0, 0), 0}}, 1), ContractError);
  EXPECT_THROW(diffuse_sources(mesh.nodes, mesh.triangles, {{Vec3(0, std::nan(""), 0), 1}}, 1),
               ContractError);
  EXPECT_THROW(diffuse_sources(mesh.nodes, {}, good, 1), ContractError);
  EXPECT_THROW(diffuse_sources(mesh.nodes, {{0, 1, 99}}, good, 1), ContractError);
  EXPECT_THROW(diffuse_sources(mesh.nodes, {{0, 1, 1}}, good, 1), ContractError);
  EXPECT_THROW(diffuse_sources(MatrixX3::Zero(9, 3), mesh.triangles, good, 1), ContractError);
}

}  // namespace
}  // namespace rhytid
