// A self-contained HTML page: sections, tables, figures. All text is escaped here and nowhere else, nothing
// is loaded from outside, and the page reads on a phone, in the dark and on paper.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "sim/output/image.h"

namespace rhytid::tools {

struct TableCell {
  std::string text;
  std::optional<Rgb> background;  ///< text is then black or white, whichever reads better
  bool strong = false;
  TableCell(std::string t) : text(std::move(t)) {}
  TableCell(const char* t) : text(t) {}
  TableCell(std::string t, Rgb colour) : text(std::move(t)), background(colour) {}
};

struct HtmlTable {
  std::vector<std::string> header;
  std::vector<std::vector<TableCell>> rows;  ///< as many cells as the header
  std::string caption;                       ///< says what the table is, also to screen readers
  int text_columns = 1;                      ///< the first ones are text (left), the others numbers (right)
  bool wide = false;                         ///< cells do not wrap; scrolls sideways on a narrow screen
};

/// A picture as a data URI.
std::string png_uri(const std::string& png_bytes);
std::string jpeg_uri(const std::string& jpeg_bytes);

enum class Verdict { good, doubtful, bad };

class HtmlPage {
 public:
  /// `title` is the page's title and its heading.
  HtmlPage(const std::string& title, const std::string& subtitle);

  /// Begins a section; `id` is its anchor (letters and -).
  void section(const std::string& id, const std::string& heading);
  void heading(const std::string& text);  ///< below a section's
  void paragraph(const std::string& text);
  void note(const std::string& text);  ///< a small grey paragraph
  void badge(Verdict verdict, const std::string& text);
  void list(const std::vector<std::string>& items);
  /// Term and description, one pair a line.
  void facts(const std::vector<std::pair<std::string, std::string>>& facts);
  /// Throws ContractError unless every row is as long as the header.
  void table(const HtmlTable& table);
  /// Preformatted text, e.g. a command line.
  void code(const std::string& text);
  /// One figure: the caption is shown, `alt` says the same to those who cannot see the picture. On a narrow screen it
  /// scrolls sideways rather than shrink until its text cannot be read; without text it shrinks.
  void svg_figure(const std::string& svg, const std::string& alt, const std::string& caption);
  void image_figure(const std::string& data_uri, int width, int height, const std::string& alt,
                    const std::string& caption, bool has_text = true);
  /// Figures between these two stand beside each other where there is room.
  void begin_row();
  void end_row();

  /// The whole page. Call once, at the end.
  std::string finish();

 private:
  std::string body_, navigation_, title_, subtitle_;
  bool in_section_ = false;
  int num_tables_ = 0;
};

}  // namespace rhytid::tools
