// The camera of a case, whoever calibrated it: OpenCV's YAML, or a view of COLMAP's text export (/camera the
// folder, /camera_image the image, /camera_unit the length of COLMAP's unit).
// Tests: tests/fitting/colmap_test.cpp
#pragma once

#include <string>

#include "fitting/cameras.h"
#include "fitting/case.h"

namespace rhytid::fitting {

/// The camera that the case names. Throws InputError; ContractError when it names none.
Camera read_case_camera(const Case& c);

/// Where that camera is as a file of our own: camera_path() of the case, where a view of COLMAP's is written
/// first, so that results keep the camera that they were made with. Throws InputError.
std::string case_camera_file(const Case& c, const std::string& folder);

}  // namespace rhytid::fitting
