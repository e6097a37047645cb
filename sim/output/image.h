// 8-bit pictures in memory and as PNG files.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

namespace rhytid {

/// An sRGB colour, 8 bits per channel.
struct Rgb {
  std::uint8_t r = 0, g = 0, b = 0;
  friend bool operator==(const Rgb&, const Rgb&) = default;
};

/// Row-major 8-bit pixels, channels interleaved; (0, 0) is the top-left pixel. 1 channel = grey, 3 = RGB,
/// 4 = RGB and straight (not premultiplied) alpha.
class Image {
 public:
  Image() = default;
  /// Filled with `value` in every channel. Throws ContractError unless sizes are positive and channels 1, 3
  /// or 4.
  Image(int width, int height, int channels, std::uint8_t value = 0);

  int width() const { return width_; }
  int height() const { return height_; }
  int channels() const { return channels_; }
  bool empty() const { return pixels_.empty(); }
  std::uint8_t* pixel(int x, int y) { return &pixels_[offset(x, y)]; }
  const std::uint8_t* pixel(int x, int y) const { return &pixels_[offset(x, y)]; }
  const std::vector<std::uint8_t>& pixels() const { return pixels_; }
  std::vector<std::uint8_t>& pixels() { return pixels_; }

  /// Mixes `colour` into a pixel with weight `coverage` in [0, 1]; outside the picture nothing happens.
  void blend(int x, int y, Rgb colour, double coverage);
  /// Fills the pixels x0 ≤ x < x1, y0 ≤ y < y1 (clipped to the picture).
  void fill(int x0, int y0, int x1, int y1, Rgb colour);

 private:
  size_t offset(int x, int y) const {
    return (static_cast<size_t>(y) * width_ + static_cast<size_t>(x)) * channels_;
  }

  int width_ = 0, height_ = 0, channels_ = 0;
  std::vector<std::uint8_t> pixels_;
};

/// PNG bytes of a picture (deterministic: no time stamp).
std::string encode_png(const Image& image);
/// Writes a PNG atomically. Throws InputError naming the path.
void write_png(const std::string& path, const Image& image);
/// Reads a PNG as 8-bit grey, RGB or RGBA; palettes and small depths are expanded, 16 bits rounded to 8.
/// Throws InputError naming the path when it is missing, not a PNG, damaged, or above 16384 pixels a side.
Image read_png(const std::string& path);

}  // namespace rhytid
