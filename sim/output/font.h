// Text in pictures: a built-in 5 × 7 pixel face (two more rows for descenders), drawn smoothly at any size.
#pragma once

#include <array>
#include <cstdint>
#include <string_view>

#include "sim/output/image.h"

namespace rhytid {

/// Rows from the top; bit 4 is the leftmost of 5 columns. Rows 7 and 8 hang below the base line.
using Glyph = std::array<std::uint8_t, 9>;

/// Glyph of a Unicode code point: printable ASCII and µ ² ³ ° × · − – ε κ; anything else is a hollow box.
const Glyph& glyph(char32_t code_point);

/// Width in pixels of UTF-8 text whose glyph pixels are `scale` pixels wide (advance 6 · scale).
double text_width(std::string_view text, double scale);

enum class TextAnchor { left, centre, right };

/// Draws UTF-8 text with the top of its capitals at y (capitals are 7 · scale high), smoothed edges.
void draw_text(Image& image, double x, double y, std::string_view text, double scale, Rgb colour,
               TextAnchor anchor = TextAnchor::left);

}  // namespace rhytid
