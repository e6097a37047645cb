#include <algorithm>
#include <cmath>
#include <limits>

#include "sim/output/font.h"
#include "sim/output/picture.h"
#include "sim/output/text.h"
#include "tools/report/sections.h"
#include "tools/report/skin_view.h"
#include "tools/report/wording.h"

namespace rhytid::tools {
namespace {

constexpr int picture_width = 880, picture_height = 640;

/// dp/dt of the parameter's transform at its value.
double transform_slope(const fitting::FittedParameter& p) {
  if (p.transform == "log") return p.value;
  if (p.transform == "logit") return (p.value - p.lower) * (p.upper - p.value) / (p.upper - p.lower);
  return 1;
}

/// A ring with its label, dark with a light halo so that it shows on every colour of the map.
void draw_source(Image& image, const Vec3& at, const std::string& label, double scale) {
  const double radius = 5 * scale;
  for (int y = static_cast<int>(at.y() - 2 * radius); y <= at.y() + 2 * radius; ++y) {
    for (int x = static_cast<int>(at.x() - 2 * radius); x <= at.x() + 2 * radius; ++x) {
      const double off = std::abs(std::hypot(x - at.x(), y - at.y()) - radius);
      image.blend(x, y, {255, 255, 255}, std::clamp(2.4 * scale - off, 0.0, 1.0));
      image.blend(x, y, {20, 20, 24}, std::clamp(1.2 * scale - off, 0.0, 1.0));
    }
  }
  // Kept inside the map: the colour bar stands at the right.
  const double half = 0.5 * text_width(label, scale), rightmost = image.width() - 75 * scale - half;
  const double x = std::clamp(at.x(), half + 6, std::max(half + 6, rightmost)), y = at.y() + 1.6 * radius;
  for (const auto& [dx, dy] :
       {std::pair{-1, 0}, {1, 0}, {0, -1}, {0, 1}, {-1, -1}, {1, 1}, {-1, 1}, {1, -1}}) {
    draw_text(image, x + dx * scale, y + dy * scale, label, scale, {255, 255, 255}, TextAnchor::centre);
  }
  draw_text(image, x, y, label, scale, {20, 20, 24}, TextAnchor::centre);
}

const fitting::FittedParameter* fitted_strength(const fitting::FitResult& fit, const Scene& scene,
                                                size_t source) {
  const std::string& name = scene.ligaments->sources[source].name;
  const std::string number = std::to_string(source);
  for (const auto& p : fit.parameters) {
    for (const std::string& key : {name, number}) {
      if (!key.empty() && p.address == "/ligaments/sources/" + key + "/strength") return &p;
    }
  }
  return nullptr;
}

/// Values that are one but for rounding are one: a scale of colours would show the rounding as a pattern.
VectorXd without_rounding(const VectorXd& values) {
  double low = std::numeric_limits<double>::infinity(), high = -low;
  for (const double v : values)
    if (std::isfinite(v)) low = std::min(low, v), high = std::max(high, v);
  if (!(high - low < 1e-9 * std::max(std::fabs(low), std::fabs(high)))) return values;
  return values.unaryExpr([low](double v) { return std::isfinite(v) ? low : v; });
}

Image draw_map(const ReportData& data, const VectorXd& per_column, const std::string& label,
               bool with_strengths) {
  const SceneModel& model = *data.model;
  const SkinMesh& mesh = model.model().mesh;
  const SubdividedSurface surface(mesh, SurfaceSide::inner, picture_subdivision(mesh));
  PictureField field;
  field.values = without_rounding(surface.interpolate(per_column));
  field.label = label;
  PictureOptions options;
  options.samples = 2;
  const double scale = std::min(picture_width, picture_height) / 400.0;
  options.camera =
      skin_view(surface, data.camera, picture_width, picture_height, static_cast<int>(66 * scale));
  options.background = {255, 255, 255};
  Image image = draw_surface(surface, {}, options, &field);
  const Scene& scene = model.scene();
  for (size_t s = 0; s < model.source_positions().size(); ++s) {
    const Vec3 pixel = options.camera->project(model.source_positions()[s]);
    if (!(pixel.z() > 0)) continue;
    std::string text = scene.ligaments->sources[s].name;
    if (text.empty()) text = "source " + std::to_string(s);
    if (with_strengths) text += " " + short_text(scene.ligaments->sources[s].strength, 3);
    draw_source(image, pixel, text, scale);
  }
  return image;
}

void add_strengths(HtmlPage& page, const ReportData& data) {
  const Scene& scene = data.model->scene();
  HtmlTable table;
  table.wide = true;
  table.caption = "The sources of the map. Strength b in 1/mm; positions on the inner surface in mm.";
  table.header = {"source", "strength b", "95 % interval", "x", "y", "z", "radius"};
  for (size_t s = 0; s < scene.ligaments->sources.size(); ++s) {
    const SourceScene& source = scene.ligaments->sources[s];
    const auto* fitted = fitted_strength(data.fit, scene, s);
    const Vec3 at = data.model->source_positions()[s];
    std::string interval = "not fitted";
    if (fitted) {
      interval = fitted->determined ? short_text(fitted->low95, 4) + " to " + short_text(fitted->high95, 4)
                                    : "not determined";
    }
    table.rows.push_back({source.name.empty() ? "source " + std::to_string(s) : source.name,
                          short_text(source.strength, 4), interval, fixed_text(at.x(), 2),
                          fixed_text(at.y(), 2), fixed_text(at.z(), 2), short_text(source.radius, 3)});
  }
  page.table(table);
}

std::string range_text(const VectorXd& values) {
  double low = INFINITY, high = -INFINITY;
  for (const double v : values) {
    if (std::isfinite(v)) low = std::min(low, v), high = std::max(high, v);
  }
  return low <= high ? short_text(low, 3) + " to " + short_text(high, 3) + " 1/mm" : "nowhere determined";
}

}  // namespace

VectorXd ligament_deviation(const SceneModel& model, const fitting::FitResult& fit) {
  if (!model.scene().ligaments) return {};
  const NativeBlock& block = model.model().native_block("ligaments/b");
  const auto n = static_cast<Eigen::Index>(fit.parameters.size());
  MatrixXd scaled = MatrixXd::Zero(block.size, n);  // ∂b/∂p · standard deviation of p
  VectorXd open = VectorXd::Zero(block.size);       // > 0 where an undetermined parameter acts
  bool moves = false;
  for (Eigen::Index k = 0; k < n; ++k) {
    const fitting::FittedParameter& p = fit.parameters[static_cast<size_t>(k)];
    const std::string address = fit.address_in_clip(p, 0);  // the map is that of the first clip
    if (address.empty()) continue;
    const VectorXd column = model.native_derivative(model.scene(), address).segment(block.offset, block.size);
    if (column.isZero(0)) continue;
    moves = true;
    if (p.determined && std::isfinite(p.sigma)) {
      scaled.col(k) = column * (p.sigma * transform_slope(p));
    } else {
      open = open.cwiseMax(column.cwiseAbs() / column.cwiseAbs().maxCoeff());
    }
  }
  if (!moves) return {};
  MatrixXd correlation = fit.correlation;
  if (correlation.rows() != n || !correlation.allFinite()) {
    // Rows of undetermined parameters are not numbers; they are left out above.
    MatrixXd cleaned = MatrixXd::Identity(n, n);
    for (Eigen::Index i = 0; correlation.rows() == n && i < n; ++i)
      for (Eigen::Index j = 0; j < n; ++j)
        if (std::isfinite(correlation(i, j)) && i != j) cleaned(i, j) = correlation(i, j);
    correlation = cleaned;
  }
  const VectorXd variance = (scaled * correlation).cwiseProduct(scaled).rowwise().sum();
  VectorXd deviation = variance.cwiseMax(0).cwiseSqrt();
  // An undetermined source whose weight is below a thousandth of its largest does not make a place unknown.
  for (Eigen::Index i = 0; i < deviation.size(); ++i) {
    if (open[i] > 1e-3) deviation[i] = std::nan("");
  }
  return deviation;
}

void add_ligaments(HtmlPage& page, const ReportData& data) {
  page.section("ligaments", "Retaining ligaments");
  if (!data.model) {
    page.paragraph("The scene could not be read, so there is no map.");
    return;
  }
  const Scene& scene = data.model->scene();
  if (!scene.ligaments) {
    page.paragraph("This scene has no ligaments.");
    return;
  }
  page.paragraph(
      "The ligaments tie the inner surface of the skin to what lies below. Their parameter b says how "
      "fast they stiffen when stretched; it spreads from sources over the surface. The maps show the "
      "inner surface at rest, seen from the side of the camera.");
  const VectorXd b = data.model->ligament_map(scene);
  const VectorXd deviation = ligament_deviation(*data.model, data.fit);
  const auto add = [&](const VectorXd& values, const std::string& label, bool strengths,
                       const std::string& alt, const std::string& caption) {
    const Image image = draw_map(data, values, label, strengths);
    page.image_figure(png_uri(encode_png(image)), image.width(), image.height(), alt, caption);
  };
  page.begin_row();
  add(b, "b [1/mm]", true, "Heat map of the ligament parameter b over the patch, from " + range_text(b) + ".",
      "Ligament parameter b at the fitted values (" + range_text(b) +
          "). Rings: sources with their strength.");
  const bool known_somewhere = deviation.size() > 0 && !deviation.array().isNaN().all();
  if (known_somewhere) {
    add(deviation, "std b [1/mm]", false,
        "Map of the standard deviation of b, " + range_text(deviation) + ".",
        "Standard deviation of b (" + range_text(deviation) +
            "), propagated linearly from the fitted parameters with their correlations." +
            (deviation.hasNaN() ? " Grey: a parameter acts there that the footage does not determine." : ""));
  }
  page.end_row();
  if (deviation.size() == 0) {
    page.note("Nothing that was fitted changes b, so the map has no deviation.");
  } else if (!known_somewhere) {
    page.note(
        "b has no finite deviation anywhere: a parameter that the footage does not determine acts on the "
        "whole "
        "patch.");
  }
  add_strengths(page, data);
}

}  // namespace rhytid::tools
