#include "sim/core/build_info.h"

namespace rhytid {

BuildInfo build_info() {
#if defined(__clang__)
  const std::string compiler = "clang " __clang_version__;
#else
  const std::string compiler = "gcc " __VERSION__;
#endif
  return {RHYTID_VERSION, RHYTID_BUILD_TYPE, compiler, RHYTID_SANITIZERS};
}

}  // namespace rhytid
