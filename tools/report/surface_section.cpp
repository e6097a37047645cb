#include <algorithm>
#include <cmath>
#include <opencv2/imgproc.hpp>

#include "sim/output/picture.h"
#include "sim/output/text.h"
#include "sim/scene/collider_motion.h"
#include "tools/render/finger.h"
#include "tools/report/sections.h"
#include "tools/report/skin_view.h"

namespace rhytid::tools {
namespace {

constexpr int picture_width = 800;

std::vector<PictureSolid> glass_fingers(const Scene& scene, double time) {
  std::vector<PictureSolid> solids;
  for (const ColliderScene& collider : scene.colliders) {
    if (collider.shape != ShapeKind::sphere || collider.path.empty()) continue;
    const Vec3 at = ColliderMotion(collider, scene.time.offset).at(time).centre;
    solids.push_back(capsule_solid(at, at, collider.radius));
    solids.back().opacity = 0.25;
  }
  return solids;
}

void add_footage_frame(HtmlPage& page, const ReportData& data, int frame) {
  auto picture = footage_frame(data.footage, frame);
  if (!picture) return;
  const double scale = static_cast<double>(picture_width) / picture->cols;
  cv::resize(*picture, *picture, {}, scale, scale, scale < 1 ? cv::INTER_AREA : cv::INTER_CUBIC);
  page.image_figure(jpeg_uri(encode_jpeg(*picture)), picture->cols, picture->rows,
                    "The footage, frame " + std::to_string(frame) + ".",
                    "Footage, frame " + std::to_string(frame) + ".", false);
}

}  // namespace

void add_surface(HtmlPage& page, const ReportData& data, const VectorXd& displacement, int frame) {
  page.section("surface", "The skin, simulated beside observed");
  const Scene& scene = data.model->scene();
  const SkinMesh& mesh = data.model->model().mesh;
  const double time = frame / scene.time.frame_rate;
  const SubdividedSurface surface(mesh, SurfaceSide::outer, picture_subdivision(mesh));

  PictureOptions options;
  options.samples = 2;
  options.background = {255, 255, 255};
  options.width = picture_width;
  options.height = picture_width * 3 / 4;
  if (data.camera) options.camera = footage_view(*data.camera, picture_width);
  const bool distorted =
      data.camera && std::any_of(data.camera->distortion.begin(), data.camera->distortion.end(),
                                 [](double k) { return k != 0; });
  page.begin_row();
  add_footage_frame(page, data, frame);
  const Image shaded = draw_surface(surface, displacement, options, nullptr, glass_fingers(scene, time));
  page.image_figure(png_uri(encode_png(shaded)), shaded.width(), shaded.height(),
                    "The simulated surface in the same frame, shaded with raking light.",
                    "Simulation at the fitted values, frame " + std::to_string(frame) +
                        ", in raking light that brings out wrinkles. The finger is glass." +
                        (!data.camera ? ""
                         : distorted  ? " Same camera, without its lens distortion."
                                      : " Same camera."),
                    false);

  PictureField field;
  field.values = surface.normal_displacement(displacement);
  field.label = "height [mm]";
  field.map = ColourMap::diverging;
  PictureOptions map = options;
  map.height = picture_width * 3 / 4;
  map.camera =
      skin_view(surface, data.camera, map.width, map.height, static_cast<int>(66 * map.height / 400.));
  const Image height = draw_surface(surface, displacement, map, &field);
  const std::string range =
      short_text(field.values.minCoeff(), 3) + " to " + short_text(field.values.maxCoeff(), 3);
  page.image_figure(png_uri(encode_png(height)), height.width(), height.height(),
                    "Map of the height change along the rest normals, " + range + " mm.",
                    "Height change of the outer surface along its rest normals: " + range +
                        " mm. White is unchanged; wrinkles are stripes.");

  MatrixX3 moved = surface.positions(displacement) - surface.positions({});
  PictureField slide;
  slide.values = (moved.rowwise().squaredNorm() - field.values.cwiseAbs2()).cwiseMax(0).cwiseSqrt();
  slide.label = "slide [mm]";
  const Image sideways = draw_surface(surface, displacement, map, &slide);
  const std::string most = short_text(slide.values.maxCoeff(), 3);
  page.image_figure(png_uri(encode_png(sideways)), sideways.width(), sideways.height(),
                    "Map of how far the outer surface was dragged sideways, up to " + most + " mm.",
                    "How far the outer surface was dragged along itself: up to " + most + " mm.");
  page.end_row();
}

}  // namespace rhytid::tools
