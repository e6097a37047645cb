// Any number that a scene file holds, by its address: also those that no derivative is known of, such as the
// thickness of a layer or the gap of a contact's onset. What may be fitted is in parameter.h.
//
// An address is the JSON pointer of the value, items of lists by name or by number, components of vectors by number:
//   /skin/layers/film/thickness   /base/onset   /base/centre/2   /ligaments/sources/0/radius
// The thickness of a layer with a thickness_map is the mean of the map; setting it scales the map.
//
// Tests: tests/sim/scene/scene_quantity_test.cpp
#pragma once

#include <string>
#include <string_view>

#include "sim/core/units.h"
#include "sim/scene/scene.h"

namespace rhytid {

struct SceneQuantity {
  std::string address;  ///< items of lists by name
  std::string name;     ///< short, for tables: "film thickness"
  Dimension dimension;
  double value = 0;  ///< in the scene, internal units (mm, N, MPa, s, rad)
};

/// The number at `address`. Throws InputError naming the nearest number of this scene when there is none; integers and
/// words are no quantities.
SceneQuantity describe_quantity(const Scene& scene, std::string_view address);

/// What to say instead of an address that describe_quantity refuses, after "expected": the nearest number.
std::string expected_quantity(const Scene& scene, std::string_view address);

/// The scene with another value there, as if its file said so. Throws InputError for an unknown address or a
/// scene that could not be read.
Scene with_quantity(const Scene& scene, std::string_view address, double value);

}  // namespace rhytid
