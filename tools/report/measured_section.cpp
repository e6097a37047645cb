#include <map>
#include <utility>

#include "fitting/measured_unit.h"
#include "sim/output/plot.h"
#include "tools/report/sections.h"

namespace rhytid::tools {

void add_measured(HtmlPage& page, const ReportData& data) {
  using fitting::FittedMeasurement;
  if (data.fit.measured.empty()) return;
  page.section("measured", "Measured besides the tracks");
  std::map<std::pair<int, std::string>, std::vector<const FittedMeasurement*>> quantities;
  for (const FittedMeasurement& m : data.fit.measured) quantities[{m.clip, m.quantity}].push_back(&m);
  page.begin_row();
  for (const auto& [key, list] : quantities) {
    const auto& [clip, quantity] = key;
    const std::string of_clip =
        data.fit.clips.empty() ? "" : " of clip " + data.fit.clips[static_cast<std::size_t>(clip)].name;
    LinePlot plot;
    plot.width = 460, plot.height = 280;
    plot.x.label = "frame";
    plot.y.label = quantity + " [" + fitting::measured_unit(quantity) + "]";
    PlotSeries measured, predicted;
    measured.label = "measured ± 1 deviation", predicted.label = "predicted";
    measured.style = PlotStyle::points, predicted.style = PlotStyle::line_and_points;
    for (const FittedMeasurement* m : list) {
      measured.x.push_back(m->frame), measured.y.push_back(m->value), measured.error.push_back(m->sigma);
      predicted.x.push_back(m->frame), predicted.y.push_back(m->predicted);
    }
    plot.series = {measured, predicted};
    page.svg_figure(svg(plot), quantity + of_clip + ": measured and predicted by frame.",
                    quantity + of_clip + ".");
  }
  page.end_row();
}

}  // namespace rhytid::tools
