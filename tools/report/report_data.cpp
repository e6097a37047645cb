#include "tools/report/report_data.h"

#include <algorithm>
#include <filesystem>
#include <map>
#include <opencv2/imgcodecs.hpp>

#include "fitting/parametrisation.h"
#include "fitting/tracking/frame_source.h"
#include "sim/core/error.h"
#include "sim/scene/load.h"
#include "sim/scene/parameter.h"

namespace rhytid::tools {
namespace {

namespace fs = std::filesystem;

/// The path of an existing file, or nothing.
std::string found_file(const std::string& named, const ReportData& data) {
  if (named.empty()) return {};
  std::error_code ignored;
  const fs::path path(named);
  for (const fs::path& candidate :
       {path, fs::path(data.fit.case_file).parent_path() / path, fs::path(data.folder) / path.filename()}) {
    if (fs::is_regular_file(candidate, ignored)) return candidate.string();
  }
  return {};
}

Scene scene_of_fit(ReportData& data) {
  data.scene_file = found_file(data.fit.scene_file, data);
  if (data.scene_file.empty()) {
    throw InputError(data.fit.scene_file.empty() ? "the fit names no scene file"
                                                 : data.fit.scene_file + ": the scene file is not there");
  }
  std::vector<std::string> settings;
  if (data.fit_case) settings = data.fit_case->scene_settings;
  return load_scene(data.scene_file, settings);
}

void load_case(ReportData& data) {
  const std::string file = found_file(data.fit.case_file, data);
  if (file.empty()) return;
  try {
    data.fit_case = fitting::load_case(file);
  } catch (const InputError& e) {
    data.left_out.push_back(std::string("The case file was not used: ") + e.what());
  }
}

/// The values put in as the fit did: with a case, contact penalties follow the modulus of the gauge layer.
Scene with_fitted_values(Scene scene, const ReportData& data) {
  const auto& parameters = data.fit.parameters;
  if (!data.fit_case || parameters.empty()) {
    for (const fitting::FittedParameter& p : parameters) set_parameter(scene, p.address, p.value);
    return scene;
  }
  fitting::FitCase fit = data.fit_case->fit;
  fit.parameters.clear();
  for (const fitting::FittedParameter& p : parameters) {
    fitting::FitParameter parameter;
    parameter.address = p.address;
    parameter.initial = p.initial, parameter.lower = p.lower, parameter.upper = p.upper;
    parameter.transform = p.transform == "log"     ? ParameterTransform::log
                          : p.transform == "logit" ? ParameterTransform::logit
                                                   : ParameterTransform::none;
    fit.parameters.push_back(parameter);
  }
  const fitting::Parametrisation parametrisation(scene, fit);
  VectorXd t(parametrisation.size());
  for (Eigen::Index k = 0; k < t.size(); ++k) {
    const auto i = static_cast<size_t>(k);
    t[k] = parametrisation.variables()[i].to_transformed(parameters[i].value);
  }
  return parametrisation.scene(t.cwiseMax(parametrisation.lower()).cwiseMin(parametrisation.upper()));
}

void load_model(ReportData& data) {
  try {
    data.model = std::make_unique<const SceneModel>(with_fitted_values(scene_of_fit(data), data));
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
  load_case(data);
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
    fitting::FrameSource source({.path = footage, .first = frame, .last = frame});
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
