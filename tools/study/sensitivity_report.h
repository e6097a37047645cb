// Tables, plots, pictures and page of a sensitivity study.
#pragma once

#include <string>

#include "sim/scene/scene_model.h"
#include "tools/study/sensitivity.h"

namespace rhytid::tools {

/// The table and sentences that go to the terminal and sensitivity.txt.
std::string sensitivity_text(const Sensitivity& s, const SensitivityOptions& options);

/// parameters.csv, frames.csv, singular_values.csv, correlation.csv, map.csv, map.vtp, map.ply, map.png,
/// response_NAME.png of the strongest parameters, rms.svg, sensitivity.json, sensitivity.txt, index.html;
/// those of an earlier study of the folder go first.
void write_sensitivity(const std::string& folder, const SceneModel& scene_model, double end_time,
                       const Sensitivity& s, const SensitivityOptions& options);

}  // namespace rhytid::tools
