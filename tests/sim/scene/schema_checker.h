// A small JSON Schema evaluator: the part of draft 2020-12 that scene_schema() uses, independent of its
// making.
#pragma once

#include <nlohmann/json.hpp>
#include <string>

namespace rhytid::testing {

/// Whether `value` satisfies `schema`; $ref is looked up in `root`. Throws std::runtime_error on a keyword
/// that it does not know, so that a schema cannot pass by being misunderstood.
bool satisfies(const nlohmann::json& value, const nlohmann::json& schema, const nlohmann::json& root);

}  // namespace rhytid::testing
