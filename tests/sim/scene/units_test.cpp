#include "sim/core/units.h"

#include <gmock/gmock.h>

#include "sim/core/error.h"

namespace rhytid {
namespace {

using ::testing::HasSubstr;

std::string error_of(std::string_view text, Dimension expected) {
  try {
    parse_quantity(text, expected, "here");
  } catch (const InputError& error) {
    return error.what();
  }
  return "no error";
}

// Scaling by powers of ten is one rounding, so the double of the literal comes out bit for bit.
TEST(Units, ReadsQuantitiesExactly) {
  EXPECT_EQ(parse_quantity("20 kPa", dimension::pressure, ""), 0.02);
  EXPECT_EQ(parse_quantity("7 kPa", dimension::pressure, ""), 0.007);
  EXPECT_EQ(parse_quantity("4 MPa", dimension::pressure, ""), 4.);
  EXPECT_EQ(parse_quantity("500 Pa", dimension::pressure, ""), 5e-4);
  EXPECT_EQ(parse_quantity("8 mm", dimension::length, ""), 8.);
  EXPECT_EQ(parse_quantity("0.5 cm", dimension::length, ""), 5.);
  EXPECT_EQ(parse_quantity("50 µm", dimension::length, ""), 0.05);
  EXPECT_EQ(parse_quantity("50um", dimension::length, ""), 0.05);
  EXPECT_EQ(parse_quantity("24 Hz", dimension::frequency, ""), 24.);
  EXPECT_EQ(parse_quantity("24 1/s", dimension::frequency, ""), 24.);
  EXPECT_EQ(parse_quantity("1 MPa/mm", dimension::pressure_per_length, ""), 1.);
  EXPECT_EQ(parse_quantity("1 N/mm^3", dimension::pressure_per_length, ""), 1.);
  EXPECT_EQ(parse_quantity("1 kN m^-3", dimension::pressure_per_length, ""), 1e-6);
  EXPECT_EQ(parse_quantity("0.8 1/mm", dimension::per_length, ""), 0.8);
  EXPECT_EQ(parse_quantity("0.8/mm", dimension::per_length, ""), 0.8);
  EXPECT_EQ(parse_quantity("0.8 mm⁻¹", dimension::per_length, ""), 0.8);
  EXPECT_EQ(parse_quantity("20 mm^2", dimension::area, ""), 20.);
  EXPECT_EQ(parse_quantity("20 mm²", dimension::area, ""), 20.);
  EXPECT_EQ(parse_quantity("2 cm2", dimension::area, ""), 200.);
  EXPECT_EQ(parse_quantity("12 ms", dimension::time, ""), 0.012);
  EXPECT_EQ(parse_quantity("5 mm/s", dimension::speed, ""), 5.);
  EXPECT_EQ(parse_quantity("3 J/m^2/m", dimension::pressure, ""), 3e-6);
  EXPECT_EQ(parse_quantity("80 %", dimension::none, ""), 0.8);
  EXPECT_EQ(parse_quantity(" -1.5e-3 ", dimension::none, ""), -1.5e-3);
  EXPECT_DOUBLE_EQ(parse_quantity("30 deg", dimension::angle, ""), 0.52359877559829887);
  EXPECT_EQ(parse_quantity("2 N*mm", "").dimension, dimension::force * dimension::length);
}

TEST(Units, WrongDimensionSaysWhatWasExpected) {
  EXPECT_EQ(error_of("3 s", dimension::pressure),
            "here: got \"3 s\" (a time), expected a pressure, e.g. \"20 kPa\"");
  EXPECT_EQ(error_of("20", dimension::length),
            "here: got \"20\" (a plain number), expected a length, e.g. \"8 mm\"");
  EXPECT_THAT(error_of("30 deg", dimension::none), HasSubstr("an angle"));
  EXPECT_THAT(error_of("1 mm/s^2", dimension::speed), HasSubstr("mm·s^-2"));
}

TEST(Units, RefusesWhatIsNoQuantity) {
  for (const char* text :
       {"",       " ",      "mm",      "1 furlong", "1 mm//s", "1 mm^",    "1 mm^x", "1 mm^-",
        "1 1",    "1 2 mm", "nan",     "inf",       "-inf mm", "1e999 mm", "+-1 mm", "0x10 mm",
        "1,5 mm", "1 mm)",  "1 \n mm", "1 kkPa",    "1 KPa",   "1 mm^10"})
    EXPECT_THAT(error_of(text, dimension::length), HasSubstr("expected a length, e.g. \"8 mm\"")) << text;
  EXPECT_THAT(error_of("1 MPA", dimension::pressure),
              HasSubstr("\"1 MPA\" (MPA is no unit, MPa is one), expected"));
  EXPECT_THAT(error_of("1 furlong", dimension::length), HasSubstr("(furlong is no unit), expected"));
  EXPECT_EQ(error_of("1\n2", dimension::length).find('\n'), std::string::npos);
}

TEST(Units, ExamplesAndReportsReadBack) {
  for (Dimension d :
       {dimension::none, dimension::length, dimension::area, dimension::force, dimension::time,
        dimension::angle, dimension::pressure, dimension::pressure_per_length, dimension::per_length,
        dimension::frequency, dimension::speed, dimension::force / dimension::time}) {
    EXPECT_EQ(parse_quantity(dimension_example(d), "").dimension, d) << dimension_example(d);
    for (double value : {0., 1.234e-5, -0.02, 3.25, 98765.})
      EXPECT_NEAR(parse_quantity(format_quantity(value, d, 12), d, ""), value, 1e-11 * std::abs(value));
  }
  EXPECT_EQ(format_quantity(0.02, dimension::pressure), "20 kPa");
  EXPECT_EQ(format_quantity(4, dimension::pressure), "4 MPa");
  EXPECT_EQ(format_quantity(0.05, dimension::length), "50 µm");
  EXPECT_EQ(format_quantity(0.8, dimension::per_length), "0.8 1/mm");
  EXPECT_EQ(format_quantity(1. / 12, dimension::time), "83.33 ms");
}

}  // namespace
}  // namespace rhytid
