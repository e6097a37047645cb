// rhytid register: where the camera stands to the mesh, from a few landmarks picked in a picture.
#include <CLI/CLI.hpp>
#include <Eigen/Geometry>
#include <cmath>
#include <filesystem>
#include <nlohmann/json.hpp>
#include <numbers>
#include <opencv2/imgcodecs.hpp>
#include <opencv2/imgproc.hpp>

#include "fitting/cameras.h"
#include "fitting/case.h"
#include "fitting/case_camera.h"
#include "fitting/landmarks.h"
#include "fitting/tracking/frame_source.h"
#include "sim/core/error.h"
#include "sim/mesh/triangle_surface.h"
#include "sim/output/atomic_file.h"
#include "sim/output/text.h"
#include "sim/scene/load.h"
#include "sim/scene/scene_model.h"
#include "sim/scene/scene_surface.h"
#include "tools/clip_argument.h"
#include "tools/text_table.h"
#include "tools/verb.h"

namespace rhytid::tools {
namespace {

using fitting::Landmark;
using fitting::PoseEstimate;

constexpr double kDegrees = 180 / std::numbers::pi;

/// The outer skin of the scene at rest, and beyond the patch that is simulated the rest of the mesh file.
class VisibleMesh {
 public:
  explicit VisibleMesh(const SceneModel& scene_model) : is_outer_(scene_model.scene().skin.surface.is_outer) {
    const SurfaceScene& surface = scene_model.scene().skin.surface;
    const SkinMesh& skin = scene_model.model().mesh;
    patch = scene_surface(surface);
    for (int v = 0; v < static_cast<int>(patch.vertices.rows()); ++v)
      patch.vertices.row(v) = skin.rest.row(skin.node(skin.vertex_columns[v], skin.num_levels - 1));
    whole_ = surface.file.empty()
                 ? patch
                 : read_surface(surface.file, surface.mm_per_unit > 0 ? surface.mm_per_unit : 1);
    list(whole_, in_whole_);
    list(patch, in_patch_);
  }

  /// Place of a vertex by its index in the file, mm. Throws InputError that says what is expected.
  Vec3 operator()(long index) const {
    const auto count = static_cast<long>(in_whole_.size());
    if (index < 0 || index >= count)
      throw InputError("a vertex of the mesh, 0 to " + std::to_string(count - 1));
    const auto source = static_cast<std::size_t>(patch.standing_for(static_cast<int>(index)));
    if (source < in_patch_.size() && in_patch_[source] >= 0)
      return patch.vertices.row(in_patch_[source]).transpose();
    if (!is_outer_)
      throw InputError("a vertex of the patch (the mesh is the inner side, the skin beyond it is not known)");
    if (in_whole_[source] < 0) throw InputError("a vertex that a face of the mesh has");
    return whole_.vertices.row(in_whole_[source]).transpose();
  }

  TriangleSurface patch;  ///< its vertices are those of the outer skin
  /// The mesh around it, where it is known as it is seen.
  const TriangleSurface* whole() const { return is_outer_ ? &whole_ : nullptr; }

 private:
  static void list(const TriangleSurface& mesh, std::vector<int>& by_source) {
    for (int v = 0; v < static_cast<int>(mesh.vertices.rows()); ++v) {
      const auto source = static_cast<std::size_t>(mesh.source_of_vertex(v));
      if (source >= by_source.size()) by_source.resize(source + 1, -1);
      if (by_source[source] < 0) by_source[source] = v;  // subdivision gives the new ones an old number
    }
  }

  bool is_outer_;
  TriangleSurface whole_;
  std::vector<int> in_whole_, in_patch_;  ///< by index in the file; −1 = not there
};

cv::Point2i pixel_of(const Vec2& p) {
  // Far outside the picture drawing would overflow.
  const auto whole = [](double x) { return static_cast<int>(std::lround(std::clamp(x, -1e4, 1e5))); };
  return {whole(p.x()), whole(p.y())};
}

/// The mesh as the camera sees it over the picture: edges of faces that look to the camera. Returns how many of its
/// faces do.
double draw_mesh(cv::Mat& picture, const TriangleSurface& mesh, const fitting::Camera& camera,
                 const cv::Scalar& colour) {
  int facing = 0;
  for (const std::array<int, 3>& face : mesh.faces) {
    std::array<Vec3, 3> corners;
    std::array<Vec2, 3> seen;
    for (std::size_t k = 0; k < 3; ++k) {
      corners[k] = mesh.vertices.row(face[k]).transpose();
      seen[k] = camera.project(corners[k]);
    }
    const Vec3 normal = (corners[1] - corners[0]).cross(corners[2] - corners[0]);
    if (normal.dot(camera.centre() - corners[0]) <= 0) continue;
    ++facing;
    for (std::size_t k = 0; k < 3; ++k)
      if (seen[k].allFinite() && seen[(k + 1) % 3].allFinite())
        cv::line(picture, pixel_of(seen[k]), pixel_of(seen[(k + 1) % 3]), colour, 1, cv::LINE_AA);
  }
  return static_cast<double>(facing) / static_cast<double>(std::max<std::size_t>(1, mesh.faces.size()));
}

/// Green circle: picked; red cross: where the mesh has it.
void draw_landmarks(cv::Mat& picture, const std::vector<Landmark>& landmarks, const PoseEstimate& pose) {
  const int size = std::max(4, picture.cols / 160);
  for (const Landmark& l : landmarks) {
    const cv::Point2i picked = pixel_of(l.pixel), mesh = pixel_of(pose.camera.project(l.point));
    cv::line(picture, picked, mesh, {0, 0, 255}, 1, cv::LINE_AA);
    cv::circle(picture, picked, size, {0, 200, 0}, 2, cv::LINE_AA);
    cv::drawMarker(picture, mesh, {0, 0, 255}, cv::MARKER_CROSS, 2 * size, 1, cv::LINE_AA);
    cv::putText(picture, l.name, picked + cv::Point2i(size + 2, -size), cv::FONT_HERSHEY_SIMPLEX, size / 14.0,
                {0, 0, 0}, 3, cv::LINE_AA);
    cv::putText(picture, l.name, picked + cv::Point2i(size + 2, -size), cv::FONT_HERSHEY_SIMPLEX, size / 14.0,
                {255, 255, 255}, 1, cv::LINE_AA);
  }
}

/// A number for people: no digits behind the point from 10 on.
std::string text_of(double value) {
  return value < 10 ? short_text(value, 2) : std::to_string(std::lround(value));
}

std::string pose_text(const std::vector<Landmark>& landmarks, const PoseEstimate& pose) {
  std::string text = "Pose from " + std::to_string(landmarks.size()) + " landmarks, " + text_of(pose.rms) +
                     " px rms (reduced chi-square " + text_of(pose.reduced_chi_square) + ")\n\n";
  TextTable table({"landmark", "x px", "y px", "off by px", "left out px"});
  for (std::size_t i = 0; i < landmarks.size(); ++i)
    table.add({landmarks[i].name, short_text(landmarks[i].pixel.x(), 5),
               short_text(landmarks[i].pixel.y(), 5), text_of(pose.residuals[i].norm()),
               pose.left_out.empty() ? "" : text_of(pose.left_out[i])});
  text += table.text() + "\nleft out: distance from where the other landmarks put it\n" +
          "Deviations at the landmarks' middle: " + text_of(pose.across_sigma) + " mm across, " +
          text_of(pose.depth_sigma) + " mm along the line of sight, tilt " +
          text_of(kDegrees * pose.tilt_sigma) + " degrees, roll " + text_of(kDegrees * pose.roll_sigma) +
          " degrees\n";
  for (const std::string& doubt : pose.doubts) text += "Doubt: " + doubt + "\n";
  return text;
}

nlohmann::ordered_json pose_json(const std::vector<Landmark>& landmarks, const PoseEstimate& pose) {
  using nlohmann::ordered_json;
  const auto list = [](const auto& v) {
    ordered_json j = ordered_json::array();
    for (Eigen::Index i = 0; i < v.size(); ++i) j.push_back(v(i));
    return j;
  };
  ordered_json points = ordered_json::array(), covariance = ordered_json::array();
  for (std::size_t i = 0; i < landmarks.size(); ++i) {
    const Landmark& l = landmarks[i];
    points.push_back({{"name", l.name},
                      {"pixel", list(l.pixel)},
                      {"point_mm", list(l.point)},
                      {"sigma_px", l.sigma},
                      {"residual_px", list(pose.residuals[i])}});
    if (!pose.left_out.empty()) points.back()["left_out_px"] = pose.left_out[i];
  }
  for (int row = 0; row < 6; ++row) covariance.push_back(list(Eigen::VectorXd(pose.covariance.row(row))));
  return {{"landmarks", points},
          {"rms_px", pose.rms},
          {"reduced_chi_square", pose.reduced_chi_square},
          {"covariance_of_rotation_rad_and_translation_mm", covariance},
          {"across_sigma_mm", pose.across_sigma},
          {"depth_sigma_mm", pose.depth_sigma},
          {"tilt_sigma_deg", kDegrees * pose.tilt_sigma},
          {"roll_sigma_deg", kDegrees * pose.roll_sigma},
          {"doubts", pose.doubts}};
}

class RegisterVerb final : public Verb {
 public:
  VerbHelp help() const override {
    return {
        "register",
        "place the camera against the mesh, from landmarks picked in the first frame",
        "A fit needs the mesh of the face in the frame of a camera. Pick some points of the mesh in the "
        "first frame (corners of eyes and mouth, moles, at least 4, better 6 or more, not all at one depth), "
        "note "
        "pixel and vertex, and register finds the pose of the camera that puts them there, says how sure it "
        "is, which landmark does not agree with the others, and draws the mesh over the frame. Exit 3 with a "
        "pose that is doubtful. The "
        "camera's lens comes from the file that the case names.",
        "case.json with its camera (the lens) and scene (the mesh); landmarks: a CSV of "
        "name,x_px,y_px,vertex "
        "(counted from 0) or name,x_px,y_px,x_mm,y_mm,z_mm, and maybe sigma_px",
        "camera.yaml with the pose, registration.json, registration.png. Prints what each landmark is off by",
        "rhytid register case.json --landmarks landmarks.csv -o run/registered"};
  }
  bool takes_case() const override { return true; }
  void add_options(CLI::App& app) override {
    app.add_option("--landmarks", landmarks_, "the CSV of landmarks")->required()->option_text("FILE");
    app.add_option("--image", image_,
                   "picture to draw on (default: the first frame of the case's footage, if any)")
        ->option_text("FILE");
    app.add_option("--sigma", sigma_, "deviation of a landmark per axis, px, where the CSV has none (2)")
        ->option_text("PX")
        ->check(CLI::Range(1e-3, 1e3));
    add_clip_option(app, clip_);
  }

  ExitCode run(VerbContext& context) override {
    const ChosenView chosen = chosen_view(fitting::load_case(context.options.file, context.options.settings),
                                          clip_, context.options.output);
    const fitting::Case& c = chosen.of_view;
    if (c.camera.empty())
      throw InputError(c.file + ": /camera", "nothing",
                       "a camera file with the lens: focal lengths and centre");
    const fitting::Camera lens = fitting::read_case_camera(c);
    const SceneModel scene_model(load_scene(c.scene, c.scene_settings));
    const VisibleMesh mesh(scene_model);
    const std::vector<Landmark> landmarks = fitting::read_landmarks(landmarks_, sigma_, mesh);
    PoseEstimate pose = fitting::estimate_pose(landmarks, lens, landmarks_);
    cv::Mat picture = picture_of(c, lens);

    (void)context.output_folder();
    const std::string& folder = chosen.folder;
    if (mesh.whole() != nullptr) draw_mesh(picture, *mesh.whole(), pose.camera, {150, 150, 150});
    if (draw_mesh(picture, mesh.patch, pose.camera, {220, 180, 60}) < 0.1)
      pose.doubts.push_back(
          "the camera sees the patch from behind: is y counted downwards from the top, are left and "
          "right swapped?");
    draw_landmarks(picture, landmarks, pose);
    std::vector<unsigned char> png;
    if (!cv::imencode(".png", picture, png))
      throw InputError(folder, "no picture", "a picture that can be written");
    // All texts before the first file: what fails leaves no half of the results.
    const std::string json =
        pose_json(landmarks, pose).dump(1, ' ', false, nlohmann::ordered_json::error_handler_t::replace) +
        "\n";
    write_file(folder + "/registration.png", std::string(png.begin(), png.end()));
    write_file(folder + "/registration.json", json);
    fitting::write_camera(pose.camera, folder + "/camera.yaml");
    context.out << pose_text(landmarks, pose) << "written to " << folder
                << ": camera.yaml (for /camera of the case), registration.json, registration.png\n";
    for (const std::string& doubt : pose.doubts) context.progress.warning("doubtful pose: " + doubt);
    return pose.doubts.empty() ? ExitCode::ok : ExitCode::not_converged;
  }

 private:
  /// What is drawn on: the picture asked for, else the footage's first frame, else white.
  cv::Mat picture_of(const fitting::Case& c, const fitting::Camera& camera) const {
    fitting::FrameSourceOptions options;
    options.path = image_;
    if (image_.empty() && !c.footage.empty()) {
      const auto beside = std::filesystem::path(c.file).parent_path() / c.footage;
      if (std::filesystem::exists(beside)) options.path = beside.string();
    }
    options.last = 0;
    cv::Mat picture;
    if (options.path.empty()) {
      picture = cv::Mat(camera.height, camera.width, CV_8UC3, cv::Scalar(255, 255, 255));
    } else if (std::optional<fitting::Frame> frame = fitting::FrameSource(options).next()) {
      picture = frame->colour.clone();
    } else {
      throw InputError(options.path, "no frame", "a picture or a video");
    }
    if (picture.cols != camera.width || picture.rows != camera.height)
      throw InputError(
          options.path, std::to_string(picture.cols) + " x " + std::to_string(picture.rows) + " px",
          std::to_string(camera.width) + " x " + std::to_string(camera.height) + " px as in " + c.camera);
    return picture;
  }

  std::string landmarks_, image_;
  std::string clip_;
  double sigma_ = 2;
};

}  // namespace

std::unique_ptr<Verb> make_verb_register() {
  return std::make_unique<RegisterVerb>();
}

}  // namespace rhytid::tools
