// Clouds from files: the same points from every format, units, and what is refused by name.
#include "sim/surface/point_cloud.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <bit>
#include <cstring>
#include <fstream>

#include "sim/core/error.h"
#include "tests/support/temporary_folder.h"

namespace rhytid {
namespace {

using testing::HasSubstr;

class PointCloudFile : public testing::Test {
 protected:
  std::string write(const std::string& name, const std::string& text) const {
    const std::string path = folder_ / name;
    std::ofstream(path, std::ios::binary) << text;
    return path;
  }
  /// Two points: (1, 2, 3) with normal +z and (−4, 0.5, 6) with normal (3, 0, 4)/5.
  static void expect_the_two(const PointCloud& cloud, double scale = 1) {
    ASSERT_EQ(cloud.points.rows(), 2);
    EXPECT_EQ(Vec3(cloud.points.row(0)), scale * Vec3(1, 2, 3));
    EXPECT_EQ(Vec3(cloud.points.row(1)), scale * Vec3(-4, 0.5, 6));
    EXPECT_LT((Vec3(cloud.normals.row(0)) - Vec3(0, 0, 1)).norm(), 1e-15);
    EXPECT_LT((Vec3(cloud.normals.row(1)) - Vec3(0.6, 0, 0.8)).norm(), 1e-15);
  }
  void expect_refused(const std::string& name, const std::string& text, const std::string& why) const {
    const std::string path = write(name, text);
    try {
      (void)read_point_cloud(path, 1);
      ADD_FAILURE() << "not refused: " << text;
    } catch (const InputError& error) {
      EXPECT_THAT(error.what(), HasSubstr(path));
      EXPECT_THAT(error.what(), HasSubstr(why));
    }
  }
  test::TemporaryFolder folder_;
};

TEST_F(PointCloudFile, XyzWithBlanksCommasAndComments) {
  expect_the_two(
      read_point_cloud(write("a.xyz", "# bone\n1 2 3 0 0 7\n\n-4, 0.5, +6, 3, 0, 4 # last\r\n"), 1));
  expect_the_two(read_point_cloud(write("a.txt", "1 2 3 0 0 1\n-4 5e-1 6 3 0 4"), 10), 10);
}

TEST_F(PointCloudFile, ObjWithNormalsInOrderOrByFaces) {
  expect_the_two(read_point_cloud(write("a.obj", "v 1 2 3\nv -4 0.5 6\nvn 0 0 2\nvn 3 0 4\n"), 1));
  expect_the_two(read_point_cloud(
      write("b.obj",
            "v 1 2 3\nv -4 0.5 6\nvn 3 0 4\nvn 0 1 1\nvn 0 -1 1\nf 1//2 2//1 1/1/3\nf -1//-3 1//2 1//3\n"),
      1));
}

TEST_F(PointCloudFile, PlyInAsciiAndBothByteOrders) {
  expect_the_two(read_point_cloud(
      write("a.ply",
            "ply\nformat ascii 1.0\ncomment bone\nelement camera 1\nproperty float f\nelement vertex 2\n"
            "property uchar red\nproperty float x\nproperty float y\nproperty float z\n"
            "property double nx\nproperty double ny\nproperty double nz\nelement face 1\n"
            "property list uchar int vertex_indices\nend_header\n35\n255 1 2 3 0 0 1\n7 -4 0.5 6 3 0 4\n"
            "3 0 1 0\n"),
      1));
  for (const bool big : {false, true}) {
    std::string data;
    const auto add = [&](auto value) {
      char bytes[sizeof value];
      std::memcpy(bytes, &value, sizeof value);
      if (big != (std::endian::native == std::endian::big)) std::reverse(bytes, bytes + sizeof value);
      data.append(bytes, sizeof value);
    };
    const double rows[2][6] = {{1, 2, 3, 0, 0, 1}, {-4, 0.5, 6, 3, 0, 4}};
    for (const auto& row : rows) {
      for (int k = 0; k < 3; ++k) add(static_cast<float>(row[k]));
      add(static_cast<std::int16_t>(-300));
      for (int k = 3; k < 6; ++k) add(row[k]);
    }
    const std::string format = big ? "binary_big_endian" : "binary_little_endian";
    const std::string header =
        "ply\nformat " + format +
        " 1.0\nelement vertex 2\nproperty float x\nproperty float32 y\nproperty float z\n"
        "property short label\nproperty double nx\nproperty float64 ny\nproperty double nz\n"
        "end_header\n";
    expect_the_two(read_point_cloud(write("b.ply", header + data), 1));
    expect_refused("c.ply", header + data.substr(0, data.size() - 3), "the end of the file");
  }
}

TEST_F(PointCloudFile, RefusesByName) {
  EXPECT_THROW((void)read_point_cloud(folder_ / "absent.xyz", 1), InputError);
  expect_refused("a.stl", "solid", ".stl");
  expect_refused("a.xyz", "1 2 3 0 0 1\n1 2 3\n", "a.xyz:2");
  expect_refused("a.xyz", "1 2 x 0 0 1\n", "'x'");
  expect_refused("a.xyz", "1 2 3 0 0 1\n1 2 nan 0 0 1\n", "point 2");
  expect_refused("a.xyz", "1 2 3 0 0 1\n2 2 3 0 0 0\n", "no normal");
  expect_refused("a.xyz", "1 2 3 0 0 1\n1 2 3 0 0 1\n", "two distinct points");
  expect_refused("a.xyz", "", "two distinct points");
  expect_refused("a.obj", "v 1 2 3\nv 4 5 6\nvn 0 0 1\n", "2 points and 1 normals");
  expect_refused("a.obj", "v 1 2 3\nv 4 5 6\nvn 0 0 1\nf 1//1 2//1 3//1\n", "'3//1'");
  expect_refused("a.ply", "ply\nformat ascii 1.0\nelement vertex 1\nproperty float x\nend_header\n1\n",
                 "no property y");
  expect_refused("a.ply",
                 "ply\nformat ascii 1.0\nelement vertex 1\nproperty list uchar int x\nend_header\n1 1\n",
                 "a list");
  expect_refused("a.ply", "ply\nformat wood\nend_header\n", "wood");
  expect_refused("a.ply", "nothing\n", "expected ply");
}

}  // namespace
}  // namespace rhytid
