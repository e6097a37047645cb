#include "tests/support/paths.h"

namespace rhytid {

std::string source_dir() {
  return RHYTID_SOURCE_DIR;
}

}  // namespace rhytid
