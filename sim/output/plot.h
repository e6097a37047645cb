// Small SVG plots for reports: lines and points with error bars, intervals (forest plots) and bars.
// Text is real text, colours are those of Okabe and Ito (distinguishable with any colour vision); the output
// depends on nothing but the data.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "sim/output/image.h"

namespace rhytid {

/// One axis of a plot. Limits that are not given come from the data with a little room.
struct PlotAxis {
  std::string label;         ///< with the unit: "time [s]"
  bool logarithmic = false;  ///< values ≤ 0 are then not drawn
  std::optional<double> minimum, maximum;
};

enum class PlotStyle { line, points, line_and_points };

struct PlotSeries {
  std::string label;          ///< legend entry; empty = none
  std::vector<double> x, y;   ///< same size; a non-finite value breaks the line
  std::vector<double> error;  ///< half-length of vertical error bars, same size or empty
  PlotStyle style = PlotStyle::line;
  bool dashed = false;
  std::optional<Rgb> colour;  ///< default: the next of the palette
  /// Written beside the points, same size or empty.
  std::vector<std::string> names = {};
};

/// A straight line across a line plot, e.g. a threshold or the truth.
struct PlotRule {
  bool vertical = false;
  double at = 0;
  std::string label;
};

struct LinePlot {
  std::string title;
  PlotAxis x, y;
  std::vector<PlotSeries> series;
  std::vector<PlotRule> rules;
  int width = 640, height = 400;  ///< px
};

/// One row of a forest plot: an estimate with its interval.
struct PlotInterval {
  std::string label;
  double value, low, high;
  std::optional<double> truth;  ///< drawn as a diamond beside the estimate
  std::string note;             ///< text at the right edge, e.g. "12.1 ± 0.4 kPa"
};

struct IntervalPlot {
  std::string title;
  PlotAxis axis;
  std::vector<PlotInterval> rows;
  std::optional<double> reference;  ///< a vertical line, e.g. 1 for ratios to the truth
  std::string truth_label = "truth";
  int width = 640;  ///< px; the height follows from the rows
};

struct BarGroup {
  std::string label;           ///< under the bars
  std::vector<double> values;  ///< one per series; non-finite = no bar
  std::vector<double> errors;  ///< half-lengths, same size or empty
};

struct BarChart {
  std::string title;
  PlotAxis y;
  std::vector<std::string> series;  ///< legend; a single empty name = no legend
  std::vector<BarGroup> groups;
  int width = 640, height = 360;  ///< px
};

/// A complete <svg> element, usable as a file and inline in HTML. Throw ContractError on sizes that do not
/// fit and on empty ranges (minimum ≥ maximum, logarithmic limits ≤ 0). A plot without drawable data says "no
/// data".
std::string svg(const LinePlot& plot);
std::string svg(const IntervalPlot& plot);
std::string svg(const BarChart& plot);

/// The i-th colour of the palette (repeats after 7).
Rgb palette_colour(size_t i);

}  // namespace rhytid
