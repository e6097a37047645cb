#include "fitting/environment.h"

#include "tools/environment.h"

namespace rhytid::tools {

std::vector<EnvironmentFact> fitting_environment() {
  using Verdict = EnvironmentFact::Verdict;
  std::vector<EnvironmentFact> facts;
  for (const auto& library : fitting::library_versions()) facts.push_back({library.name, library.version});
  std::string backends;
  for (const std::string& name : fitting::video_backends()) backends += (backends.empty() ? "" : " ") + name;
  facts.push_back({"video backends", backends.empty() ? "none" : backends});

  // H.264 makes small files but may be missing; MJPG in AVI is the fall-back that must be there.
  const bool has_h264 = fitting::video_writer_opens("avc1", ".mp4");
  const bool has_mjpg = fitting::video_writer_opens("MJPG", ".avi");
  facts.push_back({"video writer avc1 (H.264, .mp4)", has_h264 ? "opens" : "does not open"});
  facts.push_back({"video writer MJPG (.avi)", has_mjpg ? "opens" : "does not open",
                   has_mjpg ? Verdict::good : Verdict::bad});
  return facts;
}

}  // namespace rhytid::tools
