#include "tools/study/wrinkle_recorder.h"

#include <numbers>

#include "sim/core/error.h"
#include "sim/output/atomic_file.h"
#include "sim/output/picture.h"
#include "sim/output/text.h"
#include "tools/study/study_run.h"

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

}  // namespace

WrinkleSamples place_samples(const SkinMesh& mesh, const WrinkleMeasure& measure) {
  WrinkleSamples samples;
  if (measure.line) {
    const auto& line = samples.line.emplace(mesh, *measure.line, measure.line_points);
    if (line.missing() > 0)
      throw InputError("/measure/line", std::to_string(line.missing()) + " points beside the surface",
                       "a line on the surface of the scene");
  }
  if (measure.window) {
    const auto& window = samples.window.emplace(mesh, *measure.window, measure.window_spacing);
    if (2 * window.missing() > window.rows() * window.columns())
      throw InputError("/measure/window", "most points beside the surface",
                       "a window on the surface of the scene");
  }
  return samples;
}

std::vector<std::string> WrinkleRecorder::files() const {
  return {"wrinkles.csv", "profile.csv", "above.png", "ligaments.png"};
}

void WrinkleRecorder::begin(const SceneModel& scene_model, const std::string& folder) {
  scene_model_ = &scene_model;
  folder_ = folder;
  samples_ = place_samples(scene_model.model().mesh, measure_);
  table_.emplace(columns(measure_));
}

void WrinkleRecorder::start(const State& rest) {
  started_();
  if (scene_model_->ligaments() != nullptr) draw_ligaments();
  if (!scene_model_->run_options().settle) frame(0, rest);
}

void WrinkleRecorder::resume(int last_frame) {
  const std::string path = folder_ + "/wrinkles.csv";
  const auto refuse = [&path](const std::string& found) {
    throw InputError(path, found, "a row for every frame");
  };
  CsvTable earlier = *table_;
  int next = 0;  // frames are whole and come in order, from 0
  earlier.restore(read_file(path), path, [&](const std::vector<double>& row) {
    if (row[0] > last_frame) return false;
    if (row[0] != next)
      refuse("frame " + short_text(row[0]) + " where " + std::to_string(next) + " should be");
    ++next;
    return true;
  });
  if (next <= last_frame) refuse("no frame " + std::to_string(next));
  table_ = std::move(earlier);
}

void WrinkleRecorder::frame(int frame, const State& state) {
  std::vector<double> row = {static_cast<double>(frame), state.time};
  const auto add = [&row](const WrinkleDescriptors& d) {
    for (const double value : {d.amplitude, d.wavelength, d.extent}) row.push_back(value);
  };
  if (samples_.line) {
    const VectorXd heights = samples_.line->heights(state.u).col(0);
    const VectorXd wrinkles = band_pass(heights, samples_.line->spacing(), measure_.band);
    const WrinkleCount count = count_wrinkles(wrinkles, samples_.line->spacing());
    for (const double value :
         {double(count.crests), double(count.sign_changes), count.crest_spacing, count.largest})
      row.push_back(value);
    add(describe(wrinkle_sums(wrinkles, samples_.line->spacing())));
    CsvTable profile({{"place", "mm"}, {"height", "mm"}, {"wrinkles", "mm"}});
    for (Eigen::Index i = 0; i < heights.size(); ++i)
      profile.add_numbers({static_cast<double>(i) * samples_.line->spacing(), heights[i], wrinkles[i]});
    profile.write(folder_ + "/profile.csv");
  }
  if (samples_.window) {
    const MatrixXd wrinkles =
        band_pass(samples_.window->heights(state.u), samples_.window->spacing(), measure_.band);
    const WrinkleDescriptors d = describe(wrinkle_sums(wrinkles, samples_.window->spacing()));
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
  PictureOptions options = skin_from_above(outer);
  options.title = scene_model_->scene().name + ", frame " + std::to_string(scene_model_->scene().time.frames);
  PictureField field;
  field.values = outer.normal_displacement(state.u);
  field.label = "height [mm]";
  field.map = ColourMap::diverging;
  write_png(folder_ + "/above.png", draw_surface(outer, state.u, options, &field,
                                                 collider_solids(scene_model_->scene(), state.time)));
}

void WrinkleRecorder::draw_ligaments() const {
  draw_on_skin(*scene_model_, scene_model_->ligament_map(scene_model_->scene()), "ligament b [1/mm]",
               scene_model_->scene().name, folder_ + "/ligaments.png");
}

}  // namespace rhytid::tools
