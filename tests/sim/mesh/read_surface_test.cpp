// PLY, GLB and MSH readers: the same surface from every format, numbers of the file, refusals, damaged files.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <chrono>
#include <optional>
#include <random>

#include "sim/scene/scene_surface.h"
#include "tests/sim/mesh/mesh_files.h"
#include "tests/sim/mesh/surface_testing.h"
#include "tests/support/memory_limit.h"

namespace rhytid {
namespace {

using namespace testing_support;
using nlohmann::json;
using testing::AllOf;
using testing::ElementsAre;
using testing::HasSubstr;
using Face = std::array<int, 3>;

std::string refusal_of(const std::string& extension, const std::string& bytes) {
  return input_error([&] { (void)read_surface(write_file("refused." + extension, bytes), 1); });
}

TEST(ReadSurface, EveryFormatGivesTheSameSurface) {
  const TriangleSurface patch = wavy_patch();
  for (const auto& [extension, bytes] : every_format(patch)) {
    const TriangleSurface read = read_surface(write_file("same." + extension, bytes), 2);
    SCOPED_TRACE(read.format);
    EXPECT_EQ(read.vertices, MatrixX3(2 * patch.vertices));
    EXPECT_EQ(read.faces, patch.faces);
    EXPECT_EQ(read.source_vertex[7], 7);
    EXPECT_EQ(read.source_face[7], 7);
    EXPECT_THAT(read.notes[0], HasSubstr("30 vertices, 40 triangles"));
    EXPECT_NO_THROW(validate_surface(read));
  }
}

TEST(ReadSurface, MessagesNameTheNumbersOfTheFile) {
  const TriangleSurface patch = wavy_patch();
  std::vector<std::array<long, 2>> numbers;
  for (const auto& [extension, bytes] : every_format(patch)) {
    const TriangleSurface cropped =
        crop_sphere(read_surface(write_file("numbers." + extension, bytes), 1), Vec3::Zero(), 35);
    ASSERT_LT(cropped.faces.size(), patch.faces.size());
    ASSERT_NE(cropped.source_of_vertex(5), 5);
    EXPECT_EQ(cropped.vertices.row(5), patch.vertices.row(cropped.source_of_vertex(5)));
    numbers.push_back({cropped.file_vertex(5) - 10 * cropped.source_of_vertex(5),
                       cropped.file_face(5) - cropped.source_of_face(5)});
    if (extension != "msh") {
      EXPECT_EQ(cropped.file_vertex(5), cropped.source_of_vertex(5) + (extension == "obj"));
    }
  }
  EXPECT_EQ(numbers[5], (std::array<long, 2>{10, 101}));
  EXPECT_EQ(numbers[6], (std::array<long, 2>{10, 101}));
  EXPECT_EQ(numbers[0][1], 1);
  EXPECT_EQ(numbers[1][1], 0);
}

TEST(ReadSurface, FansQuadranglesAndLargerPolygons) {
  const TriangleSurface ply = read_surface(
      write_file("fan.ply",
                 "ply\r\nformat ascii 1.0\r\nelement vertex 5\r\nproperty int x\r\nproperty float y\r\n"
                 "property float z\r\nelement face 1\r\nproperty list int uint vertex_index\r\n"
                 "end_header\r\n0 0 0\n1 0 0 1 1 0\n0.5 2 0\n0 1 0\n5 0 1 2 3 4\n"),
      1);
  EXPECT_THAT(ply.faces, ElementsAre(Face{0, 1, 2}, Face{0, 2, 3}, Face{0, 3, 4}));
  const TriangleSurface msh = read_surface(
      write_file("fan.msh",
                 "$MeshFormat\n2.2 0 8\n$EndMeshFormat\n$Elements\n1\n5 3 2 0 1 1 2 3 7\n$EndElements\n"
                 "$Nodes\n4\n1 0 0 0\n2 1 0 0\n3 1 1 0\n7 0 1 0\n$EndNodes\n"),
      1);
  EXPECT_THAT(msh.faces, ElementsAre(Face{0, 1, 2}, Face{0, 2, 3}));
  EXPECT_EQ(msh.file_vertex(3), 7);
  EXPECT_EQ(msh.file_face(1), 5);
}

TEST(ReadSurface, CropsThatFindNothingOnAGiantAskForTheUnit) {
  TriangleSurface head = wavy_patch();
  SurfaceScene scene;
  scene.file = write_file("giant.obj", as_obj(head));
  scene.mm_per_unit = 1000;
  scene.crop_centre = Vec3(0, 0, 0);
  scene.crop_radius = 20;
  for (const char* by : {"geodesic", "distance"}) {
    scene.crop_by = by;
    EXPECT_THAT(input_error([&] { (void)scene_surface(scene); }),
                AllOf(HasSubstr("its extent is 80 m"), HasSubstr("is mm_per_unit right")));
  }
  scene.crop_radius = 1e9;  // whoever means it
  EXPECT_NO_THROW((void)scene_surface(scene));
}

// Rotation by 90° about z, then doubling, then a shift: x ↦ 2 (−y, x, z) + (1, 2, 3).
TEST(ReadGlb, AppliesNodeTransformsBothWays) {
  const TriangleSurface patch = wavy_patch();
  const double half = std::sqrt(0.5);
  const TriangleSurface parts =
      read_surface(write_file("parts.glb", as_glb(patch, {{"translation", {1, 2, 3}},
                                                          {"rotation", {0, 0, half, half}},
                                                          {"scale", {2, 2, 2}}})),
                   1);
  const TriangleSurface matrix =
      read_surface(write_file("matrix.glb",
                              as_glb(patch, {{"matrix", {0, 2, 0, 0, -2, 0, 0, 0, 0, 0, 2, 0, 1, 2, 3, 1}}})),
                   1);
  MatrixX3 expected(patch.vertices.rows(), 3);
  expected << -2 * patch.vertices.col(1), 2 * patch.vertices.col(0), 2 * patch.vertices.col(2);
  expected.rowwise() += Eigen::RowVector3d(1, 2, 3);
  EXPECT_LT((parts.vertices - expected).cwiseAbs().maxCoeff(), 1e-12);
  EXPECT_LT((matrix.vertices - expected).cwiseAbs().maxCoeff(), 1e-12);
  EXPECT_EQ(parts.faces, patch.faces);
}

TEST(ReadGlb, MirroredNodesKeepTheSurfaceFacingOut) {
  const TriangleSurface patch = wavy_patch();
  const TriangleSurface mirrored =
      read_surface(write_file("mirror.glb", as_glb(patch, {{"scale", {-1, 1, 1}}})), 1);
  const auto normal_z = [](const TriangleSurface& s) { return vertex_normals(s, 0).col(2).mean(); };
  EXPECT_GT(normal_z(patch), 0.9);
  EXPECT_GT(normal_z(mirrored), 0.9);
}

TEST(ReadGlb, RefusesShapesThatOnlyWeightsWouldMake) {
  const TriangleSurface patch = wavy_patch();
  EXPECT_THAT(refusal_of("glb", as_glb(patch, {{"weights", {0, 0.5}}})),
              HasSubstr("morph targets with weights"));
  EXPECT_EQ(read_surface(write_file("neutral.glb", as_glb(patch, {{"weights", {0, 0}}})), 1).vertices,
            patch.vertices);
}

TEST(ReadGlb, JoinsTheSeamsThatTexturesMake) {
  TriangleSurface patch = wavy_patch(), cut = patch;
  // Every face with vertices of its own, as flat shading exports it.
  cut.vertices.resize(3 * static_cast<int>(patch.faces.size()), 3);
  for (int f = 0; f < static_cast<int>(patch.faces.size()); ++f)
    for (int k = 0; k < 3; ++k) {
      cut.vertices.row(3 * f + k) = patch.vertices.row(patch.faces[f][k]);
      cut.faces[f][k] = 3 * f + k;
    }
  TriangleSurface joined = read_surface(write_file("seams.glb", as_glb(cut)), 1);
  join_coincident_vertices(joined);
  EXPECT_EQ(joined.vertices.rows(), patch.vertices.rows());
  EXPECT_NO_THROW(validate_surface(joined));
  EXPECT_THAT(joined.notes.back(), HasSubstr("90 vertices joined"));
  for (int v = 0; v < joined.vertices.rows(); ++v)  // numbers are those of the file
    EXPECT_EQ(joined.vertices.row(v), cut.vertices.row(joined.source_vertex[v]));
}

TEST(ReadGlb, KeepsItsSeamsWhenTold) {
  TriangleSurface cut = wavy_patch();
  const MatrixX3 whole = cut.vertices;
  cut.vertices.resize(3 * static_cast<int>(cut.faces.size()), 3);
  for (int f = 0; f < static_cast<int>(cut.faces.size()); ++f)
    for (int k = 0; k < 3; ++k) {
      cut.vertices.row(3 * f + k) = whole.row(cut.faces[f][k]);
      cut.faces[f][k] = 3 * f + k;
    }
  SurfaceScene scene;
  scene.file = write_file("kept.glb", as_glb(cut));
  scene.mm_per_unit = 1;
  EXPECT_EQ(scene_surface(scene).vertices.rows(), whole.rows()) << "auto joins what the format doubles";
  scene.coincident = "keep";
  EXPECT_EQ(scene_surface(scene).vertices, cut.vertices);
}

/// Small files that claim to hold more than they do: refused at once, without room for what they claim.
TEST(ReadSurface, RefusesSmallFilesThatClaimMuch) {
  std::optional<test::MemoryLimit> limit(std::in_place, std::size_t{256} << 20);
  if (test::MemoryLimit::is_effective) {
    EXPECT_THROW((void)std::vector<double>(std::size_t{1} << 26), std::bad_alloc);
  }
  const auto start = std::chrono::steady_clock::now();
  const auto ply = [](const std::string& vertices, const std::string& faces, const std::string& rest) {
    return "ply\nformat ascii 1.0\nelement vertex " + vertices +
           "\nproperty float x\nproperty float y\nproperty float z\nelement face " + faces +
           "\nproperty list uchar int vertex_indices\nend_header\n" + rest;
  };
  for (const char* count : {"2147483647", "4294967296", "1000000000000", "18446744073709551615", "-1"}) {
    EXPECT_NE(refusal_of("ply", ply(count, "1", "0 0 0\n")), "") << count;
    EXPECT_NE(refusal_of("ply", ply("1", count, "0 0 0\n3 0 0 0\n")), "") << count;
    const std::string nodes = "$MeshFormat\n2.2 0 8\n$EndMeshFormat\n$Nodes\n";
    EXPECT_NE(refusal_of("msh", nodes + count + "\n1 0 0 0\n$EndNodes\n"), "") << count;
    EXPECT_NE(refusal_of("msh", nodes + "1\n1 0 0 0\n$EndNodes\n$Elements\n" + count + "\n1 2 0 1 1 1\n"), "")
        << count;
    EXPECT_NE(refusal_of("msh", "$MeshFormat\n4.1 0 8\n$EndMeshFormat\n$Nodes\n1 " + std::string(count) +
                                    " 1 1\n2 1 0 " + count + "\n1\n0 0 0\n$EndNodes\n"),
              "")
        << count;
    EXPECT_NE(refusal_of("obj", "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 " + std::string(count) + "9\n"), "")
        << count;
  }
  for (const long long count : {-1LL, 1LL << 31, 1LL << 40, 1LL << 62}) {
    for (const char* what : {"count", "byteOffset"}) {
      nlohmann::json root = {
          {"asset", {{"version", "2.0"}}},
          {"scenes", {{{"nodes", {0}}}}},
          {"nodes", {{{"mesh", 0}}}},
          {"buffers", {{{"byteLength", 36}}}},
          {"bufferViews", {{{"buffer", 0}, {"byteLength", 36}}}},
          {"accessors", {{{"bufferView", 0}, {"componentType", 5126}, {"count", 3}, {"type", "VEC3"}}}},
          {"meshes", {{{"primitives", {{{"attributes", {{"POSITION", 0}}}}}}}}}};
      root["accessors"][0][what] = count;
      EXPECT_NE(refusal_of("glb", glb_container(root, std::string(36, '\0'))), "") << what << " " << count;
      root["accessors"][0] = {{"componentType", 5126}, {"count", count}, {"type", "VEC3"}};
      EXPECT_NE(refusal_of("glb", glb_container(root, std::string(36, '\0'))), "") << "no view, " << count;
    }
  }
  limit.reset();  // these are large, and JSON that is being destroyed may not run out of memory
  // A node that is its own child, and a chain that is too deep to follow on the stack.
  nlohmann::json loop = {
      {"asset", {{"version", "2.0"}}}, {"scenes", {{{"nodes", {0}}}}}, {"nodes", {{{"children", {0}}}}}};
  EXPECT_NE(refusal_of("glb", glb_container(loop, "")), "");
  loop["nodes"] = nlohmann::json::array();
  for (int k = 1; k <= 200000; ++k) loop["nodes"].push_back({{"children", {k % 200000}}});
  EXPECT_NE(refusal_of("glb", glb_container(loop, "")), "");
  EXPECT_LT(std::chrono::steady_clock::now() - start, std::chrono::seconds(30));
}

TEST(ReadSurface, RefusesWithALineThatHelps) {
  const TriangleSurface patch = wavy_patch();
  EXPECT_THAT(refusal_of("stl", ""), HasSubstr(".obj, .ply, .glb or .msh"));
  EXPECT_THAT(refusal_of("gltf", "{}"), HasSubstr("one binary .glb"));
  EXPECT_THAT(refusal_of("ply", as_obj(patch)), HasSubstr("is it a PLY file"));
  EXPECT_THAT(refusal_of("glb", as_obj(patch)), HasSubstr("is it a binary glTF file"));
  EXPECT_THAT(refusal_of("msh", as_obj(patch)), HasSubstr("is it a Gmsh"));
  EXPECT_THAT(input_error([] { (void)read_surface("/no/such.ply", 1); }),
              AllOf(HasSubstr("got no file there"), HasSubstr(".obj, .ply, .glb or .msh")));
  EXPECT_THAT(input_error([] { (void)read_surface("/", 1); }), HasSubstr("got what is no file"));
  EXPECT_THAT(refusal_of("msh", "$MeshFormat\n2.2 1 8\n"), HasSubstr("binary"));
  EXPECT_THAT(refusal_of("msh", "$MeshFormat\n4 0 8\n"), AllOf(HasSubstr(":2:"), HasSubstr("2.2 or 4.1")));
  EXPECT_THAT(
      refusal_of("msh", "$MeshFormat\n2.2 0 8\n$EndMeshFormat\n$Elements\n1\n7 9 2 0 1 1 2 3 4 5 6\n"),
      HasSubstr("curved"));

  std::string ply = as_ply(patch, "binary_little_endian");
  EXPECT_THAT(refusal_of("ply", ply.substr(0, ply.size() - 3)),
              AllOf(HasSubstr("face 39"), HasSubstr("truncated")));
  const std::string huge = "vertex 30", count = "vertex 99999999999";
  // A count beyond the file is refused without reserving room for it.
  EXPECT_THAT(refusal_of("ply", ply.replace(ply.find(huge), huge.size(), count)), HasSubstr(": vertex "));
}

TEST(ReadSurface, DoubtfulUnitsAreRefused) {
  TriangleSurface head = wavy_patch();
  head.vertices *= 3;  // 240 mm wide
  EXPECT_NO_THROW(refuse_doubtful_unit(head));
  TriangleSurface metres = head, centimetres = head;
  metres.vertices /= 1000;
  centimetres.vertices /= 10;
  EXPECT_THAT(input_error([&] { refuse_doubtful_unit(metres); }),
              HasSubstr("extent 0.24: metres? set mm_per_unit 1000"));
  EXPECT_THAT(input_error([&] { refuse_doubtful_unit(centimetres); }), HasSubstr("set mm_per_unit 10"));
  head.vertices *= 1000;
  EXPECT_THAT(input_error([&] { validate_surface(head); }), HasSubstr("mm_per_unit times 0.001"));
}

TEST(CropSurface, BoxSphereAndListKeepWhatIsInside) {
  const TriangleSurface grid = grid_surface(12, 12, 12, 12, GridPattern::union_jack);
  const TriangleSurface box = crop_box(grid, Vec3(-2.5, -6, -1), Vec3(2.5, 3.5, 1));
  EXPECT_EQ(box.faces.size(), 2u * 4 * 9);  // cells between −2..2 and −6..3
  EXPECT_EQ(box.vertices.rows(), 5 * 10);
  const TriangleSurface ball = crop_sphere(grid, Vec3(0, 0, 3), 5);  // a disc of radius 4
  for (int v = 0; v < ball.vertices.rows(); ++v) EXPECT_LE(ball.vertices.row(v).norm(), 4 + 1e-12);
  EXPECT_GT(ball.faces.size(), 2u * 30);
  const TriangleSurface again = crop_vertices(grid, box.source_vertex, "list.txt");
  EXPECT_EQ(again.vertices, box.vertices);
  EXPECT_EQ(again.faces, box.faces);
  EXPECT_THAT(again.notes.back(), HasSubstr("72 of 288 triangles"));
  EXPECT_THAT(input_error([&] {
                crop_vertices(grid, {0, 1, 169}, "list.txt");
              }),
              AllOf(HasSubstr("list.txt"), HasSubstr("169"), HasSubstr("168")));
  EXPECT_THAT(input_error([&] { crop_box(grid, Vec3(20, 20, 0), Vec3(21, 21, 1)); }),
              HasSubstr("keeps no face"));
}

TEST(CropSurface, SaysWhatHangsLoose) {
  const TriangleSurface grid = grid_surface(12, 12, 12, 12, GridPattern::diagonal_plus);
  std::vector<int> two_islands;
  for (int v = 0; v < grid.vertices.rows(); ++v)
    if (std::abs(grid.vertices(v, 0)) > 1.5) two_islands.push_back(v);
  two_islands.pop_back();
  EXPECT_THAT(crop_vertices(grid, two_islands, "list").notes.back(), HasSubstr("hang on the largest part"));
}

TEST(CoincidentVertices, AreRefusedOrJoined) {
  TriangleSurface left = grid_surface(40, 40, 2, 2, GridPattern::diagonal_plus), both = left;
  both.vertices.resize(18, 3);
  both.vertices << left.vertices, left.vertices.rowwise() + Eigen::RowVector3d(40, 0, 0);
  for (const auto& [a, b, c] : left.faces) both.faces.push_back({a + 9, b + 9, c + 9});
  both.source_vertex.clear();
  EXPECT_THAT(input_error([&] { refuse_coincident_vertices(both); }),
              AllOf(HasSubstr("3 vertices"), HasSubstr("coincident")));
  join_coincident_vertices(both);
  EXPECT_EQ(both.vertices.rows(), 15);
  EXPECT_NO_THROW(validate_surface(both));
  EXPECT_NO_THROW(refuse_coincident_vertices(both));
}

TEST(ExtrudeFiles, EdgesFromHalfToFiveMillimetresWork) {
  for (const double edge : {0.5, 5.0}) {
    const TriangleSurface patch = grid_surface(40 * edge, 20 * edge, 40, 20, GridPattern::union_jack);
    const TriangleSurface read = read_surface(write_file("edges.ply", as_ply(patch, "binary_big_endian")), 1);
    ExtrusionOptions options;
    options.layers = {{1.5, 1, 3}, {0.1, 1, 2}};
    const SkinMesh mesh = extrude(read, options);
    const auto volume = integrate_volume(mesh, 2);
    EXPECT_GT(volume.smallest_determinant, 0);
    EXPECT_NEAR(volume.total, 1.6 * 800 * edge * edge, 1e-3 * edge * edge);
  }
}

/// One to three random damages: cut, flipped bits, changed digits, doubled and removed pieces.
std::string damaged(std::string bytes, std::mt19937& random) {
  const auto below = [&random](std::size_t n) { return random() % std::max<std::size_t>(n, 1); };
  for (std::size_t damage = 0, damages = 1 + below(3); damage < damages && !bytes.empty(); ++damage) {
    const std::size_t at = below(bytes.size()), length = 1 + below(12);
    switch (below(6)) {
      case 0:
        bytes.resize(at);
        break;
      case 1:
        bytes[at] = static_cast<char>(bytes[at] ^ (1 << below(8)));
        break;
      case 2: {
        const std::size_t digit = bytes.find_first_of("0123456789", at);
        if (digit != std::string::npos) bytes[digit] = "0123456789-e."[below(13)];
        break;
      }
      case 3:
        bytes.insert(at, bytes.substr(at, length));
        break;
      case 4:
        bytes.erase(at, length);
        break;
      default: {
        const std::size_t digit =
            bytes.find_first_of("0123456789", below(std::min<std::size_t>(bytes.size(), 900)));
        if (digit != std::string::npos) bytes.insert(digit, "99999999999999999999", 1 + below(20));
      }
    }
  }
  return bytes;
}

TEST(ReadSurface, DamagedFilesGiveAnErrorOrASurface) {
  const TriangleSurface patch = wavy_patch();
  std::mt19937 random(20240301);
  for (const auto& [extension, bytes] : every_format(patch)) {
    int refused = 0;
    for (int k = 0; k < 400; ++k) {
      const std::string path = write_file("damaged." + extension, damaged(bytes, random));
      try {
        const TriangleSurface surface = read_surface(path, 1);
        ASSERT_TRUE(surface.vertices.allFinite());
        ASSERT_FALSE(surface.faces.empty());
        for (const auto& face : surface.faces)
          for (const int v : face) ASSERT_TRUE(v >= 0 && v < surface.vertices.rows());
        try {
          validate_surface(surface);
        } catch (const InputError&) {
          ++refused;
        }
      } catch (const InputError& error) {
        ++refused;
        ASSERT_THAT(error.what(), HasSubstr(path));
      }
    }
    EXPECT_GT(refused, 100) << extension;
    EXPECT_LT(refused, 400) << extension;
  }
}

}  // namespace
}  // namespace rhytid
