#include "tools/scene_review.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>

#include "sim/core/units.h"
#include "sim/mesh/surface_edges.h"
#include "sim/scene/collider_motion.h"
#include "sim/scene/parts/base_part.h"
#include "sim/surface/heat_map.h"
#include "sim/terms/contact_law.h"

namespace rhytid::tools {
namespace {

std::string length_text(double mm) {
  return format_quantity(mm, dimension::length, 3);
}

std::string number_text(double value) {
  char text[32];
  std::snprintf(text, sizeof text, "%.3g", value);
  return text;
}

double mean_edge(const SkinMesh& mesh) {
  double sum = 0;
  for (const auto& f : mesh.surface.faces)
    for (int k = 0; k < 3; ++k)
      sum += (mesh.surface.vertices.row(f[k]) - mesh.surface.vertices.row(f[(k + 1) % 3])).norm();
  return sum / (3 * static_cast<double>(mesh.surface.faces.size()));
}

double skin_thickness(const SkinScene& skin) {
  double sum = 0;
  for (const LayerScene& l : skin.layers) sum += l.thickness;
  return sum;
}

void review_wrinkles(const SceneModel& scene_model, std::vector<std::string>& warnings) {
  const auto scale = wrinkle_scale(scene_model);
  if (!scale) return;
  if (scale->nodes_per_wavelength() < wanted_nodes_per_wavelength)
    warnings.push_back("the mesh is too coarse to wrinkle: " + scale->film + " on " + scale->soft +
                       " has a wavelength of " + length_text(scale->wavelength) + ", that is " +
                       number_text(scale->nodes_per_wavelength()) + " nodes " +
                       length_text(scale->node_spacing) +
                       " apart; 10 or more resolve it (finer cells or a "
                       "higher /skin/order)");
}

/// Where bone or ligaments make it skin: numbers without a unit are MPa, and kPa are meant too often.
void review_moduli(const Scene& scene, std::vector<std::string>& warnings) {
  constexpr double softest = 1e-4, stiffest = 10;  // MPa, of skin in the literature with room to spare
  if (!scene.base && !scene.ligaments) return;
  for (const LayerScene& layer : scene.skin.layers)
    if (layer.youngs_modulus < softest || layer.youngs_modulus > stiffest)
      warnings.push_back(
          "/skin/layers/" + layer.name +
          "/youngs_modulus: " + format_quantity(layer.youngs_modulus, dimension::pressure) +
          " is far from skin's 0.1 kPa to 10 MPa: is the unit right? Numbers without one are MPa");
}

void review_support(const SceneModel& scene_model, const StepCost& cost, std::vector<std::string>& warnings) {
  const Scene& scene = scene_model.scene();
  if (scene.skin.rim == RimCondition::clamped || !scene.skin.held.empty()) return;
  // A pivot this far below the largest is a rigid motion that only rounding resists.
  if (cost.positive_definite && cost.smallest_pivot > 1e-13 * cost.largest_pivot) return;
  const std::string rim = scene.skin.rim == RimCondition::free ? "a free rim" : "a sliding rim";
  if (scene.ligaments) {
    warnings.push_back(rim + " and ligaments so weak that the stiffness at rest is singular to rounding");
  } else if (scene.base) {
    warnings.push_back(rim +
                       " and no ligaments: nothing holds the skin at rest, since the base only pushes; "
                       "the first step will hardly converge");
  } else {
    warnings.push_back(rim +
                       " with neither ligaments nor base: nothing holds the skin; it can move as a rigid "
                       "body and a step has no unique minimum");
  }
}

void review_collider(const SceneModel& scene_model, const ColliderScene& collider,
                     std::vector<std::string>& warnings) {
  const SkinMesh& mesh = scene_model.model().mesh;
  const TimeScene& time = scene_model.scene().time;
  if (time.frames == 0) return;
  const ColliderMotion motion(collider, time.offset);
  const auto shape = collider_shape(collider);
  const std::string at = "collider " + collider.name;
  double rest_gap = std::numeric_limits<double>::infinity(), smallest = rest_gap, rim_distance = rest_gap;
  for (int frame = 0; frame <= time.frames; ++frame) {
    const BodyPose pose = motion.at(frame / time.frame_rate);
    double here = std::numeric_limits<double>::infinity();
    Vec3 touched = Vec3::Zero();
    for (int column = 0; column < mesh.num_columns; ++column) {
      const Vec3 x = mesh.rest.row(mesh.node(column, mesh.num_levels - 1)).transpose();
      const double g = shape->evaluate(pose.to_body(x)).gap;
      if (g < here) here = g, touched = x;
    }
    if (frame == 0) rest_gap = here;
    smallest = std::min(smallest, here);
    if (here > 0 || collider.shape == ShapeKind::plane) continue;
    for (int column : mesh.rim_columns) {
      const Vec3 x = mesh.rest.row(mesh.node(column, mesh.num_levels - 1)).transpose();
      rim_distance = std::min(rim_distance, (x - touched).norm());
    }
  }
  if (rest_gap < 0)
    warnings.push_back(at + " reaches " + length_text(-rest_gap) +
                       " into the skin at time 0, so that the rest state is no equilibrium");
  if (smallest > 0)
    warnings.push_back(at + " never touches the skin: it stays " + length_text(smallest) +
                       " away from the surface at rest");
  const double thickness = skin_thickness(scene_model.scene().skin);
  if (rim_distance < 3 * thickness)
    warnings.push_back(at + " pushes " + length_text(rim_distance) +
                       " from the rim, less than three skin thicknesses (" + length_text(3 * thickness) +
                       "): the boundary condition there will shape the result");
}

}  // namespace

SurfaceEdgeLengths surface_edge_lengths(const TriangleSurface& surface) {
  std::vector<double> lengths;
  for (const SurfaceEdge& edge : SurfaceEdges(surface.faces).edges)
    lengths.push_back((surface.vertices.row(edge.first) - surface.vertices.row(edge.second)).norm());
  std::sort(lengths.begin(), lengths.end());
  return {lengths.front(), lengths[lengths.size() / 2], lengths.back(),
          surface.vertices.colwise().maxCoeff() - surface.vertices.colwise().minCoeff()};
}

std::optional<WrinkleScale> wrinkle_scale(const SceneModel& scene_model) {
  const SkinScene& skin = scene_model.scene().skin;
  if (skin.layers.size() < 2) return std::nullopt;
  const LayerScene& film = skin.layers.back();
  const LayerScene& soft = skin.layers[skin.layers.size() - 2];
  const auto plane_strain = [](const LayerScene& l) {
    return l.youngs_modulus / (1 - l.poissons_ratio * l.poissons_ratio);
  };
  const double ratio = plane_strain(film) / (3 * plane_strain(soft));
  if (film.youngs_modulus < 5 * soft.youngs_modulus) return std::nullopt;
  WrinkleScale scale;
  scale.film = film.name;
  scale.soft = soft.name;
  scale.wavelength = 2 * std::numbers::pi * film.thickness * std::cbrt(ratio);
  scale.critical_strain = 0.25 / std::pow(ratio, 2. / 3);
  scale.node_spacing = mean_edge(scene_model.model().mesh) / skin.order;
  return scale;
}

std::vector<std::string> review_ligaments(const SceneModel& scene_model) {
  std::vector<std::string> warnings;
  const Scene& scene = scene_model.scene();
  if (!scene.ligaments || scene.ligaments->sources.empty()) return warnings;
  const SkinMesh& mesh = scene_model.model().mesh;
  MatrixX3 inner(mesh.num_columns, 3);
  for (int c = 0; c < mesh.num_columns; ++c) inner.row(c) = mesh.rest.row(mesh.node(c, 0));
  const auto& listed = scene.ligaments->sources;
  std::vector<HeatSource> sources;
  for (std::size_t s = 0; s < listed.size(); ++s) {
    sources.push_back({scene_model.source_positions()[s], listed[s].radius});
    if (listed[s].vertex) continue;
    const double moved = (scene_model.source_positions()[s] - listed[s].position).norm();
    if (moved > std::max(2 * skin_thickness(scene.skin), mean_edge(mesh)))
      warnings.push_back("ligament source " + listed[s].name + " was moved by " + length_text(moved) +
                         " to reach the inner surface");
  }
  const HeatMapWeights heat =
      diffuse_sources(inner, scene_model.column_triangles(), sources, scene.ligaments->diffusion_time);
  if (heat.num_unreached > 0)
    warnings.push_back(std::to_string(heat.num_unreached) + " of " + std::to_string(mesh.num_columns) +
                       " inner nodes are reached by no ligament source and take the nearest one's strength; "
                       "raise /ligaments/diffusion_time");
  for (int s : heat.unresolved_sources)
    warnings.push_back("ligament source " + listed[s].name + ": its radius " + length_text(listed[s].radius) +
                       " contains no node, so that it acts on the nearest one alone");
  return warnings;
}

/// The gap at rest is subtracted: bone that lies lower than the skin acts as if it touched.
/// Held parts rest in frame 0 whatever the offset of the clock, and begin where their paths are then.
void review_held(const SceneModel& scene_model, std::vector<std::string>& warnings) {
  const TimeScene& time = scene_model.scene().time;
  if (time.frames == 0 || scene_model.run_options().settle) return;
  const VectorXd given = scene_model.model().given_displacement(time.offset);
  const double jump = given.size() > 0 ? given.cwiseAbs().maxCoeff() : 0;
  if (jump > 0)
    warnings.push_back(
        "/time/offset: held parts rest in frame 0 and are " + length_text(jump) +
        " away at the first moment of the first step, which no smaller step can divide; let their "
        "paths begin later, or move the knots instead of the clock");
}

void review_base(const SceneModel& scene_model, std::vector<std::string>& warnings) {
  const Scene& scene = scene_model.scene();
  // Where a plane lies says nothing: most scenes leave it at the origin.
  if (!scene.base || scene.base->shape == ShapeKind::plane) return;
  const auto [lowest, highest] = base_rest_gaps(scene_model.model());
  const double allowed = 0.1 * skin_thickness(scene.skin);
  if (highest > allowed)
    warnings.push_back("/base: the bone lies up to " + length_text(highest) +
                       " below the inner surface at rest; the gap at rest is subtracted, so that the skin is "
                       "supported there as if the bone touched it");
  if (lowest < -allowed)
    warnings.push_back("/base: the bone reaches up to " + length_text(-lowest) +
                       " into the skin at rest; the gap at rest is subtracted, so that the skin is supported "
                       "there as if the bone ended at it");
}

std::vector<std::string> review_scene(const SceneModel& scene_model, const StepCost& cost) {
  std::vector<std::string> warnings;
  review_moduli(scene_model.scene(), warnings);
  review_held(scene_model, warnings);
  review_base(scene_model, warnings);
  review_support(scene_model, cost, warnings);
  review_wrinkles(scene_model, warnings);
  for (const ColliderScene& c : scene_model.scene().colliders) review_collider(scene_model, c, warnings);
  const std::vector<std::string> of_ligaments = review_ligaments(scene_model);
  warnings.insert(warnings.end(), of_ligaments.begin(), of_ligaments.end());
  return warnings;
}

}  // namespace rhytid::tools
