#include <algorithm>
#include <cmath>

#include "sim/core/error.h"
#include "sim/output/font.h"
#include "sim/output/picture.h"
#include "sim/output/text.h"

namespace rhytid {

void draw_colour_bar(Image& image, int x, int y, int width, int height, ColourMap map, double minimum,
                     double maximum, const std::string& label, double scale) {
  require(minimum < maximum && width > 0 && height > 1, "draw_colour_bar: empty range or box");
  constexpr Rgb ink{60, 60, 64};
  for (int row = 0; row < height; ++row) {
    image.fill(x, y + row, x + width, y + row + 1, map_colour(map, 1 - (row + 0.5) / height));
  }
  const int line = std::max(1, static_cast<int>(std::lround(0.5 * scale)));
  const std::vector<double> ticks =
      round_ticks(minimum, maximum, std::clamp(static_cast<int>(height / (22 * scale)), 2, 8));
  const double step =
      ticks.size() > 1 ? ticks[1] - ticks[0] : std::max(maximum - minimum, 1e-6 * std::abs(maximum));
  for (const double tick : ticks) {
    const double at = y + height * (1 - (tick - minimum) / (maximum - minimum));
    const int top = static_cast<int>(std::lround(at - 0.5 * line));
    image.fill(x + width, top, x + width + static_cast<int>(3 * scale), top + line, ink);
    draw_text(image, x + width + 5 * scale, at - 3.5 * scale, tick_text(tick, step), scale, ink);
  }
  // The label is right-aligned with the widest tick text, so that long labels grow into the picture, not out
  // of it.
  const double right =
      std::min(image.width() - 4 * scale, x + width + 5 * scale + text_width("-0.000", scale));
  const double left = std::max(4 * scale, std::min<double>(x, right - text_width(label, scale)));
  draw_text(image, left, y - 16 * scale, label, scale, ink);
}

}  // namespace rhytid
