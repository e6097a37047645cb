// What all studies share: the scene that they work on, shards of their runs, when a result is out of date, what
// predicted tracks see, and pictures of the skin.
#pragma once

#include <cmath>
#include <optional>
#include <string>
#include <vector>

#include "sim/output/picture.h"
#include "sim/scene/parameter.h"
#include "sim/scene/scene_model.h"
#include "tools/study/experiment.h"
#include "tools/study/variant_result.h"
#include "tools/verb.h"

namespace CLI {
class Validator;
}

namespace rhytid::tools {

/// Part `index` of `count` of a study's runs, for several machines: run i belongs to part 1 + i mod count.
struct Shard {
  int index = 1, count = 1;
  bool takes(std::size_t run) const {
    return run % static_cast<std::size_t>(count) + 1 == static_cast<std::size_t>(index);
  }
};

/// "2/4" as a shard; empty text is the whole. Throws InputError otherwise.
Shard parse_shard(const std::string& text);

/// A scene, or one variant of an experiment with what it measures.
struct StudyScene {
  Scene scene;
  std::string variant;       ///< "experiment, variant"; empty for a scene alone
  WrinkleMeasure measure;    ///< of the experiment; a scene alone has no line and no window
  std::string measure_text;  ///< what a result depends on
};

/// Loads FILE of a study: a scene, a case for its scene, or an experiment.json, of which the variant of that
/// name is taken (empty: the first). The settings of the command line come last. Throws InputError.
StudyScene load_study_scene(VerbContext& context, StudySize size, const std::string& variant);

/// What a result of this scene depends on, the measure beside it.
VariantIdentity study_identity(const Scene& scene, const Model& model, const std::string& measure);

/// Names as addresses of `scene`, or when empty all that the scene has but places (of sources, of knots of
/// paths), which per cents say nothing of. Throws InputError for one that it has not, or that is given twice.
std::vector<ParameterSpec> study_parameters(const Scene& scene, const std::vector<std::string>& addresses);

/// Throws InputError naming `where` for a scene of no frame: it has nothing to measure.
void require_frames(const Scene& scene, const std::string& where);

/// Tracks that a study predicts with, spread evenly over the outer surface and seen in every frame.
struct PredictedTracks {
  double noise = 0.01;  ///< mm, of each component of a track in each frame
  int count = 200;
  std::optional<Vec3> view;  ///< direction of sight, of length 1: what moves along it is not seen
  /// What adjoint::SurfaceResponse::root is multiplied by to be whitened, 1/mm.
  double weight() const { return std::sqrt(static_cast<double>(count)) / noise; }
  /// "200 tracks spread evenly ...", without a full stop.
  std::string text() const;
};

/// Options --noise, --tracks and --view. CLI11 writes into `tracks`, which must live as long as `app`.
void add_track_options(CLI::App& app, PredictedTracks& tracks);

/// Whether a noise, a prior or the like can be calculated with: 1e-9 to 1e9, and not what is no number.
bool is_size(double value);
/// The same as a check of an option.
CLI::Validator size_check();

/// Names for files: letters, digits, . and - stay, the rest becomes _. Those that would be the same get numbers,
/// also where capitals are all that differs.
std::vector<std::string> file_names(const std::vector<std::string>& texts);

/// Draws a scalar on the outer skin, seen from above: `values` per column. `solids_at` adds the colliders at
/// that time as thin glass, and the ligament sources as black dots.
void draw_on_skin(const SceneModel& scene_model, const VectorXd& values, const std::string& label,
                  const std::string& title, const std::string& path, ColourMap map = ColourMap::sequential,
                  std::optional<double> solids_at = std::nullopt);

/// The surface seen along its mean normal, the longer side across the picture, with room for a colour bar.
PictureOptions skin_from_above(const SubdividedSurface& outer);

}  // namespace rhytid::tools
