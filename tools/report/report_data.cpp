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

void load_camera(ReportData& data) {
  if (data.fit.camera_file.empty()) return;
  try {
    const std::string file = found_file(data.fit.camera_file, data);
    if (file.empty()) throw InputError(data.fit.camera_file + ": the camera file is not there");
    data.camera = fitting::read_camera(file);
  } catch (const InputError& e) {
    data.left_out.push_back(std::string("The skin is not shown as the camera saw it: ") + e.what());
  }
}

}  // namespace

int ReportData::late_frame() const {
  std::map<int, int> counts;
  for (const fitting::FitResidual& r : fit.residuals) ++counts[r.frame];
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
  load_camera(data);
  data.footage = found_file(data.fit.footage_file, data);
  if (data.footage.empty()) {
    data.left_out.push_back(data.fit.footage_file.empty()
                                ? "No footage in the pictures: the fit names none."
                                : "No footage in the pictures: " + data.fit.footage_file + " is not there.");
  }
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
