#include "sim/output/colour_map.h"

#include <Eigen/LU>
#include <algorithm>
#include <array>
#include <cmath>
#include <vector>

namespace rhytid {

namespace {

double to_linear(double s) {
  return s <= 0.04045 ? s / 12.92 : std::pow((s + 0.055) / 1.055, 2.4);
}
double to_srgb(double l) {
  return l <= 0.0031308 ? 12.92 * l : 1.055 * std::pow(l, 1 / 2.4) - 0.055;
}

/// lround(255 · to_srgb(l)) for l in [0, 1], from a table: pictures ask for millions.
std::uint8_t srgb_byte(double l) {
  constexpr int cells = 8192;
  static const auto first = [] {  // the byte at the beginning of each cell
    std::array<std::uint8_t, cells + 1> bytes{};
    for (std::size_t k = 0; k < bytes.size(); ++k)
      bytes[k] = static_cast<std::uint8_t>(std::lround(255 * to_srgb(static_cast<double>(k) / cells)));
    return bytes;
  }();
  if (!(l > 0)) return 0;
  const auto cell = std::min(static_cast<std::size_t>(l * cells), static_cast<std::size_t>(cells - 1));
  // Inside most cells nothing changes; where it does, the formula decides.
  return first[cell] == first[cell + 1] ? first[cell]
                                        : static_cast<std::uint8_t>(std::lround(255 * to_srgb(l)));
}

/// Linear sRGB → cone-like response and response^(1/3) → Lab, as published.
Mat3 lms_from_rgb() {
  Mat3 m;
  m << 0.4122214708, 0.5363325363, 0.0514459929, 0.2119034982, 0.6806995451, 0.1073969566, 0.0883024619,
      0.2817188376, 0.6299787005;
  return m;
}
Mat3 lab_from_lms() {
  Mat3 m;
  m << 0.2104542553, 0.7936177850, -0.0040720468, 1.9779984951, -2.4285922050, 0.4505937099, 0.0259040371,
      0.7827717662, -0.8086757660;
  return m;
}

Vec3 oklab(Rgb colour) {
  const Vec3 lms = lms_from_rgb() * linear_from_srgb(colour);
  return lab_from_lms() * lms.array().pow(1.0 / 3).matrix();
}

Rgb from_oklab(const Vec3& lab) {
  static const Mat3 lms_from_lab = lab_from_lms().inverse(), rgb_from_lms = lms_from_rgb().inverse();
  return srgb_from_linear(rgb_from_lms * Vec3((lms_from_lab * lab).array().cube()));
}

/// 257 colours between equally spaced control points.
std::vector<Rgb> table(const std::vector<Rgb>& control) {
  std::vector<Rgb> out(257);
  const double spans = static_cast<double>(control.size() - 1);
  for (int i = 0; i <= 256; ++i) {
    const double at = spans * i / 256;
    const int k = std::min(static_cast<int>(at), static_cast<int>(spans) - 1);
    out[i] = from_oklab(oklab(control[k]) + (at - k) * (oklab(control[k + 1]) - oklab(control[k])));
  }
  return out;
}

}  // namespace

Vec3 linear_from_srgb(Rgb c) {
  static const std::array<double, 256> linear = [] {
    std::array<double, 256> values{};
    for (std::size_t k = 0; k < values.size(); ++k) values[k] = to_linear(static_cast<double>(k) / 255.0);
    return values;
  }();
  return {linear[c.r], linear[c.g], linear[c.b]};
}

Rgb srgb_from_linear(const Vec3& linear) {
  std::array<std::uint8_t, 3> out;
  for (int k = 0; k < 3; ++k) {
    out[k] = srgb_byte(std::clamp(linear[k], 0.0, 1.0));
  }
  return {out[0], out[1], out[2]};
}

double lightness(Rgb colour) {
  return oklab(colour)[0];
}

Rgb map_colour(ColourMap map, double s) {
  static const std::vector<Rgb> sequential =
      table({{68, 3, 87}, {62, 74, 137}, {38, 130, 142}, {53, 183, 121}, {170, 216, 60}, {253, 231, 40}});
  static const std::vector<Rgb> diverging = table({{24, 60, 138},
                                                   {66, 128, 206},
                                                   {160, 198, 232},
                                                   {247, 247, 247},
                                                   {244, 176, 148},
                                                   {214, 92, 74},
                                                   {138, 18, 40}});
  if (std::isnan(s)) return {150, 150, 150};
  const auto& colours = map == ColourMap::sequential ? sequential : diverging;
  return colours[static_cast<size_t>(std::lround(256 * std::clamp(s, 0.0, 1.0)))];
}

std::string hex_colour(Rgb c) {
  static constexpr char digits[] = "0123456789abcdef";
  std::string out = "#";
  for (const int value : {int(c.r), int(c.g), int(c.b)}) out += {digits[value / 16], digits[value % 16]};
  return out;
}

}  // namespace rhytid
