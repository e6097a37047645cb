// The parts of the rules table (rules.h), in the order of the documentation. Defaults come from the structs
// of scene.h, so that a Scene made in C++ and a scene file that leaves a key out cannot differ.
#pragma once

#include <vector>

#include "sim/scene/rules.h"

namespace rhytid {

std::vector<Rule> skin_rules();      ///< /skin: surface, orders, layers
std::vector<Rule> ligament_rules();  ///< /ligaments and their sources
std::vector<Rule> contact_rules();   ///< /base and /colliders
std::vector<Rule> run_rules();       ///< /time, /solver, /output

}  // namespace rhytid
