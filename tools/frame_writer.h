// The files of a frame: volume, outer surface, pictures, and the two time series that list them.
#pragma once

#include <string>
#include <vector>

#include "sim/output/picture.h"
#include "sim/output/surface_tessellation.h"
#include "sim/output/vtu.h"
#include "sim/scene/scene_model.h"

namespace rhytid::tools {

struct FrameOptions {
  int subdivision = 4;                             ///< of each face in surface files and pictures
  int picture_width = 1000, picture_height = 750;  ///< px
};

/// Writes into `folder`: frames/frame_0007.vtu + frames.pvd and surface/frame_0007.vtp + surface.pvd when the
/// scene asks for vtu; pictures/shaded_0007.png and pictures/displacement_0007.png when it asks for pictures.
/// All atomic. The scene model must outlive it.
class FrameWriter {
 public:
  FrameWriter(const SceneModel& scene_model, std::string folder, const FrameOptions& options);
  /// Throws InputError naming the path that cannot be written.
  void write(int frame, const State& state);
  /// Lists frames that an earlier run wrote, without writing them again.
  void restore(int frame, double time);

 private:
  void list(int frame, double time);
  void draw(int frame, const State& state, const VectorXd& magnitude) const;

  const SceneModel* scene_model_;
  std::string folder_;
  FrameOptions options_;
  SubdividedSurface outer_;
  PictureOptions picture_;  ///< with one camera for all frames
  std::vector<PvdEntry> volumes_, surfaces_;
};

/// Colliders as glass bodies at time t (spheres; planes are not drawn).
std::vector<PictureSolid> collider_solids(const Scene& scene, double t);

/// Time that the two pictures of a frame take, s: measured at rest on a picture of half the width, since it
/// goes with the number of pixels.
double measure_pictures(const SceneModel& scene_model, const FrameOptions& options);

}  // namespace rhytid::tools
