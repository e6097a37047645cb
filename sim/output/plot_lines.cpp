#include <algorithm>
#include <cmath>

#include "sim/core/error.h"
#include "sim/core/types.h"
#include "sim/output/colour_map.h"
#include "sim/output/plot_canvas.h"

namespace rhytid {

namespace {

struct LegendEntry {
  std::string label, colour;
  PlotStyle style;
  bool dashed;
};

std::string line_attributes(const std::string& colour, bool dashed) {
  return "fill=\"none\" stroke=\"" + colour + "\" stroke-width=\"1.8\" stroke-linejoin=\"round\"" +
         (dashed ? " stroke-dasharray=\"6 4\"" : "");
}

double left_margin(const PlotScale& scale) {
  double widest = 0;
  for (const auto& tick : scale.ticks(45)) widest = std::max(widest, estimated_width(tick.label));
  return 34 + widest;
}

class LinePainter {
 public:
  LinePainter(const LinePlot& plot, SvgCanvas& canvas, const PlotBox& box, const PlotScale& x,
              const PlotScale& y)
      : plot_(plot), canvas_(canvas), box_(box), x_(x), y_(y) {}

  void draw_series(const PlotSeries& series, const std::string& colour) {
    if (series.style != PlotStyle::points) draw_line(series, colour);
    for (size_t i = 0; i < series.x.size(); ++i) {
      if (!x_.shows(series.x[i]) || !y_.drawable(series.y[i])) continue;
      if (!series.error.empty()) draw_error(x_.pixel(series.x[i]), series.y[i], series.error[i], colour);
      if (series.style != PlotStyle::line && y_.shows(series.y[i])) {
        canvas_.circle(x_.pixel(series.x[i]), y_.pixel(series.y[i]), 3, "fill=\"" + colour + "\"");
        if (!series.names.empty())
          canvas_.text(x_.pixel(series.x[i]) + 5, y_.pixel(series.y[i]) - 4, series.names[i], "start",
                       "fill=\"" + colour + "\" font-size=\"10\"");
      }
    }
  }

  void draw_rules() {
    for (const PlotRule& rule : plot_.rules) {
      constexpr const char* attributes = "stroke=\"#777\" stroke-width=\"1.2\" stroke-dasharray=\"2 3\"";
      const PlotScale& scale = rule.vertical ? x_ : y_;
      if (!scale.shows(rule.at)) continue;
      const double at = scale.pixel(rule.at);
      if (rule.vertical) {
        canvas_.line(at, box_.top, at, box_.bottom, attributes);
        canvas_.text(at + 4, box_.top + 11, rule.label, "start", "fill=\"#666\" font-size=\"11\"");
      } else {
        canvas_.line(box_.left, at, box_.right, at, attributes);
        canvas_.text(box_.right - 4, at - 4, rule.label, "end", "fill=\"#666\" font-size=\"11\"");
      }
    }
  }

  void draw_legend(const std::vector<LegendEntry>& entries) {
    double y = box_.top + 8;
    for (const LegendEntry& entry : entries) {
      const double x = box_.right + 12;
      if (entry.style != PlotStyle::points)
        canvas_.line(x, y, x + 22, y, line_attributes(entry.colour, entry.dashed));
      if (entry.style != PlotStyle::line) canvas_.circle(x + 11, y, 3, "fill=\"" + entry.colour + "\"");
      canvas_.text(x + 28, y + 4, entry.label, "start", "fill=\"#222\"");
      y += 18;
    }
  }

 private:
  /// Segments are cut where they leave the box (a clipPath would need an id that is unique in the whole
  /// page).
  void draw_line(const PlotSeries& series, const std::string& colour) {
    std::string data;
    Vec2 pen(NAN, NAN);
    for (size_t i = 0; i + 1 < series.x.size(); ++i) {
      if (!x_.drawable(series.x[i]) || !y_.drawable(series.y[i])) continue;
      if (!x_.drawable(series.x[i + 1]) || !y_.drawable(series.y[i + 1])) continue;
      Vec2 from(x_.pixel(series.x[i]), y_.pixel(series.y[i]));
      Vec2 to(x_.pixel(series.x[i + 1]), y_.pixel(series.y[i + 1]));
      if (!cut_to_box(from, to)) continue;
      if (pen != from) data += "M" + px(from.x()) + " " + px(from.y());
      data += "L" + px(to.x()) + " " + px(to.y());
      pen = to;
    }
    if (!data.empty()) canvas_.path(data, line_attributes(colour, series.dashed));
  }

  /// Shortens a segment to its part inside the box; false when there is none (Liang and Barsky).
  bool cut_to_box(Vec2& from, Vec2& to) const {
    const Vec2 low(box_.left, box_.top), high(box_.right, box_.bottom), step = to - from;
    double begin = 0, end = 1;
    for (int k = 0; k < 2; ++k) {
      if (step[k] == 0) {
        if (from[k] < low[k] || from[k] > high[k]) return false;
        continue;
      }
      const double at_low = (low[k] - from[k]) / step[k], at_high = (high[k] - from[k]) / step[k];
      begin = std::max(begin, std::min(at_low, at_high));
      end = std::min(end, std::max(at_low, at_high));
    }
    if (begin > end) return false;
    const Vec2 start = from;
    if (begin > 0) from = start + begin * step;
    if (end < 1) to = start + end * step;
    return true;
  }

  void draw_error(double x, double y, double half, const std::string& colour) {
    if (!std::isfinite(half)) return;
    const double a = y_.clamped_pixel(y - half), b = y_.clamped_pixel(y + half);
    const std::string attributes = "stroke=\"" + colour + "\" stroke-width=\"1.2\"";
    canvas_.line(x, a, x, b, attributes);
    canvas_.line(x - 3, a, x + 3, a, attributes);
    canvas_.line(x - 3, b, x + 3, b, attributes);
  }

  const LinePlot& plot_;
  SvgCanvas& canvas_;
  const PlotBox& box_;
  const PlotScale &x_, &y_;
};

}  // namespace

std::string svg(const LinePlot& plot) {
  std::vector<double> all_x, all_y;
  std::vector<LegendEntry> legend;
  std::vector<std::string> colours;
  double legend_width = 0;
  for (const PlotSeries& series : plot.series) {
    require(series.x.size() == series.y.size() &&
                (series.error.empty() || series.error.size() == series.x.size()) &&
                (series.names.empty() || series.names.size() == series.x.size()),
            "plot: x, y, errors and names must have the same size");
    colours.push_back(hex_colour(series.colour.value_or(palette_colour(colours.size()))));
    for (size_t i = 0; i < series.x.size(); ++i) {
      if (!std::isfinite(series.x[i]) || !std::isfinite(series.y[i])) continue;
      all_x.push_back(series.x[i]);
      all_y.push_back(series.y[i]);
      if (series.error.empty()) continue;
      all_y.push_back(series.y[i] - series.error[i]);
      all_y.push_back(series.y[i] + series.error[i]);
    }
    if (series.label.empty()) continue;
    legend.push_back({series.label, colours.back(), series.style, series.dashed});
    legend_width = std::max(legend_width, 48 + estimated_width(series.label));
  }
  for (const PlotRule& rule : plot.rules) (rule.vertical ? all_x : all_y).push_back(rule.at);

  SvgCanvas canvas(plot.width, plot.height, plot.title);
  PlotBox box{60, plot.title.empty() ? 14.0 : 34.0, plot.width - 16.0 - legend_width, plot.height - 46.0};
  const PlotScale y(plot.y, all_y, box.bottom, box.top, 0.06);
  box.left = left_margin(y);
  const PlotScale x(plot.x, all_x, box.left, box.right, 0.02);
  canvas.frame(box, &x, plot.x, &y, plot.y);
  if (!x.has_data() || !y.has_data()) canvas.no_data(box);
  LinePainter painter(plot, canvas, box, x, y);
  painter.draw_rules();
  for (size_t i = 0; i < plot.series.size(); ++i) painter.draw_series(plot.series[i], colours[i]);
  painter.draw_legend(legend);
  return canvas.finish();
}

}  // namespace rhytid
