// Problems of structural mechanics with known answers: Cook's membrane (B8), beams and shells of the set of
// MacNeal and Harder (B9). One layer of P4 × P2 prisms, small displacements, meshes placed on the true
// shapes.
#include <gtest/gtest.h>

#include <cmath>
#include <cstdio>

#include "linear_elasticity.h"

namespace rhytid::test {
namespace {

constexpr double kPi = 3.14159265358979323846;

using Place = std::function<Vec3(double, double, double)>;

/// A mesh and the square it came from.
struct Shape {
  SkinMesh mesh, natural;
  Shape(int p, int q, int nx, int ny, const Place& place, GridPattern pattern = GridPattern::union_jack)
      : mesh(mapped_mesh(p, q, nx, ny, pattern, place)),
        natural(
            mapped_mesh(p, q, nx, ny, pattern, [](double s, double t, double w) { return Vec3(s, t, w); })) {}
  std::vector<int> edge(int axis, double at) const { return LinearElasticity::edge(natural, axis, at); }
  int middle_level() const { return mesh.num_levels / 2; }
};

void hold(LinearElasticity& k, const Shape& shape, const std::vector<int>& columns,
          std::initializer_list<int> axes) {
  for (const int c : columns)
    for (int level = 0; level < shape.mesh.num_levels; ++level)
      for (const int axis : axes) k.hold(shape.mesh.node(c, level), axis);
}

void report(const char* problem, double value, double reference) {
  std::printf("  %-46s %.5g, reference %.5g: %+.2f %%\n", problem, value, reference,
              100 * (value / reference - 1));
}

/// Mid-edge displacement of Cook's membrane: 48 long, 44 high at the left, 16 at the right, load 1.
double cook(int cells, double nu, bool plane_strain) {
  const Shape shape(4, 2, cells, cells,
                    [](double s, double t, double w) { return Vec3(48 * s, 44 * s + t * (44 - 28 * s), w); });
  LinearElasticity k(shape.mesh, 1, nu);
  hold(k, shape, shape.edge(0, 0), {0, 1});
  for (int c = 0; c < shape.mesh.num_columns; ++c)
    for (int level = 0; level < 3; ++level)
      if (plane_strain || level == 1) k.hold(shape.mesh.node(c, level), 2);
  const std::vector<int> end = shape.edge(0, 1);
  k.load_face(end, Vec3(0, 1, 0));
  const VectorXd u = k.solve();
  return u[3 * shape.mesh.node(end[end.size() / 2], 1) + 1];
}

TEST(Structures, CooksMembrane) {
  std::printf("Cook's membrane, mid-edge displacement:\n");
  double value = 0;
  for (const int cells : {2, 4, 8, 16})
    report(("plane stress, " + std::to_string(cells) + " cells").c_str(), value = cook(cells, 1. / 3, false),
           23.960);
  EXPECT_NEAR(value, 23.960, 1e-3 * 23.960);
  // Nearly incompressible and in plane strain. Quartics do not lock; singular corners make it rise slowly.
  double last = 0;
  for (const int cells : {4, 8, 16}) {
    report(("plane strain, nu 0.4999, " + std::to_string(cells) + " cells").c_str(),
           value = cook(cells, 0.4999, true), 18.37);
    EXPECT_GT(value, last);
    last = value;
  }
  EXPECT_NEAR(value, 18.37, 0.01 * 18.37);
}

/// Displacement of the tip of a beam along `direction` under a unit load that way; the root stays in its
/// plane and may contract there.
double tip(int nx, int ny, const Place& place, double youngs_modulus, double nu, const Vec3& direction) {
  const Shape shape(4, 2, nx, ny, place);
  LinearElasticity k(shape.mesh, youngs_modulus, nu);
  // The root face stays in its plane but may contract in it, as beam theory has it.
  const std::vector<int> root = shape.edge(0, 0), end = shape.edge(0, 1);
  const int middle = root[root.size() / 2];
  hold(k, shape, root, {0});
  hold(k, shape, {middle}, {1});
  k.hold(shape.mesh.node(middle, 1), 2);
  k.load_face(end, direction);
  const VectorXd u = k.solve();
  return u.segment<3>(3 * shape.mesh.node(end[end.size() / 2], 1)).dot(direction);
}

TEST(Structures, BeamsOfMacNealAndHarder) {
  const Place straight = [](double s, double t, double w) { return Vec3(6 * s, 0.2 * (t - 0.5), 0.1 * w); };
  const Place curved = [](double s, double t, double w) {
    const double r = 4.12 + 0.2 * t, angle = s * kPi / 2;
    return Vec3(r * std::sin(angle), r * std::cos(angle), 0.1 * w);  // root along y, tip along x
  };
  const Place twisted = [](double s, double t, double w) {
    const double a = s * kPi / 2, y = 1.1 * (t - 0.5), z = 0.32 * w;
    return Vec3(12 * s, y * std::cos(a) - z * std::sin(a), y * std::sin(a) + z * std::cos(a));
  };
  // Curved bar bent by a radial force P at its end, plane stress [Timoshenko, Goodier, Theory of Elasticity,
  // 33]: δ = π P (a² + b²) / E N, N = a² − b² + (a² + b²) ln(b/a). The set itself states 0.08734.
  const double a2 = 4.12 * 4.12, b2 = 4.32 * 4.32, n = a2 - b2 + 0.5 * (a2 + b2) * std::log(b2 / a2);
  const double exact_curved = kPi * 10 * (a2 + b2) / (1e7 * n);
  struct Row {
    const char* name;
    const Place& place;
    int nx, ny;
    double e, nu;
    Vec3 load;
    double reference;
  };
  const Row rows[] = {
      {"straight beam, extension", straight, 6, 1, 1e7, 0.3, Vec3::UnitX(), 3e-5},
      {"straight beam, in-plane shear", straight, 6, 1, 1e7, 0.3, Vec3::UnitY(), 0.1081},
      {"straight beam, out-of-plane shear", straight, 6, 1, 1e7, 0.3, Vec3::UnitZ(), 0.4321},
      {"curved beam, in-plane shear (plane elasticity)", curved, 12, 2, 1e7, 0.25, Vec3::UnitX(),
       exact_curved},
      {"curved beam, out-of-plane shear", curved, 12, 2, 1e7, 0.25, Vec3::UnitZ(), 0.5022},
      {"twisted beam, in-plane shear", twisted, 12, 2, 29e6, 0.22, Vec3::UnitZ(), 5.424e-3},
      {"twisted beam, out-of-plane shear", twisted, 12, 2, 29e6, 0.22, Vec3::UnitY(), 1.754e-3}};
  std::printf("MacNeal-Harder beams, P4 x P2:\n");
  for (const Row& r : rows) {
    const double value = tip(r.nx, r.ny, r.place, r.e, r.nu, r.load);
    report(r.name, value, r.reference);
    EXPECT_NEAR(value, r.reference, 0.01 * r.reference) << r.name;
  }
}

/// Uniform force per area on both faces, each half.
void load_faces(LinearElasticity& k, const SkinMesh& mesh, const Vec3& force_per_middle_area,
                double outer_ratio) {
  for (const SkinSide side : {SkinSide::inner, SkinSide::outer}) {
    const TermGroup g = surface_group(mesh, side, triangle_rule(10));
    const double share = 0.5 / (side == SkinSide::outer ? outer_ratio : 2 - outer_ratio);
    for (int e = 0; e < g.num_elements; ++e)
      for (int q = 0; q < g.num_points; ++q)
        for (int i = 0; i < g.num_nodes; ++i)
          k.load.segment<3>(3 * g.nodes[static_cast<std::size_t>(e * g.num_nodes + i)]) +=
              force_per_middle_area * share * g.weight[static_cast<std::size_t>(e * g.num_points + q)] *
              g.node_by_row[static_cast<std::size_t>(q * g.num_nodes + i)];
  }
}

/// Mid-side drop of the Scordelis-Lo roof (a quarter: crown and midspan are planes of symmetry).
double roof(int cells) {
  const double radius = 25, thickness = 0.25;
  const Shape shape(4, 2, cells, cells, [&](double s, double t, double w) {
    const double r = radius + thickness * w, angle = t * 40 * kPi / 180;
    return Vec3(25 * s, r * std::sin(angle), r * std::cos(angle));
  });
  LinearElasticity k(shape.mesh, 4.32e8, 0);
  load_faces(k, shape.mesh, Vec3(0, 0, -90), 1 + 0.5 * thickness / radius);
  hold(k, shape, shape.edge(0, 1), {1, 2});  // diaphragm
  hold(k, shape, shape.edge(0, 0), {0});
  hold(k, shape, shape.edge(1, 0), {1});
  const VectorXd u = k.solve();
  return -u[3 * shape.mesh.node(shape.edge(0, 0).back(), 1) + 2];
}

/// Displacement under the load of the pinched cylinder with end diaphragms (an eighth).
double cylinder(int cells) {
  const double radius = 300, thickness = 3;
  const Shape shape(4, 2, cells, cells, [&](double s, double t, double w) {
    const double r = radius + thickness * w, angle = t * kPi / 2;
    return Vec3(300 * s, r * std::sin(angle), r * std::cos(angle));
  });
  LinearElasticity k(shape.mesh, 3e6, 0.3);
  hold(k, shape, shape.edge(0, 1), {1, 2});
  hold(k, shape, shape.edge(0, 0), {0});
  hold(k, shape, shape.edge(1, 0), {1});
  hold(k, shape, shape.edge(1, 1), {2});
  const int loaded = shape.edge(0, 0).front();
  for (int level = 0; level < 3; ++level)
    k.load[3 * shape.mesh.node(loaded, level) + 2] = -0.25 * (level == 1 ? 4 : 1) / 6;
  const VectorXd u = k.solve();
  return -u[3 * shape.mesh.node(loaded, 1) + 2];
}

/// Displacement under the loads of the hemisphere with an 18 degree hole (a quarter).
double hemisphere(int cells) {
  const double radius = 10, thickness = 0.04;
  const Shape shape(4, 2, cells, cells, [&](double s, double t, double w) {
    const double r = radius + thickness * w, azimuth = s * kPi / 2, height = t * 72 * kPi / 180;
    return Vec3(r * std::cos(azimuth) * std::cos(height), r * std::sin(azimuth) * std::cos(height),
                r * std::sin(height));
  });
  LinearElasticity k(shape.mesh, 6.825e7, 0.3);
  hold(k, shape, shape.edge(0, 0), {1});
  hold(k, shape, shape.edge(0, 1), {0});
  const std::vector<int> equator = shape.edge(1, 0);
  k.hold(shape.mesh.node(equator[equator.size() / 2], 1), 2);
  for (int level = 0; level < 3; ++level) {
    k.load[3 * shape.mesh.node(equator.front(), level)] = (level == 1 ? 4. : 1.) / 6;
    k.load[3 * shape.mesh.node(equator.back(), level) + 1] = -(level == 1 ? 4. : 1.) / 6;
  }
  const VectorXd u = k.solve();
  return u[3 * shape.mesh.node(equator.front(), 1)];
}

TEST(Structures, ShellsOfMacNealAndHarder) {
  std::printf("MacNeal-Harder shells, P4 x P2:\n");
  double value = roof(4);
  report("Scordelis-Lo roof, 4 cells", value, 0.3024);
  EXPECT_NEAR(value, 0.3024, 0.01 * 0.3024);
  for (const int cells : {4, 8}) report("pinched cylinder", value = cylinder(cells), 1.8248e-5);
  EXPECT_NEAR(value, 1.8248e-5, 0.01 * 1.8248e-5);
  for (const int cells : {4, 8})
    report("pinched hemisphere (deep shell .0930)", value = hemisphere(cells), 0.0940);
  EXPECT_NEAR(value, 0.0935, 0.01 * 0.0935);
}

}  // namespace
}  // namespace rhytid::test
