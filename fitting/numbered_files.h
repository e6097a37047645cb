// Which frame a file is of, from its name: a shell puts f_10.csv before f_2.csv, and a frame may be missing.
// Tests: tests/fitting/track_import_test.cpp
#pragma once

#include <string>
#include <vector>

namespace rhytid::fitting {

struct NumberedFile {
  std::string path;
  int number = 0;
};

/// The files by increasing number: that in which their names differ (of one file the last number in its name,
/// 1 when there is none). Files whose names differ in something else are numbered from 1 in the order given,
/// and `notes` gets a sentence that says so. Throws InputError for two files of one number.
std::vector<NumberedFile> number_files(const std::vector<std::string>& files,
                                       std::vector<std::string>& notes);

}  // namespace rhytid::fitting
