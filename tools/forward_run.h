// A forward run with its files: what `simulate` does, and what a study does for each of its variants.
#pragma once

#include <string>
#include <vector>

#include "sim/scene/scene_model.h"
#include "tools/frame_writer.h"
#include "tools/verb.h"

namespace rhytid::tools {

/// Someone who measures a run frame by frame. Of start and resume one is called, after begin.
class FrameListener {
 public:
  virtual ~FrameListener() = default;
  /// Names of the files that it keeps in the run's folder: those of an earlier run go before one starts.
  virtual std::vector<std::string> files() const = 0;
  /// The run is ready to go. The model lives as long as the run.
  virtual void begin(const SceneModel& scene_model, const std::string& folder) = 0;
  /// It starts at rest.
  virtual void start(const State& rest) = 0;
  /// It goes on after this frame. Throws InputError when what it needs of the frames before is not there;
  /// the run then starts from the beginning.
  virtual void resume(int frame) = 0;
  /// A frame is done; called before the checkpoint that resume starts from. Frame 0 only after settling.
  virtual void frame(int frame, const State& state) = 0;
};

/// Runs the scene of context.options with its settings and leaves the files that `rhytid simulate --help`
/// names in the output folder. With `resume` it goes on from the state that lies there: one that is damaged
/// or of another scene is refused, but with a listener, as all that a listener needs from earlier frames, no
/// more than a reason to start from the beginning. Throws InputError.
ExitCode run_forward(VerbContext& context, const FrameOptions& options, bool resume,
                     FrameListener* listener = nullptr);

}  // namespace rhytid::tools
