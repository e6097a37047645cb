#include "tools/study/parameter_range.h"

#include <algorithm>
#include <cmath>
#include <sstream>

#include "sim/core/csv_reader.h"
#include "sim/core/error.h"
#include "sim/core/parse_number.h"
#include "sim/output/atomic_file.h"
#include "sim/output/text.h"

namespace rhytid::tools {
namespace {

/// The transform that both ends of the range can take.
ParameterTransform transform_of(const ParameterRange& r) {
  const ParameterSpec& s = r.spec;
  if (s.transform == ParameterTransform::log && r.lower > 0) return s.transform;
  if (s.transform == ParameterTransform::logit && r.lower > s.lower && r.upper < s.upper) return s.transform;
  return ParameterTransform::none;
}

/// A plain number in internal units, or a quantity.
double value_of(const std::string& cell, Dimension dimension, const std::string& where) {
  double number = 0;
  if (parse(cell, number) && std::isfinite(number)) return number;
  return parse_quantity(cell, dimension, where);
}

}  // namespace

double ParameterRange::at(double x) const {
  const auto logit = [&](double p) { return std::log((p - spec.lower) / (spec.upper - p)); };
  if (x <= 0) return lower;
  if (x >= 1) return upper;
  switch (transform_of(*this)) {
    case ParameterTransform::log:
      return lower * std::pow(upper / lower, x);
    case ParameterTransform::logit: {
      const double odds = std::exp(logit(lower) + x * (logit(upper) - logit(lower)));
      return spec.lower + (spec.upper - spec.lower) * odds / (1 + odds);
    }
    case ParameterTransform::none:
      break;
  }
  return lower + x * (upper - lower);
}

ParameterRange range_around(const ParameterSpec& spec, double factor) {
  if (!(factor > 1) || !std::isfinite(factor))
    throw InputError("--factor", short_text(factor), "a number above 1");
  const double p = spec.value;
  ParameterRange r{spec, p, p};
  const bool is_inside = p > spec.lower && p < spec.upper;
  if (spec.transform == ParameterTransform::log && p > 0) {
    r.lower = p / factor, r.upper = p * factor;
  } else if (spec.transform == ParameterTransform::logit && is_inside) {
    const double odds = (p - spec.lower) / (spec.upper - p), width = spec.upper - spec.lower;
    r.lower = spec.lower + width * (odds / factor) / (1 + odds / factor);
    r.upper = spec.lower + width * (odds * factor) / (1 + odds * factor);
  } else {
    const double reach = (1 - 1 / factor) * 0.5 * (spec.upper - spec.lower);
    r.lower = p - reach, r.upper = p + reach;
  }
  r.lower = std::max(r.lower, std::min(spec.lower, p));
  r.upper = std::min(r.upper, std::max(spec.upper, p));
  if (!(r.lower < r.upper))
    throw InputError(spec.address, short_text(p), "a value with room around it for --factor");
  return r;
}

std::vector<ParameterRange> read_ranges(const std::string& path, const Scene& scene) {
  std::istringstream lines(read_file(path));
  std::vector<ParameterRange> ranges;
  bool has_header = false;
  for_csv_lines(lines, path, [&](const CsvLine& line) {
    const std::vector<std::string> header = {"address", "lower", "upper"};
    if (!has_header) {
      if (line.cells != header) throw InputError(line.place, "'" + line.text + "'", "address,lower,upper");
      has_header = true;
      return;
    }
    require_cells_as_in_header(line, header.size());
    ParameterRange r;
    try {
      r.spec = describe_parameter(scene, line.cells[0]);
      r.lower = value_of(line.cells[1], r.spec.dimension, "lower");
      r.upper = value_of(line.cells[2], r.spec.dimension, "upper");
      Scene changed = scene;
      for (const double value : {r.lower, r.upper}) set_parameter(changed, r.spec.address, value);
    } catch (const InputError& error) {
      throw InputError(line.place + ": " + error.what());
    }
    if (!(r.lower < r.upper))
      throw InputError(line.place, line.cells[1] + " and " + line.cells[2], "the lower bound first");
    for (const ParameterRange& other : ranges)
      if (other.spec.address == r.spec.address)
        throw InputError(line.place, r.spec.address + " a second time", "each address once");
    ranges.push_back(std::move(r));
  });
  if (ranges.empty()) throw InputError(path, "no rows", "address,lower,upper and a row per parameter");
  return ranges;
}

}  // namespace rhytid::tools
