#include "fitting/case_camera.h"

#include "fitting/colmap.h"
#include "sim/core/error.h"

namespace rhytid::fitting {

Camera read_case_camera(const Case& c) {
  require(!c.camera.empty(), "read_case_camera: the case names no camera");
  const std::string at = c.file + ": " + c.view_pointer;
  if (!is_colmap(c.camera)) {
    if (!c.camera_image.empty() || c.camera_unit)
      throw InputError(at + "/camera_image and /camera_unit", "a camera " + c.camera,
                       "a folder with cameras.txt and images.txt of COLMAP, or none of the two");
    return read_camera(c.camera);
  }
  if (!c.camera_unit)
    throw InputError(at + "/camera_unit", "nothing",
                     "the length of COLMAP's unit, as \"12.5 mm\": its files have no unit");
  return read_colmap_camera(c.camera, c.camera_image, *c.camera_unit);
}

std::string case_camera_file(const Case& c, const std::string& folder) {
  const std::string path = camera_path(c, folder);
  if (c.camera.empty()) return path;
  const Camera camera = read_case_camera(c);
  if (is_colmap(c.camera)) write_camera(camera, path);
  return path;
}

}  // namespace rhytid::fitting
