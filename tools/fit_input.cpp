#include "tools/fit_input.h"

#include <algorithm>
#include <filesystem>

#include "fitting/case_camera.h"
#include "sim/core/error.h"
#include "sim/scene/load.h"
#include "tools/footage_record.h"
#include "tools/track_footage.h"

namespace rhytid::tools {
namespace {

namespace fs = std::filesystem;

/// Where the files of one view of one clip are.
struct ViewFiles {
  fitting::Case of_view;
  std::string folder, tracks, camera, footage;
  int clip = 0, view = 0;
};

ViewFiles files_of(const fitting::Case& c, int clip, int view, const std::string& folder) {
  ViewFiles f;
  f.clip = clip, f.view = view;
  f.of_view = fitting::case_of_view(c, clip, view);
  f.folder = fitting::folder_of_view(c, clip, view, folder);
  f.tracks = fitting::tracks_path(f.of_view, f.folder);
  f.camera = fitting::camera_path(f.of_view, f.folder);
  f.footage = fitting::footage_path(f.of_view, f.folder);
  return f;
}

/// Of all clips, views of a clip behind each other.
std::vector<ViewFiles> all_files(const fitting::Case& c, const std::string& folder) {
  if (c.clips.empty()) return {files_of(c, 0, 0, folder)};
  std::vector<ViewFiles> all;
  for (int k = 0; k < static_cast<int>(c.clips.size()); ++k)
    for (int v = 0; v < static_cast<int>(c.clips[k].views.size()); ++v)
      all.push_back(files_of(c, k, v, folder));
  return all;
}

void require_tracks_or_footage(const ViewFiles& files) {
  if (fs::exists(files.tracks) || fs::exists(files.footage)) return;
  throw InputError(files.tracks, "no file, and no footage " + files.footage + " to track",
                   "tracks, or footage (of a camera, or made by 'rhytid render')");
}

/// The first stage of the main job, when nobody has done it yet or the tracks in the folder are not those
/// that the case asks for. Throws InputError rather than write over tracks that the command line had a say
/// in, or take tracks for others that cannot be made.
ExitCode current_tracks(const ViewFiles& files, VerbContext& context) {
  const std::string &tracks = files.tracks, &footage = files.footage;
  const fs::path own = fs::path(files.folder) / "tracks.csv";
  const bool is_there = fs::exists(tracks);
  std::error_code ignored;
  if (is_there && !(fs::equivalent(tracks, own, ignored) && fs::exists(own.parent_path() / "track.json")))
    return ExitCode::ok;                          // made elsewhere, or by something else
  fs::create_directories(files.folder, ignored);  // writing says when there is none
  const TrackJob job = track_job(files.of_view, files.folder, "", context.progress);
  if (is_there) {
    const auto outdated = outdated_tracks(tracks, footage, track_settings(job));
    if (!outdated) return ExitCode::ok;
    if (outdated->by_hand || !fs::exists(footage))
      throw InputError(tracks, "tracks " + outdated->why,
                       "those of the case (track again; without " + tracks + " and with footage, fit does)");
    context.progress.note(tracks + " is " + outdated->why + ": tracking " + footage + " again");
  } else {
    context.progress.note("no tracks yet (" + tracks + "): tracking " + footage + " first");
  }
  const ExitCode code =
      track_footage(job, files.folder, context.options.threads, context.progress, context.out);
  if (code == ExitCode::ok && !fs::exists(tracks))
    throw InputError(tracks, "no file", "the name tracks.csv, which tracking writes");
  return code;
}

/// Tracks name their camera, and so does a camera file; with one camera in play both mean the same.
void adopt_camera_name(fitting::Camera& camera, const fitting::TrackSet& tracks, VerbContext& context) {
  if (tracks.tracks.empty()) return;
  const std::string& name = tracks.tracks.front().camera;
  const auto same = [&name](const fitting::Track& t) { return t.camera == name; };
  const bool is_only = std::all_of(tracks.tracks.begin(), tracks.tracks.end(), same);
  if (is_only && camera.name != name) {
    context.progress.note("all tracks are of camera '" + name + "'; the camera file's name '" + camera.name +
                          "' is ignored");
    camera.name = name;
  }
}

/// Camera and tracks of one view; of several, each goes by the name that the case gives it.
void add_view(const ViewFiles& files, const std::string& name, fitting::FitClip& clip, VerbContext& context) {
  fitting::Camera camera = fitting::read_camera(files.camera);
  fitting::TrackSet tracks = fitting::read_tracks(files.tracks);
  adopt_camera_name(camera, tracks, context);
  if (!name.empty()) {
    std::erase_if(tracks.tracks, [&](const fitting::Track& t) { return t.camera != camera.name; });
    for (fitting::Track& track : tracks.tracks) track.camera = name;
    camera.name = name;
  }
  clip.cameras.push_back(std::move(camera));
  clip.files += (clip.files.empty() ? "" : ", ") + files.tracks;
  for (fitting::Track& track : tracks.tracks) clip.tracks.tracks.push_back(std::move(track));
}

/// What is known of the truth, under the addresses that the fit gives its parameters.
void add_truth(const ViewFiles& files, const fitting::FitClip& clip, fitting::JointFitInput& input,
               VerbContext& context) {
  const std::string truth = (fs::path(files.folder) / "truth.json").string();
  if (!is_truth_of(truth, files.footage, files.tracks)) {
    if (fs::exists(truth)) context.progress.warning(truth + " is the truth of other footage: not compared");
    return;
  }
  for (const auto& [address, value] : fitting::read_truth(truth, clip.scene)) {
    input.truth.emplace(address, value);
    if (!clip.name.empty()) input.truth.emplace("/clips/" + clip.name + address, value);
  }
}

}  // namespace

std::string recorded(const std::string& path, const std::string& folder) {
  const auto clean = [](const std::string& p) { return fs::absolute(p).lexically_normal(); };
  const fs::path inside = clean(path).lexically_relative(clean(folder + "/x").parent_path());
  const bool is_inside = !inside.empty() && *inside.begin() != "..";
  return is_inside ? inside.string() : clean(path).string();
}

std::optional<fitting::JointFitInput> fit_input(const fitting::Case& c, const fitting::FitCase& options,
                                                const std::string& folder, VerbContext& context,
                                                ExitCode& tracked) {
  const std::vector<ViewFiles> files = all_files(c, folder);
  const auto in_clip = [&](const ViewFiles& f, const auto& act) {
    try {
      return act();
    } catch (const InputError& error) {
      if (c.clips.empty()) throw;
      throw InputError("clip '" + c.clips[f.clip].name + "': " + error.what());
    }
  };
  // What is missing is said before hours of tracking.
  for (const ViewFiles& f : files)
    in_clip(f, [&] {
      require_tracks_or_footage(f);
      std::error_code ignored;  // writing says when there is none
      fs::create_directories(f.folder, ignored);
      return fitting::read_camera(fitting::case_camera_file(f.of_view, f.folder));
    });
  for (const ViewFiles& f : files) {
    tracked = in_clip(f, [&] { return current_tracks(f, context); });
    if (tracked != ExitCode::ok) return std::nullopt;
  }
  fitting::JointFitInput input{.clips = {},
                               .options = options,
                               .truth = {},
                               .evaluations = (fs::path(folder) / "evaluations").string()};
  for (const fitting::StageCase& stage : options.stages)
    input.stages.push_back(fitting::scenes_of_stage(c, stage));
  const std::vector<Scene> scenes = fitting::scenes_of(c);
  for (std::size_t k = 0; k < scenes.size(); ++k) {
    fitting::FitClip& clip = input.clips.emplace_back();
    if (!c.clips.empty()) clip.name = c.clips[k].name, clip.weight = c.clips[k].weight;
    clip.scene = scenes[k];
    const std::string& measured = c.clips.empty() ? c.measurements : c.clips[k].measurements;
    if (!measured.empty()) clip.measured = fitting::read_measurements(measured);
    for (const std::string& warning : scene_warnings(clip.scene))
      context.progress.warning((clip.name.empty() ? "" : "clip " + clip.name + ": ") + warning);
  }
  for (const ViewFiles& f : files)
    in_clip(f, [&] {
      fitting::FitClip& clip = input.clips[f.clip];
      add_view(f, c.clips.empty() ? "" : c.clips[f.clip].views[f.view].name, clip, context);
      add_truth(f, clip, input, context);
      return 0;
    });
  return input;
}

void record_files(const fitting::Case& c, const std::string& folder, fitting::FitResult& result) {
  result.case_name = c.name;
  result.case_file = recorded(c.file, folder);
  for (const ViewFiles& f : all_files(c, folder)) {
    const std::string scene = recorded(f.of_view.scene, folder), footage = recorded(f.footage, folder),
                      tracks = recorded(f.tracks, folder), camera = recorded(f.camera, folder);
    if (f.clip == 0 && f.view == 0) {
      result.scene_file = scene;
      result.footage_file = footage;
      result.tracks_file = tracks;
      result.camera_file = camera;
    }
    if (f.clip >= static_cast<int>(result.clips.size())) continue;
    fitting::FittedClip& clip = result.clips[f.clip];
    clip.scene_file = scene;
    fitting::FittedView& view = clip.views[f.view];
    view.footage_file = footage;
    view.tracks_file = tracks;
    view.camera_file = camera;
  }
}

}  // namespace rhytid::tools
