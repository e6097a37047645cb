// A temporary folder that holds the frames of one test.
#pragma once

#include <gtest/gtest.h>
#include <unistd.h>

#include <cstdio>
#include <filesystem>
#include <opencv2/imgcodecs.hpp>
#include <string>

#include "fitting/tracking/frame_source.h"

namespace rhytid::fitting::testing {

class FootageFolder {
 public:
  FootageFolder()
      : path_((std::filesystem::temp_directory_path() /
               ("rhytid_footage_" +
                std::string(::testing::UnitTest::GetInstance()->current_test_info()->name()) + "_" +
                std::to_string(::getpid())))
                  .string()) {
    std::filesystem::create_directories(path_);
  }
  ~FootageFolder() { std::filesystem::remove_all(path_); }
  FootageFolder(const FootageFolder&) = delete;
  FootageFolder& operator=(const FootageFolder&) = delete;

  void add(const cv::Mat& image) {
    char name[32];
    std::snprintf(name, sizeof name, "/f_%03d.png", count_++);
    cv::imwrite(path_ + name, image);
  }
  std::string file(const std::string& name) const { return path_ + "/" + name; }
  int count() const { return count_; }

  FrameSource source() const {
    FrameSourceOptions options;
    options.path = path_ + "/f_%03d.png";
    options.frames_per_second = 25;
    return FrameSource(options);
  }

 private:
  std::string path_;
  int count_ = 0;
};

}  // namespace rhytid::fitting::testing
