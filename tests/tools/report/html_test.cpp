// The page builder escapes and nests; the wording says numbers as the interval allows.
#include "tools/report/html.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>

#include "sim/core/error.h"
#include "sim/output/plot.h"
#include "sim/output/text.h"
#include "tests/tools/report/html_checker.h"
#include "tools/report/wording.h"

namespace rhytid::tools {
namespace {

using ::testing::HasSubstr;
using ::testing::Not;

TEST(HtmlChecker, SeesWhatIsWrong) {
  const auto page = [](const std::string& body) { return "<!DOCTYPE html><html>" + body + "</html>"; };
  EXPECT_EQ(test::html_complaint(page("<p class=\"a\">x &amp; y</p>")), "");
  for (const char* wrong :
       {"<p>", "<p><b></p></b>", "a & b", "a < b", "a > b", "<p class=a></p>", "<script></script>",
        "<img src=\"picture.png\" alt=\"\">", "<img src=\"data:image/png;base64,\">",
        "<a href=\"page.html\">x</a>", "<p onclick=\"x\"></p>", "<style>@import \"x\";</style>",
        "<p id=\"a\" id=\"b\"></p>"}) {
    EXPECT_NE(test::html_complaint(page(wrong)), "") << wrong;
  }
}

TEST(HtmlPage, EscapesEverything) {
  const std::string evil = "<script>alert(\"x\" & 'y')</script>";
  HtmlPage page(evil, evil);
  page.section("a", evil);
  page.heading(evil);
  page.paragraph(evil);
  page.note(evil);
  page.badge(Verdict::bad, evil);
  page.list({evil});
  page.facts({{evil, evil}});
  page.code(evil);
  page.table({{evil, evil}, {{evil, TableCell(evil, {0, 0, 0})}}, evil});
  BarChart chart;
  chart.title = chart.y.label = evil;
  chart.series = {evil};
  chart.groups = {{evil, {1}, {}}};
  page.svg_figure(svg(chart), evil, evil);
  page.image_figure(png_uri(std::string("\0\1\2", 3)), 3, 2, evil, evil);
  page.section("b", "second");
  page.begin_row();
  page.end_row();
  const std::string html = page.finish();
  EXPECT_EQ(test::html_complaint(html), "");
  EXPECT_THAT(html, Not(HasSubstr("<script")));
  EXPECT_THAT(html, Not(HasSubstr("http")));
  EXPECT_THAT(html, HasSubstr("src=\"data:image/png;base64,AAEC\""));
  EXPECT_THAT(html, HasSubstr("<a href=\"#b\">second</a>"));
}

TEST(HtmlPage, TextOnColourCanBeRead) {
  HtmlPage page("t", "s");
  page.table({{"a", "b"}, {{TableCell("x", {0, 0, 90}), TableCell("y", {250, 250, 200})}}, ""});
  const std::string html = page.finish();
  EXPECT_THAT(html, HasSubstr("background:#00005a;color:#fff"));
  EXPECT_THAT(html, HasSubstr("background:#fafac8;color:#000"));
  EXPECT_THROW(page.table({{"a", "b"}, {{"only one"}}, ""}), ContractError);
}

TEST(HtmlPage, WhatIsWiderThanAPhoneScrollsByKeyboardTooAndSaysSo) {
  HtmlPage page("t", "s");
  page.table({{"a", "b"}, {{"x", "y"}}, "caption"});
  page.image_figure(png_uri(std::string("\0\1\2", 3)), 900, 2, "alt", "caption");
  const std::string html = page.finish();
  EXPECT_EQ(test::html_complaint(html), "");
  EXPECT_THAT(html, HasSubstr("class=\"scroll\" tabindex=\"0\" role=\"region\""));
  EXPECT_THAT(html, HasSubstr("<div class=\"look\"><img"));
  EXPECT_THAT(html, HasSubstr("Scroll sideways to see all."));
}

TEST(HtmlPage, ChartsThatFitAPhoneAndPicturesWithoutTextShrinkToIt) {
  HtmlPage page("t", "s");
  page.svg_figure("<svg width=\"460\" height=\"280\"></svg>", "small", "caption");
  page.svg_figure("<svg width=\"640\" height=\"280\"></svg>", "large", "caption");
  page.image_figure(png_uri(std::string("\0\1\2", 3)), 900, 2, "photograph", "caption", false);
  const std::string html = page.finish();
  EXPECT_EQ(test::html_complaint(html), "");
  EXPECT_THAT(html,
              HasSubstr("<div class=\"look whole\" style=\"--least:0px\" role=\"img\" aria-label=\"small\""));
  EXPECT_THAT(html,
              HasSubstr("<div class=\"look\" style=\"--least:461px\" role=\"img\" aria-label=\"large\""));
  EXPECT_THAT(html, HasSubstr("<div class=\"look whole\" style=\"--least:0px\"><img"));
}

TEST(Wording, UnitsThatReadWell) {
  const ReadableUnit unit = readable_unit(0.0123, "MPa");
  EXPECT_EQ(unit.unit, "kPa");
  EXPECT_DOUBLE_EQ(unit.scale, 1e-3);
  EXPECT_EQ(unit.text(0.012345, 3), "12.3 kPa");
  EXPECT_EQ(readable_unit(2, "").text(2.5, 3), "2.5");
  EXPECT_EQ(readable_unit(2, "1/mm").text(2.5, 3), "2.5 1/mm");
  EXPECT_EQ(readable_unit(0, "MPa").text(0, 3), "0 MPa");
  EXPECT_EQ(readable_unit(3, "parsec").text(3, 3), "3 parsec");  // unknown: as it is
}

TEST(Wording, DigitsFollowTheInterval) {
  EXPECT_EQ(digits_for(100, 90, 110), 3);  // ± 10: 100
  EXPECT_EQ(digits_for(1.2345, 1.2335, 1.2355), 6);
  EXPECT_EQ(digits_for(1, 0, INFINITY), 4);
  EXPECT_EQ(digits_for(0, -1, 1), 4);
  fitting::FittedParameter p;
  p.unit = "MPa";
  p.value = 1.0234, p.low95 = 0.9934, p.high95 = 1.0534;
  EXPECT_EQ(estimate_text(p), "1.023 MPa (95\u00a0% interval 0.9934 to 1.053 MPa)");
  p.value = 0.0204, p.low95 = 0.0194, p.high95 = 0.0214;
  EXPECT_EQ(estimate_text(p), "20.4 kPa (95\u00a0% interval 19.4 to 21.4 kPa)");
  p.determined = false;
  EXPECT_THAT(estimate_text(p), HasSubstr("not determined"));
  p.determined = true, p.high95 = INFINITY;
  EXPECT_THAT(estimate_text(p), HasSubstr("not determined"));
  EXPECT_EQ(truth_inside(1.0, 0.9, 1.1), true);
  EXPECT_EQ(truth_inside(1.2, 0.9, 1.1), false);
  EXPECT_FALSE(truth_inside(std::nullopt, 0.9, 1.1).has_value());
  EXPECT_FALSE(truth_inside(1.0, NAN, 1.1).has_value());
  EXPECT_EQ(counted(1, "frame"), "1 frame");
  EXPECT_EQ(counted(0, "frame"), "0 frames");
}

}  // namespace
}  // namespace rhytid::tools
