// The scalars of a scene that can be fitted, swept and differentiated: one address, unit, range and transform
// each.
//
// An address is the JSON pointer of the value in the scene file; items of lists by name or by number:
//   /skin/layers/film/youngs_modulus   /ligaments/sources/0/strength   /colliders/finger/friction/coefficient
// Components of a vector by number:
//   /colliders/finger/path/0/position/2   /ligaments/sources/jaw/position/0   /colliders/finger/semi_axes/1
#pragma once

#include <string>
#include <string_view>
#include <vector>

#include "sim/core/units.h"
#include "sim/scene/scene.h"

namespace rhytid {

/// How an optimiser should see a parameter p in [lower, upper]: none p, log ln p, logit
/// ln((p−lower)/(upper−p)).
enum class ParameterTransform { none, log, logit };

struct ParameterSpec {
  std::string address;          ///< by names: /skin/layers/film/youngs_modulus
  std::string name;             ///< short, for tables and legends: "film youngs_modulus"
  std::string unit;             ///< of value, lower and upper: "MPa", "1/mm", "" for plain numbers
  Dimension dimension;          ///< the same as exponents, for parse_quantity and format_quantity
  double lower = 0, upper = 0;  ///< default bounds of a fit; inside the range that a scene may hold
  ParameterTransform transform = ParameterTransform::none;
  double value = 0;  ///< in the scene
};

/// Describes the parameter at `address`, which is rewritten to use names. Throws InputError naming the
/// nearest valid address of this scene when there is none.
ParameterSpec describe_parameter(const Scene& scene, std::string_view address);

/// What to say instead of an address that describe_parameter refuses, after "expected": the nearest one, or
/// that the value it addresses is none of those that can be fitted.
std::string expected_parameter(const Scene& scene, std::string_view address);

/// Every fit-able scalar of the scene: scalars in the order of the file, then components of vectors.
std::vector<ParameterSpec> all_parameters(const Scene& scene);

/// Value in internal units (mm, N, MPa, s). Throws InputError as describe_parameter does.
double get_parameter(const Scene& scene, std::string_view address);

/// Sets the value in internal units. Throws InputError for an unknown address or a value that a scene file
/// could not hold (not finite, out of the range of its rule).
void set_parameter(Scene& scene, std::string_view address, double value);

}  // namespace rhytid
