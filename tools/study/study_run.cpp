#include "tools/study/study_run.h"

#include <CLI/CLI.hpp>
#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <set>

#include "sim/core/digest.h"
#include "sim/core/error.h"
#include "sim/core/parse_number.h"
#include "sim/output/picture.h"
#include "sim/output/text.h"
#include "sim/scene/load.h"
#include "sim/time/model_digest.h"
#include "sim/time/program_digest.h"
#include "tools/frame_writer.h"
#include "tools/scene_argument.h"

namespace rhytid::tools {
namespace {

constexpr int kSubdivision = 4;      // of faces, in pictures
constexpr double kGlass = 0.12;      // opacity of colliders: the skin below them is what matters
constexpr double kSourceBall = 0.4;  // mm

/// The outer node over the inner one that is nearest to a source.
Vec3 outer_point_above(const SkinMesh& mesh, const Vec3& source) {
  int nearest = 0;
  const auto distance = [&](int c) { return (mesh.rest.row(mesh.node(c, 0)).transpose() - source).norm(); };
  for (int c = 1; c < mesh.num_columns; ++c)
    if (distance(c) < distance(nearest)) nearest = c;
  return mesh.rest.row(mesh.node(nearest, mesh.num_levels - 1)).transpose();
}

}  // namespace

Shard parse_shard(const std::string& text) {
  if (text.empty()) return {};
  Shard shard;
  const std::size_t slash = text.find('/');
  const auto refuse = [&] { throw InputError("--shard", "'" + text + "'", "I/N with 1 <= I <= N, as 2/4"); };
  if (slash == std::string::npos) refuse();
  if (!parse(std::string_view(text).substr(0, slash), shard.index) ||
      !parse(std::string_view(text).substr(slash + 1), shard.count) || shard.index < 1 ||
      shard.index > shard.count)
    refuse();
  return shard;
}

StudyScene load_study_scene(VerbContext& context, StudySize size, const std::string& variant) {
  const std::string& file = context.options.file;
  StudyScene result;
  if (!is_experiment(file)) {
    if (!variant.empty())
      throw InputError("--variant", "'" + variant + "' with a scene", "an experiment.json");
    result.scene = load_scene_argument(file, context.options.settings, context.progress);
    return result;
  }
  const Experiment experiment = load_experiment(file, size);
  const auto chosen = std::find_if(experiment.variants.begin(), experiment.variants.end(),
                                   [&](const Variant& v) { return variant.empty() || v.name == variant; });
  if (chosen == experiment.variants.end())
    throw InputError("--variant", "'" + variant + "'", "one of " + variant_names(experiment));
  std::vector<Setting> settings = chosen->settings;
  for (const std::string& text : context.options.settings) settings.push_back({text});
  result.scene = load_scene(experiment.scene, settings);
  result.variant = experiment.name + ", " + chosen->name;
  result.measure = experiment.measure;
  result.measure_text = experiment.measure_json.dump();
  context.progress.note("variant " + chosen->name + " of " + file);
  return result;
}

VariantIdentity study_identity(const Scene& scene, const Model& model, const std::string& measure) {
  nlohmann::json json = scene_to_json(scene);
  json.erase("description");
  Digest of_scene, of_measure;
  of_scene.text(json.dump());
  of_measure.text(measure);
  return {of_scene.hex(), of_measure.hex(), content_digest(model), program_digest()};
}

std::vector<ParameterSpec> study_parameters(const Scene& scene, const std::vector<std::string>& addresses) {
  std::vector<ParameterSpec> specs;
  if (addresses.empty()) {
    // Places are no matter of per cents: they are looked at when they are asked for.
    for (const ParameterSpec& spec : all_parameters(scene))
      if (spec.transform != ParameterTransform::none) specs.push_back(spec);
    return specs;
  }
  for (const std::string& address : addresses) {
    specs.push_back(describe_parameter(scene, address));
    for (std::size_t k = 0; k + 1 < specs.size(); ++k)
      if (specs[k].address == specs.back().address)
        throw InputError("--parameter", "'" + address + "' a second time", "each parameter once");
  }
  return specs;
}

void require_frames(const Scene& scene, const std::string& where) {
  if (scene.time.frames < 1) throw InputError(where + ": /time/frames", "0", "at least one frame");
}

std::string PredictedTracks::text() const {
  std::string seen = ", in three dimensions";
  if (view) {
    seen = ", seen along (";
    for (const double x : *view) seen += (seen.back() == '(' ? "" : ", ") + short_text(x);
    seen += ")";
  }
  return std::to_string(count) + " tracks spread evenly over the surface, in every frame, noise " +
         short_text(noise) + " mm per component" + seen;
}

bool is_size(double value) {
  return value >= 1e-9 && value <= 1e9;
}

CLI::Validator size_check() {
  return CLI::Validator(
      [](std::string& text) {
        double value = 0;
        return parse(text, value) && is_size(value)
                   ? std::string()
                   : "got '" + text + "', expected a number from 1e-9 to 1e9";
      },
      "");
}

void add_track_options(CLI::App& app, PredictedTracks& tracks) {
  app.add_option("--noise", tracks.noise, "of each component of a track in each frame, mm (default 0.01)")
      ->check(size_check())
      ->option_text("MM");
  app.add_option("--tracks", tracks.count, "tracks spread evenly over the surface (default 200)")
      ->check(CLI::Range(1, 100000000))
      ->option_text("N");
  app.add_option_function<std::vector<double>>(
         "--view",
         [&tracks](const std::vector<double>& view) {
           const Vec3 direction(view[0], view[1], view[2]);
           if (!direction.allFinite() || direction == Vec3::Zero())
             throw InputError("--view",
                              short_text(view[0]) + " " + short_text(view[1]) + " " + short_text(view[2]),
                              "a direction, three finite numbers that are not all zero");
           tracks.view = direction.stableNormalized();
         },
         "direction of sight: motion along it is not seen (default: all is)")
      ->expected(3)
      ->option_text("X Y Z");
}

std::vector<std::string> file_names(const std::vector<std::string>& texts) {
  std::vector<std::string> names;
  std::set<std::string> taken;  // in small letters
  for (const std::string& text : texts) {
    std::string name = text;
    for (char& c : name)
      if (!std::isalnum(static_cast<unsigned char>(c)) && c != '.' && c != '-') c = '_';
    const auto is_taken = [&](std::string wanted) {
      for (char& c : wanted) c = static_cast<char>(std::tolower(static_cast<unsigned char>(c)));
      return !taken.insert(wanted).second;
    };
    std::string unique = name;
    for (int count = 2; is_taken(unique); ++count) unique = name + "_" + std::to_string(count);
    names.push_back(std::move(unique));
  }
  return names;
}

PictureOptions skin_from_above(const SubdividedSurface& outer) {
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

void draw_on_skin(const SceneModel& scene_model, const VectorXd& values, const std::string& label,
                  const std::string& title, const std::string& path, ColourMap map,
                  std::optional<double> solids_at) {
  const SubdividedSurface outer(scene_model.model().mesh, SurfaceSide::outer, kSubdivision);
  PictureOptions options = skin_from_above(outer);
  options.title = title;
  PictureField field;
  field.values = outer.interpolate(values);
  field.label = label;
  field.map = map;
  // A constant field has no range of its own, and rounding is none.
  if (!(values.maxCoeff() - values.minCoeff() > 1e-9 * values.cwiseAbs().maxCoeff())) {
    field.minimum = std::min(0.0, 2 * values.minCoeff());
    field.maximum = std::max(2 * values.maxCoeff(), 1e-9);
  }
  std::vector<PictureSolid> solids;
  if (solids_at) {
    solids = collider_solids(scene_model.scene(), *solids_at);
    for (PictureSolid& collider : solids) collider.opacity = kGlass;
    for (const Vec3& source : scene_model.source_positions()) {
      const Vec3 above = outer_point_above(scene_model.model().mesh, source);
      solids.push_back(capsule_solid(above, above, kSourceBall));
      solids.back().colour = {30, 30, 30};
      solids.back().opacity = 1;
    }
  }
  write_png(path, draw_surface(outer, {}, options, &field, solids));
}

}  // namespace rhytid::tools
