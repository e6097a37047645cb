#include "sim/output/plot_canvas.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>

#include "sim/core/error.h"
#include "sim/output/colour_map.h"
#include "sim/output/text.h"

namespace rhytid {

Rgb palette_colour(size_t i) {
  // Okabe and Ito's colours without black and the pale yellow, blue first.
  static constexpr std::array<Rgb, 7> colours = {{{0, 114, 178},
                                                  {213, 94, 0},
                                                  {0, 158, 115},
                                                  {204, 121, 167},
                                                  {230, 159, 0},
                                                  {86, 180, 233},
                                                  {90, 90, 90}}};
  return colours[i % colours.size()];
}

std::string px(double value) {
  return short_text(std::round(100 * value) / 100, 8);
}

double estimated_width(std::string_view text) {
  size_t characters = 0;
  for (const char c : text) characters += (static_cast<unsigned char>(c) & 0xC0) != 0x80;
  return 6.6 * static_cast<double>(characters);
}

PlotScale::PlotScale(const PlotAxis& axis, const std::vector<double>& values, double pixel_begin,
                     double pixel_end, double room, bool include_zero)
    : logarithmic_(axis.logarithmic), pixel_begin_(pixel_begin), pixel_end_(pixel_end) {
  low_ = std::numeric_limits<double>::infinity();
  high_ = -low_;
  for (const double value : values) {
    if (!drawable(value)) continue;
    low_ = std::min(low_, transformed(value));
    high_ = std::max(high_, transformed(value));
  }
  has_data_ = low_ <= high_;
  if (!has_data_) low_ = 0, high_ = 1;
  if (include_zero && !logarithmic_) low_ = std::min(low_, 0.0), high_ = std::max(high_, 0.0);
  if (!(low_ < high_)) {  // one value only: give it a neighbourhood
    const double half = logarithmic_ ? 0.5 : std::max(0.5 * std::abs(low_), 1e-300);
    low_ -= half, high_ += half;
  }
  const double margin = room * (high_ - low_);
  const bool zero_low = include_zero && low_ == 0, zero_high = include_zero && high_ == 0;
  if (!zero_low) low_ -= margin;
  if (!zero_high) high_ += margin;
  for (const auto& limit : {axis.minimum, axis.maximum}) {
    require(!limit || drawable(*limit), "plot: an axis limit is not finite or not positive on a log axis");
  }
  if (axis.minimum) low_ = transformed(*axis.minimum);
  if (axis.maximum) high_ = transformed(*axis.maximum);
  // Data outside one given limit may leave nothing in between.
  if (axis.minimum && !axis.maximum && high_ <= low_) high_ = low_ + 1;
  if (axis.maximum && !axis.minimum && high_ <= low_) low_ = high_ - 1;
  require(low_ < high_, "plot: axis minimum must be below its maximum");
}

double PlotScale::transformed(double value) const {
  return logarithmic_ ? std::log10(value) : value;
}
bool PlotScale::drawable(double value) const {
  return std::isfinite(value) && (!logarithmic_ || value > 0);
}

bool PlotScale::shows(double value) const {
  if (!drawable(value)) return false;
  const double slack = 1e-9 * (high_ - low_), at = transformed(value);
  return at >= low_ - slack && at <= high_ + slack;
}

double PlotScale::pixel(double value) const {
  return pixel_begin_ + (transformed(value) - low_) / (high_ - low_) * (pixel_end_ - pixel_begin_);
}

double PlotScale::clamped_pixel(double value) const {
  if (logarithmic_ && value <= 0) return pixel_begin_;
  const auto [least, most] = std::minmax(pixel_begin_, pixel_end_);
  return std::clamp(pixel(value), least, most);
}

std::vector<PlotScale::Tick> PlotScale::ticks(double spacing) const {
  const int target = std::max(2, static_cast<int>(std::abs(pixel_end_ - pixel_begin_) / spacing));
  // Less than most of a decade reads better with round numbers than with powers of ten.
  if (logarithmic_ && high_ - low_ > 0.7) return logarithmic_ticks(spacing);
  const double low = logarithmic_ ? std::pow(10, low_) : low_,
               high = logarithmic_ ? std::pow(10, high_) : high_;
  const std::vector<double> values = round_ticks(low, high, target);
  const double step = values.size() > 1 ? values[1] - values[0] : high - low;
  std::vector<Tick> out;
  for (const double value : values) {
    if (drawable(value)) out.push_back({value, tick_text(value, step)});
  }
  return out;
}

std::vector<PlotScale::Tick> PlotScale::logarithmic_ticks(double spacing) const {
  const int first = static_cast<int>(std::floor(low_)), last = static_cast<int>(std::ceil(high_));
  const double decade = std::abs(pixel_end_ - pixel_begin_) / (high_ - low_);
  const int every = std::max(1, static_cast<int>(std::ceil(0.6 * spacing / decade)));
  std::vector<Tick> out;
  for (int e = first; e <= last; ++e) {
    const double power = std::pow(10.0, e);
    const bool plain = e >= -3 && e <= 4;
    const std::string label = e % every != 0 ? ""
                              : plain        ? fixed_text(power, std::max(0, -e))
                                             : "1e" + std::to_string(e);
    if (shows(power) && (every == 1 || e % every == 0)) out.push_back({power, label});
    // 2 and 5 are labelled too where decades are long and few.
    const bool label_2_5 = decade > 2 * spacing && high_ - low_ < 2.5;
    for (int k = 2; k <= 9 && every == 1 && decade > 60; ++k) {
      const bool labelled = label_2_5 && (k == 2 || k == 5);
      if (shows(k * power)) out.push_back({k * power, labelled ? tick_text(k * power, power) : ""});
    }
  }
  return out;
}

SvgCanvas::SvgCanvas(int width, int height, std::string_view title) {
  require(width >= 160 && height >= 80, "plot: at least 160 x 80 pixels");
  const std::string w = std::to_string(width), h = std::to_string(height);
  text_ = "<svg xmlns=\"http://www.w3.org/2000/svg\" width=\"" + w + "\" height=\"" + h +
          "\" viewBox=\"0 0 " + w + " " + h +
          "\" font-family=\"Helvetica,Arial,sans-serif\" font-size=\"12\" stroke=\"none\" "
          "role=\"img\">\n<title>" +
          xml_escaped(title) + "</title>\n";
  rectangle(0, 0, width, height, "fill=\"#fff\"");
  if (!title.empty())
    text(0.5 * width, 20, title, "middle", "font-size=\"14\" font-weight=\"bold\" fill=\"#222\"");
}

void SvgCanvas::line(double x0, double y0, double x1, double y1, std::string_view attributes) {
  text_ += "<line x1=\"" + px(x0) + "\" y1=\"" + px(y0) + "\" x2=\"" + px(x1) + "\" y2=\"" + px(y1) + "\" " +
           std::string(attributes) + "/>\n";
}

void SvgCanvas::rectangle(double x, double y, double width, double height, std::string_view attributes) {
  text_ += "<rect x=\"" + px(x) + "\" y=\"" + px(y) + "\" width=\"" + px(width) + "\" height=\"" +
           px(height) + "\" " + std::string(attributes) + "/>\n";
}

void SvgCanvas::circle(double x, double y, double radius, std::string_view attributes) {
  text_ += "<circle cx=\"" + px(x) + "\" cy=\"" + px(y) + "\" r=\"" + px(radius) + "\" " +
           std::string(attributes) + "/>\n";
}

void SvgCanvas::path(std::string_view data, std::string_view attributes) {
  text_ += "<path d=\"" + std::string(data) + "\" " + std::string(attributes) + "/>\n";
}

void SvgCanvas::text(double x, double y, std::string_view content, std::string_view anchor,
                     std::string_view attributes, double rotate) {
  // A turned text is moved first: viewers agree on rotation about the origin, not all on rotation about a
  // point.
  const std::string place =
      rotate == 0 ? "x=\"" + px(x) + "\" y=\"" + px(y) + "\""
                  : "transform=\"translate(" + px(x) + " " + px(y) + ") rotate(" + px(rotate) + ")\"";
  text_ += "<text " + place + " text-anchor=\"" + std::string(anchor) + "\" " + std::string(attributes);
  text_ += ">" + xml_escaped(content) + "</text>\n";
}

void SvgCanvas::frame(const PlotBox& box, const PlotScale* x, const PlotAxis& x_axis, const PlotScale* y,
                      const PlotAxis& y_axis) {
  constexpr std::string_view grid = "stroke=\"#e4e4e4\"", minor = "stroke=\"#f2f2f2\"";
  constexpr std::string_view ink = "stroke=\"#444\"", label = "fill=\"#444\"", name = "fill=\"#222\"";
  if (x) {
    for (const auto& tick : x->ticks(80)) {
      const double at = x->pixel(tick.value);
      line(at, box.top, at, box.bottom, tick.label.empty() ? minor : grid);
      if (tick.label.empty()) continue;
      line(at, box.bottom, at, box.bottom + 4, ink);
      text(at, box.bottom + 17, tick.label, "middle", label);
    }
    text(0.5 * (box.left + box.right), box.bottom + 36, x_axis.label, "middle", name);
  }
  if (y) {
    for (const auto& tick : y->ticks(45)) {
      const double at = y->pixel(tick.value);
      line(box.left, at, box.right, at, tick.label.empty() ? minor : grid);
      if (tick.label.empty()) continue;
      line(box.left - 4, at, box.left, at, ink);
      text(box.left - 7, at + 4, tick.label, "end", label);
    }
    if (!y_axis.label.empty()) text(15, 0.5 * (box.top + box.bottom), y_axis.label, "middle", name, -90);
  }
  line(box.left, box.bottom, box.right, box.bottom, ink);
  if (y) line(box.left, box.top, box.left, box.bottom, ink);
}

void SvgCanvas::no_data(const PlotBox& box) {
  text(0.5 * (box.left + box.right), 0.5 * (box.top + box.bottom), "no data", "middle", "fill=\"#999\"");
}

std::string SvgCanvas::finish() {
  text_ += "</svg>\n";
  return std::move(text_);
}

}  // namespace rhytid
