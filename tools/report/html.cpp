#include "tools/report/html.h"

#include <cstdlib>

#include "sim/core/error.h"
#include "sim/output/colour_map.h"
#include "sim/output/text.h"

namespace rhytid::tools {
namespace {

constexpr const char* style = R"(
:root{color-scheme:light dark;--page:#f6f6f4;--card:#fff;--ink:#1d1f23;--soft:#5c6068;--line:#dcdcd8;--edge:#0003;--accent:#0a5c99;
--good:#0b6b4b;--doubtful:#8a5a00;--bad:#a4262c}
@media(prefers-color-scheme:dark){:root{--page:#17191c;--card:#212429;--ink:#e9eaec;--soft:#a4a9b2;--line:#383c43;--edge:#000a;
--accent:#7cc0f2;--good:#5fd1a5;--doubtful:#e8b45a;--bad:#ff9a94}}
*{box-sizing:border-box}
html{-webkit-text-size-adjust:100%;text-size-adjust:100%}
body{margin:0;background:var(--page);color:var(--ink);font:16px/1.55 system-ui,-apple-system,"Segoe UI",Roboto,
Helvetica,Arial,sans-serif}
main,header,nav{max-width:1120px;margin:0 auto;padding:0 20px}
header{padding-top:32px}
h1{font-size:1.75rem;line-height:1.2;margin:0 0 4px}
h2{font-size:1.25rem;line-height:1.3;margin:0 0 12px}
h3{font-size:1.02rem;margin:22px 0 8px}
p{margin:0 0 12px;max-width:75ch;overflow-wrap:anywhere}
ul{margin:0 0 12px;padding-left:1.3em}
li{margin-bottom:5px;max-width:75ch;overflow-wrap:anywhere}
a{color:var(--accent)}
.sub,.note{color:var(--soft);font-size:.92rem}
nav ul{list-style:none;display:flex;flex-wrap:wrap;gap:4px 18px;padding:0;margin:14px 0 18px;font-size:.92rem}
nav li{margin:0}
section{background:var(--card);border:1px solid var(--line);border-radius:10px;padding:22px;margin:0 0 18px}
.badge{display:inline-block;border:1.5px solid;border-radius:999px;padding:2px 12px;font-size:.9rem;font-weight:600;
margin:0 0 12px}
.good{color:var(--good)}.doubtful{color:var(--doubtful)}.bad{color:var(--bad)}
:focus-visible{outline:2px solid var(--accent);outline-offset:2px}
.scroll{overflow-x:auto;margin:0 0 14px;background:linear-gradient(90deg,var(--card) 30%,transparent) 0 0/48px 100%,
linear-gradient(270deg,var(--card) 30%,transparent) 100% 0/48px 100%,linear-gradient(90deg,var(--edge),transparent) 0 0/16px
100%,linear-gradient(270deg,var(--edge),transparent) 100% 0/16px 100%;background-repeat:no-repeat;
background-attachment:local,local,scroll,scroll}
tbody th{position:sticky;left:0;background:var(--card)}
table{border-collapse:collapse;font-size:.92rem;font-variant-numeric:tabular-nums;min-width:min(100%,420px)}
.caption{color:var(--soft);margin:0 0 4px;font-size:.9rem}
th,td{padding:6px 12px 6px 0;border-bottom:1px solid var(--line);text-align:right;vertical-align:top}
th{font-weight:600}thead th{vertical-align:bottom}
tbody td:not(.t){white-space:nowrap}.t{text-align:left}.wide td,.wide th{white-space:nowrap}
td.c{padding:6px 8px;text-align:center;border:1px solid var(--card)}
dl{display:grid;grid-template-columns:max-content 1fr;gap:4px 18px;margin:0 0 12px;font-size:.95rem}
dt{color:var(--soft)}dd{margin:0;overflow-wrap:anywhere}
pre{overflow-x:auto;background:var(--page);border:1px solid var(--line);border-radius:6px;padding:10px 12px;
font:.86rem/1.5 ui-monospace,SFMono-Regular,Menlo,Consolas,monospace;margin:0 0 12px}
figure{margin:0 0 16px;min-width:0}
figcaption{color:var(--soft);font-size:.9rem;margin-top:6px;max-width:75ch}
figure img,figure svg{display:block;width:100%;height:auto;border-radius:6px;background:#fff}
figure svg{max-width:640px}
.row{display:grid;grid-template-columns:repeat(auto-fit,minmax(min(100%,400px),1fr));gap:6px 22px;align-items:start}
@media(max-width:560px){main,header,nav{padding:0 12px}header{padding-top:20px}section{padding:16px 14px}
.look{overflow-x:auto}.look svg,.look img{min-width:var(--least,600px)}
.look+figcaption::before{content:"Scroll sideways to see all. "}.whole+figcaption::before{content:none}
h1{font-size:1.4rem}dl{grid-template-columns:1fr;gap:0}dd{margin-bottom:8px}th,td{padding-right:9px}}
@media print{:root{color-scheme:light;--page:#fff;--card:#fff;--ink:#000;--soft:#444;--line:#bbb}nav{display:none}
body{font-size:10.5pt}section{border:0;padding:0}figure,tr,pre{break-inside:avoid}h2,h3{break-after:avoid}
.scroll,.look,pre{overflow:visible;background:none}pre{white-space:pre-wrap}td{print-color-adjust:exact;-webkit-print-color-adjust:exact}}
)";

/// In HTML an inline <svg> needs no name space, and its own <title> would say the alt text a second time.
std::string inline_svg(std::string svg) {
  const auto cut = [&svg](const std::string& from, const std::string& to, bool with_end) {
    const size_t begin = svg.find(from);
    if (begin == std::string::npos) return;
    const size_t end = svg.find(to, begin + from.size());
    if (end != std::string::npos) svg.erase(begin, end - begin + (with_end ? to.size() : 0));
  };
  cut(" xmlns=\"", "\"", true);
  cut(" role=\"", "\"", true);
  cut("<title>", "</title>", true);
  return svg;
}

/// Of an <svg>, px; 600 where it does not say.
double drawn_width(const std::string& svg) {
  const std::string key = " width=\"";
  const size_t at = svg.find(key);
  const double width = at == std::string::npos ? 0 : std::strtod(svg.c_str() + at + key.size(), nullptr);
  return width > 0 ? width : 600;
}

}  // namespace

std::string png_uri(const std::string& png_bytes) {
  return "data:image/png;base64," + base64(png_bytes);
}
std::string jpeg_uri(const std::string& jpeg_bytes) {
  return "data:image/jpeg;base64," + base64(jpeg_bytes);
}

HtmlPage::HtmlPage(const std::string& title, const std::string& subtitle)
    : title_(title), subtitle_(subtitle) {}

void HtmlPage::section(const std::string& id, const std::string& heading) {
  if (in_section_) body_ += "</section>\n";
  in_section_ = true;
  navigation_ += "<li><a href=\"#" + xml_escaped(id) + "\">" + xml_escaped(heading) + "</a></li>\n";
  body_ += "<section id=\"" + xml_escaped(id) + "\">\n<h2>" + xml_escaped(heading) + "</h2>\n";
}

void HtmlPage::heading(const std::string& text) {
  body_ += "<h3>" + xml_escaped(text) + "</h3>\n";
}
void HtmlPage::paragraph(const std::string& text) {
  body_ += "<p>" + xml_escaped(text) + "</p>\n";
}
void HtmlPage::note(const std::string& text) {
  body_ += "<p class=\"note\">" + xml_escaped(text) + "</p>\n";
}
void HtmlPage::badge(Verdict verdict, const std::string& text) {
  const char* kind = verdict == Verdict::good ? "good" : verdict == Verdict::bad ? "bad" : "doubtful";
  body_ += "<p class=\"badge " + std::string(kind) + "\">" + xml_escaped(text) + "</p>\n";
}

void HtmlPage::list(const std::vector<std::string>& items) {
  if (items.empty()) return;
  body_ += "<ul>\n";
  for (const std::string& item : items) body_ += "<li>" + xml_escaped(item) + "</li>\n";
  body_ += "</ul>\n";
}

void HtmlPage::facts(const std::vector<std::pair<std::string, std::string>>& facts) {
  body_ += "<dl>\n";
  for (const auto& [term, description] : facts) {
    body_ += "<dt>" + xml_escaped(term) + "</dt><dd>" + xml_escaped(description) + "</dd>\n";
  }
  body_ += "</dl>\n";
}

void HtmlPage::table(const HtmlTable& table) {
  const std::string id = "table-" + std::to_string(++num_tables_);
  body_ += "<div><p class=\"caption\" id=\"" + id + "\">" + xml_escaped(table.caption) + "</p>\n";
  body_ += "<div class=\"scroll\" tabindex=\"0\" role=\"region\" aria-labelledby=\"" + id +
           "\"><table aria-labelledby=\"" + id + "\"";
  if (table.wide) body_ += " class=\"wide\"";
  body_ += ">\n<thead><tr>";
  for (size_t i = 0; i < table.header.size(); ++i) {
    const bool text = static_cast<int>(i) < table.text_columns;
    body_ += std::string("<th scope=\"col\"") + (text ? " class=\"t\">" : ">") +
             xml_escaped(table.header[i]) + "</th>";
  }
  body_ += "</tr></thead>\n<tbody>\n";
  for (const auto& row : table.rows) {
    require(row.size() == table.header.size(), "HtmlPage::table: a row needs one cell per column");
    body_ += "<tr>";
    for (size_t i = 0; i < row.size(); ++i) {
      const TableCell& cell = row[i];
      const bool text = static_cast<int>(i) < table.text_columns;
      const std::string kind = i == 0 ? "th scope=\"row\"" : "td";
      body_ += "<" + kind;
      if (cell.background) {
        body_ += " class=\"c\" style=\"background:" + hex_colour(*cell.background) +
                 (lightness(*cell.background) > 0.6 ? ";color:#000\"" : ";color:#fff\"");
      } else if (text) {
        body_ += " class=\"t\"";
      }
      const std::string content = xml_escaped(cell.text);
      body_ +=
          ">" + (cell.strong ? "<strong>" + content + "</strong>" : content) + (i == 0 ? "</th>" : "</td>");
    }
    body_ += "</tr>\n";
  }
  body_ += "</tbody></table></div></div>\n";
}

void HtmlPage::code(const std::string& text) {
  body_ += "<pre>" + xml_escaped(text) + "</pre>\n";
}

void HtmlPage::svg_figure(const std::string& svg, const std::string& alt, const std::string& caption) {
  // At 0.72 of what was drawn a chart can still be read (text of 9 px); smaller ones then fit a telephone.
  constexpr double kLeast = 0.72, kTelephone = 335;
  const double least = kLeast * drawn_width(svg);
  body_ += std::string("<figure><div class=\"look") + (least <= kTelephone ? " whole" : "") +
           "\" style=\"--least:" + (least <= kTelephone ? "0" : fixed_text(least, 0)) +
           "px\" role=\"img\" aria-label=\"" + xml_escaped(alt) + "\">" + inline_svg(svg) +
           "</div>\n<figcaption>" + xml_escaped(caption) + "</figcaption></figure>\n";
}

void HtmlPage::image_figure(const std::string& data_uri, int width, int height, const std::string& alt,
                            const std::string& caption, bool has_text) {
  body_ += std::string("<figure><div class=\"look") + (has_text ? "\"" : " whole\" style=\"--least:0px\"") +
           "><img src=\"" + xml_escaped(data_uri) + "\" width=\"" + std::to_string(width) + "\" height=\"" +
           std::to_string(height) + "\" alt=\"" + xml_escaped(alt) + "\"></div>\n<figcaption>" +
           xml_escaped(caption) + "</figcaption></figure>\n";
}

void HtmlPage::begin_row() {
  body_ += "<div class=\"row\">\n";
}
void HtmlPage::end_row() {
  body_ += "</div>\n";
}

std::string HtmlPage::finish() {
  if (in_section_) body_ += "</section>\n";
  in_section_ = false;
  return "<!DOCTYPE html>\n<html lang=\"en\">\n<head>\n<meta charset=\"utf-8\">\n"
         "<meta name=\"viewport\" content=\"width=device-width, initial-scale=1\">\n<title>" +
         xml_escaped(title_) + "</title>\n<style>" + style + "</style>\n</head>\n<body>\n<header>\n<h1>" +
         xml_escaped(title_) + "</h1>\n<p class=\"sub\">" + xml_escaped(subtitle_) +
         "</p>\n</header>\n<nav aria-label=\"Sections\"><ul>\n" + navigation_ + "</ul></nav>\n<main>\n" +
         body_ + "</main>\n</body>\n</html>\n";
}

}  // namespace rhytid::tools
