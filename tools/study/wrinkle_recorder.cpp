#include "tools/study/wrinkle_recorder.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <numbers>
#include <sstream>

#include "sim/core/error.h"
#include "sim/output/atomic_file.h"
#include "sim/output/picture.h"

namespace rhytid::tools {
namespace {

constexpr int kSubdivision = 4;  // of faces, in pictures

std::vector<CsvColumn> columns(const WrinkleMeasure& measure) {
  std::vector<CsvColumn> list = {{"frame", ""}, {"time", "s"}};
  const auto descriptors = [&list](const std::string& of, const std::string& unit) {
    list.push_back({of + "_amplitude", "mm"});
    list.push_back({of + "_wavelength", "mm"});
    list.push_back({of + "_extent", unit});
  };
  if (measure.line) {
    for (const char* count : {"line_crests", "line_sign_changes"}) list.push_back({count, ""});
    for (const char* length : {"line_crest_spacing", "line_half_height"}) list.push_back({length, "mm"});
    descriptors("line", "mm");
  }
  if (measure.window) {
    descriptors("window", "mm2");
    list.push_back({"window_direction", "deg"});
    list.push_back({"window_coherence", ""});
  }
  return list;
}

/// The surface seen along its mean normal, the longer side across the picture.
PictureOptions from_above(const SubdividedSurface& outer) {
  PictureOptions options;
  const Vec3 normal = outer.smooth_normals({}).colwise().sum().transpose().normalized();
  // Picture-up: y for skins that face z, else z; heads stand along y.
  const Vec3 up = std::abs(normal[1]) < 0.9 ? Vec3::UnitY() : Vec3::UnitZ();
  options.view_direction = -normal;
  options.up = up - up.dot(normal) * normal;
  options.width = 1000;
  const MatrixX3 x = outer.positions({});
  const Vec3 right = options.up->cross(normal).normalized();
  const auto extent = [&x](const Vec3& axis) {
    const VectorXd along = x * axis;
    return along.maxCoeff() - along.minCoeff();
  };
  const double ratio = extent(options.up->normalized()) / extent(right);
  options.height = std::clamp(static_cast<int>(1000 * ratio * 0.85) + 60, 320, 900);
  options.samples = 2;
  const Vec3 low = x.colwise().minCoeff().transpose(), high = x.colwise().maxCoeff().transpose();
  PinholeCamera camera =
      frame_box(low, high, *options.view_direction, *options.up, options.width, options.height);
  // Room for the colour bar on the right.
  camera.K.topLeftCorner<2, 2>() *= 0.88;
  camera.K(0, 2) -= 0.05 * camera.width;
  options.camera = camera;
  return options;
}

}  // namespace

void WrinkleRecorder::begin(const SceneModel& scene_model, const std::string& folder) {
  scene_model_ = &scene_model;
  folder_ = folder;
  const SkinMesh& mesh = scene_model.model().mesh;
  if (measure_.line) line_.emplace(mesh, *measure_.line, measure_.line_points);
  if (line_ && line_->missing() > 0)
    throw InputError("/measure/line", std::to_string(line_->missing()) + " points beside the surface",
                     "a line on the surface of the scene");
  if (measure_.window) window_.emplace(mesh, *measure_.window, measure_.window_spacing);
  if (window_ && 2 * window_->missing() > window_->rows() * window_->columns())
    throw InputError("/measure/window", "most points beside the surface",
                     "a window on the surface of the scene");
  table_.emplace(columns(measure_));
}

void WrinkleRecorder::start(const State& rest) {
  started_();
  if (scene_model_->ligaments() != nullptr) draw_ligaments();
  if (!scene_model_->run_options().settle) frame(0, rest);
}

void WrinkleRecorder::resume(int last_frame) {
  const std::string path = folder_ + "/wrinkles.csv";
  std::istringstream lines(read_file(path));
  std::string line;
  if (!std::getline(lines, line) || line + "\n" != table_->text())
    throw InputError(path, "a table with other columns", "the wrinkles.csv that the run wrote");
  while (std::getline(lines, line)) {
    // Numbers only: kept as text they come back unchanged.
    std::vector<CsvCell> cells;
    std::istringstream row(line);
    for (std::string cell; std::getline(row, cell, ',');) cells.emplace_back(cell);
    if (cells.empty() || std::stoi(std::get<std::string>(cells[0])) > last_frame) break;
    table_->add_row(std::move(cells));
  }
}

void WrinkleRecorder::frame(int frame, const State& state) {
  std::vector<double> row = {static_cast<double>(frame), state.time};
  const auto add = [&row](const WrinkleDescriptors& d) {
    for (const double value : {d.amplitude, d.wavelength, d.extent}) row.push_back(value);
  };
  if (line_) {
    const VectorXd heights = line_->heights(state.u).col(0);
    const VectorXd wrinkles = band_pass(heights, line_->spacing(), measure_.band);
    const WrinkleCount count = count_wrinkles(wrinkles, line_->spacing());
    for (const double value :
         {double(count.crests), double(count.sign_changes), count.crest_spacing, count.largest})
      row.push_back(value);
    add(describe(wrinkle_sums(wrinkles, line_->spacing())));
    CsvTable profile({{"place", "mm"}, {"height", "mm"}, {"wrinkles", "mm"}});
    for (Eigen::Index i = 0; i < heights.size(); ++i)
      profile.add_numbers({static_cast<double>(i) * line_->spacing(), heights[i], wrinkles[i]});
    profile.write(folder_ + "/profile.csv");
  }
  if (window_) {
    const MatrixXd wrinkles = band_pass(window_->heights(state.u), window_->spacing(), measure_.band);
    const WrinkleDescriptors d = describe(wrinkle_sums(wrinkles, window_->spacing()));
    add(d);
    row.push_back(d.direction * 180 / std::numbers::pi);
    row.push_back(d.coherence);
  }
  table_->add_numbers(row);
  table_->write(folder_ + "/wrinkles.csv");
  if (frame == scene_model_->scene().time.frames) draw(state);
}

void WrinkleRecorder::draw(const State& state) const {
  const SubdividedSurface outer(scene_model_->model().mesh, SurfaceSide::outer, kSubdivision);
  PictureOptions options = from_above(outer);
  options.title = scene_model_->scene().name + ", frame " + std::to_string(scene_model_->scene().time.frames);
  PictureField field;
  field.values = outer.normal_displacement(state.u);
  field.label = "height [mm]";
  field.map = ColourMap::diverging;
  write_png(folder_ + "/above.png", draw_surface(outer, state.u, options, &field,
                                                 collider_solids(scene_model_->scene(), state.time)));
}

void WrinkleRecorder::draw_ligaments() const {
  const SubdividedSurface outer(scene_model_->model().mesh, SurfaceSide::outer, kSubdivision);
  PictureOptions options = from_above(outer);
  options.title = scene_model_->scene().name;
  PictureField field;
  field.values = outer.interpolate(scene_model_->ligament_map(scene_model_->scene()));
  field.label = "ligament b [1/mm]";
  write_png(folder_ + "/ligaments.png", draw_surface(outer, {}, options, &field));
}

}  // namespace rhytid::tools
