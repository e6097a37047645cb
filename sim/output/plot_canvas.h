// What all plots of plot.h share: SVG elements, axis scales with ticks, the frame. Private to the plots.
#pragma once

#include <string>
#include <string_view>
#include <vector>

#include "sim/output/plot.h"

namespace rhytid {

/// Maps data to pixels along one axis, linearly or by log10.
class PlotScale {
 public:
  /// `values` are all data along the axis (non-finite ones and, on a log axis, values ≤ 0 are ignored).
  /// `room` is the fraction of the range left free on both sides unless a limit is given. `include_zero`
  /// stretches linear axes.
  PlotScale(const PlotAxis& axis, const std::vector<double>& values, double pixel_begin, double pixel_end,
            double room, bool include_zero = false);

  bool shows(double value) const;     ///< finite, drawable and inside the limits (with rounding slack)
  bool drawable(double value) const;  ///< finite, and positive on a log axis
  double pixel(double value) const;   ///< not clamped
  double clamped_pixel(double value) const;
  bool has_data() const { return has_data_; }

  struct Tick {
    double value;
    std::string label;  ///< empty = minor tick of a log axis
  };
  /// About one tick per `spacing` pixels.
  std::vector<Tick> ticks(double spacing) const;

 private:
  double transformed(double value) const;
  std::vector<Tick> logarithmic_ticks(double spacing) const;

  bool logarithmic_, has_data_;
  double low_, high_, pixel_begin_, pixel_end_;  // low, high in transformed units
};

struct PlotBox {
  double left, top, right, bottom;
};

/// Collects SVG elements.
class SvgCanvas {
 public:
  SvgCanvas(int width, int height, std::string_view title);
  void line(double x0, double y0, double x1, double y1, std::string_view attributes);
  void rectangle(double x, double y, double width, double height, std::string_view attributes);
  void circle(double x, double y, double radius, std::string_view attributes);
  void path(std::string_view data, std::string_view attributes);
  /// `anchor` is "start", "middle" or "end"; `rotate` in degrees about (x, y).
  void text(double x, double y, std::string_view content, std::string_view anchor = "start",
            std::string_view attributes = {}, double rotate = 0);
  /// Axis lines, grid and labels around a box; a null scale draws nothing for that axis.
  void frame(const PlotBox& box, const PlotScale* x, const PlotAxis& x_axis, const PlotScale* y,
             const PlotAxis& y_axis);
  void no_data(const PlotBox& box);
  std::string finish();

 private:
  std::string text_;
};

/// A pixel coordinate as short text.
std::string px(double value);
/// Rough width of `text` in the plots' 12 px font, to reserve space.
double estimated_width(std::string_view text);

}  // namespace rhytid
