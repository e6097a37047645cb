#include "tools/report/report_data.h"

#include <algorithm>
#include <filesystem>
#include <map>
#include <opencv2/imgcodecs.hpp>

#include "fitting/tracking/frame_source.h"
#include "sim/core/error.h"
#include "sim/scene/load.h"

namespace rhytid::tools {
namespace {

namespace fs = std::filesystem;

/// The path of an existing file, or nothing. Names are relative to the folder of results, or absolute; a
/// folder that moved takes its files along.
std::string found_file(const std::string& named, const ReportData& data) {
  if (named.empty()) return {};
  std::error_code ignored;
  const fs::path path(named), folder(data.folder);
  for (const fs::path& candidate : {folder / path, folder / path.filename()})
    if (fs::is_regular_file(candidate, ignored)) return candidate.lexically_normal().string();
  return {};
}

void load_model(ReportData& data) {
  try {
    if (data.fit.fitted_scene_file.empty()) throw InputError("no run of the fit succeeded");
    data.scene_file = found_file(data.fit.fitted_scene_file, data);
    if (data.scene_file.empty())
      throw InputError(data.fit.fitted_scene_file + ": the scene file is not there");
    data.model = std::make_unique<const SceneModel>(load_scene(data.scene_file));
  } catch (const InputError& e) {
    data.left_out.push_back(std::string("No picture of the skin: ") + e.what());
  }
}

std::optional<fitting::Camera> load_camera(const std::string& named, ReportData& data) {
  if (named.empty()) return std::nullopt;
  try {
    const std::string file = found_file(named, data);
    if (file.empty()) throw InputError(named + ": the camera file is not there");
    return fitting::read_camera(file);
  } catch (const InputError& e) {
    data.left_out.push_back(std::string("The skin is not shown as the camera saw it: ") + e.what());
    return std::nullopt;
  }
}

SeenClip load_seen(const std::string& title, const std::string& camera, const std::string& footage,
                   ReportData& data) {
  SeenClip seen;
  seen.title = title;
  seen.camera = load_camera(camera, data);
  seen.footage = found_file(footage, data);
  if (seen.footage.empty()) {
    const std::string lacking = "No footage in the pictures" + (title.empty() ? "" : " of " + title) + ": ";
    data.left_out.push_back(lacking + (footage.empty() ? "the fit names none." : footage + " is not there."));
  }
  return seen;
}

void load_all_seen(ReportData& data) {
  if (data.fit.clips.empty()) {
    data.seen.push_back(load_seen("", data.fit.camera_file, data.fit.footage_file, data));
    data.seen[0].residuals = data.fit.residuals;
    return;
  }
  std::vector<size_t> first;  // of each clip among `seen`
  for (const fitting::FittedClip& clip : data.fit.clips) {
    first.push_back(data.seen.size());
    for (const fitting::FittedView& view : clip.views) {
      const std::string title = clip.name.empty()       ? "camera " + view.camera
                                : clip.views.size() > 1 ? clip.name + ", camera " + view.camera
                                                        : clip.name;
      data.seen.push_back(load_seen(title, view.camera_file, view.footage_file, data));
    }
  }
  for (const fitting::FitResidual& r : data.fit.residuals)
    data.seen[first[static_cast<size_t>(r.clip)] + static_cast<size_t>(r.view)].residuals.push_back(r);
}

}  // namespace

int SeenClip::late_frame() const {
  std::map<int, int> counts;
  for (const fitting::FitResidual& r : residuals) ++counts[r.frame];
  int fullest = 0, late = -1;
  for (const auto& [frame, count] : counts) fullest = std::max(fullest, count);
  for (const auto& [frame, count] : counts) {
    if (2 * count >= fullest) late = frame;
  }
  return late;
}

ReportData gather_report_data(const std::string& folder) {
  ReportData data;
  data.folder = folder;
  data.fit = fitting::read_fit_result(folder);
  load_model(data);
  load_all_seen(data);
  data.camera = data.seen[0].camera;
  data.footage = data.seen[0].footage;
  return data;
}

std::optional<cv::Mat> footage_frame(const std::string& footage, int frame) {
  if (footage.empty() || frame < 0) return std::nullopt;
  try {
    fitting::FrameSourceOptions one_frame;
    one_frame.path = footage;
    one_frame.first = one_frame.last = frame;
    fitting::FrameSource source(one_frame);
    if (auto found = source.next()) return found->colour.clone();
  } catch (const InputError&) {
    // A report goes without the picture; the caller says so.
  }
  return std::nullopt;
}

std::string encode_jpeg(const cv::Mat& bgr) {
  std::vector<unsigned char> bytes;
  cv::imencode(".jpg", bgr, bytes, {cv::IMWRITE_JPEG_QUALITY, 88});
  return {bytes.begin(), bytes.end()};
}

}  // namespace rhytid::tools
