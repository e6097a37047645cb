#include "tools/report/wording.h"

#include <algorithm>
#include <cmath>

#include "sim/core/error.h"
#include "sim/core/units.h"
#include "sim/output/text.h"

namespace rhytid::tools {
namespace {

std::string with_unit(const std::string& number, const std::string& unit) {
  return unit.empty() ? number : number + " " + unit;
}

std::string estimate(double value, double low, double high, const std::string& unit, bool determined) {
  const int digits = digits_for(value, low, high);
  const ReadableUnit readable = readable_unit(value, unit);
  if (!determined || !std::isfinite(low) || !std::isfinite(high)) {
    return "not determined by this footage (the fit ended at " + readable.text(value, 3) + ")";
  }
  return readable.text(value, digits) + " (95\u00a0% interval " + readable.number(low, digits) + " to " +
         readable.text(high, digits) + ")";
}

}  // namespace

std::string ReadableUnit::number(double value, int digits) const {
  if (std::isnan(value)) return "unknown";
  return short_text(value / scale, digits);
}

std::string ReadableUnit::text(double value, int digits) const {
  return with_unit(number(value, digits), unit);
}

ReadableUnit readable_unit(double value, const std::string& internal_unit) {
  if (internal_unit.empty()) return {};
  if (value == 0 || !std::isfinite(value)) return {internal_unit, 1};
  try {
    const Dimension dimension = parse_quantity("1 " + internal_unit, "").dimension;
    const std::string text = format_quantity(value, dimension);
    const size_t space = text.find(' ');
    if (space == std::string::npos) return {internal_unit, 1};
    const std::string unit = text.substr(space + 1);
    return {unit, parse_quantity("1 " + unit, dimension, "")};
  } catch (const InputError&) {
    return {internal_unit, 1};
  }
}

int digits_for(double value, double low, double high) {
  const double half = 0.5 * (high - low);
  if (!(half > 0) || !std::isfinite(half) || !(std::abs(value) > 0)) return 4;
  return static_cast<int>(std::clamp(std::ceil(std::log10(std::abs(value) / half)) + 2, 3., 8.));
}

std::string estimate_text(const fitting::FittedParameter& p) {
  return estimate(p.value, p.low95, p.high95, p.unit, p.determined);
}

std::string estimate_text(const fitting::DerivedQuantity& d) {
  return estimate(d.value, d.low95, d.high95, d.unit, true);
}

std::optional<bool> truth_inside(const std::optional<double>& truth, double low, double high) {
  if (!truth || std::isnan(*truth) || std::isnan(low) || std::isnan(high)) return std::nullopt;
  return low <= *truth && *truth <= high;
}

}  // namespace rhytid::tools
