// A rectangle on the surface as experiment files give it, in more than one place.
#pragma once

#include <functional>
#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "sim/output/surface_samples.h"
#include "sim/scene/rules.h"

namespace rhytid::tools {

/// The rules of its keys; that of the object itself, at `pointer`, is the caller's.
std::vector<Rule> surface_window_rules(const std::string& pointer);

SampleWindow surface_window(const nlohmann::json& window);

/// Throws the error about a value at a pointer.
using RefuseValue =
    std::function<void(const std::string& pointer, const std::string& got, const std::string& expected)>;

/// What no single rule can say: its directions span a plane, it has neither too few nor too many points.
void check_surface_window(const nlohmann::json& window, const std::string& pointer,
                          const RefuseValue& refuse);

}  // namespace rhytid::tools
