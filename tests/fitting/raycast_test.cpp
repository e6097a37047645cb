#include "fitting/raycast.h"

#include <gtest/gtest.h>

#include <Eigen/Geometry>
#include <cmath>
#include <random>

#include "fitting/attachment.h"
#include "sim/core/error.h"

namespace rhytid::fitting {
namespace {

/// Triangulated sphere of radius r about c by latitude and longitude.
void add_sphere(const Vec3& c, double r, int n, MatrixX3* vertices,
                std::vector<std::array<int, 3>>* triangles) {
  const int first = static_cast<int>(vertices->rows());
  vertices->conservativeResize(first + (n + 1) * 2 * n, 3);
  for (int i = 0; i <= n; ++i)
    for (int j = 0; j < 2 * n; ++j) {
      const double a = M_PI * i / n, b = M_PI * j / n;
      vertices->row(first + i * 2 * n + j) =
          c + r * Vec3(std::sin(a) * std::cos(b), std::sin(a) * std::sin(b), std::cos(a));
    }
  for (int i = 0; i < n; ++i)
    for (int j = 0; j < 2 * n; ++j) {
      const int k = (j + 1) % (2 * n), p = first + i * 2 * n, q = p + 2 * n;
      if (i > 0) triangles->push_back({p + j, q + j, p + k});
      if (i < n - 1) triangles->push_back({p + k, q + j, q + k});
    }
}

TEST(RayCaster, PointsAreExactFarFromTheOrigin) {
  MatrixX3 v(0, 3);
  std::vector<std::array<int, 3>> t;
  const Vec3 centre(5000, -3000, 8000);  // mm: single precision alone would be wrong by half a micrometre
  add_sphere(centre, 80, 40, &v, &t);
  const RayCaster caster(v, t);
  std::mt19937 random(1);
  std::normal_distribution<double> normal;
  for (int i = 0; i < 500; ++i) {
    const Vec3 target = centre + 40 * Vec3(normal(random), normal(random), normal(random)).normalized();
    Ray ray{centre + 500 * Vec3(normal(random), normal(random), normal(random)).normalized(), {}};
    ray.direction = (target - ray.origin).normalized();
    const auto hit = caster.cast(ray);
    ASSERT_TRUE(hit.has_value());
    EXPECT_TRUE(hit->front_facing);
    EXPECT_GE(hit->barycentric.minCoeff(), 0);
    EXPECT_NEAR(hit->barycentric.sum(), 1, 1e-14);
    EXPECT_LT((ray.origin + hit->distance * ray.direction - hit->point).norm(), 1e-9);
    // The nearer of the two crossings.
    EXPECT_LT(hit->distance, (centre - ray.origin).norm());
  }
}

TEST(RayCaster, FindsPointsOnVerticesAndEdges) {
  MatrixX3 v(0, 3);
  std::vector<std::array<int, 3>> t;
  add_sphere(Vec3(1, 2, 3), 50, 12, &v, &t);
  const RayCaster caster(v, t);
  const Vec3 eye(1, 2, 300);
  int upper = 0;
  for (const auto& tri : t)
    for (int k = 0; k < 3; ++k) {
      const Vec3 a = v.row(tri[k]), b = v.row(tri[(k + 1) % 3]);
      for (const Vec3& target : {a, Vec3((a + b) / 2)}) {
        if (target.z() < 30) continue;  // seen from the eye without grazing
        ++upper;
        const auto hit = caster.cast({eye, (target - eye).normalized()});
        ASSERT_TRUE(hit.has_value());
        EXPECT_LT((hit->point - target).norm(), 1e-10);
      }
    }
  EXPECT_GT(upper, 100);
}

TEST(RayCaster, MissesAndBackSides) {
  MatrixX3 v(3, 3);
  v << 0, 0, 0, 10, 0, 0, 0, 10, 0;
  const RayCaster caster(v, {{0, 1, 2}});
  EXPECT_TRUE(caster.cast({{2, 2, 5}, {0, 0, -1}})->front_facing);
  EXPECT_FALSE(caster.cast({{2, 2, -5}, {0, 0, 1}})->front_facing);
  EXPECT_FALSE(caster.cast({{2, 2, 5}, {0, 0, 1}}).has_value());
  EXPECT_FALSE(caster.cast({{6, 6, 5}, {0, 0, -1}}).has_value());
  EXPECT_FALSE(RayCaster(MatrixX3(0, 3), {}).cast({{0, 0, 0}, {0, 0, 1}}).has_value());
  EXPECT_THROW(RayCaster(v, {{0, 1, 3}}), ContractError);
}

TEST(Attachment, ProjectedMaterialPointsAreFoundAgain) {
  MatrixX3 v(0, 3);
  std::vector<std::array<int, 3>> t;
  add_sphere(Vec3::Zero(), 90, 30, &v, &t);
  const RayCaster caster(v, t);
  Camera camera;
  camera.name = "front";
  camera.intrinsics << 1500, 0, 500, 0, 1500, 400, 0, 0, 1;
  camera.distortion = {-0.1, 0.02, 1e-4, -2e-4, 0};
  camera.rotation = Eigen::AngleAxisd(M_PI, Vec3(1, 0, 0)).toRotationMatrix();
  camera.translation = {0, 0, 500};
  TrackSet set;
  std::vector<Vec3> truth;
  for (std::size_t i = 0; i < t.size(); ++i) {
    const Vec3 bary(0.2, 0.5, 0.3);
    const Vec3 p = bary[0] * v.row(t[i][0]) + bary[1] * v.row(t[i][1]) + bary[2] * v.row(t[i][2]);
    if (p.z() < 40) continue;  // the side that the camera sees
    set.tracks.push_back(
        {static_cast<int>(truth.size()), "front", {{0, 0, TrackStatus::ok, camera.project(p)}}});
    truth.push_back(p);
  }
  set.tracks.push_back({9000, "front", {{0, 0, TrackStatus::lost}}});
  set.tracks.push_back({9001, "front", {{0, 0, TrackStatus::ok, {5, 5}}}});
  set.tracks.push_back({0, "side", {{0, 0, TrackStatus::ok, {500, 400}}}});
  const AttachmentResult result = attach_tracks(set, camera, caster);
  EXPECT_EQ(result.report.attached, static_cast<int>(truth.size()));
  EXPECT_EQ(result.report.not_seen, 1);
  EXPECT_EQ(result.report.missed_mesh, 1);
  EXPECT_EQ(result.report.back_side, 0);
  ASSERT_EQ(result.attachments.size(), truth.size());
  ASSERT_GT(truth.size(), 300u);
  for (std::size_t i = 0; i < truth.size(); ++i) {
    EXPECT_LT((result.attachments[i].point - truth[i]).norm(), 1e-9);
    EXPECT_LT((result.attachments[i].barycentric - Vec3(0.2, 0.5, 0.3)).norm(), 1e-9);
  }
  // Turned inside out, everything is seen from behind.
  for (auto& tri : t) std::swap(tri[1], tri[2]);
  EXPECT_EQ(attach_tracks(set, camera, RayCaster(v, t)).report.back_side, static_cast<int>(truth.size()));
}

}  // namespace
}  // namespace rhytid::fitting
