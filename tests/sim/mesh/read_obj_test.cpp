#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <fstream>
#include <ostream>

#include "sim/mesh/triangle_surface.h"
#include "tests/sim/mesh/surface_testing.h"

namespace rhytid {
namespace {

using testing::HasSubstr;
using testing_support::input_error;
using Face = std::array<int, 3>;

std::string write_obj(const std::string& text) {
  const auto* test = testing::UnitTest::GetInstance()->current_test_info();
  std::string name = std::string(test->test_suite_name()) + "_" + test->name();
  std::replace(name.begin(), name.end(), '/', '_');
  const std::string path = testing::TempDir() + "rhytid_" + name + ".obj";
  std::ofstream(path, std::ios::binary) << text;
  return path;
}

const std::string square = "v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\n";

TEST(ReadObj, FansPolygonsAndScales) {
  const std::string path = write_obj("# comment\nmtllib a.mtl\n" + square + "vn 0 0 1\ng part\nf 1 2 3 4\n");
  const TriangleSurface surface = read_obj(path, 10);
  ASSERT_EQ(surface.vertices.rows(), 4);
  EXPECT_EQ(surface.vertices.row(2), Eigen::RowVector3d(10, 10, 0));
  EXPECT_THAT(surface.faces, testing::ElementsAre(Face{0, 1, 2}, Face{0, 2, 3}));
  EXPECT_THAT(surface.source_face, testing::ElementsAre(0, 0));
  EXPECT_THAT(surface.source_vertex, testing::ElementsAre(0, 1, 2, 3));
  EXPECT_EQ(surface.origin, path);
}

TEST(ReadObj, ReadsAllCornerFormsAndNegativeIndices) {
  const TriangleSurface surface =
      read_obj(write_obj(square + "f 1/1 2/2 3/3\nf 1//5 3//6 4//7\nf -4/1/1 -3/-2/1 -1/1/1\n"), 1);
  EXPECT_THAT(surface.faces, testing::ElementsAre(Face{0, 1, 2}, Face{0, 2, 3}, Face{0, 1, 3}));
}

TEST(ReadObj, NegativeIndicesCountBackFromTheirLine) {
  const TriangleSurface surface = read_obj(write_obj("v 0 0 0\nv 1 0 0\nv 0 1 0\nf -3 -2 -1\nv 0 0 5\n"), 1);
  EXPECT_THAT(surface.faces, testing::ElementsAre(Face{0, 1, 2}));
}

TEST(ReadObj, AcceptsWindowsLineEndsTabsColoursContinuationAndMissingLastNewline) {
  const TriangleSurface surface = read_obj(
      write_obj("v\t+0 0 0 0.5 0.5 0.5\r\nv 1e0 0 0\r\nv 1 1 -2.5E-1\r\n\r\nf 1 2 \\\r\n3 # last"), 1);
  EXPECT_THAT(surface.faces, testing::ElementsAre(Face{0, 1, 2}));
  EXPECT_EQ(surface.vertices(2, 2), -0.25);
}

TEST(ReadObj, AcceptsFacesAheadOfTheirVertices) {
  EXPECT_THAT(read_obj(write_obj("f 1 2 3\n" + square), 1).faces, testing::ElementsAre(Face{0, 1, 2}));
}

struct BadObj {
  const char* name;
  std::string text, where, what;
};
std::ostream& operator<<(std::ostream& out, const BadObj& bad) {
  return out << bad.name;
}

class ReadObjRefuses : public testing::TestWithParam<BadObj> {};

TEST_P(ReadObjRefuses, NamingFileAndLine) {
  const std::string path = write_obj(GetParam().text);
  const std::string line = input_error([&] { read_obj(path, 1); });
  EXPECT_THAT(line, HasSubstr(path + GetParam().where));
  EXPECT_THAT(line, HasSubstr(GetParam().what));
}

INSTANTIATE_TEST_SUITE_P(
    Texts, ReadObjRefuses,
    testing::Values(BadObj{"words", "v 0 0 zero\n", ":1: ", "'zero'"},
                    BadObj{"nan", "v 0 0 0\nv 0 nan 0\n", ":2: ", "finite"},
                    BadObj{"short", "v 0 0\n", ":1: ", "2 coordinates"},
                    BadObj{"beyond", square + "f 1 2 3\nf 1 2 9\n", ":6: ", "vertex index 9, expected 1..4"},
                    BadObj{"zero", square + "f 0 1 2\n", ":5: ", "vertex index 0"},
                    BadObj{"back", square + "f 1 2 -5\n", ":5: ", "vertex index -5, expected at least -4"},
                    BadObj{"two", square + "\nf 1 2\n", ":6: ", "2 corners"},
                    BadObj{"corner", square + "f 1 2/x 3\n", ":5: ", "'2/x'"},
                    BadObj{"slashes", square + "f 1/1/1/1 2 3\n", ":5: ", "'1/1/1/1'"},
                    BadObj{"faceless", square, ": ", "no faces"}, BadObj{"empty", "", ": ", "no vertices"}),
    [](const auto& instance) { return std::string(instance.param.name); });

TEST(ReadObj, RefusesAMissingFile) {
  EXPECT_EQ(input_error([] { read_obj("/nowhere/none.obj", 1); }),
            "/nowhere/none.obj: got no file there, expected a readable mesh file (.obj, .ply, .glb or .msh)");
}

}  // namespace
}  // namespace rhytid
