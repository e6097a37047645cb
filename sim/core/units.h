// Physical quantities as text: "20 kPa", "0.8 1/mm", "5 mm/s" to numbers in the internal units mm, N, MPa, s,
// rad.
//
// A dimension is a product of powers of length, force, time and angle, so that products and quotients of
// units need no table: MPa = N mm⁻², hence MPa/mm = N mm⁻³. Angles are kept apart from plain numbers so that
// "30 deg" is refused where a friction coefficient is expected.
#pragma once

#include <string>
#include <string_view>

namespace rhytid {

/// Exponents of length, force, time and angle; all zero for a plain number.
struct Dimension {
  int length = 0, force = 0, time = 0, angle = 0;

  friend constexpr bool operator==(const Dimension&, const Dimension&) = default;
  friend constexpr Dimension operator*(Dimension a, Dimension b) {
    return {a.length + b.length, a.force + b.force, a.time + b.time, a.angle + b.angle};
  }
  friend constexpr Dimension operator/(Dimension a, Dimension b) {
    return {a.length - b.length, a.force - b.force, a.time - b.time, a.angle - b.angle};
  }
};

namespace dimension {
inline constexpr Dimension none{};
inline constexpr Dimension length{.length = 1};
inline constexpr Dimension area{.length = 2};
inline constexpr Dimension force{.force = 1};
inline constexpr Dimension time{.time = 1};
inline constexpr Dimension angle{.angle = 1};
inline constexpr Dimension pressure = force / area;
inline constexpr Dimension pressure_per_length = pressure / length;
inline constexpr Dimension per_length = none / length;
inline constexpr Dimension frequency = none / time;
inline constexpr Dimension speed = length / time;
}  // namespace dimension

/// A number in internal units with its dimension.
struct Quantity {
  double value = 0;
  Dimension dimension;
};

/// Reads a number followed by an optional unit: products and quotients of µm mm cm m in, mN N kN, Pa kPa MPa
/// GPa mmHg, ms s min, Hz kHz, mJ J, deg rad, %, with powers ("mm^2", "mm²", "mm2"). Powers of ten are
/// applied as one correctly rounded operation: "20 kPa" is the double 0.02. The result is finite. Throws
/// InputError ("got ..., expected ...", starting with `where`) on anything else.
Quantity parse_quantity(std::string_view text, const std::string& where);

/// As above, and refuses any other dimension: the error names the expected kind with an example.
double parse_quantity(std::string_view text, Dimension expected, const std::string& where);

/// Internal unit as text: "MPa", "mm", "1/mm", "mm²", "MPa/mm"; "" for a plain number.
std::string unit_text(Dimension d);

/// What it is, with article: "a pressure", "a length"; "a quantity in N·s" when it has no name of its own.
std::string dimension_text(Dimension d);

/// An example that parse_quantity accepts: "20 kPa", "8 mm"; "0.5" for a plain number.
std::string dimension_example(Dimension d);

/// For people: `digits` significant digits in the most readable unit (0.02 MPa -> "20 kPa"). Parses back.
std::string format_quantity(double value, Dimension d, int digits = 4);

}  // namespace rhytid
