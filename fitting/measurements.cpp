#include "fitting/measurements.h"

#include <cmath>
#include <filesystem>
#include <fstream>
#include <map>
#include <set>

#include "adjoint/resultant_force.h"
#include "adjoint/wrinkle_output.h"
#include "sim/core/csv_reader.h"
#include "sim/core/error.h"
#include "sim/scene/nearest.h"

namespace rhytid::fitting {
namespace {

/// An output and the quantities that are its values in a frame, in order.
struct Part {
  std::vector<std::string> quantities;
  std::shared_ptr<const adjoint::Output> output;
};

std::vector<Part> parts_of(const Model& model, const std::optional<WrinkleLine>& wrinkles) {
  std::vector<Part> parts;
  for (const Term& term : model.terms) {
    if (!term.name().starts_with("contact ")) continue;  // that of the base is "base contact"
    const std::string name = term.name().substr(8), force = "force_" + name;
    parts.push_back({{force + "_x", force + "_y", force + "_z"},
                     std::make_shared<adjoint::ResultantForce>(adjoint::collider_force(model, name))});
  }
  if (wrinkles) {
    SurfaceSamples samples(model.mesh, wrinkles->line, wrinkles->points);
    if (samples.missing() > 0)
      throw InputError("fit: /fit/wrinkles", std::to_string(samples.missing()) + " points beside the skin",
                       "a line on the skin");
    parts.push_back({{"wrinkle_amplitude", "wrinkle_wavelength"},
                     std::make_shared<adjoint::WrinkleDescription>(std::move(samples), wrinkles->band)});
  }
  return parts;
}

}  // namespace

std::vector<Measurement> read_measurements(const std::string& path) {
  std::ifstream file(path, std::ios::binary);
  if (!file || std::filesystem::is_directory(path))
    throw InputError(path, "no readable file", "a CSV of measurements: frame,quantity,value,sigma");
  const std::vector<std::string> header = {"frame", "quantity", "value", "sigma"};
  bool has_header = false;
  std::vector<Measurement> list;
  std::set<std::pair<int, std::string>> known;
  for_csv_lines(file, path, [&](const CsvLine& line) {
    if (!has_header) {
      if (line.cells != header)
        throw InputError(line.place, line.text, "the header frame,quantity,value,sigma");
      has_header = true;
      return;
    }
    require_cells_as_in_header(line, header.size());
    Measurement m{0, line.cells[1], csv_number(line.cells[2], line.place),
                  csv_number(line.cells[3], line.place), line.place};
    const double frame = csv_number(line.cells[0], line.place, "a frame number");
    if (!(frame >= 1 && frame <= 1e6 && frame == std::floor(frame)))
      throw InputError(line.place, "frame " + line.cells[0], "a whole number from 1 (frame 0 is at rest)");
    m.frame = static_cast<int>(frame);
    if (!(m.sigma > 0)) throw InputError(line.place, "sigma " + line.cells[3], "a positive number");
    if (!known.emplace(m.frame, m.quantity).second)
      throw InputError(line.place, m.quantity + " of frame " + line.cells[0] + " a second time",
                       "one value per quantity and frame");
    list.push_back(std::move(m));
  });
  if (list.empty())
    throw InputError(path, "no measurement", "the header frame,quantity,value,sigma and a line each");
  return list;
}

MeasuredQuantities::MeasuredQuantities(const Model& model, const std::vector<Measurement>& list,
                                       const std::optional<WrinkleLine>& wrinkles, int frames) {
  require(!list.empty(), "MeasuredQuantities: nothing was measured");
  std::map<std::string, int> rows;
  std::vector<std::string> names;
  std::vector<std::shared_ptr<const adjoint::Output>> outputs;
  const auto is_measured = [&](const Part& part) {
    for (const std::string& quantity : part.quantities)
      for (const Measurement& m : list)
        if (m.quantity == quantity) return true;
    return false;
  };
  int row = 0;
  for (Part& part : parts_of(model, wrinkles)) {
    for (const std::string& quantity : part.quantities) names.push_back(quantity);
    if (!is_measured(part)) continue;
    for (const std::string& quantity : part.quantities) rows[quantity] = row++;
    outputs.push_back(std::move(part.output));
  }
  output_ = std::make_shared<adjoint::CombinedOutput>(std::move(outputs));
  for (const Measurement& m : list) {
    const auto found = rows.find(m.quantity);
    if (found == rows.end())
      throw InputError(m.place, "quantity '" + m.quantity + "'",
                       names.empty()
                           ? "nothing: the scene has no collider and the case no /fit/wrinkles"
                           : "one that the scene has, nearest is '" + nearest_word(m.quantity, names) +
                                 "' (wrinkle_... need /fit/wrinkles)");
    if (m.frame <= frames) values_.push_back({m, found->second});
  }
}

}  // namespace rhytid::fitting
