#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "sim/mesh/triangle_surface.h"
#include "tests/sim/mesh/surface_testing.h"

namespace rhytid {
namespace {

using testing::AllOf;
using testing::HasSubstr;
using testing_support::input_error;

TriangleSurface grid() {
  return grid_surface(4, 4, 2, 2, GridPattern::diagonal_plus);
}
std::string refusal(const TriangleSurface& surface) {
  return input_error([&] { validate_surface(surface); });
}
void append_vertex(TriangleSurface& surface, const Vec3& position) {
  surface.vertices.conservativeResize(surface.vertices.rows() + 1, 3);
  surface.vertices.bottomRows(1) = position.transpose();
  surface.source_vertex.push_back(static_cast<int>(surface.vertices.rows()) - 1);
}

TEST(ValidateSurface, AcceptsAClosedSurface) {
  TriangleSurface tetrahedron;
  tetrahedron.vertices.resize(4, 3);
  tetrahedron.vertices << 0, 0, 0, 5, 0, 0, 0, 5, 0, 0, 0, 5;
  tetrahedron.faces = {{0, 2, 1}, {0, 1, 3}, {0, 3, 2}, {1, 2, 3}};
  EXPECT_NO_THROW(validate_surface(tetrahedron));
}

TEST(ValidateSurface, RefusesNoFaces) {
  TriangleSurface surface = grid();
  surface.faces.clear();
  EXPECT_THAT(refusal(surface), AllOf(HasSubstr(surface.origin), HasSubstr("no faces")));
}

TEST(ValidateSurface, RefusesAnIndexOutOfRange) {
  TriangleSurface surface = grid();
  surface.faces[2][1] = 40;
  EXPECT_THAT(refusal(surface), AllOf(HasSubstr("face 3 "), HasSubstr("vertex 41"), HasSubstr("9")));
}

TEST(ValidateSurface, RefusesNonFiniteCoordinates) {
  TriangleSurface surface = grid();
  surface.vertices(4, 1) = std::numeric_limits<double>::quiet_NaN();
  EXPECT_THAT(refusal(surface), HasSubstr("vertex 5"));
}

TEST(ValidateSurface, RefusesAnAbsurdScale) {
  TriangleSurface surface = grid();
  surface.vertices *= 0.1;
  EXPECT_THAT(refusal(surface), AllOf(HasSubstr("0.5657 mm"), HasSubstr("mm_per_unit")));
  surface.vertices *= 1e5;
  EXPECT_THAT(refusal(surface), HasSubstr("mm_per_unit"));
}

TEST(ValidateSurface, RefusesADegenerateFace) {
  TriangleSurface surface = grid();
  surface.vertices.row(1) = (surface.vertices.row(0) + surface.vertices.row(4)) / 2;  // onto a diagonal
  EXPECT_THAT(refusal(surface), AllOf(HasSubstr("face 1 (vertices 1 2 5)"), HasSubstr("degenerate")));
}

TEST(ValidateSurface, RefusesARepeatedFace) {
  TriangleSurface surface = grid();
  const auto [a, b, c] = surface.faces[3];
  surface.faces.push_back({c, a, b});
  EXPECT_THAT(refusal(surface), AllOf(HasSubstr("face 9 "), HasSubstr("repeats face 4")));
}

TEST(ValidateSurface, RefusesAnEdgeOfThreeFaces) {
  TriangleSurface surface = grid();
  append_vertex(surface, Vec3(0, 0, 2));
  surface.faces.push_back({0, 4, 9});
  EXPECT_THAT(refusal(surface), AllOf(HasSubstr("vertices 1 and 5"), HasSubstr("3 faces (1 2 9)")));
}

TEST(ValidateSurface, RefusesMixedOrientation) {
  TriangleSurface surface = grid();
  std::swap(surface.faces[5][0], surface.faces[5][1]);
  EXPECT_THAT(refusal(surface), AllOf(HasSubstr("face 6"), HasSubstr("the same way"), HasSubstr("orient")));
}

TEST(ValidateSurface, RefusesSeveralParts) {
  TriangleSurface surface = grid();
  for (const double x : {10, 12, 11}) append_vertex(surface, Vec3(x, x == 11, 0));
  surface.faces.push_back({9, 10, 11});
  EXPECT_THAT(refusal(surface), AllOf(HasSubstr("2 separate parts"), HasSubstr("face 9")));
}

TEST(ValidateSurface, RefusesAVertexThatJoinsTwoFans) {
  TriangleSurface ring = grid_surface(3, 3, 3, 3, GridPattern::diagonal_minus);
  ring.faces.erase(ring.faces.begin() + 8, ring.faces.begin() + 10);  // the middle cell
  ring.faces.erase(ring.faces.begin(), ring.faces.begin() + 2);       // a corner cell
  for (auto& face : ring.faces)
    for (int& vertex : face) --vertex;  // vertex 0 went with its only cell
  ring.vertices = MatrixX3(ring.vertices.bottomRows(15));
  ring.source_vertex.erase(ring.source_vertex.begin());
  EXPECT_THAT(refusal(ring), AllOf(HasSubstr("vertex 6 "), HasSubstr("split the vertex")));
}

TEST(ValidateSurface, RefusesAVertexWithoutFaces) {
  TriangleSurface surface = grid();
  append_vertex(surface, Vec3(0, 0, 1));
  EXPECT_THAT(refusal(surface), HasSubstr("vertex 10 belongs to no face"));
}

TEST(ValidateSurface, NamesTheNumbersOfTheFile) {
  TriangleSurface surface = grid();
  for (int v = 0; v < 9; ++v) surface.source_vertex[v] = 100 + v;
  for (int f = 0; f < 8; ++f) surface.source_face.push_back(50 + f);
  surface.vertices.row(1) = surface.vertices.row(0);
  EXPECT_THAT(refusal(surface), HasSubstr("face 51 (vertices 101 102 105)"));
}

}  // namespace
}  // namespace rhytid
