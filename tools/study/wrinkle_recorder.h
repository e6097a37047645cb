// Measures the wrinkles of a run after every frame and keeps what it found in files.
#pragma once

#include <functional>
#include <optional>
#include <string>

#include "sim/output/csv.h"
#include "tools/forward_run.h"
#include "tools/study/experiment.h"

namespace rhytid::tools {

/// The points of a surface on which wrinkles are measured.
struct WrinkleSamples {
  std::optional<SurfaceSamples> line, window;
};

/// Places them on the outer surface. Throws InputError, naming the key, when the line or most of the window
/// lies beside it.
WrinkleSamples place_samples(const SkinMesh& mesh, const WrinkleMeasure& measure);

/// Writes into the run's folder, all atomic:
///  - wrinkles.csv: a row per frame, counts and descriptors along the line and in the window
///    (sim/output/wrinkles.h);
///  - profile.csv: the line at the last frame so far, with place, height and band-passed height;
///  - above.png: the surface from above at the last frame, coloured by its displacement along its normals;
///  - ligaments.png: ligament parameter b at the first, if there are ligaments.
class WrinkleRecorder final : public FrameListener {
 public:
  /// `started` is called when a run starts at rest, the files of an earlier one being gone.
  WrinkleRecorder(WrinkleMeasure measure, std::function<void()> started)
      : measure_(std::move(measure)), started_(std::move(started)) {}
  std::vector<std::string> files() const override;
  void begin(const SceneModel& scene_model, const std::string& folder) override;
  void start(const State& rest) override;
  void resume(int frame) override;
  void frame(int frame, const State& state) override;

 private:
  void draw(const State& state) const;
  void draw_ligaments() const;

  WrinkleMeasure measure_;
  std::function<void()> started_;
  const SceneModel* scene_model_ = nullptr;
  std::string folder_;
  WrinkleSamples samples_;
  std::optional<CsvTable> table_;
};

}  // namespace rhytid::tools
