// What was measured besides the motion of points: forces on a finger, size and wavelength of wrinkles. Each
// value is a residual (measured − predicted)/σ of the fit, with derivatives from the same sweeps as pixels.
//
//   force_NAME_x, _y, _z    N    of the skin on collider NAME, world axes (adjoint/resultant_force.h)
//   wrinkle_amplitude       mm   on the line of /fit/wrinkles, band-passed (adjoint/wrinkle_output.h): they
//   wrinkle_wavelength      mm   do not depend on the phase of the waves, which pixels do
//
// File: CSV with the header frame,quantity,value,sigma; frames count from the rest frame 0, which has none.
// To add a quantity: name it in `parts_of` and give its adjoint::Output.
//
// Tests: tests/fitting/measurements_test.cpp
#pragma once

#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "adjoint/outputs.h"
#include "sim/output/surface_samples.h"
#include "sim/output/wrinkles.h"

namespace rhytid::fitting {

/// One value measured in one frame.
struct Measurement {
  int frame = 0;
  std::string quantity;
  double value = 0, sigma = 0;  ///< in the quantity's unit
  std::string place;            ///< "file:line", for messages
};

/// Where wrinkles were measured.
struct WrinkleLine {
  SampleLine line;  ///< mm
  int points = 200;
  WrinkleBand band;
};

/// Reads the file described above. Throws InputError "file:line: ..." for what cannot be read, a sigma that is
/// not positive, frame 0 and a quantity given twice in a frame.
std::vector<Measurement> read_measurements(const std::string& path);

/// Measured values of a run as one output.
class MeasuredQuantities {
 public:
  /// `list` must not be empty. Throws InputError for a quantity that the scene does not have, naming those it
  /// has, and for a line beside the skin; measurements beyond `frames` are left out.
  MeasuredQuantities(const Model& model, const std::vector<Measurement>& list,
                     const std::optional<WrinkleLine>& wrinkles, int frames);

  /// All quantities, frames 1 and later.
  const std::shared_ptr<const adjoint::Output>& output() const { return output_; }
  /// The measured values, and where each stands among the output's of its frame.
  struct Value {
    Measurement measurement;
    int row = 0;
  };
  const std::vector<Value>& values() const { return values_; }

 private:
  std::shared_ptr<const adjoint::Output> output_;
  std::vector<Value> values_;
};

}  // namespace rhytid::fitting
