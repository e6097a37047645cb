#include <algorithm>
#include <cmath>
#include <map>
#include <opencv2/imgproc.hpp>

#include "sim/output/plot.h"
#include "sim/output/text.h"
#include "tools/report/sections.h"
#include "tools/report/wording.h"

namespace rhytid::tools {
namespace {

using fitting::FitResidual;

const cv::Scalar observed_colour(233, 180, 86), predicted_colour(0, 94, 213),
    arrow_colour(60, 240, 250);  // BGR

double length(const FitResidual& r) {
  return std::hypot(r.x_px - r.predicted_x_px, r.y_px - r.predicted_y_px);
}

/// The roundest factor that brings the 95 % quantile of the arrows to at most a twentieth of the picture.
double magnification(const std::vector<FitResidual>& residuals, double picture_width) {
  std::vector<double> lengths;
  for (const FitResidual& r : residuals) {
    if (std::isfinite(length(r))) lengths.push_back(length(r));
  }
  if (lengths.empty()) return 1;
  const auto quantile =
      lengths.begin() + static_cast<std::ptrdiff_t>(0.95 * static_cast<double>(lengths.size() - 1));
  std::nth_element(lengths.begin(), quantile, lengths.end());
  const double wanted = picture_width / 20 / std::max(*quantile, 1e-6);
  double factor = 1;
  for (const double candidate : {2., 5., 10., 20., 50., 100., 200., 500., 1000.}) {
    if (candidate <= wanted) factor = candidate;
  }
  return factor;
}

/// Marks on a picture `scale` times the footage. Coordinates have pixel centres at whole numbers.
void draw_marks(cv::Mat& picture, const std::vector<FitResidual>& residuals, double scale, double factor) {
  constexpr int shift = 4;  // OpenCV draws at sixteenths of a pixel
  const auto at = [scale](double x, double y) {
    const double units = 1 << shift;
    return cv::Point(static_cast<int>(std::lround(((x + 0.5) * scale - 0.5) * units)),
                     static_cast<int>(std::lround(((y + 0.5) * scale - 0.5) * units)));
  };
  const int radius = static_cast<int>(4 * (1 << shift));
  for (const FitResidual& r : residuals) {
    cv::circle(picture, at(r.x_px, r.y_px), radius, {20, 20, 20}, 3, cv::LINE_AA, shift);
    cv::circle(picture, at(r.x_px, r.y_px), radius, observed_colour, 1, cv::LINE_AA, shift);
  }
  for (const FitResidual& r : residuals) {
    if (!std::isfinite(length(r))) continue;
    const cv::Point from = at(r.predicted_x_px, r.predicted_y_px);
    const cv::Point to = at(r.predicted_x_px + factor * (r.x_px - r.predicted_x_px),
                            r.predicted_y_px + factor * (r.y_px - r.predicted_y_px));
    cv::line(picture, from, to, {20, 20, 20}, 3, cv::LINE_AA, shift);
    cv::line(picture, from, to, arrow_colour, 1, cv::LINE_AA, shift);
    cv::circle(picture, from, 2 << shift, predicted_colour, cv::FILLED, cv::LINE_AA, shift);
  }
}

/// The frame, or grey paper around the marks when there is no footage.
cv::Mat background(const SeenClip& data, int frame, bool& is_footage) {
  const auto found = footage_frame(data.footage, frame);
  is_footage = found.has_value();
  if (found) return *found;
  double width = 64, height = 48;
  for (const FitResidual& r : data.residuals) {
    width = std::max(width, r.x_px + 20);
    height = std::max(height, r.y_px + 20);
  }
  if (data.camera) width = data.camera->width, height = data.camera->height;
  const auto side = [](double x) { return static_cast<int>(std::clamp(x, 64., 4096.)); };
  return {side(height), side(width), CV_8UC3, cv::Scalar(90, 90, 90)};
}

void add_overlay(HtmlPage& page, const SeenClip& data, int frame) {
  std::vector<FitResidual> shown;
  for (const FitResidual& r : data.residuals) {
    if (r.frame == frame) shown.push_back(r);
  }
  bool is_footage = false;
  cv::Mat picture = background(data, frame, is_footage);
  const double scale = std::clamp(1000. / picture.cols, 0.25, 2.);
  cv::resize(picture, picture, {}, scale, scale, scale < 1 ? cv::INTER_AREA : cv::INTER_CUBIC);
  const double factor = magnification(shown, picture.cols / scale);
  draw_marks(picture, shown, scale, factor);
  page.image_figure(
      jpeg_uri(encode_jpeg(picture)), picture.cols, picture.rows,
      "Frame " + std::to_string(frame) + " with " + counted(static_cast<long>(shown.size()), "feature") +
          ", observed and predicted positions and residual arrows.",
      "Frame " + std::to_string(frame) + (is_footage ? "" : " (the footage could not be read)") +
          ". Blue rings: tracked features. Orange dots: where the fitted simulation puts them. Yellow lines: "
          "residual from prediction to observation, drawn " +
          short_text(factor) + " times its length.");
}

void add_frame_errors(HtmlPage& page, const SeenClip& data) {
  struct Sum {
    double squares = 0, weighted = 0, weights = 0;
    int count = 0;
  };
  std::map<int, Sum> frames;
  for (const FitResidual& r : data.residuals) {
    if (!std::isfinite(length(r))) continue;
    Sum& sum = frames[r.frame];
    sum.squares += length(r) * length(r);
    sum.weighted += r.weight * length(r) * length(r);
    sum.weights += r.weight;
    ++sum.count;
  }
  PlotSeries plain, robust;
  plain.style = robust.style = PlotStyle::line_and_points;
  robust.dashed = true;
  double worst = 0;
  int worst_frame = 0;
  for (const auto& [frame, sum] : frames) {
    const double rms = std::sqrt(sum.squares / sum.count);
    if (rms > worst) worst = rms, worst_frame = frame;
    plain.x.push_back(frame);
    plain.y.push_back(rms);
    robust.x.push_back(frame);
    robust.y.push_back(sum.weights > 0 ? std::sqrt(sum.weighted / sum.weights) : std::nan(""));
  }
  LinePlot plot;
  plot.width = 460;
  plot.height = 300;
  plot.x.label = "frame";
  plot.y.label = "rms residual [px]";
  plot.y.minimum = 0;
  if (worst > 0) plot.y.maximum = 1.25 * worst;
  plot.series = {plain};
  const bool weights_matter = std::any_of(data.residuals.begin(), data.residuals.end(),
                                          [](const FitResidual& r) { return r.weight < 0.999; });
  if (weights_matter) {
    plot.series[0].label = "all alike";
    robust.label = "robust weights";
    plot.series.push_back(robust);
  }
  page.svg_figure(svg(plot),
                  "Root mean square residual per frame; the largest is " + short_text(worst, 3) +
                      " px in frame " + std::to_string(worst_frame) + ".",
                  "Distance between observed and predicted features, root mean square over each frame.");
}

/// The tracks that fit worst: where to look first when a fit disappoints.
void add_worst_tracks(HtmlPage& page, const SeenClip& data) {
  struct Sum {
    double squares = 0, weight = 0, largest = 0;
    int count = 0;
  };
  std::map<int, Sum> tracks;
  for (const FitResidual& r : data.residuals) {
    if (!std::isfinite(length(r))) continue;
    Sum& sum = tracks[r.track];
    sum.squares += length(r) * length(r);
    sum.weight += r.weight;
    sum.largest = std::max(sum.largest, length(r));
    ++sum.count;
  }
  std::vector<std::pair<int, Sum>> order(tracks.begin(), tracks.end());
  std::stable_sort(order.begin(), order.end(), [](const auto& a, const auto& b) {
    return a.second.squares / a.second.count > b.second.squares / b.second.count;
  });
  HtmlTable table;
  table.caption =
      "The features that the simulation follows worst. A weight below 1 means that the robust loss "
      "trusts them less.";
  table.header = {"track", "rms [px]", "largest [px]", "frames", "mean weight"};
  for (size_t i = 0; i < std::min<size_t>(5, order.size()); ++i) {
    const auto& [track, sum] = order[i];
    table.rows.push_back({std::to_string(track), short_text(std::sqrt(sum.squares / sum.count), 3),
                          short_text(sum.largest, 3), std::to_string(sum.count),
                          short_text(sum.weight / sum.count, 3)});
  }
  page.table(table);
}

}  // namespace

void add_footage(HtmlPage& page, const ReportData& data) {
  page.section("footage", "Predicted against tracked features");
  for (const SeenClip& seen : data.seen) {
    if (!seen.title.empty()) page.heading("Clip " + seen.title);
    const int frame = seen.late_frame();
    if (frame < 0) {
      page.paragraph("The fit left no residuals.");
      continue;
    }
    add_overlay(page, seen, frame);
    page.begin_row();
    add_frame_errors(page, seen);
    add_worst_tracks(page, seen);
    page.end_row();
  }
}

}  // namespace rhytid::tools
