#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <regex>

#include "sim/core/error.h"
#include "sim/output/plot.h"
#include "sim/output/plot_canvas.h"

namespace rhytid {
namespace {

using ::testing::HasSubstr;
using ::testing::Not;

size_t count_of(const std::string& text, const std::string& part) {
  size_t count = 0;
  for (size_t at = text.find(part); at != std::string::npos; at = text.find(part, at + 1)) ++count;
  return count;
}

/// Every opened element is closed, in order, and every attribute is quoted: enough to catch broken output.
void expect_well_formed(const std::string& text) {
  std::vector<std::string> open;
  const std::regex tag(R"(<(/?)([a-z]+)((?:\s+[a-zA-Z0-9-]+="[^"<>]*")*)\s*(/?)>)");
  std::string rest;
  auto at = text.cbegin();
  for (std::sregex_iterator i(text.begin(), text.end(), tag), end; i != end; ++i) {
    rest += std::string(at, text.cbegin() + i->position());
    at = text.cbegin() + i->position() + i->length();
    if ((*i)[1].length() > 0) {
      ASSERT_FALSE(open.empty());
      EXPECT_EQ(open.back(), (*i)[2].str());
      open.pop_back();
    } else if ((*i)[4].length() == 0) {
      open.push_back((*i)[2].str());
    }
  }
  EXPECT_TRUE(open.empty());
  EXPECT_THAT(rest, Not(HasSubstr("<"))) << "a tag that is not well formed";
  EXPECT_THAT(text, Not(HasSubstr("nan")));
  EXPECT_THAT(text, Not(HasSubstr("inf")));
}

TEST(PlotScale, LinearAndLogarithmicPositions) {
  PlotAxis axis;
  axis.minimum = 2, axis.maximum = 12;
  const PlotScale linear(axis, {}, 100, 300, 0);
  EXPECT_DOUBLE_EQ(linear.pixel(7), 200);
  EXPECT_FALSE(linear.shows(12.1));
  axis.logarithmic = true;
  axis.minimum = 0.01, axis.maximum = 100;
  const PlotScale logarithmic(axis, {}, 400, 0, 0);
  EXPECT_DOUBLE_EQ(logarithmic.pixel(1), 200);
  EXPECT_DOUBLE_EQ(logarithmic.pixel(10), 100);
  EXPECT_FALSE(logarithmic.shows(0));
  std::vector<std::string> labels;
  for (const auto& tick : logarithmic.ticks(50)) {
    if (!tick.label.empty()) labels.push_back(tick.label);
  }
  EXPECT_THAT(labels, ::testing::ElementsAre("0.01", "0.1", "1", "10", "100"));
  axis.minimum = -1;
  EXPECT_THROW(PlotScale(axis, {}, 0, 1, 0), ContractError);
}

TEST(LinePlotSvg, DrawsSeriesErrorsRulesAndEscapesText) {
  LinePlot plot;
  plot.title = "a < b & \"c\"";
  plot.x.label = "time [s]";
  plot.y.label = "force [N]";
  plot.series.push_back({"model", {0, 1, 2, 3}, {0, 1, std::nan(""), 2}, {}, PlotStyle::line, true, {}});
  plot.series.push_back(
      {"data", {0, 1, 2}, {0.1, 1.1, 1.5}, {0.1, 0.1, 0.1}, PlotStyle::points, false, Rgb{1, 2, 3}});
  plot.rules.push_back({false, 1.2, "limit"});
  const std::string text = svg(plot);
  expect_well_formed(text);
  EXPECT_THAT(text, HasSubstr("a &lt; b &amp; &quot;c&quot;"));
  EXPECT_EQ(count_of(text, "<circle"), 4u) << "three points and one legend entry";
  EXPECT_THAT(text, HasSubstr("#010203"));
  EXPECT_EQ(count_of(text, "<path"), 1u);
  EXPECT_THAT(text, HasSubstr("stroke-dasharray=\"6 4\""));
  EXPECT_THAT(text, HasSubstr(">limit</text>"));
  // The gap: one segment only, 0 → 1.
  std::smatch path;
  ASSERT_TRUE(std::regex_search(text, path, std::regex("<path d=\"([^\"]*)\"")));
  EXPECT_EQ(count_of(path[1], "L"), 1u) << path[1];
}

TEST(LinePlotSvg, NamesPointsWhereTheyAreDrawn) {
  LinePlot plot;
  plot.y.logarithmic = true;
  plot.series.push_back(
      {"", {1, 2, 3}, {1, 0, 10}, {}, PlotStyle::points, false, Rgb{1, 2, 3}, {"one", "none", "<ten>"}});
  const std::string text = svg(plot);
  expect_well_formed(text);
  EXPECT_THAT(text, HasSubstr(">one</text>"));
  EXPECT_THAT(text, HasSubstr(">&lt;ten&gt;</text>"));
  EXPECT_EQ(count_of(text, ">none</text>"), 0u) << "no logarithm, no point, no name";
  plot.series[0].names.pop_back();
  EXPECT_THROW((void)svg(plot), ContractError);
}

TEST(LinePlotSvg, CutsLinesAtTheBox) {
  LinePlot plot;
  plot.y.minimum = 0, plot.y.maximum = 1;
  plot.series.push_back({"", {0, 1, 2}, {0.5, 1e6, 0.5}, {}, PlotStyle::line, false, {}});
  const std::string text = svg(plot);
  std::smatch path;
  ASSERT_TRUE(std::regex_search(text, path, std::regex("<path d=\"([^\"]*)\"")));
  const std::string data = path[1];
  const std::regex point("[ML](-?[0-9.]+) (-?[0-9.]+)");
  for (std::sregex_iterator i(data.begin(), data.end(), point), end; i != end; ++i) {
    const double y = std::stod((*i)[2]);
    EXPECT_TRUE(y >= 13.9 && y <= 354.1) << y;
  }
  EXPECT_EQ(count_of(data, "M"), 2u) << "up and out, and in again";
}

TEST(LinePlotSvg, EmptyAndDegenerateDataSayNoData) {
  LinePlot plot;
  EXPECT_THAT(svg(plot), HasSubstr("no data"));
  plot.y.logarithmic = true;
  plot.series.push_back({"x", {1, 2}, {-1, 0}, {}, PlotStyle::line_and_points, false, {}});
  EXPECT_THAT(svg(plot), HasSubstr("no data"));
  plot.series[0].y = {3, 3};
  EXPECT_THAT(svg(plot), Not(HasSubstr("no data")));
  expect_well_formed(svg(plot));
  plot.series[0].y.pop_back();
  EXPECT_THROW(svg(plot), ContractError);
  plot.series.clear();
  plot.x.minimum = 3, plot.x.maximum = 3;
  EXPECT_THROW(svg(plot), ContractError);
}

TEST(IntervalPlotSvg, DrawsRowsTruthAndOpenEnds) {
  const double inf = std::numeric_limits<double>::infinity();
  IntervalPlot plot;
  plot.title = "fit / truth";
  plot.axis.logarithmic = true;
  plot.reference = 1;
  plot.rows = {{"E soft", 1.1, 0.9, 1.3, 1.0, "20.1 kPa"}, {"tau", 0.7, 0, inf, {}, "not determined"}};
  const std::string text = svg(plot);
  expect_well_formed(text);
  EXPECT_THAT(text, HasSubstr(">E soft</text>"));
  EXPECT_THAT(text, HasSubstr(">not determined</text>"));
  EXPECT_EQ(count_of(text, "<circle"), 3u);
  // Diamonds: one in the row, one in the legend; arrows: both ends of the second row.
  EXPECT_EQ(count_of(text, "<path"), 4u);
}

TEST(BarChartSvg, BarsStandOnZeroAndMayBeNegative) {
  BarChart chart;
  chart.series = {"ours", "baseline"};
  chart.groups = {{"sheet", {2, 4}, {0.1, 0.2}}, {"sphere", {-1, std::nan("")}, {}}};
  const std::string text = svg(chart);
  expect_well_formed(text);
  // Bars: 2 + 1, legend 2, background 1.
  EXPECT_EQ(count_of(text, "<rect"), 6u);
  std::vector<double> heights;
  const std::regex bar(
      "<rect x=\"[^\"]*\" y=\"[^\"]*\" width=\"[^\"]*\" height=\"([^\"]*)\" fill=\"#(0072b2|d55e00)\"");
  for (std::sregex_iterator i(text.begin(), text.end(), bar), end; i != end; ++i)
    heights.push_back(std::stod((*i)[1]));
  ASSERT_EQ(heights.size(), 5u);
  EXPECT_NEAR(heights[1] / heights[0], 2, 1e-3);
  EXPECT_NEAR(heights[2] / heights[0], 0.5, 1e-3);
  chart.groups[0].values.pop_back();
  EXPECT_THROW(svg(chart), ContractError);
}

}  // namespace
}  // namespace rhytid
