// What this build is: version, compiler, configuration. For --version, doctor and the reports.
#pragma once

#include <string>

namespace rhytid {

struct BuildInfo {
  std::string version;     ///< of the project, "major.minor.patch"
  std::string build_type;  ///< CMake's: Release, Debug, ...
  std::string compiler;    ///< name and version
  std::string sanitizers;  ///< as given to RHYTID_SANITIZE, empty when none
};

BuildInfo build_info();

}  // namespace rhytid
