#include "tools/bench/recovery_twin.h"

#include <filesystem>
#include <nlohmann/json.hpp>

#include "fitting/case_camera.h"
#include "sim/core/error.h"
#include "sim/output/atomic_file.h"
#include "tools/render/footage.h"
#include "tools/render/skin_camera.h"
#include "tools/render/truth.h"
#include "tools/render/twin_run.h"

namespace rhytid::tools {

void RecoveryTwin::film(const fitting::RenderCase& noise, unsigned seed, const std::string& path) const {
  FootageWriter footage(path, noise.codec, rate, camera.width, camera.height);
  for (std::size_t f = 0; f < frames.size(); ++f)
    footage.add(sensor_picture(frames[f], static_cast<int>(f), noise.noise, seed));
  footage.commit();
}

std::optional<RecoveryTwin> make_recovery_twin(const fitting::Case& c, const Scene& fit,
                                               const SceneModel& truth, const std::string& folder,
                                               Progress& progress) {
  std::filesystem::create_directories(folder);
  const int stride = frame_stride(fit, truth.scene());
  const std::string motion = folder + "/truth_motion.bin";
  const TwinRun run = kept_twin(truth, stride, motion, progress);
  if (progress.interrupted()) return std::nullopt;
  if (!run.complete)
    throw InputError(c.file, "a truth whose run ended early: " + run.failure, "one that ends");
  const MovingSurface& surface = run.surface;
  write_motion(surface, motion);
  const fitting::Camera camera =
      c.camera.empty() ? automatic_camera(surface, c.render.width, c.render.height, c.render.tilt)
                       : fitting::read_case_camera(c);
  const SubdividedSurface tessellation(surface.mesh, SurfaceSide::outer, subdivision_for(surface, camera, 3));
  const SkinRenderer renderer(surface, tessellation, truth.scene(), camera, c.render);
  RecoveryTwin twin;
  const int frames = surface.frames();
  twin.rate = frames > 1 ? (frames - 1) / surface.times.back() : truth.scene().time.frame_rate;
  progress.stage("render", frames);
  for (int f = 0; f < frames; ++f) {
    twin.frames.push_back(renderer.levels(f));
    progress.step_done(f + 1);
    if (progress.interrupted()) return std::nullopt;
  }
  fitting::write_camera(camera, folder + "/camera.yaml");
  twin.camera = fitting::read_camera(folder + "/camera.yaml");
  write_file(folder + "/truth.json", truth_record(fit, truth, stride, frames).dump(2) + "\n");
  return twin;
}

}  // namespace rhytid::tools
