#include "sim/output/text.h"

#include <array>
#include <charconv>
#include <cmath>
#include <cstdint>

#include "sim/core/error.h"

namespace rhytid {

namespace {

template <typename... Format>
std::string chars(double value, Format... format) {
  std::array<char, 400> buffer;  // fixed notation of 1e308 with decimals fits
  const auto result = std::to_chars(buffer.data(), buffer.data() + buffer.size(), value, format...);
  return {buffer.data(), result.ptr};
}

}  // namespace

std::string exact_text(double value) {
  if (std::isnan(value)) return "nan";
  return chars(value);
}

std::string short_text(double value, int digits) {
  if (!std::isfinite(value)) return exact_text(value);
  return chars(value, std::chars_format::general, digits);
}

std::string fixed_text(double value, int decimals) {
  if (!std::isfinite(value)) return exact_text(value);
  std::string text = chars(value, std::chars_format::fixed, decimals);
  if (text.find_first_of("123456789") == std::string::npos && text[0] == '-') text.erase(0, 1);  // no "-0.00"
  return text;
}

std::string counted(long count, const std::string& noun) {
  return std::to_string(count) + " " + noun + (count == 1 ? "" : "s");
}

std::string xml_escaped(std::string_view text) {
  std::string out;
  for (const char c : text) {
    switch (c) {
      case '&':
        out += "&amp;";
        break;
      case '<':
        out += "&lt;";
        break;
      case '>':
        out += "&gt;";
        break;
      case '"':
        out += "&quot;";
        break;
      case '\'':
        out += "&#39;";
        break;
      default:
        out += c;
    }
  }
  return out;
}

std::string base64(std::string_view bytes) {
  static constexpr char alphabet[] = "ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/";
  std::string out;
  out.reserve((bytes.size() + 2) / 3 * 4);
  for (size_t i = 0; i < bytes.size(); i += 3) {
    const size_t count = std::min<size_t>(3, bytes.size() - i);
    uint32_t group = 0;
    for (size_t k = 0; k < 3; ++k) {
      group = group << 8 | (k < count ? static_cast<unsigned char>(bytes[i + k]) : 0u);
    }
    for (size_t k = 0; k < 4; ++k) out += k <= count ? alphabet[group >> (18 - 6 * k) & 63] : '=';
  }
  return out;
}

std::vector<double> round_ticks(double low, double high, int target) {
  require(std::isfinite(low) && std::isfinite(high) && low < high && target > 0, "round_ticks: bad range");
  const double rough = (high - low) / target;
  const double decade = std::pow(10.0, std::floor(std::log10(rough)));
  double step = 10 * decade;
  for (const double factor : {1.0, 2.0, 5.0}) {
    // 1.4 centres the choice: the step nearest to the wish on a logarithmic scale.
    if (rough <= factor * decade * 1.4) {
      step = factor * decade;
      break;
    }
  }
  // Apart by round-off only, as in the map of a constant field: there is nothing between, and counting up
  // would not move on.
  if (step < 1e-12 * std::max(std::abs(low), std::abs(high))) return {0.5 * (low + high)};
  std::vector<double> ticks;
  const double slack = 1e-9 * step;
  for (double k = std::ceil((low - slack) / step); k * step <= high + slack; k += 1)
    ticks.push_back(k * step);
  return ticks;
}

std::string tick_text(double value, double step) {
  require(step > 0, "tick_text: step must be positive");
  if (std::abs(value) < 1e-9 * step) return "0";
  const double largest = std::max(std::abs(value), step);
  if (largest >= 1e5 || largest < 1e-3) {
    const int digits = 1 + std::max(0, static_cast<int>(std::round(std::log10(largest / step))));
    std::string text = chars(value, std::chars_format::scientific, digits);
    const auto e = text.find('e');
    std::string mantissa = text.substr(0, e), exponent = text.substr(e + 1);
    while (mantissa.back() == '0') mantissa.pop_back();
    if (mantissa.back() == '.') mantissa.pop_back();
    return mantissa + "e" + std::to_string(std::stoi(exponent));
  }
  const int decimals = std::max(0, -static_cast<int>(std::floor(std::log10(step) + 1e-9)));
  return fixed_text(value, decimals);
}

}  // namespace rhytid
