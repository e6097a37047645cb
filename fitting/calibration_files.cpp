#include "fitting/calibration_files.h"

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <filesystem>
#include <limits>
#include <nlohmann/json.hpp>
#include <numbers>

#include "fitting/utf8.h"
#include "sim/output/plot_canvas.h"
#include "sim/output/text.h"

namespace rhytid::fitting {
namespace {

std::string base_name(const std::string& file) {
  return std::filesystem::path(file).filename().string();
}

std::string digits(const LensParameter& p, double value) {
  const double width = p.high - p.low;
  const int decimals = width > 0 ? std::clamp(1 - static_cast<int>(std::floor(std::log10(width))), 0, 9) : 4;
  return fixed_text(value, decimals);
}

std::string left_out_terms(const Calibration& c) {
  std::string names;
  for (int k = 4; k < kNumLensParameters; ++k)
    if (!c.parameters[static_cast<std::size_t>(k)].is_fitted)
      names += (names.empty() ? "" : " ") + std::string(kLensParameters[static_cast<std::size_t>(k)]);
  return names;
}

/// What more terms than the chosen ones would bring; empty when there are no more.
std::string left_out_text(const Calibration& c) {
  const std::string names = left_out_terms(c);
  const auto chosen =
      std::find_if(c.models.begin(), c.models.end(), [](const LensModel& m) { return m.is_chosen; });
  if (names.empty() || chosen == c.models.end()) return {};
  double richer = std::numeric_limits<double>::infinity();
  for (const LensModel& m : c.models)
    if (m.num_terms > chosen->num_terms) richer = std::min(richer, m.predicted_rms);
  const std::string compared =
      short_text(richer, 3) + " px rms instead of " + short_text(chosen->predicted_rms, 3);
  return " (" + names + " left out: photographs a lens was not fitted to are predicted " +
         (richer < chosen->predicted_rms ? "better with more by no more than chance, "
                                         : "no better with more, ") +
         compared + ")";
}

constexpr double kMargin = 16, kPictureSide = 640, kListWidth = 330, kLine = 16;  // px of the SVG

/// The largest of 1, 2, 5 times a power of ten that is not above `value`.
double round_down(double value) {
  const double power = std::pow(10, std::floor(std::log10(value)));
  for (const double step : {5.0, 2.0})
    if (step * power <= value) return step * power;
  return power;
}

std::string hex(Rgb c) {
  char text[8];
  std::snprintf(text, sizeof text, "#%02x%02x%02x", c.r, c.g, c.b);
  return text;
}

/// Enlargement that makes long residuals (the 95th percentile) a fortieth of the picture.
double arrow_gain(const Calibration& c) {
  std::vector<double> lengths;
  for (const CalibrationPhotograph& p : c.photographs)
    for (const Vec2& r : p.residuals) lengths.push_back(r.norm());
  if (lengths.empty()) return 1;
  const auto at = lengths.begin() + static_cast<long>(0.95 * static_cast<double>(lengths.size() - 1));
  std::nth_element(lengths.begin(), at, lengths.end());
  return round_down(std::max(c.camera.width, c.camera.height) / 40.0 / std::max(*at, 1e-6));
}

void shade_uncovered(const Calibration& c, double scale, SvgCanvas* svg) {
  constexpr int cells = 10;
  bool covered[cells][cells] = {};
  for (const CalibrationPhotograph& p : c.photographs)
    for (const Vec2& q : p.is_used ? p.board.corners : std::vector<Vec2>())
      covered[std::clamp(static_cast<int>((q.x() + 0.5) / c.camera.width * cells), 0, cells - 1)]
             [std::clamp(static_cast<int>((q.y() + 0.5) / c.camera.height * cells), 0, cells - 1)] = true;
  const double w = scale * c.camera.width / cells, h = scale * c.camera.height / cells;
  for (int i = 0; i < cells; ++i)
    for (int j = 0; j < cells; ++j)
      if (!covered[i][j])
        svg->rectangle(kMargin + i * w, kMargin + kLine + j * h, w, h, "fill=\"#e8e8e8\" stroke=\"none\"");
}

}  // namespace

std::string calibration_text(const Calibration& c) {
  std::string text;
  char line[300];
  const auto add = [&](const char* name, const std::string& value) {
    std::snprintf(line, sizeof line, "%-14s", name);
    text += line + value + "\n";
  };
  add("board", to_string(c.board) + " inner corners" +
                   (c.square > 0 ? ", squares of " + short_text(c.square) + " mm" : ""));
  add("photographs", std::to_string(c.used) + " of " + std::to_string(c.photographs.size()) + " used, " +
                         std::to_string(c.camera.width) + " x " + std::to_string(c.camera.height) + " px");
  for (const CalibrationPhotograph& p : c.photographs)
    if (!p.is_used) add("", "left out: " + p.file + ": " + p.reason);
  double least = 1e30, most = 0, worst = 0;
  for (const CalibrationPhotograph& p : c.photographs)
    if (p.is_used)
      least = std::min(least, p.rms_px), most = std::max(most, p.rms_px), worst = std::max(worst, p.worst_px);
  add("reprojection", short_text(c.rms_px, 3) + " px rms (per photograph " + short_text(least, 3) + " to " +
                          short_text(most, 3) + ", worst corner " + short_text(worst, 3) + ")");
  add("coverage", fixed_text(100 * c.coverage, 0) + " % of the picture, out to " +
                      fixed_text(100 * c.reach, 0) + " % of the way from its middle to its corners");
  add("distortion", (c.model == "none" ? "no distortion" : c.model) + left_out_text(c));
  text += "\n              value         95 % interval\n";
  for (int k = 0; k < kNumLensParameters; ++k) {
    const LensParameter& p = c.parameters[static_cast<std::size_t>(k)];
    if (!p.is_fitted) continue;
    std::snprintf(line, sizeof line, "%-3s %-4s %14s   %s .. %s\n",
                  kLensParameters[static_cast<std::size_t>(k)], k < 4 ? "px" : "", digits(p, p.value).c_str(),
                  digits(p, p.low).c_str(), digits(p, p.high).c_str());
    text += line;
  }
  return text;
}

std::string calibration_json(const Calibration& c) {
  using nlohmann::ordered_json;
  ordered_json j;
  j["board"] = {{"columns", c.board.columns}, {"rows", c.board.rows}};
  if (c.square > 0) j["board"]["square_mm"] = c.square;
  j["image_size_px"] = {c.camera.width, c.camera.height};
  j["distortion_model"] = c.model;
  for (int k = 0; k < kNumLensParameters; ++k) {
    const LensParameter& p = c.parameters[static_cast<std::size_t>(k)];
    ordered_json& item = j["parameters"][kLensParameters[static_cast<std::size_t>(k)]];
    item = {{"value", p.value}, {"unit", k < 4 ? "px" : ""}, {"fitted", p.is_fitted}};
    if (!p.is_fitted) continue;
    item["interval_95"] = {p.low, p.high};
    item["sigma"] = p.sigma;
    item["sigma_linearised"] = p.linear_sigma;
    item["sigma_between_photographs"] = p.jackknife_sigma;
  }
  j["rms_px"] = c.rms_px;
  j["coverage"] = c.coverage;
  j["reach"] = c.reach;
  for (const LensModel& m : c.models)
    j["models"].push_back(
        {{"terms", m.name}, {"predicted_rms_px", m.predicted_rms}, {"chosen", m.is_chosen}});
  for (const CalibrationPhotograph& p : c.photographs) {
    ordered_json item = {{"file", p.file}, {"used", p.is_used}};
    if (!p.is_used) {
      item["reason"] = p.reason;
    } else {
      item["rms_px"] = p.rms_px;
      item["worst_px"] = p.worst_px;
      item["tilt_degrees"] = p.tilt * 180 / std::numbers::pi;
      for (int i = 0; i < 3; ++i) item["R"].push_back({p.rotation(i, 0), p.rotation(i, 1), p.rotation(i, 2)});
      item[c.square > 0 ? "t_mm" : "t_squares"] = {p.translation.x(), p.translation.y(), p.translation.z()};
    }
    j["photographs"].push_back(std::move(item));
  }
  j["warnings"] = c.warnings;
  return j.dump(1, ' ', false, ordered_json::error_handler_t::replace) + "\n";  // names of files
}

std::string calibration_svg(const Calibration& c) {
  const double scale = kPictureSide / std::max(c.camera.width, c.camera.height);
  const double width = scale * c.camera.width, height = scale * c.camera.height;
  const double list = kLine * static_cast<double>(c.photographs.size() + 5);
  const double total = std::max(height, list) + 2 * kMargin + 2 * kLine;
  const double gain = arrow_gain(c), top = kMargin + kLine;
  SvgCanvas svg(static_cast<int>(width + kListWidth + 3 * kMargin), static_cast<int>(total),
                "Corner less projection, enlarged " + short_text(gain) + " times (grey: no corners)");
  shade_uncovered(c, scale, &svg);
  svg.rectangle(kMargin, top, width, height, "fill=\"none\" stroke=\"#444\"");

  const double x = width + 2 * kMargin;
  double y = top + kLine;
  svg.text(x, y,
           std::to_string(c.camera.width) + " x " + std::to_string(c.camera.height) + " px, rms " +
               short_text(c.rms_px, 3) + " px, distortion " + c.model);
  y += kLine;
  svg.line(x, y - 4, x + scale * gain, y - 4, "stroke=\"#000\" stroke-width=\"2\"");
  svg.text(x + scale * gain + 6, y, "1 px");
  y += 1.5 * kLine;
  std::size_t index = 0;
  for (const CalibrationPhotograph& p : c.photographs) {
    const std::string colour = p.is_used ? hex(palette_colour(index++)) : "#999999";
    svg.rectangle(x, y - 9, 10, 10, "fill=\"" + colour + "\" stroke=\"none\"");
    std::string name = valid_utf8(base_name(p.file));
    if (name.size() > 24) name = "..." + utf8_tail(name, 21);
    svg.text(x + 16, y, name + (p.is_used ? ", rms " + short_text(p.rms_px, 3) + " px" : ", left out"));
    y += kLine;
    std::string arrows, feet;  // a dot where an arrow begins
    for (std::size_t i = 0; i < p.residuals.size(); ++i) {
      const Vec2 from = p.board.corners[i] - p.residuals[i], to = from + gain * p.residuals[i];
      const std::string foot = "M" + px(kMargin + scale * from.x()) + " " + px(top + scale * from.y());
      arrows += foot + "L" + px(kMargin + scale * to.x()) + " " + px(top + scale * to.y());
      feet += foot + "h0";
    }
    if (arrows.empty()) continue;
    svg.path(arrows, "fill=\"none\" stroke=\"" + colour + "\" stroke-width=\"1\"");
    svg.path(feet, "fill=\"none\" stroke=\"" + colour + "\" stroke-width=\"2.5\" stroke-linecap=\"round\"");
  }
  return svg.finish();
}

}  // namespace rhytid::fitting
