#include "tools/report/program_facts.h"

#include "sim/core/build_info.h"
#include "sim/output/text.h"
#include "sim/scene/names.h"
#include "sim/solve/blas_info.h"

namespace rhytid::tools {
namespace {

std::string layer_text(const LayerScene& layer, const SkinScene& skin) {
  std::string text = layer.name + " " + short_text(layer.thickness) + " mm";
  if (skin.scheme == ThicknessScheme::stacked) {
    text += " (" + counted(layer.elements, "element") + " of order " + std::to_string(layer.order) + ")";
  }
  return text;
}

}  // namespace

std::string shell_word(const std::string& word) {
  const bool plain = !word.empty() && word.find_first_not_of(
                                          "abcdefghijklmnopqrstuvwxyzABCDEFGHIJKLMNOPQRSTUVWXYZ"
                                          "0123456789_-./,:+=@%") == std::string::npos;
  if (plain) return word;
  std::string quoted = "'";
  for (const char c : word) quoted += c == '\'' ? std::string("'\\''") : std::string(1, c);
  return quoted + "'";
}

Facts scheme_facts(const SceneModel& model) {
  const Scene& scene = model.scene();
  const SkinMesh& mesh = model.model().mesh;
  std::string layers;
  for (const LayerScene& layer : scene.skin.layers) {
    layers += (layers.empty() ? "" : ", ") + layer_text(layer, scene.skin);
  }
  return {{"Scene", scene.name + (scene.description.empty() ? "" : ": " + scene.description)},
          {"Elements", counted(mesh.num_elements(), "prism") + " of order " + std::to_string(mesh.order) +
                           " in the plane, " + counted(3L * mesh.num_nodes(), "displacement component")},
          {"Thickness", to_string(scene.skin.scheme) + ": " + layers},
          {"Time", counted(scene.time.frames, "frame") + " at " + short_text(scene.time.frame_rate) +
                       " Hz, " + counted(scene.time.substeps, "substep") + " a frame"},
          {"Damper", to_string(scene.time.damper)},
          {"Minimiser", scene.solver.minimiser + ", relative tolerance " +
                            short_text(scene.solver.relative_tolerance) + " plus " +
                            short_text(scene.solver.absolute_tolerance) + " N"}};
}

Facts build_facts() {
  const BuildInfo build = build_info();
  const BlasInfo blas = blas_info();
  return {{"Version", "Rhytid " + build.version + ", " + build.build_type +
                          (build.sanitizers.empty() ? "" : ", sanitizers " + build.sanitizers)},
          {"Compiler", build.compiler},
          {"BLAS", blas.name + (blas.config.empty() ? "" : " (" + blas.config + ")")}};
}

}  // namespace rhytid::tools
