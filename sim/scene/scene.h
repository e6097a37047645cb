// A scene as plain data: exactly what scene.json says, after defaults, units and validation. mm, N, MPa, s.
#pragma once

#include <array>
#include <map>
#include <optional>
#include <string>
#include <vector>

#include "sim/core/types.h"
#include "sim/scene/damper_scheme.h"
#include "sim/terms/path.h"

namespace rhytid {

enum class RimCondition { clamped, sliding, free };
enum class ThicknessScheme { stacked, composite };
enum class LigamentForm { exponential, fung_quadratic };
enum class VolumeQuadrature { full, reduced };
enum class RuleKind { product, full, sheet };
enum class ShapeKind { sphere, plane, imls, capsule, ellipsoid };

struct LayerScene {
  std::string name;
  double thickness = 0;       ///< mm; with thickness_by_vertex its mean, over the patch once a model is built
  std::string thickness_map;  ///< resolved path of a file with a thickness per vertex, empty when constant
  std::vector<double>
      thickness_by_vertex;    ///< mm, by vertex of the input surface, NaN = none; from that file
  int elements = 1;           ///< element layers (stacked)
  int order = 3;              ///< q (stacked); 2 locks near ν = ½ (tests/verification/README.md)
  double youngs_modulus = 0;  ///< MPa, instantaneous: mu = E / 2(1+nu), K = E / 3(1−2nu)
  double poissons_ratio = 0.49;
  double stiffening = 1;             ///< C of the Fung term
  double relaxing_fraction = 0.8;    ///< mu_m / mu; mu_inf = (1 − fraction) mu
  double relaxation_time = 1. / 12;  ///< tau, s
};

struct SurfaceScene {
  // Exactly one of file or grid.
  std::string file;                  ///< resolved path, empty when a grid
  double mm_per_unit = 0;            ///< 0 = not given: 1, refused when the file's size makes that doubtful
  std::string coincident = "auto";   ///< auto | join | keep: vertices at exactly the same place
  std::optional<Vec3> crop_centre;   ///< mm
  double crop_radius = 0;            ///< mm
  std::string crop_by = "geodesic";  ///< geodesic | distance: how crop_radius is measured
  std::optional<Vec3> crop_low, crop_high;  ///< mm, corners of a box
  std::vector<int> crop_vertices;           ///< indices in the mesh file, from 0
  std::string crop_vertices_file;           ///< the same in a text file
  int subdivide = 0;                        ///< passes of Loop subdivision after the crop
  bool is_outer = true;                     ///< the surface is the outer skin (else the inner face)
  std::array<double, 2> grid_size{0, 0};    ///< mm
  std::array<int, 2> grid_cells{0, 0};
  std::string grid_pattern = "union_jack";
  double bend_radius = 0;  ///< mm, 0 = flat
  int normal_smoothing = 2;
  double imperfection_amplitude = 0;  ///< mm: nodes lie off the surface by up to this, at random
  int imperfection_seed = 1;
};

struct SourceScene {
  std::string name;
  Vec3 position = Vec3::Zero();  ///< mm, projected to the inner surface
  std::optional<int> vertex;     ///< vertex of the input surface instead of a position
  double strength = 1;           ///< b_s, 1/mm
  double radius = 5;             ///< mm
};

struct LigamentScene {
  double stiffness = 5e-4;  ///< k, MPa
  double smoothing = 0;     ///< eps, mm (0 = 1e-2 of the skin thickness)
  LigamentForm law = LigamentForm::exponential;
  double diffusion_time = 20;  ///< t, mm²
  std::vector<SourceScene> sources;
  // Or, in place of sources, b itself:
  std::string map;                  ///< resolved path of a file with b per vertex, empty with sources
  std::vector<double> b_by_vertex;  ///< 1/mm, by vertex of the input surface, NaN = none; from that file
  double map_scale = 1;             ///< factor on the map
};

struct FrictionScene {
  double coefficient = 0.8;
  double slip_speed = 1;              ///< eps_v, mm/s
  std::string mollifier = "quintic";  ///< quintic (publication) | quadratic (IPC)
};

struct PointsScene {
  std::string file;  ///< resolved path
  double mm_per_unit = 1;
};

struct BaseScene {
  ShapeKind shape =
      ShapeKind::plane;         ///< plane | sphere | imls of the rest inner surface, or of `points` if given
  double stiffness = 1;         ///< kappa, MPa/mm
  double onset = 1e-3;          ///< eps_g, mm (0 = C¹ literal penalty)
  Vec3 centre = Vec3::Zero();   ///< sphere, mm
  double radius = 0;            ///< sphere, mm
  Vec3 normal = Vec3::UnitZ();  ///< plane
  double imls_support = 0;      ///< h, mm (0 = 3 × median point spacing)
  std::string imls_kernel = "smooth";  ///< smooth (1 − d²/h²)⁴ | literal (1 − d/h)⁴
  std::optional<PointsScene> points;   ///< imls: a cloud with normals in place of the inner surface
};

/// Where a body is at a time; between knots it is interpolated, outside it stays.
struct PathKnot {
  double time;                   ///< s
  Vec3 position;                 ///< mm
  Vec3 rotation = Vec3::Zero();  ///< axis times angle, rad
};

struct ColliderScene {
  std::string name;
  ShapeKind shape = ShapeKind::sphere;
  double radius = 8;              ///< mm; sphere and capsule
  double length = 0;              ///< capsule: between the centres of its ends, mm
  Vec3 axis = Vec3::UnitZ();      ///< capsule: its direction, in the body's axes
  Vec3 semi_axes = Vec3::Zero();  ///< ellipsoid, mm, along the body's axes
  Vec3 normal = Vec3::UnitZ();    ///< plane: outward normal
  double stiffness = 1;           ///< kappa, MPa/mm
  double onset = 1e-3;            ///< eps_g, mm
  std::optional<FrictionScene> friction;
  PathKind interpolation = PathKind::linear;
  std::string path_file;  ///< CSV that `path` is read from; empty when the scene holds it
  std::vector<PathKnot> path;
};

/// What the friction of a step takes its pressure and direction from: those where the step before ended, or these
/// extrapolated by their change over that step.
enum class FrictionLag { previous, extrapolated };

struct TimeScene {
  double frame_rate = 24;  ///< 1/s
  int frames = 0;          ///< frames after the rest frame 0
  int substeps = 1;        ///< per frame
  FrictionLag lag = FrictionLag::previous;
  int lag_passes = 1;  ///< solves per step over the lag of friction; 1 with an extrapolated one
  int max_bisections = 4;
  DamperScheme damper = DamperScheme::exponential;
  double offset = 0;  ///< s by which the clock of all paths runs ahead of the frames
};

struct SolverScene {
  /// newton | newton_projected | lbfgs | lbfgs_literal. A file with the last has the publication's values
  /// (published_minimiser) for those of the keys below that it leaves out.
  std::string minimiser = "newton";
  double relative_tolerance = 1e-9;
  double absolute_tolerance = 1e-10;  ///< N
  int max_iterations = 200;
  int lbfgs_memory = 20, lbfgs_refresh = 20;
  std::string factor_precision = "automatic";  ///< automatic | full | mixed (FactorPrecision)
};

/// Tension of the skin in its rest shape (sim/terms/pre_stretch_law.h).
struct PreStretchScene {
  double stretch = 1;             ///< λ₁; in all in-plane directions without `across`
  std::optional<double> across;   ///< λ₂, at right angles to `direction`
  std::optional<Vec3> direction;  ///< of λ₁, projected to the surface
};

/// Where a held part of the skin is moved to at a time.
struct HeldKnot {
  double time;        ///< s
  Vec3 displacement;  ///< mm, of every node of the part, from its rest position
};

/// A part of the skin that is held through its whole thickness, whatever the rim does: still, or moved along
/// a path.
struct HeldScene {
  std::string name;
  Vec3 low, high;              ///< mm, corners of a box: the part is where the given surface lies in it
  std::vector<HeldKnot> path;  ///< linear between knots, constant outside; empty = it stays
};

struct SkinScene {
  SurfaceScene surface;
  int order = 3;  ///< p
  ThicknessScheme scheme = ThicknessScheme::stacked;
  int composite_order = 3;   ///< q when composite
  int triangle_degree = 0;   ///< 0 = 2p, or 2p + 2 with the full rule
  int thickness_points = 0;  ///< per layer; 0 = max(q, 2), or q + 1 with the full rule or reduced volume
  RuleKind rule = RuleKind::product;  ///< skin_rule.h
  int prism_degree = 0;  ///< of a prism rule in place of the product of the two above; 0 = the product
  VolumeQuadrature volume = VolumeQuadrature::full;
  int contact_degree = 0;  ///< triangle degree on contact and ligament surfaces; 0 = max(10, 2p+2)
  RimCondition rim = RimCondition::clamped;
  std::vector<HeldScene> held;
  std::optional<PreStretchScene> pre_stretch;
  std::vector<LayerScene> layers;  ///< inner to outer
};

struct OutputScene {
  bool vtu = true, pictures = true, csv = true;
  int every = 1;  ///< frames between outputs
};

struct Scene {
  std::string name, description;
  std::string file;  ///< where it came from, for messages
  SkinScene skin;
  std::optional<LigamentScene> ligaments;
  std::optional<BaseScene> base;
  std::vector<ColliderScene> colliders;
  TimeScene time;
  SolverScene solver;
  OutputScene output;
};

}  // namespace rhytid
