#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <png.h>

#include <bit>
#include <cmath>
#include <cstdio>
#include <random>

#include "sim/core/error.h"
#include "sim/output/atomic_file.h"
#include "sim/output/colour_map.h"
#include "sim/output/font.h"
#include "sim/output/image.h"
#include "tests/support/temporary_folder.h"

namespace rhytid {
namespace {

using test::TemporaryFolder;

TEST(Png, RoundTripIsExactForEveryChannelCount) {
  const TemporaryFolder folder;
  std::mt19937 random(1);
  for (const int channels : {1, 3, 4}) {
    Image image(37, 23, channels);
    for (auto& value : image.pixels()) value = static_cast<std::uint8_t>(random());
    const std::string path = folder / ("p" + std::to_string(channels) + ".png");
    write_png(path, image);
    const Image back = read_png(path);
    EXPECT_EQ(back.width(), 37);
    EXPECT_EQ(back.height(), 23);
    EXPECT_EQ(back.channels(), channels);
    EXPECT_EQ(back.pixels(), image.pixels());
    EXPECT_EQ(read_file(path), encode_png(image)) << "not deterministic";
  }
}

TEST(Png, ReadsSixteenBitGreyRoundedToEight) {
  const TemporaryFolder folder;
  const std::string path = folder / "g16.png";
  FILE* file = std::fopen(path.c_str(), "wb");
  png_structp png = png_create_write_struct(PNG_LIBPNG_VER_STRING, nullptr, nullptr, nullptr);
  png_infop info = png_create_info_struct(png);
  png_init_io(png, file);
  png_set_IHDR(png, info, 3, 1, 16, PNG_COLOR_TYPE_GRAY, PNG_INTERLACE_NONE, PNG_COMPRESSION_TYPE_DEFAULT,
               PNG_FILTER_TYPE_DEFAULT);
  png_write_info(png, info);
  std::uint8_t row[6] = {0x00, 0x00, 0x80, 0x80, 0xFF, 0xFF};
  png_write_row(png, row);
  png_write_end(png, info);
  png_destroy_write_struct(&png, &info);
  std::fclose(file);
  const Image image = read_png(path);
  EXPECT_EQ(image.channels(), 1);
  EXPECT_THAT(image.pixels(), ::testing::ElementsAre(0, 128, 255));
}

TEST(Png, RefusesWhatIsNotAPngNamingThePath) {
  const TemporaryFolder folder;
  const std::string path = folder / "x.png";
  const auto expect_refused = [&] {
    try {
      read_png(path);
      ADD_FAILURE() << "no exception";
    } catch (const InputError& error) {
      EXPECT_THAT(error.what(), ::testing::HasSubstr(path));
    }
  };
  expect_refused();  // missing
  write_file(path, "GIF89a");
  expect_refused();
  write_file(path, "");
  expect_refused();
  const std::string good = encode_png(Image(64, 64, 3, 77));
  write_file(path, std::string_view(good).substr(0, good.size() / 2));
  expect_refused();
}

TEST(Image, BlendClipsAndMixes) {
  Image image(4, 4, 3, 100);
  image.blend(-1, 0, {255, 0, 0}, 1);
  image.blend(4, 4, {255, 0, 0}, 1);
  EXPECT_THAT(image.pixels(), ::testing::Each(100));
  image.blend(1, 2, {200, 0, 100}, 0.5);
  EXPECT_EQ(image.pixel(1, 2)[0], 150);
  EXPECT_EQ(image.pixel(1, 2)[1], 50);
  EXPECT_EQ(image.pixel(1, 2)[2], 100);
  EXPECT_THROW(Image(0, 3, 3), ContractError);
  EXPECT_THROW(Image(3, 3, 2), ContractError);
}

TEST(Font, EveryPrintableCharacterIsDistinct) {
  for (char32_t a = 33; a < 127; ++a) {
    int ink = 0;
    for (const auto row : glyph(a)) {
      ink += std::popcount(row);
      EXPECT_LT(row, 32);
    }
    EXPECT_GT(ink, 1) << "code " << static_cast<int>(a);
    for (char32_t b = 32; b < a; ++b) EXPECT_NE(glyph(a), glyph(b)) << char(a) << char(b);
  }
  EXPECT_EQ(glyph(U'\u4E00'), glyph(U'\u0001'));  // both are the hollow box
}

TEST(Font, DrawsInsideItsWidthAndHonoursAnchors) {
  const std::string text = "Hg8µ";
  EXPECT_DOUBLE_EQ(text_width(text, 2.0), (4 * 6 - 1) * 2.0);
  EXPECT_DOUBLE_EQ(text_width("", 2.0), 0.0);
  for (const auto& [anchor, left] :
       {std::pair{TextAnchor::left, 40.0}, {TextAnchor::centre, 17.0}, {TextAnchor::right, -6.0}}) {
    Image image(100, 40, 1, 255);
    draw_text(image, 40, 10, text, 2.0, {0, 0, 0}, anchor);
    int first = 100, last = -1, top = 40, bottom = -1;
    for (int y = 0; y < 40; ++y) {
      for (int x = 0; x < 100; ++x) {
        if (image.pixel(x, y)[0] > 100) continue;
        first = std::min(first, x), last = std::max(last, x), top = std::min(top, y),
        bottom = std::max(bottom, y);
      }
    }
    EXPECT_NEAR(first, std::max(0.0, left), 1.01);
    EXPECT_NEAR(last, left + text_width(text, 2.0) - 1, 1.01);
    EXPECT_NEAR(top, 10, 1.01);
    EXPECT_NEAR(bottom, 10 + 18 - 1, 1.01);  // two rows of descender
  }
}

TEST(Font, SurvivesMalformedUtf8) {
  Image image(60, 20, 3, 255);
  draw_text(image, 1, 1, "\xC2", 1, {});
  draw_text(image, 1, 1, "\xFF\xE2\x88", 1, {});
  EXPECT_DOUBLE_EQ(text_width("\xFF", 1), 5);
}

TEST(ColourMap, SequentialLightnessRisesAndDivergingPeaksInTheMiddle) {
  double previous = 0;
  for (int i = 0; i <= 64; ++i) {
    const double value = lightness(map_colour(ColourMap::sequential, i / 64.0));
    EXPECT_GT(value, previous) << i;
    previous = value;
  }
  for (int i = 0; i < 32; ++i) {
    const auto at = [](double s) { return lightness(map_colour(ColourMap::diverging, s)); };
    EXPECT_LT(at(i / 64.0), at((i + 1) / 64.0));
    EXPECT_GT(at(0.5 + i / 64.0), at(0.5 + (i + 1) / 64.0));
    EXPECT_NEAR(at(i / 64.0), at(1 - i / 64.0), 0.06) << "the two arms should weigh the same";
  }
  EXPECT_EQ(map_colour(ColourMap::sequential, -3), map_colour(ColourMap::sequential, 0));
  EXPECT_EQ(hex_colour({1, 171, 255}), "#01abff");
  for (const Rgb c : {Rgb{0, 0, 0}, Rgb{255, 255, 255}, Rgb{12, 200, 99}}) {
    EXPECT_EQ(srgb_from_linear(linear_from_srgb(c)), c);
  }
  // The transfer function of sRGB (IEC 61966-2-1), rounded; between the entries of any table too.
  for (int i = 0; i <= 100000; ++i) {
    const double l = i / 100000.;
    const double s = l <= 0.0031308 ? 12.92 * l : 1.055 * std::pow(l, 1 / 2.4) - 0.055;
    ASSERT_EQ(srgb_from_linear({l, 1, 0}), (Rgb{static_cast<std::uint8_t>(std::lround(255 * s)), 255, 0}))
        << l;
  }
}

}  // namespace
}  // namespace rhytid
