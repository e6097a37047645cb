// What is allowed but doubtful (load.h: scene_warnings).
#include <algorithm>
#include <cmath>
#include <sstream>
#include <vector>

#include "sim/core/units.h"
#include "sim/scene/load.h"
#include "sim/scene/names.h"
#include "sim/scene/skin_rule.h"

namespace rhytid {
namespace {

/// Text of numbers at four digits.
template <class... Parts>
std::string sentence(const Parts&... parts) {
  std::ostringstream text;
  text.precision(4);
  (text << ... << parts);
  return text.str();
}

std::string length_text(double mm) {
  return format_quantity(mm, dimension::length);
}
std::string time_text(double s) {
  return format_quantity(s, dimension::time);
}

void warn_of_layer(const LayerScene& layer, const Scene& scene, std::vector<std::string>& warnings) {
  const std::string at = "/skin/layers/" + layer.name;
  if (layer.stiffening < 0.25)
    warnings.push_back(sentence(at, "/stiffening: ", layer.stiffening,
                                " is below 0.25, where the energy loses convexity at moderate stretch"));
  const bool relaxes = layer.relaxing_fraction > 0 && scene.time.damper != DamperScheme::none;
  const double frame = 1 / scene.time.frame_rate, ratio = frame / layer.relaxation_time;
  if (relaxes && scene.time.frames > 0 && (ratio < 0.05 || ratio > 5))
    warnings.push_back(sentence(at, "/relaxation_time: frame interval / relaxation time = ", ratio,
                                " is outside 0.05..5, so that the relaxation time (",
                                time_text(layer.relaxation_time),
                                ") can hardly be identified from frames every ", time_text(frame)));
  const double step = ratio / scene.time.substeps;
  if (relaxes && scene.time.frames > 0 && scene.time.damper == DamperScheme::literal && step > 0.1)
    warnings.push_back(sentence("/time/damper: literal is first order and the step is ", step,
                                " relaxation times of layer ", layer.name, "; exponential is second order"));
  if (scene.skin.scheme == ThicknessScheme::composite && layer.elements > 1)
    warnings.push_back(
        sentence(at, "/elements: ", layer.elements,
                 " is not used, since the composite scheme has one element through all layers"));
}

/// What would unlock a layer of order 1 or 2, one element thick: more than q Gauss points through it, or exactness to
/// as much, lock order 2. Empty when nothing locks.
std::string unlocking(const SkinScene& skin, size_t layer) {
  const LayerScene& l = skin.layers[layer];
  if (skin.scheme != ThicknessScheme::stacked || skin.volume == VolumeQuadrature::reduced || l.order > 2 ||
      l.elements > 1)
    return {};
  if (l.order == 1) return "take order 2 or 3";
  if (check_skin_rules(skin)[layer].thickness < 2 * l.order) return {};
  if (skin.prism_degree > 0) return "take 0 for /skin/quadrature/prism_degree, or order 3";
  if (skin.thickness_points > l.order)
    return sentence("take ", l.order, " for /skin/quadrature/thickness_points, or order 3");
  return "take \"product\" for /skin/quadrature/rule, or order 3";
}

/// Below a film a layer that locks buckles late (errors of the onset strain: tests/verification/README.md, Wrinkling).
void warn_of_wrinkling_stack(const SkinScene& skin, std::vector<std::string>& warnings) {
  for (size_t i = 0; i + 1 < skin.layers.size(); ++i) {
    const LayerScene &soft = skin.layers[i], &film = skin.layers[i + 1];
    const std::string remedy = unlocking(skin, i);
    if (film.youngs_modulus > 10 * soft.youngs_modulus && !remedy.empty())
      warnings.push_back(sentence("/skin/layers/", soft.name, "/order: ", soft.order, " under the stiffer ",
                                  film.name, " delays wrinkling by 14 % and more",
                                  soft.order == 2 ? " with this quadrature; " : "; ", remedy));
  }
  if (skin.scheme == ThicknessScheme::composite && skin.composite_order < 3 && skin.layers.size() > 1)
    warnings.push_back(sentence("/skin/composite_order: ", skin.composite_order,
                                " through several layers delays wrinkling 3 to 9 times; take 3 or 4"));
}

/// Squeezed between finger and bone a nearly incompressible layer must bulge, which takes a cubic, or points that do not
/// ask for it (figures: tests/verification/README.md, Locking).
void warn_of_locking(const Scene& scene, std::vector<std::string>& warnings) {
  const SkinScene& skin = scene.skin;
  if (!scene.base) return;
  for (size_t i = 0; i < skin.layers.size(); ++i) {
    const LayerScene& layer = skin.layers[i];
    // A film that is bent, not squeezed, does not mind.
    const bool is_film = i > 0 && layer.thickness < 0.5 * skin.layers[i - 1].thickness;
    const std::string remedy = unlocking(skin, i);
    if (layer.poissons_ratio >= 0.45 && !is_film && !remedy.empty())
      warnings.push_back(sentence("/skin/layers/", layer.name, "/order: ", layer.order,
                                  " locks at a Poisson's ratio of ", layer.poissons_ratio,
                                  layer.order == 2 ? " with this quadrature" : "",
                                  ": squeezed skin comes out twice as stiff and more; ", remedy));
  }
}

/// What another shape would read: given, and without effect.
struct ShapeKey {
  const char* key;
  bool is_given;
  std::vector<ShapeKind> shapes;  ///< that read it
};

void warn_of_unused(const std::string& at, ShapeKind shape, const std::vector<ShapeKey>& keys,
                    std::vector<std::string>& warnings) {
  for (const auto& [key, is_given, shapes] : keys)
    if (is_given && std::find(shapes.begin(), shapes.end(), shape) == shapes.end())
      warnings.push_back(sentence(at, "/", key, ": is not used, since the shape is ", to_string(shape)));
}

void warn_of_unused_keys(const Scene& scene, std::vector<std::string>& warnings) {
  using enum ShapeKind;
  if (scene.base) {
    const BaseScene &base = *scene.base, plain;
    warn_of_unused("/base", base.shape,
                   {{"radius", base.radius != plain.radius, {sphere}},
                    {"centre", base.centre != plain.centre, {sphere}},
                    {"normal", base.normal != plain.normal, {plane}},
                    {"imls_support", base.imls_support != plain.imls_support, {imls}},
                    {"imls_kernel", base.imls_kernel != plain.imls_kernel, {imls}}},
                   warnings);
  }
  for (const ColliderScene& collider : scene.colliders) {
    const ColliderScene plain;
    warn_of_unused("/colliders/" + collider.name, collider.shape,
                   {{"radius", collider.radius != plain.radius, {sphere, capsule}},
                    {"length", collider.length != plain.length, {capsule}},
                    {"axis", collider.axis != plain.axis, {capsule}},
                    {"semi_axes", collider.semi_axes != plain.semi_axes, {ellipsoid}},
                    {"normal", collider.normal != plain.normal, {plane}}},
                   warnings);
  }
}

/// Rules that the energy of in-plane strains is too much for: it comes out too low, near ν = ½ most.
void warn_of_quadrature(const SkinScene& skin, std::vector<std::string>& warnings) {
  for (const SkinRuleCheck& check : check_skin_rules(skin))
    if (check.is_weak())
      warnings.push_back(sentence(
          "/skin/quadrature: exact to degree ", check.plane, " in the plane and ", check.thickness,
          " through the thickness, where ",
          check.layer.empty() ? "the composite element" : "layer " + check.layer, " of orders ", skin.order,
          " and ", check.order, " needs ", check.plane_needed, " and ", check.thickness_needed,
          ", so that its energy comes out too low; lower the order through the thickness or take the default "
          "product rule"));
}

void warn_of_collider(const ColliderScene& collider, const TimeScene& time,
                      std::vector<std::string>& warnings) {
  const std::string at = "/colliders/" + collider.name;
  const double end = time.frames / time.frame_rate, step = 1 / (time.frame_rate * time.substeps);
  const double read = end + time.offset;
  const std::string clock = time.offset == 0 ? "" : ", where the path is read at " + time_text(read);
  if (time.frames > 0 && collider.path.front().time > read)
    warnings.push_back(sentence(at, "/path: starts at ", time_text(collider.path.front().time),
                                ", after the last frame at ", time_text(end), clock,
                                ", so that it never moves"));
  if (time.frames > 0 && collider.path.size() > 1 && collider.path.back().time <= time.offset)
    warnings.push_back(sentence(at, "/path: ends at ", time_text(collider.path.back().time),
                                ", before frame 0, where it is read at ", time_text(time.offset),
                                ", so that it never moves"));
  if (collider.shape == ShapeKind::plane) return;
  const bool is_ellipsoid = collider.shape == ShapeKind::ellipsoid;
  const double size = is_ellipsoid ? collider.semi_axes.minCoeff() : collider.radius;
  // Lagged friction is only good while the contact moves by less than a quarter of its radius in a step, and
  // the contact is smaller than the body.
  double fastest = 0;
  for (size_t k = 1; k < collider.path.size(); ++k) {
    const PathKnot &a = collider.path[k - 1], &b = collider.path[k];
    if (a.time >= end + time.offset || b.time <= time.offset) continue;
    const double distance = (b.position - a.position).norm();
    fastest = std::max(fastest, distance * std::min(1., step / (b.time - a.time)));
  }
  if (fastest > 2 * size) {
    warnings.push_back(sentence(at, "/path: moves ", length_text(fastest),
                                " in one step, more than its diameter, so that it may pass through the skin "
                                "between two steps; raise /time/substeps"));
  } else if (collider.friction && fastest > size / 4) {
    warnings.push_back(sentence(at, "/path: moves ", length_text(fastest),
                                " in one step, more than a quarter of its ",
                                is_ellipsoid ? "shortest semi-axis " : "radius ", length_text(size),
                                ", so that lagged friction is inaccurate; raise /time/substeps"));
  }
}

void warn_of_offset(const Scene& scene, std::vector<std::string>& warnings) {
  const TimeScene& time = scene.time;
  if (time.offset == 0 || time.frames == 0) return;
  const double begin = time.offset, end = begin + time.frames / time.frame_rate;
  bool moves = false;
  const auto look_at = [&](const auto& bodies) {
    for (const auto& body : bodies)
      moves =
          moves || (body.path.size() > 1 && body.path.front().time < end && body.path.back().time > begin);
  };
  look_at(scene.colliders);
  look_at(scene.skin.held);
  if (!moves)
    warnings.push_back(sentence("/time/offset: with ", time_text(time.offset), " the run covers ",
                                time_text(begin), " to ", time_text(end),
                                " of the paths' clock, where nothing moves"));
}

}  // namespace

std::vector<std::string> scene_warnings(const Scene& scene) {
  std::vector<std::string> warnings;
  for (const LayerScene& layer : scene.skin.layers) warn_of_layer(layer, scene, warnings);
  warn_of_wrinkling_stack(scene.skin, warnings);
  warn_of_locking(scene, warnings);
  warn_of_unused_keys(scene, warnings);
  warn_of_quadrature(scene.skin, warnings);
  for (const ColliderScene& collider : scene.colliders) warn_of_collider(collider, scene.time, warnings);
  warn_of_offset(scene, warnings);
  if (scene.time.frames == 0)
    warnings.push_back("/time/frames: 0, so that a run ends where it starts; give the number of frames");
  return warnings;
}

}  // namespace rhytid
