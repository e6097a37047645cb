// A case: everything that one identification needs besides the scene. Read from case.json with the same
// strictness as scenes (unknown key, wrong unit, out of range: one line, InputError); a case may extend
// another.
//
//   case.json  { "name", "scene": "scene.json", "settings": ["/pointer=value", ...],
//                "truth": {"scene": "truth.json", "settings": ["/pointer=value", ...]},
//                "camera": "camera.yaml", "footage": "footage.mp4", "tracks": "tracks.csv",
//                "render": {...}, "track": {...}, "fit": {"parameters": [{"address", ...}], ...},
//                "clips": [{"name": "left", "settings": [...], "tracks": "left.csv", ...}, ...] }
//
// With clips the case names several experiments with the same skin, fitted together: what a clip leaves out
// it has from the case. A parameter /clips/NAME/time/offset is of that clip, /clips/*/time/offset one for
// each clip; without such a beginning it is shared by all clips whose scene has it.
//
// A truth without a scene of its own is the fit's scene, settings included, changed by the truth's settings.
// A clip without a truth has that of the case, with the clip's scene and settings; where that truth has a scene
// of its own, it is changed by the clip's settings, then by the truth's.
// Relative input paths are resolved against the case file; footage and tracks that do not exist there are
// looked for, and written, in the output folder. Tests: tests/fitting/case_test.cpp
#pragma once

#include <array>
#include <numbers>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "fitting/head_motion.h"
#include "fitting/measurements.h"
#include "fitting/wave_spectrum.h"
#include "sim/scene/located_json.h"
#include "sim/scene/parameter.h"

namespace rhytid::fitting {

/// One fitted parameter; what is not given comes from describe_parameter.
struct FitParameter {
  std::string address;                          ///< into a scene
  std::optional<double> initial, lower, upper;  ///< internal units
  std::optional<ParameterTransform> transform;
  std::optional<double> prior_sigma;  ///< standard deviation of a Gaussian prior in the transformed parameter
  std::string clip = {};  ///< of this clip alone; empty: shared by all clips whose scene has the address
  /// What moves by how much when the value goes from 0 to 1, where it is none of the scene's own parameters but
  /// moves several (path_deviations.h). `address` then only names it, `initial` and bounds are given.
  std::vector<std::pair<std::string, double>> moves = {};
  std::string name = {};   ///< for reports; of the scene's own parameters the scene says it
  std::string group = {};  ///< parameters of one name here are considered as one, by the sum of what they do
  bool is_held = false;    ///< only differentiated by (consider.h): observations need not outnumber these
};

/// A number of the scene that is none of its parameters, and to what it is known (considered_quantities.h); or the
/// path of a collider, "/colliders/NAME/path": what all its knots are off alike in each direction, mm.
struct ConsideredQuantity {
  std::string address;       ///< into a scene, items of lists by name
  std::string clip = {};     ///< of this clip alone; empty: of all clips whose scene has it
  double sigma = 0;          ///< internal units, or of the value itself; 0: it is exact
  bool is_relative = false;  ///< `sigma` is a fraction of the value
};

struct RenderCase {
  int width = 640, height = 480;              ///< px
  int supersampling = 2;                      ///< samples per pixel and axis
  double noise = 1.0;                         ///< standard deviation of image noise, grey levels of 255
  unsigned seed = 1;                          ///< of texture and noise
  double texture_scale = 0.5;                 ///< mm, typical size of skin marks
  std::string codec = "mjpg";                 ///< mjpg (avi) | h264 (mp4; small, but it removes the noise)
  bool finger = true;                         ///< draw the colliders
  int finger_dots = 0;                        ///< dark dots drawn on each, for `finger --marker`
  double tilt = 20 * std::numbers::pi / 180;  ///< rad, of the automatic camera off the mean normal
  int truth_spacing = 16;                     ///< px between the material points of truth_tracks.csv
};

struct TrackCase {
  int max_tracks = 300;
  double min_distance = 8;                   ///< px between tracks
  std::optional<std::array<double, 4>> roi;  ///< x, y, width, height, px
  bool mask_finger = true;                   ///< drop tracks that the projected colliders of the scene cover
  std::string model = "affine";              ///< affine | translation: warp of the window about a point
  int window = 21;                           ///< px, odd: side of the window about a point
  bool redetect = true;                      ///< look for points that were covered or lost
  std::optional<double> exposure;  ///< share of the frame interval the shutter is open; else found out
};

/// A cheaper fit before the fit (stages.h).
struct StageCase {
  std::vector<Setting> settings;  ///< of the scene, behind those of the case or clip
  int last_frame = 0;             ///< 0 = that of the fit
  int max_evaluations = 10;       ///< forward runs
  std::string words() const;      ///< what it does otherwise, for messages
};

/// Weights below this count as none: what they would leave of an observation is lost in rounding.
inline constexpr double kLeastWeight = 1e-9;

/// What observations of some frames weigh; of several that hold a frame the last counts.
struct FrameWeight {
  int from = 1, to = 0;   ///< frames, both included; to 0: all from there on
  double weight = 1;      ///< in [0, 1]; 0: they are not compared
  double half_every = 0;  ///< frames after which it has fallen to the half, again and again; 0: it does not
};
/// 1 where no rule holds the frame, 0 below kLeastWeight.
double frame_weight(const std::vector<FrameWeight>& rules, int frame);

struct FitCase {
  std::vector<FitParameter> parameters;
  std::vector<StageCase> stages;    ///< before the fit, in order
  std::string optimiser = "ceres";  ///< ceres | nlopt
  int max_evaluations = 30;         ///< forward runs
  double robust_scale = 3;          ///< Huber threshold in standard deviations; 0 = plain least squares
  double min_sigma = 0.05;  ///< px, floor of the standard deviation of a displacement since frame 0, per axis
  int first_frame = 1, last_frame = 0;  ///< frames used, 0 = all
  std::vector<FrameWeight> frame_weights;
  double clip_weight = 1;  ///< in (0, 1], of the clip that this is for; the fit sets it
  double rim_margin = 1;   ///< mm: tracks closer to the rim of the patch are left out
  /// Where tracked points stand still on the head: its motion is taken out by them. Empty: it stands still.
  std::vector<StillRegion> still;
  std::optional<WrinkleLine> wrinkles;  ///< where measured wrinkles are
  std::optional<WaveBand> waves;        ///< waves of the tracks that are compared besides their points
  /// Further starts, see fitting/starts.h.
  int starts = 1;           ///< with the case's own
  int local_fits = 3;       ///< searches at most, from the best of them
  double start_spread = 1;  ///< half width of the box that they are in, transformed; 1 = a quarter of a range
  int screen_frames = 0;    ///< they are compared on, 0 = half of those compared
  unsigned seed = 1;        ///< of the starts
  /// Addresses (joint_address) of fitted parameters whose profile likelihood is wanted, or "all".
  std::vector<std::string> profiles;
  /// Whether what the discretisation does to the answer is estimated, and enters the intervals.
  bool discretisation_check = true;
  /// Held parameters whose error enters the intervals (consider.h), σ_h in prior_sigma. Nothing given: the friction
  /// coefficients that are not fitted, the thicknesses of layers and where paths are.
  std::optional<std::vector<FitParameter>> consider;
  /// With `consider`, what else is considered: numbers that are no parameters, and paths.
  std::vector<ConsideredQuantity> consider_quantities, consider_paths;
  std::string path_deviations = "consider";  ///< consider | fit | ignore: those that paths are known to have
  /// Give contact penalties per unit of this layer's Young's modulus, so that the penalty is no hidden
  /// yardstick.
  std::string gauge_layer;  ///< layer whose modulus is fixed; default: the innermost
};

/// What one camera saw of a clip.
struct ViewCase {
  std::string name;                     ///< empty where it is the clip's only one
  std::string pointer;                  ///< where the case has it, "/clips/0/cameras/1"
  std::string camera, footage, tracks;  ///< as those of Case
  std::string camera_image;             ///< as that of Case
  std::optional<double> camera_unit;    ///< mm, as that of Case
};

/// One of several experiments with the same skin.
struct ClipCase {
  std::string name;
  std::string scene;
  std::vector<Setting> scene_settings;  ///< those of the case, then its own
  std::string truth_scene;
  std::vector<Setting> truth_settings;
  std::vector<ViewCase> views;  ///< at least one
  std::string measurements;     ///< as that of Case
  double weight = 1;            ///< in (0, 1]: of its tracks, against those of other clips
};

struct Case {
  std::string name, file;
  std::string scene;  ///< path of the scene that the fit uses
  std::vector<Setting> scene_settings;
  std::string truth_scene;  ///< path; empty when the footage is real
  std::vector<Setting> truth_settings;
  std::string camera;                 ///< path of the camera file; empty: the automatic one of `render`
  std::string camera_image;           ///< when `camera` is COLMAP's: which image it took; empty: the only one
  std::optional<double> camera_unit;  ///< mm, of COLMAP's unit of length
  std::string view_pointer;           ///< of the view that this is the case of, "/clips/0"; else empty
  std::string footage, tracks;        ///< paths as given
  std::string measurements;           ///< path (measurements.h); empty: none
  RenderCase render;
  TrackCase track;
  FitCase fit;
  std::vector<ClipCase> clips;  ///< empty: the case is one clip seen by one camera
};

/// Reads and validates case.json; `settings` are "/pointer=value" overrides of the case itself. The scene is
/// read too, since addresses and units of fitted parameters are checked against it. Throws InputError.
Case load_case(const std::string& path, const std::vector<std::string>& settings = {});

/// Fitted parameters that an address as a case or a command line gives it names: itself, that of a clip, or
/// one for each clip whose scene has it ("/clips/*/..."). `scenes` are those of the clips, in order; one
/// without clips. Throws InputError beginning with `where`.
std::vector<FitParameter> parameters_named(const Case& c, const std::vector<Scene>& scenes,
                                           const std::string& address, const std::string& where);

/// The same for what /fit/consider names besides parameters: a number of the scene, or "/colliders/NAME/path".
/// `sigma` is left 0. Throws InputError beginning with `where`.
std::vector<ConsideredQuantity> quantities_named(const Case& c, const std::vector<Scene>& scenes,
                                                 const std::string& address, const std::string& where);

/// Addresses as the fit knows them (joint_address) of those of `fitted` that an address names; "all" stays.
/// Throws InputError beginning with `where` when none is fitted.
std::vector<std::string> fitted_named(const Case& c, const std::vector<Scene>& scenes,
                                      const std::vector<FitParameter>& fitted, const std::string& address,
                                      const std::string& where);

/// The scenes that a fit of the case runs: one, or one per clip. Throws InputError.
std::vector<Scene> scenes_of(const Case& c);
/// Those of a stage. Throws InputError.
std::vector<Scene> scenes_of_stage(const Case& c, const StageCase& stage);

/// A view of a clip as a case of its own, as `render` and `track` know it, and where its files lie below the
/// folder of results: NAME, or NAME/VIEW where several cameras saw the clip.
Case case_of_view(const Case& c, int clip, int view);
std::string folder_of_view(const Case& c, int clip, int view, const std::string& folder);
/// The clip and view that "NAME" or "NAME/VIEW" means. Throws InputError naming what there is.
std::pair<int, int> view_named(const Case& c, const std::string& name);

/// Where the footage, tracks and camera of a case are: the path given if it exists relative to the case file,
/// else that file name in `folder` (footage.avi or .mp4, tracks.csv, camera.yaml when the case names none). A
/// camera that the case names is never looked for elsewhere; for one of COLMAP's, camera.yaml in `folder` is
/// where fitting/case_camera.h writes it.
std::string footage_path(const Case& c, const std::string& folder);
std::string tracks_path(const Case& c, const std::string& folder);
std::string camera_path(const Case& c, const std::string& folder);

}  // namespace rhytid::fitting
