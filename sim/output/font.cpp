#include "sim/output/font.h"

#include <algorithm>
#include <cmath>
#include <vector>

#include "sim/output/font_glyphs.h"

namespace rhytid {

namespace {

constexpr int glyph_columns = 5, glyph_rows = 9, advance = 6;
constexpr Glyph hollow_box = {0x1F, 0x11, 0x11, 0x11, 0x11, 0x11, 0x1F, 0, 0};

/// Code points of UTF-8 text; a malformed byte becomes U+FFFD.
std::vector<char32_t> decoded(std::string_view text) {
  std::vector<char32_t> out;
  for (size_t i = 0; i < text.size();) {
    const auto lead = static_cast<unsigned char>(text[i]);
    const int extra = lead < 0x80 ? 0 : lead >> 5 == 6 ? 1 : lead >> 4 == 14 ? 2 : lead >> 3 == 30 ? 3 : -1;
    char32_t code = extra <= 0 ? lead : lead & (0x3F >> extra);
    bool good = extra >= 0 && i + extra < text.size();
    for (int k = 1; good && k <= extra; ++k) {
      const auto next = static_cast<unsigned char>(text[i + k]);
      good = next >> 6 == 2;
      code = code << 6 | (next & 0x3F);
    }
    out.push_back(good ? code : U'\uFFFD');
    i += good ? extra + 1 : 1;
  }
  return out;
}

double ink(const Glyph& bits, int column, int row) {
  if (column < 0 || row < 0 || column >= glyph_columns || row >= glyph_rows) return 0;
  return bits[row] >> (glyph_columns - 1 - column) & 1;
}

/// Bilinear interpolation of the bitmap at (x, y) in glyph pixels, centres at half-integers.
double smooth_ink(const Glyph& bits, double x, double y) {
  const double cx = x - 0.5, cy = y - 0.5;
  const int i = static_cast<int>(std::floor(cx)), j = static_cast<int>(std::floor(cy));
  const double fx = cx - i, fy = cy - j;
  return (1 - fy) * ((1 - fx) * ink(bits, i, j) + fx * ink(bits, i + 1, j)) +
         fy * ((1 - fx) * ink(bits, i, j + 1) + fx * ink(bits, i + 1, j + 1));
}

void draw_glyph(Image& image, double left, double top, const Glyph& bits, double scale, Rgb colour) {
  const int x0 = static_cast<int>(std::floor(left - scale)), y0 = static_cast<int>(std::floor(top - scale));
  const int x1 = static_cast<int>(std::ceil(left + (glyph_columns + 1) * scale));
  const int y1 = static_cast<int>(std::ceil(top + (glyph_rows + 1) * scale));
  for (int y = y0; y < y1; ++y) {
    for (int x = x0; x < x1; ++x) {
      const double value = smooth_ink(bits, (x + 0.5 - left) / scale, (y + 0.5 - top) / scale);
      // A contour somewhat below one half rounds stair-steps and keeps diagonal strokes connected; the ramp
      // is one picture pixel wide.
      image.blend(x, y, colour, std::clamp((value - 0.36) * scale + 0.5, 0.0, 1.0));
    }
  }
}

}  // namespace

const Glyph& glyph(char32_t code_point) {
  if (code_point >= 32 && code_point < 127) return ascii_glyphs[code_point - 32];
  for (const auto& [code, bits] : other_glyphs) {
    if (code == code_point) return bits;
  }
  return hollow_box;
}

double text_width(std::string_view text, double scale) {
  const size_t count = decoded(text).size();
  return count == 0 ? 0.0 : (static_cast<double>(count) * advance - 1) * scale;
}

void draw_text(Image& image, double x, double y, std::string_view text, double scale, Rgb colour,
               TextAnchor anchor) {
  const double width = text_width(text, scale);
  double pen = anchor == TextAnchor::left ? x : anchor == TextAnchor::centre ? x - 0.5 * width : x - width;
  for (const char32_t code : decoded(text)) {
    draw_glyph(image, pen, y, glyph(code), scale, colour);
    pen += advance * scale;
  }
}

}  // namespace rhytid
