// Cameras of COLMAP's text export: cameras.txt and images.txt of one folder.
//
//   cameras.txt   CAMERA_ID MODEL WIDTH HEIGHT PARAMS...
//   images.txt    IMAGE_ID QW QX QY QZ TX TY TZ CAMERA_ID NAME, and a line of points (may be empty) after each
//
//   X_c = R(q) X + s t        world to camera, camera axes as OpenCV's; s [mm] of COLMAP's unit, which it
//                             does not know: every length of its world is times s
//   px  = px_COLMAP − ½       COLMAP has the corner of the first pixel at (0, 0), we its centre
//
//   model            parameters                              ours
//   SIMPLE_PINHOLE   f cx cy                                 fx = fy
//   PINHOLE          fx fy cx cy
//   SIMPLE_RADIAL    f cx cy k                               k1
//   RADIAL           f cx cy k1 k2                           k1 k2
//   OPENCV           fx fy cx cy k1 k2 p1 p2                 k1 k2 p1 p2
//   FULL_OPENCV      fx fy cx cy k1 k2 p1 p2 k3 k4 k5 k6     k1 k2 p1 p2 k3, where k4 = k5 = k6 = 0
//
// Source  COLMAP, "Output Format" and "Camera Models" of its documentation.
// Tests   tests/fitting/colmap_test.cpp
#pragma once

#include <string>
#include <vector>

#include "fitting/cameras.h"

namespace rhytid::fitting {

/// Whether `path` is a folder with cameras.txt and images.txt, or one of these two files.
bool is_colmap(const std::string& path);

/// The names of all images in images.txt, in its order. `path` as for is_colmap. Throws InputError.
std::vector<std::string> colmap_images(const std::string& path);

/// The camera that took `image`: the name as in images.txt, or the end of one, after a slash, when only one
/// ends so; empty when there is only one image. `mm_per_unit` is s above. Throws InputError "file:line: got
/// ..., expected ..." on malformed files, models not in the table, and unknown or ambiguous images.
Camera read_colmap_camera(const std::string& path, const std::string& image, double mm_per_unit);

/// Writes cameras.txt and images.txt (without points) into `folder`, each under a temporary name first:
/// camera i took the image cameras[i].name. The model is the first of PINHOLE, OPENCV, FULL_OPENCV that holds
/// the distortion. Throws InputError when they cannot be written, and for names with blanks or twice.
void write_colmap_cameras(const std::vector<Camera>& cameras, const std::string& folder, double mm_per_unit);

}  // namespace rhytid::fitting
