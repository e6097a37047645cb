// rhytid heatmap: ligament sources to the map of b over the inner surface.
#include <CLI/CLI.hpp>
#include <algorithm>
#include <filesystem>
#include <fstream>
#include <ostream>
#include <sstream>

#include "sim/core/error.h"
#include "sim/output/csv.h"
#include "sim/output/picture.h"
#include "sim/output/surface_files.h"
#include "sim/output/text.h"
#include "sim/scene/load.h"
#include "sim/scene/scene_model.h"
#include "sim/surface/heat_map.h"
#include "tools/ply_file.h"
#include "tools/scene_argument.h"
#include "tools/scene_review.h"
#include "tools/verb.h"

namespace rhytid::tools {
namespace {

/// The inner surface with its map.
struct LigamentMap {
  const SceneModel& scene_model;
  MatrixX3 inner;  ///< [columns][3] mm
  HeatMapWeights heat;
  VectorXd b;  ///< [columns] 1/mm

  explicit LigamentMap(const SceneModel& built) : scene_model(built) {
    const SkinMesh& mesh = built.model().mesh;
    inner.resize(mesh.num_columns, 3);
    for (int c = 0; c < mesh.num_columns; ++c) inner.row(c) = mesh.rest.row(mesh.node(c, 0));
    std::vector<HeatSource> kernels;
    for (std::size_t s = 0; s < sources().size(); ++s)
      kernels.push_back({built.source_positions()[s], sources()[s].radius});
    if (!kernels.empty())  // else the scene gives the map itself
      heat =
          diffuse_sources(inner, built.column_triangles(), kernels, built.scene().ligaments->diffusion_time);
    b = built.ligament_map(built.scene());
  }
  const std::vector<SourceScene>& sources() const { return scene_model.scene().ligaments->sources; }
};

std::vector<double> to_vector(const VectorXd& v) {
  return {v.data(), v.data() + v.size()};
}

void write_surface(const LigamentMap& map, bool with_weights, const std::string& folder) {
  std::vector<OutputField> fields = {{"ligament_b_per_mm", 1, to_vector(map.b)}};
  if (with_weights)
    for (std::size_t s = 0; s < map.sources().size(); ++s)
      fields.push_back({"weight_" + map.sources()[s].name, 1, to_vector(map.heat.weights.col(s))});
  write_vtp(folder + "/heatmap.vtp", map.inner, map.scene_model.column_triangles(), fields);

  const double low = map.b.minCoeff(), range = map.b.maxCoeff() - low;
  std::vector<Rgb> colours;
  for (const double b : map.b)
    colours.push_back(map_colour(ColourMap::sequential, range > 0 ? (b - low) / range : 0.5));
  write_ply(folder + "/heatmap.ply", map.inner, map.scene_model.column_triangles(), colours, "b", map.b);
}

void write_table(const LigamentMap& map, bool with_weights, const std::string& folder) {
  std::vector<CsvColumn> columns = {{"column", ""}, {"x", "mm"}, {"y", "mm"}, {"z", "mm"}, {"b", "per_mm"}};
  if (with_weights)
    for (const SourceScene& s : map.sources()) columns.push_back({"weight_" + s.name, ""});
  CsvTable table(columns);
  for (Eigen::Index c = 0; c < map.inner.rows(); ++c) {
    std::vector<CsvCell> row = {static_cast<std::int64_t>(c), map.inner(c, 0), map.inner(c, 1),
                                map.inner(c, 2), map.b[c]};
    if (with_weights)
      for (const double w : map.heat.weights.row(c)) row.emplace_back(w);
    table.add_row(std::move(row));
  }
  table.write(folder + "/heatmap.csv");
}

/// Sources as balls on the skin, seen from outside.
void draw(const LigamentMap& map, const VectorXd& values, const std::string& label, const std::string& title,
          const std::string& path) {
  const SkinMesh& mesh = map.scene_model.model().mesh;
  const SubdividedSurface surface(mesh, SurfaceSide::inner, std::max(4, mesh.order));
  const double size = (map.inner.colwise().maxCoeff() - map.inner.colwise().minCoeff()).norm();
  std::vector<PictureSolid> balls;
  for (const Vec3& p : map.scene_model.source_positions()) {
    balls.push_back(capsule_solid(p, p, 0.012 * size));
    balls.back().colour = {200, 40, 40};
    balls.back().opacity = 1;
  }
  PictureField field;
  field.values = surface.interpolate(values);
  field.label = label;
  // A constant map has no range of its own.
  if (!(values.maxCoeff() - values.minCoeff() > 1e-9 * values.maxCoeff())) {
    field.minimum = 0;
    field.maximum = std::max(2 * values.maxCoeff(), 1e-9);
  }
  PictureOptions options;
  options.title = title;
  const MatrixX3 normals = surface.smooth_normals({});
  const Vec3 normal = normals.colwise().sum().transpose().normalized();
  PinholeCamera camera = three_quarter_view(surface.positions({}), normal, options);
  camera.K.topLeftCorner<2, 2>() *= 0.87;  // room for the colour bar
  camera.K(0, 2) -= 0.05 * camera.width;
  options.camera = camera;
  write_png(path, draw_surface(surface, {}, options, &field, balls));
}

/// An earlier map may have had other sources; its table names the pictures that it wrote.
void remove_earlier_shares(const std::string& folder) {
  std::ifstream table(folder + "/heatmap.csv");
  std::string header, column;
  std::getline(table, header);
  for (std::istringstream names(header); std::getline(names, column, ',');) {
    std::error_code ignored;
    if (column.starts_with("weight_")) std::filesystem::remove(folder + "/" + column + ".png", ignored);
  }
}

class Heatmap : public Verb {
 public:
  VerbHelp help() const override {
    return {
        "heatmap",
        "ligament sources to the map of b over the inner surface",
        "Diffuses the ligament sources of the scene over the inner surface and writes the exponent b of the "
        "ligaments, which always stays between the smallest and the largest strength. Use it to place "
        "sources and to choose their radius and the diffusion time before simulating.",
        "scene.json with /ligaments, and the mesh it names",
        "heatmap.vtp and heatmap.ply (coloured; inner surface with b at every in-plane node), heatmap.csv "
        "(one row per node), heatmap.png (sources are red balls). With --weights also the share of every "
        "source: columns, fields and weight_NAME.png.",
        "rhytid heatmap data/scenes/sheet_drag/scene.json -o run/heatmap"};
  }
  void add_options(CLI::App& app) override {
    app.add_flag("--weights", with_weights_,
                 "also write the share of every source, b = sum of share x strength");
  }

  ExitCode run(VerbContext& context) override {
    Scene scene = load_scene_argument(context.options.file, context.options.settings, context.progress);
    if (!scene.ligaments)
      throw InputError(context.options.file + ": /ligaments", "nothing",
                       "ligaments with at least one source");
    const SceneModel scene_model(std::move(scene));
    const LigamentMap map(scene_model);
    for (const std::string& warning : review_ligaments(scene_model)) context.progress.warning(warning);
    const std::string folder = context.output_folder();
    remove_earlier_shares(folder);
    context.progress.stage("heat map", with_weights_ ? 1 + static_cast<int>(map.sources().size()) : 1);
    write_surface(map, with_weights_, folder);
    write_table(map, with_weights_, folder);
    const std::string& name = scene_model.scene().name;
    draw(map, map.b, "ligament b [1/mm]", name, folder + "/heatmap.png");
    context.progress.step_done(1);
    for (std::size_t s = 0; with_weights_ && s < map.sources().size(); ++s) {
      if (context.progress.interrupted()) return ExitCode::interrupted;
      const std::string& source = map.sources()[s].name;
      draw(map, map.heat.weights.col(s), "share of " + source, name, folder + "/weight_" + source + ".png");
      context.progress.step_done(static_cast<int>(s) + 2);
    }
    context.out << "b from " << short_text(map.b.minCoeff()) << " to " << short_text(map.b.maxCoeff())
                << " 1/mm over " << map.b.size() << " nodes; written to " << folder << '\n';
    return ExitCode::ok;
  }

 private:
  bool with_weights_ = false;
};

}  // namespace

std::unique_ptr<Verb> make_verb_heatmap() {
  return std::make_unique<Heatmap>();
}

}  // namespace rhytid::tools
