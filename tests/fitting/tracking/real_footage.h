// Where the real footage is: the folder named by RHYTID_REALDATA, or the reason to skip.
#pragma once

#include <gtest/gtest.h>

#include <cstdlib>
#include <filesystem>
#include <string>

namespace rhytid::fitting::testing {

/// Path of `file` below RHYTID_REALDATA; empty when the variable or the file is missing.
inline std::string real_file(const std::string& file) {
  const char* folder = std::getenv("RHYTID_REALDATA");
  if (folder == nullptr) return {};
  const std::string path = std::string(folder) + "/" + file;
  return std::filesystem::exists(path) ? path : std::string();
}

#define RHYTID_REAL_FILE_OR_SKIP(variable, file)                            \
  const std::string variable = ::rhytid::fitting::testing::real_file(file); \
  if (variable.empty()) GTEST_SKIP() << "RHYTID_REALDATA is not set or has no " << (file)

}  // namespace rhytid::fitting::testing
