#include "sim/output/image.h"

#include <png.h>

#include <algorithm>
#include <cmath>
#include <cstring>

#include "sim/core/error.h"
#include "sim/output/atomic_file.h"

namespace rhytid {

namespace {

constexpr png_uint_32 max_side = 16384;

png_uint_32 format_of(int channels) {
  return channels == 1 ? PNG_FORMAT_GRAY : channels == 3 ? PNG_FORMAT_RGB : PNG_FORMAT_RGBA;
}

/// Owns libpng's side of a png_image.
struct PngImage : png_image {
  PngImage() : png_image{} { version = PNG_IMAGE_VERSION; }
  ~PngImage() { png_image_free(this); }
  PngImage(const PngImage&) = delete;
  PngImage& operator=(const PngImage&) = delete;
};

std::uint8_t mixed(std::uint8_t old_value, std::uint8_t new_value, double weight) {
  return static_cast<std::uint8_t>(std::lround(old_value + weight * (new_value - old_value)));
}

}  // namespace

Image::Image(int width, int height, int channels, std::uint8_t value)
    : width_(width), height_(height), channels_(channels) {
  require(width > 0 && height > 0, "Image: sizes must be positive");
  require(channels == 1 || channels == 3 || channels == 4, "Image: channels must be 1, 3 or 4");
  pixels_.assign(static_cast<size_t>(width) * height * channels, value);
}

void Image::blend(int x, int y, Rgb colour, double coverage) {
  if (x < 0 || y < 0 || x >= width_ || y >= height_ || !(coverage > 0)) return;
  coverage = std::min(coverage, 1.0);
  std::uint8_t* p = pixel(x, y);
  if (channels_ == 1) {
    // Rec. 709 luma of the colour
    const double grey = 0.2126 * colour.r + 0.7152 * colour.g + 0.0722 * colour.b;
    p[0] = mixed(p[0], static_cast<std::uint8_t>(std::lround(grey)), coverage);
    return;
  }
  p[0] = mixed(p[0], colour.r, coverage);
  p[1] = mixed(p[1], colour.g, coverage);
  p[2] = mixed(p[2], colour.b, coverage);
  if (channels_ == 4) p[3] = mixed(p[3], 255, coverage);
}

void Image::fill(int x0, int y0, int x1, int y1, Rgb colour) {
  for (int y = std::max(y0, 0); y < std::min(y1, height_); ++y) {
    for (int x = std::max(x0, 0); x < std::min(x1, width_); ++x) blend(x, y, colour, 1.0);
  }
}

std::string encode_png(const Image& image) {
  require(!image.empty(), "encode_png: empty picture");
  PngImage png;
  png.width = static_cast<png_uint_32>(image.width());
  png.height = static_cast<png_uint_32>(image.height());
  png.format = format_of(image.channels());
  std::string bytes(PNG_IMAGE_PNG_SIZE_MAX(png), '\0');
  png_alloc_size_t size = bytes.size();
  if (!png_image_write_to_memory(&png, bytes.data(), &size, 0, image.pixels().data(), 0, nullptr)) {
    throw ContractError(std::string("encode_png: ") + png.message);
  }
  bytes.resize(size);
  return bytes;
}

void write_png(const std::string& path, const Image& image) {
  write_file(path, encode_png(image));
}

Image read_png(const std::string& path) {
  const std::string bytes = read_file(path);
  PngImage png;
  if (!png_image_begin_read_from_memory(&png, bytes.data(), bytes.size())) {
    throw InputError(path + ": not a readable PNG: " + png.message);
  }
  // Without this libpng takes 16-bit files for linear light.
  png.flags |= PNG_IMAGE_FLAG_16BIT_sRGB;
  if (png.width > max_side || png.height > max_side) {
    throw InputError(path, std::to_string(png.width) + " x " + std::to_string(png.height) + " pixels",
                     "at most " + std::to_string(max_side) + " a side");
  }
  const bool coloured = png.format & PNG_FORMAT_FLAG_COLOR, alpha = png.format & PNG_FORMAT_FLAG_ALPHA;
  const int channels = alpha ? 4 : coloured ? 3 : 1;
  Image image(static_cast<int>(png.width), static_cast<int>(png.height), channels);
  png.format = format_of(channels);
  if (!png_image_finish_read(&png, nullptr, image.pixels().data(), 0, nullptr)) {
    throw InputError(path + ": damaged PNG: " + png.message);
  }
  return image;
}

}  // namespace rhytid
