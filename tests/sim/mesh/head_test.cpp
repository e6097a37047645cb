// A real head (ICT FaceKit, generic neutral mesh, in cm, 56 parts): crop, validate, extrude.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <numbers>

#include "tests/sim/mesh/surface_testing.h"
#include "tests/support/real_data.h"

namespace rhytid {
namespace {

class Head : public testing::Test {
 protected:
  void SetUp() override {
    RHYTID_REAL_FILE_OR_SKIP(path, kHeadFile);
    path_ = path;
    head_ = read_obj(path_, 10);
  }

  std::string path_;
  TriangleSurface head_;
  const Vec3 forehead_{0, 80, 103}, cheek_{50, -20, 90};  // mm
};

TEST_F(Head, IsReadWhole) {
  EXPECT_EQ(head_.vertices.rows(), 26719);
  EXPECT_EQ(head_.faces.size(), 2u * 25836 + 548);
  EXPECT_EQ(head_.source_face.back(), 25836 + 548 - 1);
  const Vec3 size = head_.vertices.colwise().maxCoeff() - head_.vertices.colwise().minCoeff();
  EXPECT_LT((size - Vec3(248, 338, 223)).cwiseAbs().maxCoeff(), 1);
}

TEST_F(Head, IsRefusedUncropped) {
  EXPECT_THAT(testing_support::input_error([&] { validate_surface(head_); }),
              testing::AllOf(testing::HasSubstr(path_), testing::HasSubstr("56 separate parts")));
}

TEST_F(Head, ForeheadAndCheekExtrude) {
  for (const Vec3& centre : {forehead_, cheek_}) {
    const double radius = 30;
    const TriangleSurface patch = crop_geodesic_disc(head_, centre, radius);
    ASSERT_NO_THROW(validate_surface(patch));
    double area = 0;
    for (const auto& [a, b, c] : patch.faces) {
      const Vec3 ab = patch.vertices.row(b) - patch.vertices.row(a),
                 ac = patch.vertices.row(c) - patch.vertices.row(a);
      area += ab.cross(ac).norm() / 2;
    }
    // Edge paths on a quad mesh cut into triangles are up to √2 longer than geodesics.
    EXPECT_LT(area, 1.1 * std::numbers::pi * radius * radius);
    EXPECT_GT(area, 0.45 * std::numbers::pi * radius * radius);
    for (int v = 0; v < patch.vertices.rows(); ++v)
      EXPECT_EQ(patch.vertices.row(v), head_.vertices.row(patch.source_vertex[v]));

    ExtrusionOptions options;
    options.layers = {{1.5, 1, 3}, {0.1, 1, 2}};
    const SkinMesh mesh = extrude(patch, options);
    const auto volume = testing_support::integrate_volume(mesh, 2);
    EXPECT_GT(volume.smallest_determinant, 0);
    EXPECT_NEAR(volume.per_material[1], 0.1 * area, 0.01 * 0.1 * area);
    EXPECT_NEAR(volume.per_material[0], 1.5 * area, 0.05 * 1.5 * area);
    EXPECT_GT(mesh.column_normals.col(2).mean(), 0.5);  // the face looks along +z
    std::printf("[   head   ] %ld vertices, %d faces, %.0f mm², %d columns, %zu on the rim\n",
                static_cast<long>(patch.vertices.rows()), mesh.num_faces, area, mesh.num_columns,
                mesh.rim_columns.size());
  }
}

}  // namespace
}  // namespace rhytid
