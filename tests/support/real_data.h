// Data of others that tests use where it is: files below the folder that RHYTID_REALDATA names. A test
// without its file says so and is skipped; tools/test counts skipped tests by what they say.
#pragma once

#include <gtest/gtest.h>

#include <cstdlib>
#include <filesystem>
#include <string>

namespace rhytid {

/// ICT FaceKit's generic neutral mesh, in cm.
inline constexpr const char* kHeadFile = "heads/ict_facekit/generic_neutral_mesh.obj";

/// Path of `file` below RHYTID_REALDATA; empty when the variable or the file is missing.
inline std::string real_file(const std::string& file) {
  const char* folder = std::getenv("RHYTID_REALDATA");
  if (folder == nullptr) return {};
  const std::string path = std::string(folder) + "/" + file;
  return std::filesystem::exists(path) ? path : std::string();
}

/// Why real_file is empty.
inline std::string why_no_real_file(const std::string& file) {
  return std::getenv("RHYTID_REALDATA") == nullptr ? "RHYTID_REALDATA is not set"
                                                   : "RHYTID_REALDATA has no " + file;
}

#define RHYTID_REAL_FILE_OR_SKIP(variable, file)            \
  const std::string variable = ::rhytid::real_file((file)); \
  if (variable.empty()) GTEST_SKIP() << ::rhytid::why_no_real_file((file))

}  // namespace rhytid
