#include "tools/study/surface_window.h"

#include <Eigen/Geometry>
#include <algorithm>

#include "sim/output/text.h"
#include "sim/scene/located_json.h"
#include "tools/study/experiment.h"

namespace rhytid::tools {
namespace {

using nlohmann::json;

/// 500 in either direction; each takes some 200 bytes and is compared with its neighbours.
constexpr int most_window_points = 250000;

Vec3 vector_of(const json& j) {
  return {j[0].get<double>(), j[1].get<double>(), j[2].get<double>()};
}

}  // namespace

std::vector<Rule> surface_window_rules(const std::string& pointer) {
  return {
      {.pointer = pointer + "/centre",
       .type = RuleType::vector3,
       .dimension = dimension::length,
       .is_required = true,
       .doc = "Its centre; its points are moved to the surface."},
      {.pointer = pointer + "/along",
       .type = RuleType::vector3,
       .fallback = {1, 0, 0},
       .doc = "Direction of its first side."},
      {.pointer = pointer + "/normal",
       .type = RuleType::vector3,
       .fallback = {0, 0, 1},
       .doc = "Outward direction."},
      {.pointer = pointer + "/size",
       .type = RuleType::vector2,
       .dimension = dimension::length,
       .is_required = true,
       .min = 0,
       .min_is_open = true,
       .doc = "Lengths of its sides."},
      {.pointer = pointer + "/spacing",
       .dimension = dimension::length,
       .fallback = WrinkleMeasure().window_spacing,
       .min = 0,
       .min_is_open = true,
       .doc = "Between points."},
  };
}

SampleWindow surface_window(const json& window) {
  return {vector_of(window["centre"]),
          vector_of(window["along"]),
          vector_of(window["normal"]),
          {window["size"][0].get<double>(), window["size"][1].get<double>()}};
}

void check_surface_window(const json& w, const std::string& pointer, const RefuseValue& refuse) {
  const Vec3 along = vector_of(w["along"]), normal = vector_of(w["normal"]);
  if (!(along.cross(normal).norm() > 1e-6 * along.norm() * normal.norm()))
    refuse(pointer, shown_json(w["along"]) + " and " + shown_json(w["normal"]),
           "two directions that span a plane");
  const double width = w["size"][0], height = w["size"][1], spacing = w["spacing"];
  if (std::min(width, height) < 2 * spacing)
    refuse(pointer + "/size", shown_json(w["size"]), "at least twice the spacing");
  const double points = (1 + width / spacing) * (1 + height / spacing);
  if (points > most_window_points)
    refuse(pointer + "/spacing", shown_json(w["spacing"]) + ", which are " + short_text(points) + " points",
           "at most " + std::to_string(most_window_points));
}

}  // namespace rhytid::tools
