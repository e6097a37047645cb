#include <algorithm>
#include <array>
#include <cmath>

#include "sim/core/error.h"
#include "sim/output/colour_map.h"
#include "sim/output/plot_canvas.h"

namespace rhytid {

namespace {

constexpr double row_height = 26;

void draw_interval(SvgCanvas& canvas, const PlotInterval& row, const PlotScale& x, const PlotBox& box,
                   double y) {
  const std::string colour = hex_colour(palette_colour(0)), truth = hex_colour(palette_colour(1));
  const std::string stroke = "stroke=\"" + colour + "\" stroke-width=\"2\"";
  if (!std::isnan(row.low) && !std::isnan(row.high)) {
    // An end beyond the axis (or infinite) becomes an arrow: "not determined on this side".
    const bool open_low = !x.shows(row.low), open_high = !x.shows(row.high);
    const double a = open_low ? box.left : x.pixel(row.low), b = open_high ? box.right : x.pixel(row.high);
    canvas.line(a, y, b, y, stroke);
    const auto end = [&](double at, bool open, double direction) {
      if (open) {
        canvas.path("M" + px(at - 6 * direction) + " " + px(y - 4) + "L" + px(at) + " " + px(y) + "L" +
                        px(at - 6 * direction) + " " + px(y + 4),
                    "fill=\"none\" " + stroke);
      } else {
        canvas.line(at, y - 5, at, y + 5, stroke);
      }
    };
    end(a, open_low, -1);
    end(b, open_high, 1);
  }
  if (x.shows(row.value)) canvas.circle(x.pixel(row.value), y, 4.5, "fill=\"" + colour + "\"");
  if (row.truth && x.shows(*row.truth)) {
    const double at = x.pixel(*row.truth);
    canvas.path("M" + px(at) + " " + px(y - 6) + "l5 6l-5 6l-5 -6z",
                "fill=\"#fff\" stroke=\"" + truth + "\" stroke-width=\"1.8\"");
  }
}

}  // namespace

std::string svg(const IntervalPlot& plot) {
  std::vector<double> values;
  double label_width = 0, note_width = 0;
  bool any_truth = false;
  for (const PlotInterval& row : plot.rows) {
    values.insert(values.end(), {row.value, row.low, row.high});
    if (row.truth) values.push_back(*row.truth);
    any_truth = any_truth || row.truth;
    label_width = std::max(label_width, estimated_width(row.label));
    note_width = std::max(note_width, estimated_width(row.note));
  }
  if (plot.reference) values.push_back(*plot.reference);
  const double top = (plot.title.empty() ? 10 : 32) + (any_truth ? 20 : 0);
  const int height = static_cast<int>(top + row_height * std::max<size_t>(1, plot.rows.size()) + 46);
  SvgCanvas canvas(plot.width, height, plot.title);
  const PlotBox box{std::min(24 + label_width, 0.5 * plot.width), top,
                    plot.width - 18 - (note_width > 0 ? note_width + 10 : 0), height - 46.0};
  require(box.right - box.left >= 40, "plot: labels leave no room for the intervals");
  const PlotScale x(plot.axis, values, box.left, box.right, 0.06);
  canvas.frame(box, &x, plot.axis, nullptr, {});
  if (plot.reference && x.shows(*plot.reference)) {
    const double at = x.pixel(*plot.reference);
    canvas.line(at, box.top, at, box.bottom, "stroke=\"#777\" stroke-width=\"1.2\" stroke-dasharray=\"2 3\"");
  }
  if (!x.has_data()) canvas.no_data(box);
  if (any_truth) {
    const std::string blue = hex_colour(palette_colour(0)), orange = hex_colour(palette_colour(1));
    const double y = top - 12, first = box.left + 8,
                 second = first + 34 + estimated_width("estimate, interval");
    canvas.line(first - 6, y, first + 14, y, "stroke=\"" + blue + "\" stroke-width=\"2\"");
    canvas.circle(first + 4, y, 4.5, "fill=\"" + blue + "\"");
    canvas.text(first + 20, y + 4, "estimate, interval");
    canvas.path("M" + px(second) + " " + px(y - 6) + "l5 6l-5 6l-5 -6z",
                "fill=\"#fff\" stroke=\"" + orange + "\" stroke-width=\"1.8\"");
    canvas.text(second + 11, y + 4, plot.truth_label);
  }
  double y = box.top + 0.5 * row_height;
  for (const PlotInterval& row : plot.rows) {
    canvas.text(box.left - 10, y + 4, row.label, "end", "fill=\"#222\"");
    canvas.text(plot.width - 12, y + 4, row.note, "end", "fill=\"#444\"");
    draw_interval(canvas, row, x, box, y);
    y += row_height;
  }
  return canvas.finish();
}

std::string svg(const BarChart& plot) {
  const size_t count = plot.series.size();
  require(count > 0, "plot: a bar chart needs at least one series");
  std::vector<double> values;
  for (const BarGroup& group : plot.groups) {
    require(group.values.size() == count && (group.errors.empty() || group.errors.size() == count),
            "plot: a bar group needs one value per series");
    for (size_t i = 0; i < count; ++i) {
      values.push_back(group.values[i]);
      if (group.errors.empty()) continue;
      values.push_back(group.values[i] - group.errors[i]);
      values.push_back(group.values[i] + group.errors[i]);
    }
  }
  SvgCanvas canvas(plot.width, plot.height, plot.title);
  const bool legend = count > 1 || !plot.series[0].empty();
  PlotBox box{60, (plot.title.empty() ? 14.0 : 34.0) + (legend ? 20 : 0), plot.width - 16.0,
              plot.height - 34.0};
  const double slot =
      (box.right - box.left - 20) / static_cast<double>(std::max<size_t>(1, plot.groups.size()));
  double longest = 0;
  for (const BarGroup& group : plot.groups) longest = std::max(longest, estimated_width(group.label));
  const bool slanted = longest > slot - 4;  // labels that would touch are turned
  if (slanted) box.bottom -= std::min(0.5 * longest, 0.35 * plot.height) - 4;
  const PlotScale y(plot.y, values, box.bottom, box.top, 0.06, true);
  for (const auto& tick : y.ticks(45)) box.left = std::max(box.left, 34 + estimated_width(tick.label));
  canvas.frame(box, nullptr, {}, &y, plot.y);
  if (!y.has_data()) canvas.no_data(box);

  const double pitch = (box.right - box.left) / static_cast<double>(std::max<size_t>(1, plot.groups.size()));
  const double bar = std::min(0.76 * pitch / static_cast<double>(count), 48.0);
  const double base = y.clamped_pixel(0);
  for (size_t g = 0; g < plot.groups.size(); ++g) {
    const BarGroup& group = plot.groups[g];
    const double centre = box.left + (static_cast<double>(g) + 0.5) * pitch;
    for (size_t i = 0; i < count; ++i) {
      if (!y.drawable(group.values[i])) continue;
      const double x = centre + (static_cast<double>(i) - 0.5 * static_cast<double>(count)) * bar;
      const double tip = y.clamped_pixel(group.values[i]);
      canvas.rectangle(x + 0.5, std::min(tip, base), bar - 1, std::abs(tip - base),
                       "fill=\"" + hex_colour(palette_colour(i)) + "\"");
      if (group.errors.empty() || !std::isfinite(group.errors[i])) continue;
      const double a = y.clamped_pixel(group.values[i] - group.errors[i]);
      const double b = y.clamped_pixel(group.values[i] + group.errors[i]), mid = x + 0.5 * bar;
      for (const auto& [x0, y0, x1, y1] :
           {std::array{mid, a, mid, b}, {mid - 4, a, mid + 4, a}, {mid - 4, b, mid + 4, b}}) {
        canvas.line(x0, y0, x1, y1, "stroke=\"#222\" stroke-width=\"1.2\"");
      }
    }
    if (slanted) {
      canvas.text(centre + 4, box.bottom + 14, group.label, "end", "fill=\"#222\"", -30);
    } else {
      canvas.text(centre, box.bottom + 17, group.label, "middle", "fill=\"#222\"");
    }
  }
  canvas.line(box.left, base, box.right, base, "stroke=\"#444\"");
  double x = box.left;
  for (size_t i = 0; legend && i < count; ++i) {
    canvas.rectangle(x, box.top - 20, 11, 11, "fill=\"" + hex_colour(palette_colour(i)) + "\"");
    canvas.text(x + 16, box.top - 10, plot.series[i], "start", "fill=\"#222\"");
    x += 34 + estimated_width(plot.series[i]);
  }
  return canvas.finish();
}

}  // namespace rhytid
