// From scene files to Scene and back.
//
// A scene file is JSON with comments. It may extend another file (merge patch, see located_json.h), and
// values may be overridden by "pointer=value" strings, where list items are addressed by number or name:
//   /skin/layers/film/youngs_modulus=4 MPa
// Paths in a file are resolved against its folder; paths in overrides against the working directory. Every
// error is an InputError of one line: where it was written, which key, which value, what was expected.
#pragma once

#include <nlohmann/json.hpp>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "sim/scene/located_json.h"
#include "sim/scene/scene.h"

namespace rhytid {

/// The scene as written: after extends and overrides, before defaults and validation.
nlohmann::json load_scene_json(const std::string& path, const std::vector<std::string>& overrides = {});

/// Validates and converts. `file` is used in messages and becomes Scene::file.
Scene parse_scene(const nlohmann::json& json, const std::string& file);

/// The same from text, which must be complete (no extends); messages name the line.
Scene parse_scene_text(std::string_view text, const std::string& file,
                       const std::vector<std::string>& overrides = {});

/// The same from a file; messages name the line of the file that wrote the value, or the setting.
Scene load_scene(const std::string& path, const std::vector<std::string>& overrides = {});
Scene load_scene(const std::string& path, std::span<const Setting> settings);

/// The scene with all defaults, all quantities as numbers in internal units: what was run. Valid input again,
/// and its own fixed point. Throws InputError as parse_scene does.
nlohmann::json scene_with_defaults(const nlohmann::json& json);

/// A Scene as JSON that parse_scene reads back to the same Scene. Also writes scenes changed by
/// set_parameter.
nlohmann::json scene_to_json(const Scene& scene);

/// One sentence per setting that is allowed but doubtful: outside the validity box of the model, or unlikely
/// to give what was meant. Empty for a good scene.
std::vector<std::string> scene_warnings(const Scene& scene);

/// JSON Schema (draft 2020-12) of scene files, for editors: complete scenes, and scenes that extend another.
nlohmann::json scene_schema();

/// The scene format as Markdown.
std::string scene_documentation();

}  // namespace rhytid
