// Numbers of a fit as people read them: readable units, digits that the interval supports.
#pragma once

#include <optional>
#include <string>

#include "fitting/fit_result.h"

namespace rhytid::tools {

/// The most readable unit for a value, and how many internal units one of it is.
struct ReadableUnit {
  std::string unit;  ///< "kPa"; empty for plain numbers
  double scale = 1;
  /// `value` in internal units as text, without the unit.
  std::string number(double value, int digits) const;
  /// With the unit.
  std::string text(double value, int digits) const;
};

/// `internal_unit` as in FittedParameter::unit. A unit that is not known stays as it is.
ReadableUnit readable_unit(double value, const std::string& internal_unit);

/// Digits of `value` down to the second digit of half the interval's width; between 3 and 8.
int digits_for(double value, double low, double high);

/// "12.1 kPa (95 % interval 11.7 to 12.5 kPa)" with a no-break space before %, or that the footage does not
/// determine it.
std::string estimate_text(const fitting::FittedParameter& p);
std::string estimate_text(const fitting::DerivedQuantity& d);

/// Whether a known truth lies in the interval; nothing when it is not known or there is no interval.
std::optional<bool> truth_inside(const std::optional<double>& truth, double low, double high);

}  // namespace rhytid::tools
