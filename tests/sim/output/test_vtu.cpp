#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cstdio>
#include <numeric>
#include <random>

#include "sim/core/error.h"
#include "sim/output/atomic_file.h"
#include "sim/output/csv.h"
#include "sim/output/surface_files.h"
#include "sim/output/surface_tessellation.h"
#include "sim/output/vtu.h"
#include "tests/sim/output/sample_mesh.h"
#include "tests/support/paths.h"
#include "tests/support/temporary_folder.h"

namespace rhytid {
namespace {

using test::sample_displacement;
using test::sample_mesh;
using test::TemporaryFolder;
using ::testing::HasSubstr;

struct VtkAnswer {
  int exit_code;
  std::string text;
};

VtkAnswer ask_vtk(const std::string& file, const std::string& expected) {
  const std::string command = std::string("/usr/bin/python3 ") + source_dir() +
                              "/tests/sim/output/vtk_readback.py " + file + " " + expected + " 2>&1";
  FILE* pipe = popen(command.c_str(), "r");
  if (!pipe) return {77, "cannot start python3"};
  VtkAnswer answer;
  char buffer[512];
  while (fgets(buffer, sizeof buffer, pipe)) answer.text += buffer;
  answer.exit_code = WEXITSTATUS(pclose(pipe));
  if (answer.exit_code == 127) answer = {77, "no /usr/bin/python3"};
  const char* required = std::getenv("RHYTID_REQUIRE_CHECKS");
  if (answer.exit_code == 77 && required != nullptr && std::string(required) != "0")
    answer = {1, "RHYTID_REQUIRE_CHECKS is set: " + answer.text};
  return answer;
}

/// Values of our own basis at random points of every element, in VTK's parametric coordinates (t from 0 to
/// 1).
CsvTable expected_points(const SkinMesh& mesh, const VectorXd& u) {
  CsvTable table({{"cell", ""},
                  {"r", ""},
                  {"s", ""},
                  {"t", ""},
                  {"x", "mm"},
                  {"y", "mm"},
                  {"z", "mm"},
                  {"d1", "mm"},
                  {"d2", "mm"},
                  {"d3", "mm"}});
  std::mt19937 random(11);
  std::uniform_real_distribution<double> uniform;
  const TriangleBasis triangle(mesh.order);
  int cell = 0;
  for (size_t layer = 0; layer < mesh.element_layers.size(); ++layer) {
    const LineBasis line(mesh.element_layers[layer].order);
    for (int face = 0; face < mesh.num_faces; ++face, ++cell) {
      for (int trial = 0; trial < 8; ++trial) {
        double a = uniform(random), b = uniform(random);
        const double c = uniform(random);
        if (a + b > 1) a = 1 - a, b = 1 - b;
        std::vector<double> in_plane(triangle.num_nodes()), through(line.num_nodes());
        triangle.evaluate(a, b, in_plane.data(), nullptr, nullptr);
        line.evaluate(2 * c - 1, through.data(), nullptr);
        Vec3 x = Vec3::Zero(), d = Vec3::Zero();
        for (int j = 0; j < triangle.num_nodes(); ++j) {
          for (int k = 0; k < line.num_nodes(); ++k) {
            const int column = mesh.face_columns[face * triangle.num_nodes() + j];
            const int node = mesh.node(column, mesh.element_layers[layer].first_level + k);
            const double weight = in_plane[j] * through[k];
            d += weight * u.segment<3>(3 * node);
            x += weight * (Vec3(mesh.rest.row(node)) + Vec3(u.segment<3>(3 * node)));
          }
        }
        table.add_row({std::int64_t{cell}, a, b, c, x.x(), x.y(), x.z(), d.x(), d.y(), d.z()});
      }
    }
  }
  return table;
}

class VtuOfOrder : public ::testing::TestWithParam<std::tuple<int, int>> {};

TEST_P(VtuOfOrder, VtkEvaluatesTheSamePolynomial) {
  const auto [p, q] = GetParam();
  const TemporaryFolder folder;
  // Two element layers of different orders, so that degrees really are per cell.
  const SkinMesh mesh = sample_mesh(p, {q, q % 4 + 1});
  const VectorXd u = sample_displacement(mesh);
  VtuOptions options;
  options.time = 0.125;
  options.point_fields.push_back({"b_1/mm", 1, std::vector<double>(mesh.num_nodes(), 2.5)});
  options.cell_fields.push_back({"strain", 6, std::vector<double>(6 * mesh.num_elements(), 1.0)});
  write_vtu(folder / "a.vtu", mesh, u, options);
  expected_points(mesh, u).write(folder / "a.csv");
  const VtkAnswer answer = ask_vtk(folder / "a.vtu", folder / "a.csv");
  if (answer.exit_code == 77) GTEST_SKIP() << answer.text;
  EXPECT_EQ(answer.exit_code, 0) << answer.text;
  EXPECT_THAT(answer.text, HasSubstr("cells 4 time 0.125"));
}

INSTANTIATE_TEST_SUITE_P(AllOrders, VtuOfOrder,
                         ::testing::Combine(::testing::Range(1, 5), ::testing::Range(1, 5)));

TEST(Vtu, ReadBackWouldNoticeAWrongValue) {
  const TemporaryFolder folder;
  const SkinMesh mesh = sample_mesh(3, {2});
  VectorXd u = sample_displacement(mesh);
  expected_points(mesh, u).write(folder / "a.csv");
  u[3 * mesh.node(mesh.face_columns[4], 1)] += 1e-10;
  write_vtu(folder / "a.vtu", mesh, u);
  const VtkAnswer answer = ask_vtk(folder / "a.vtu", folder / "a.csv");
  if (answer.exit_code == 77) GTEST_SKIP() << answer.text;
  EXPECT_EQ(answer.exit_code, 1) << answer.text;
}

TEST(Vtu, WedgeOrderIsAPermutation) {
  for (int p = 1; p <= 4; ++p) {
    for (int q = 1; q <= 4; ++q) {
      std::vector<int> order = vtk_wedge_order(p, q), all((p + 1) * (p + 2) / 2 * (q + 1));
      std::iota(all.begin(), all.end(), 0);
      std::sort(order.begin(), order.end());
      EXPECT_EQ(order, all) << p << ' ' << q;
    }
  }
}

TEST(Vtu, RefusesSizesThatDoNotFitAndWritesNothing) {
  const TemporaryFolder folder;
  const SkinMesh mesh = sample_mesh(2, {1});
  EXPECT_THROW(write_vtu(folder / "a.vtu", mesh, VectorXd::Zero(5)), ContractError);
  VtuOptions options;
  options.cell_fields.push_back({"x", 1, {1.0}});
  EXPECT_THROW(write_vtu(folder / "a.vtu", mesh, {}, options), ContractError);
  EXPECT_THROW(write_vtu(folder / "no/a.vtu", mesh, {}), InputError);
  EXPECT_EQ(folder.num_files(), 0u);
}

TEST(Pvd, ListsFramesInOrder) {
  const TemporaryFolder folder;
  write_pvd(folder / "run.pvd", {{0, "f_0.vtu"}, {1.0 / 30, "a&b.vtu"}});
  const std::string text = read_file(folder / "run.pvd");
  const auto first = text.find("<DataSet timestep=\"0\" group=\"\" part=\"0\" file=\"f_0.vtu\"/>");
  const auto second =
      text.find("<DataSet timestep=\"0.03333333333333333\" group=\"\" part=\"0\" file=\"a&amp;b.vtu\"/>");
  EXPECT_NE(first, std::string::npos) << text;
  EXPECT_NE(second, std::string::npos) << text;
  EXPECT_LT(first, second);
}

TEST(Vtp, VtkReadsTheSurfaceBack) {
  const TemporaryFolder folder;
  const SkinMesh mesh = sample_mesh(4, {2}, 3);
  const SubdividedSurface surface(mesh, SurfaceSide::outer, 16);
  const MatrixX3 x = surface.positions(sample_displacement(mesh));
  std::vector<double> heights(x.col(2).begin(), x.col(2).end());
  write_vtp(folder / "s.vtp", x, surface.triangles(), {{"height_mm", 1, heights}});
  CsvTable table({{"point", ""}, {"x", "mm"}, {"y", "mm"}, {"z", "mm"}, {"value", "mm"}});
  for (int i = 0; i < x.rows(); i += 7) {
    table.add_row({std::int64_t{i}, x(i, 0), x(i, 1), x(i, 2), heights[i]});
  }
  table.write(folder / "s.csv");
  const VtkAnswer answer = ask_vtk(folder / "s.vtp", folder / "s.csv");
  if (answer.exit_code == 77) GTEST_SKIP() << answer.text;
  EXPECT_EQ(answer.exit_code, 0) << answer.text;
  EXPECT_THAT(answer.text, HasSubstr("points 2754 triangles 4608"));
}

TEST(Obj, WritesPositionsNormalsAndFaces) {
  const TemporaryFolder folder;
  MatrixX3 x(3, 3);
  x << 0, 0, 0, 1.0 / 3, 0, 0, 0, 1, 0;
  MatrixX3 n(3, 3);
  n << 0, 0, 1, 0, 0, 1, 0, 0, 1;
  write_obj(folder / "t.obj", x, {{0, 1, 2}}, n);
  const std::string text = read_file(folder / "t.obj");
  EXPECT_THAT(text, HasSubstr("v 0.3333333333333333 0 0\n"));
  EXPECT_THAT(text, HasSubstr("f 1//1 2//2 3//3\n"));
}

}  // namespace
}  // namespace rhytid
