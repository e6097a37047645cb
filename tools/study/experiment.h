// experiment.json: a scene, the variants of it that are run side by side, and what is measured on each.
#pragma once

#include <nlohmann/json.hpp>
#include <optional>
#include <string>
#include <vector>

#include "sim/output/surface_samples.h"
#include "sim/output/wrinkles.h"
#include "sim/scene/located_json.h"
#include "sim/scene/rules.h"
#include "tools/study/comparison.h"

namespace rhytid::tools {

enum class StudySize { quick, full };
const char* name(StudySize size);

/// Where and how wrinkles are measured.
struct WrinkleMeasure {
  WrinkleBand band;
  std::optional<SampleLine> line;
  int line_points = 400;
  std::optional<SampleWindow> window;
  double window_spacing = 0.5;  ///< mm
};

/// A value that a sweep sets, as it was written.
struct SweptValue {
  std::string address, text;
};

struct Variant {
  std::string name;
  std::vector<Setting> settings;  ///< of the experiment, its size, the variant and its size, in this order
  std::vector<SweptValue> values = {};  ///< of a grid or a table; the last of the settings
};

struct Experiment {
  std::string name, description;
  std::string file;   ///< experiment.json itself, for messages
  std::string scene;  ///< resolved path
  WrinkleMeasure measure;
  nlohmann::json measure_json;    ///< `measure` with all defaults: what a result depends on
  std::vector<Variant> variants;  ///< those of the size asked for
  std::optional<Comparison> comparison;
};

/// The rules of experiment.json.
const std::vector<Rule>& experiment_rules();

/// JSON Schema and Markdown of the format, for `rhytid schema experiment`.
nlohmann::json experiment_schema();
std::string experiment_documentation();

/// Whether the file has a list of variants, as scenes and cases have not. Throws InputError when it cannot be
/// read.
bool is_experiment(const std::string& path);

/// Throws InputError naming `where` unless the name of a variant can be that of a folder beside the tables.
void check_variant_name(const std::string& name, const std::string& where);

/// "soft, firm".
std::string variant_names(const Experiment& experiment);

/// Another kind of file where an experiment is wanted.
enum class OtherFile { none, a_scene, a_case };
OtherFile other_file(const nlohmann::json& root);
/// Throws InputError where the file is a case.
void refuse_case(const std::string& path);

/// Reads an experiment at a size. Throws InputError of one line, with `if_scene` behind it where the file is a scene.
Experiment load_experiment(const std::string& path, StudySize size, const char* if_scene = "");

}  // namespace rhytid::tools
