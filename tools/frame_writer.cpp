#include "tools/frame_writer.h"

#include <algorithm>
#include <chrono>
#include <cmath>
#include <cstdio>
#include <filesystem>

#include "sim/core/error.h"
#include "sim/output/image.h"
#include "sim/output/surface_files.h"
#include "sim/scene/collider_motion.h"
#include "sim/terms/term.h"
#include "tools/scene_argument.h"

namespace rhytid::tools {
namespace {

constexpr int picture_samples = 2;  ///< per pixel and axis

std::string numbered(const char* pattern, int frame) {
  char text[64];
  std::snprintf(text, sizeof text, pattern, frame);
  return text;
}

void make_folder(const std::string& path) {
  std::error_code error;
  std::filesystem::create_directories(path, error);
  if (error) throw InputError(path + ": cannot be made (" + error.message() + ")");
}

/// The next of a few round numbers: colour scales then change seldom from frame to frame.
double round_up(double value) {
  const double power = std::pow(10., std::floor(std::log10(value)));
  for (const double digit : {1., 1.2, 1.5, 2., 2.5, 3., 4., 5., 6., 8.})
    if (value <= digit * power) return digit * power;
  return 10 * power;
}

std::vector<double> to_vector(const MatrixX3& m) {
  return {m.data(), m.data() + m.size()};
}
std::vector<double> to_vector(const VectorXd& v) {
  return {v.data(), v.data() + v.size()};
}

}  // namespace

std::vector<PictureSolid> collider_solids(const Scene& scene, double t) {
  std::vector<PictureSolid> solids;
  for (const ColliderScene& c : scene.colliders) {
    if (c.shape == ShapeKind::plane) continue;
    const BodyPose pose = ColliderMotion(c, scene.time.offset).at(t);
    const Vec3 half =
        pose.rotation * (c.shape == ShapeKind::capsule ? 0.5 * c.length : 0) * c.axis.normalized();
    if (c.shape == ShapeKind::ellipsoid) {
      solids.push_back(ellipsoid_solid(pose.centre, pose.rotation, c.semi_axes));
    } else {
      solids.push_back(capsule_solid(pose.centre - half, pose.centre + half, c.radius));
    }
    solids.back().opacity = 0.25;  // the contact is what one wants to see
  }
  return solids;
}

FrameWriter::FrameWriter(const SceneModel& scene_model, std::string folder, const FrameOptions& options)
    : scene_model_(&scene_model),
      folder_(std::move(folder)),
      options_(options),
      outer_(scene_model.model().mesh, SurfaceSide::outer, options.subdivision) {
  const OutputScene& output = scene_model.scene().output;
  if (output.vtu)
    for (const char* name : {"/frames", "/surface"}) make_folder(folder_ + name);
  if (!output.pictures) return;
  make_folder(folder_ + "/pictures");
  picture_.width = options.picture_width;
  picture_.height = options.picture_height;
  const MatrixX3 normals = outer_.smooth_normals({});
  const Vec3 mean_normal = normals.colwise().sum().transpose().normalized();
  picture_.samples = picture_samples;
  PinholeCamera camera = three_quarter_view(outer_.positions({}), mean_normal, picture_);
  // Room for the colour bar on the right and for colliders above.
  camera.K.topLeftCorner<2, 2>() *= 0.87;
  camera.K(0, 2) -= 0.05 * camera.width;
  camera.K(1, 2) += 0.05 * camera.height;
  picture_.camera = camera;
}

void FrameWriter::list(int frame, double time) {
  if (!scene_model_->scene().output.vtu) return;
  volumes_.push_back({time, numbered("frames/frame_%04d.vtu", frame)});
  surfaces_.push_back({time, numbered("surface/frame_%04d.vtp", frame)});
}

void FrameWriter::restore(int frame, double time) {
  list(frame, time);
}

void FrameWriter::write(int frame, const State& state) {
  const Scene& scene = scene_model_->scene();
  const MatrixX3 rest = outer_.positions({}), now = outer_.positions(state.u), moved = now - rest;
  const VectorXd magnitude = moved.rowwise().norm();
  if (scene.output.vtu) {
    list(frame, state.time);
    VtuOptions volume;
    volume.time = state.time;
    write_vtu(folder_ + "/" + volumes_.back().file, scene_model_->model().mesh, state.u, volume);
    write_vtp(folder_ + "/" + surfaces_.back().file, now, outer_.triangles(),
              {{"displacement_mm", 3, to_vector(moved)},
               {"displacement_magnitude_mm", 1, to_vector(magnitude)},
               {"normal_displacement_mm", 1, to_vector(outer_.normal_displacement(state.u))}},
              state.time);
    // The series last: it never lists a file that is not there.
    write_pvd(folder_ + "/frames.pvd", volumes_);
    write_pvd(folder_ + "/surface.pvd", surfaces_);
  }
  if (scene.output.pictures) draw(frame, state, magnitude);
}

void FrameWriter::draw(int frame, const State& state, const VectorXd& magnitude) const {
  const Scene& scene = scene_model_->scene();
  PictureOptions options = picture_;
  char title[160];
  std::snprintf(title, sizeof title, "%.100s, frame %d, %.3f s", shown_name(scene).c_str(), frame,
                state.time);
  options.title = title;
  const std::vector<PictureSolid> solids = collider_solids(scene, state.time);
  write_png(folder_ + numbered("/pictures/shaded_%04d.png", frame),
            draw_surface(outer_, state.u, options, nullptr, solids));
  PictureField field;
  field.values = magnitude;
  field.label = "displacement [mm]";
  field.minimum = 0;
  const double largest = magnitude.maxCoeff();
  field.maximum = largest > 0 ? round_up(largest) : 1;
  write_png(folder_ + numbered("/pictures/displacement_%04d.png", frame),
            draw_surface(outer_, state.u, options, &field, solids));
}

double measure_pictures(const SceneModel& scene_model, const FrameOptions& options) {
  const auto begin = std::chrono::steady_clock::now();
  const SubdividedSurface outer(scene_model.model().mesh, SurfaceSide::outer, options.subdivision);
  PictureOptions picture;
  picture.width = std::max(64, options.picture_width / 2);
  picture.height = std::max(64, options.picture_height / 2);
  picture.samples = picture_samples;
  (void)encode_png(draw_surface(outer, {}, picture, nullptr, collider_solids(scene_model.scene(), 0)));
  return 2 * 4 * std::chrono::duration<double>(std::chrono::steady_clock::now() - begin).count();
}

}  // namespace rhytid::tools
