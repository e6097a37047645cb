// run.json: what was run, with what, how far it came and why it ended. Rewritten as the run goes.
#pragma once

#include <nlohmann/json.hpp>
#include <string>

#include "sim/scene/scene_model.h"
#include "tools/verb.h"

namespace rhytid::tools {

class RunRecord {
 public:
  /// `path` of run.json; versions, command, scene after defaults, schemes and sizes are taken at once.
  RunRecord(std::string path, const SceneModel& scene_model, const VerbContext& context);

  /// Adds a converged step to the totals.
  void add(const StepRecord& step);
  double setup_seconds = 0, solve_seconds = 0, output_seconds = 0;
  double solve_cpu_seconds = 0;  ///< of all threads
  int frames_done = 0;
  int resumed_from = 0;  ///< frame

  /// Writes the file. `status`: running | complete | not_converged | interrupted; `reason` a sentence.
  void write(const std::string& status, const std::string& reason = {}) const;
  long iterations() const { return iterations_; }
  long steps() const { return steps_; }

 private:
  std::string path_;
  nlohmann::ordered_json fixed_;
  int frames_ = 0;
  long steps_ = 0, iterations_ = 0, evaluations_ = 0, factorisations_ = 0, bisected_ = 0, softened_ = 0;
};

/// The status that a run.json records, "" when there is no readable one.
std::string recorded_status(const std::string& path);

}  // namespace rhytid::tools
