#include "sim/core/units.h"

#include <algorithm>
#include <array>
#include <cctype>
#include <charconv>
#include <cmath>
#include <cstdio>
#include <optional>
#include <utility>
#include <vector>

#include "sim/core/error.h"

namespace rhytid {
namespace {

/// value[internal] = value · times / over. Two exact factors instead of one rounded one: 1 kPa = 1/1000 MPa.
struct Unit {
  std::string_view name;
  double times, over;
  Dimension dimension;
};

using namespace dimension;
constexpr Dimension energy = dimension::force * dimension::length;
constexpr double pi = 3.14159265358979323846;
constexpr std::array<Unit, 30> units{{
    {"nm", 1, 1e6, length},
    {"um", 1, 1e3, length},
    {"mm", 1, 1, length},
    {"cm", 10, 1, length},
    {"m", 1000, 1, length},
    {"in", 25.4, 1, length},
    {"uN", 1, 1e6, force},
    {"mN", 1, 1e3, force},
    {"N", 1, 1, force},
    {"kN", 1e3, 1, force},
    {"Pa", 1, 1e6, pressure},
    {"kPa", 1, 1e3, pressure},
    {"MPa", 1, 1, pressure},
    {"GPa", 1e3, 1, pressure},
    {"mmHg", 133.322387415, 1e6, pressure},
    {"bar", 1, 10, pressure},
    {"psi", 6894.757293168, 1e6, pressure},
    {"us", 1, 1e6, dimension::time},
    {"ms", 1, 1e3, dimension::time},
    {"s", 1, 1, dimension::time},
    {"min", 60, 1, dimension::time},
    {"h", 3600, 1, dimension::time},
    {"Hz", 1, 1, frequency},
    {"kHz", 1e3, 1, frequency},
    {"mJ", 1, 1, energy},
    {"J", 1e3, 1, energy},
    {"rad", 1, 1, angle},
    {"deg", pi, 180, angle},
    {"%", 1, 100, none},
    {"uJ", 1, 1e3, energy},
}};

struct Kind {
  Dimension dimension;
  std::string_view unit, text, example;
};
constexpr std::array<Kind, 12> kinds{{
    {none, "", "a plain number", "0.5"},
    {length, "mm", "a length", "8 mm"},
    {area, "mm²", "an area", "20 mm^2"},
    {force, "N", "a force", "2 N"},
    {dimension::time, "s", "a time", "12 ms"},
    {angle, "rad", "an angle", "30 deg"},
    {pressure, "MPa", "a pressure", "20 kPa"},
    {pressure_per_length, "MPa/mm", "a pressure per length", "1 MPa/mm"},
    {per_length, "1/mm", "a number per length", "0.8 1/mm"},
    {frequency, "1/s", "a frequency", "24 Hz"},
    {speed, "mm/s", "a speed", "5 mm/s"},
    {energy, "mJ", "an energy", "3 mJ"},
}};

const Kind* find_kind(Dimension d) {
  for (const Kind& kind : kinds)
    if (kind.dimension == d) return &kind;
  return nullptr;
}

/// Spells typographic units in ASCII: µ -> u, ² -> ^2, ⁻¹ -> ^-1, · -> *, ° -> deg.
std::string to_ascii(std::string_view text) {
  static constexpr std::array<std::pair<std::string_view, std::string_view>, 11> spellings{{
      {"µ", "u"},
      {"μ", "u"},
      {"°", "deg"},
      {"·", "*"},
      {"⋅", "*"},
      {"⁻¹", "^-1"},
      {"⁻²", "^-2"},
      {"⁻³", "^-3"},
      {"¹", "^1"},
      {"²", "^2"},
      {"³", "^3"},
  }};
  std::string ascii;
  while (!text.empty()) {
    size_t taken = 0;
    for (const auto& [from, to] : spellings)
      if (text.starts_with(from)) {
        ascii += to;
        taken = from.size();
        break;
      }
    if (taken == 0) {
      ascii += text.front();
      taken = 1;
    }
    text.remove_prefix(taken);
  }
  return ascii;
}

bool is_unit_letter(char c) {
  return std::isalpha(static_cast<unsigned char>(c)) || c == '%';
}

/// Cursor over a unit expression: ['/'] factor { ['*' | '/' | ' '] factor }, factor = (unit | "1") [power].
class UnitParser {
 public:
  explicit UnitParser(std::string_view text) : rest_(text) {}

  /// The product of all factors as one Unit, or nothing when the text is no unit expression.
  std::optional<Unit> parse() {
    Unit product{"", 1, 1, none};
    bool is_first = true;
    for (skip_spaces(); !rest_.empty(); skip_spaces()) {
      const bool divide = take('/');
      if (!divide && !is_first) take('*');
      skip_spaces();
      const std::optional<Unit> unit = parse_factor();
      if (!unit) return {};
      product.times *= divide ? unit->over : unit->times;
      product.over *= divide ? unit->times : unit->over;
      product.dimension = divide ? product.dimension / unit->dimension : product.dimension * unit->dimension;
      is_first = false;
    }
    return product;
  }

  /// After a failure: the word that is no unit, if that was the reason.
  std::string_view unknown() const { return unknown_; }

 private:
  void skip_spaces() {
    while (!rest_.empty() && (rest_.front() == ' ' || rest_.front() == '\t')) rest_.remove_prefix(1);
  }
  bool take(char c) {
    if (rest_.empty() || rest_.front() != c) return false;
    rest_.remove_prefix(1);
    return true;
  }
  std::optional<Unit> parse_factor() {
    if (take('1')) {  // only as a numerator: "1/mm"
      skip_spaces();
      if (rest_.empty() || rest_.front() != '/') return {};
      return Unit{"1", 1, 1, none};
    }
    size_t size = 0;
    while (size < rest_.size() && is_unit_letter(rest_[size])) ++size;
    const Unit* unit = nullptr;
    for (const Unit& candidate : units)
      if (candidate.name == rest_.substr(0, size)) unit = &candidate;
    if (unit == nullptr) {
      unknown_ = rest_.substr(0, size);
      return {};
    }
    rest_.remove_prefix(size);
    const bool has_power = take('^');
    const bool negative = has_power && take('-');
    if (!has_power && (rest_.empty() || !std::isdigit(static_cast<unsigned char>(rest_.front()))))
      return *unit;
    // One digit is enough for any physical unit and keeps the factors finite.
    if (rest_.empty() || !std::isdigit(static_cast<unsigned char>(rest_.front()))) return {};
    const int power = rest_.front() - '0';
    rest_.remove_prefix(1);
    Unit result{"", 1, 1, none};
    for (int i = 0; i < power; ++i) {
      result.times *= negative ? unit->over : unit->times;
      result.over *= negative ? unit->times : unit->over;
      result.dimension = negative ? result.dimension / unit->dimension : result.dimension * unit->dimension;
    }
    return result;
  }

  std::string_view rest_, unknown_;
};

/// The text in quotes, shortened and with control characters blanked so that a message stays one line.
std::string quoted(std::string_view text) {
  std::string shown = "\"";
  for (char c : text.substr(0, 60)) shown += static_cast<unsigned char>(c) < 0x20 || c == 0x7f ? ' ' : c;
  return shown + (text.size() > 60 ? "...\"" : "\"");
}

struct Parsed {
  double number = 0;  ///< finite
  Unit unit;          ///< of the whole expression
};

/// " (MPA is no unit, MPa is one)" for the middle of a message.
std::string unknown_unit(std::string_view word) {
  const auto is_like = [word](std::string_view name) {
    return std::equal(word.begin(), word.end(), name.begin(), name.end(), [](char a, char b) {
      return std::tolower(static_cast<unsigned char>(a)) == std::tolower(static_cast<unsigned char>(b));
    });
  };
  std::string text = " (" + std::string(word.substr(0, 20)) + " is no unit";
  for (const Unit& unit : units)
    if (is_like(unit.name)) return text + ", " + std::string(unit.name) + " is one)";
  return text + ")";
}

/// Nothing when the text is not a finite number with an optional unit; `why` then says more, if more is
/// known.
std::optional<Parsed> parse(std::string_view text, std::string& why) {
  const std::string ascii = to_ascii(text);
  const char* begin = ascii.data();
  const char* end = begin + ascii.size();
  while (begin != end && (*begin == ' ' || *begin == '\t')) ++begin;
  if (begin != end && *begin == '+') {
    ++begin;
    if (begin != end && *begin == '-') return {};
  }
  double number = 0;
  const auto [after, status] = std::from_chars(begin, end, number);
  if (status != std::errc() || !std::isfinite(number)) return {};
  UnitParser parser(std::string_view(after, static_cast<size_t>(end - after)));
  const std::optional<Unit> unit = parser.parse();
  if (!unit && !parser.unknown().empty()) why = unknown_unit(parser.unknown());
  if (!unit || !std::isfinite(number * unit->times / unit->over)) return {};
  return Parsed{number, *unit};
}

}  // namespace

Quantity parse_quantity(std::string_view text, const std::string& where) {
  std::string why;
  const std::optional<Parsed> parsed = parse(text, why);
  if (!parsed)
    throw InputError(where, quoted(text) + why, "a number with a unit, e.g. \"20 kPa\" or \"8 mm\"");
  return {parsed->number * parsed->unit.times / parsed->unit.over, parsed->unit.dimension};
}

double parse_quantity(std::string_view text, Dimension expected, const std::string& where) {
  const std::string wanted = dimension_text(expected) + ", e.g. \"" + dimension_example(expected) + "\"";
  std::string why;
  const std::optional<Parsed> parsed = parse(text, why);
  if (!parsed) throw InputError(where, quoted(text) + why, wanted);
  if (parsed->unit.dimension != expected)
    throw InputError(where, quoted(text) + " (" + dimension_text(parsed->unit.dimension) + ")", wanted);
  return parsed->number * parsed->unit.times / parsed->unit.over;
}

std::string unit_text(Dimension d) {
  if (const Kind* kind = find_kind(d)) return std::string(kind->unit);
  std::string text;
  const auto add = [&text](const char* name, int power) {
    if (power == 0) return;
    if (!text.empty()) text += "·";
    text += name;
    if (power != 1) text += "^" + std::to_string(power);
  };
  add("N", d.force);
  add("mm", d.length);
  add("s", d.time);
  add("rad", d.angle);
  return text;
}

std::string dimension_text(Dimension d) {
  if (const Kind* kind = find_kind(d)) return std::string(kind->text);
  return "a quantity in " + unit_text(d);
}

std::string dimension_example(Dimension d) {
  if (const Kind* kind = find_kind(d)) return std::string(kind->example);
  return "1 " + unit_text(d);
}

std::string format_quantity(double value, Dimension d, int digits) {
  // Candidates from small to large; the largest one that leaves at least 1 in front is the most readable.
  static constexpr std::array<std::string_view, 8> readable{"Pa", "kPa", "MPa", "GPa", "um", "mm", "ms", "s"};
  std::string unit = unit_text(d);
  double shown = value;
  bool is_first = true;
  for (std::string_view name : readable)
    for (const Unit& candidate : units) {
      if (candidate.name != name || candidate.dimension != d || value == 0 || !std::isfinite(value)) continue;
      const double scaled = value * candidate.over / candidate.times;
      if (!is_first && std::abs(scaled) < 1) continue;
      unit = candidate.name == "um" ? "µm" : std::string(candidate.name);
      shown = scaled;
      is_first = false;
    }
  std::array<char, 64> buffer{};
  std::snprintf(buffer.data(), buffer.size(), "%.*g", digits, shown);
  return unit.empty() ? buffer.data() : std::string(buffer.data()) + " " + unit;
}

}  // namespace rhytid
