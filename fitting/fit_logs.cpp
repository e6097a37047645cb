#include "fitting/fit_logs.h"

#include <filesystem>

namespace rhytid::fitting {

FitLogs::FitLogs(const JointFitInput& input, JointProblem& problem,
                 const std::function<void(const std::string&)>& note) {
  if (input.evaluations.empty()) return;
  const auto tell = [&note](const std::string& text) {
    if (note && !text.empty()) note(text);
  };
  for (int c = 0; c < problem.num_clips(); ++c) {
    const std::string& name = problem.name(c);
    const std::string folder = problem.num_clips() == 1
                                   ? input.evaluations
                                   : (std::filesystem::path(input.evaluations) / name).string();
    EvaluationLog& log =
        logs_.emplace_back(folder, fit_identity(input.clips[c], input.options, problem.clip(c)), input.anew);
    log.warn = tell;
    problem.clip(c).log = &log;
    tell(log.set_aside());
    if (log.num_runs() > 0)
      tell("resumed: " + std::to_string(log.num_runs()) + " runs of an earlier start are in " + folder);
  }
}

}  // namespace rhytid::fitting
