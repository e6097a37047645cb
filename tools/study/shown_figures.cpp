#include "tools/study/shown_figures.h"

#include <cmath>
#include <limits>
#include <numbers>

#include "adjoint/resultant_force.h"
#include "adjoint/stored_energy.h"
#include "adjoint/wrinkle_output.h"
#include "tools/step_reading.h"
#include "tools/study/wrinkle_recorder.h"

namespace rhytid::tools {
namespace {

constexpr double kNan = std::numeric_limits<double>::quiet_NaN();
constexpr double kDegrees = 180 / std::numbers::pi;

/// A number and its derivatives along n coordinates.
struct Differentiated {
  double value = kNan;
  Eigen::RowVectorXd derivative;
};

/// Length of a vector; none where it is zero, which is a cusp.
Differentiated length(const VectorXd& v, const MatrixXd& dv) {
  const double norm = v.norm();
  if (norm == 0) return {0, Eigen::RowVectorXd::Constant(dv.cols(), kNan)};
  return {norm, v.transpose() * dv / norm};
}

/// Half the angle of (c, s) in degrees; none where it vanishes.
Differentiated half_angle(const VectorXd& v, const MatrixXd& dv) {
  const double square = v.squaredNorm();
  if (square == 0) return {kNan, Eigen::RowVectorXd::Constant(dv.cols(), kNan)};
  return {0.5 * kDegrees * std::atan2(v[1], v[0]),
          0.5 * kDegrees / square * (v[0] * dv.row(1) - v[1] * dv.row(0))};
}

/// A size that is zero, with derivatives zero, where there is none.
Differentiated size(const VectorXd& v, const MatrixXd& dv) {
  if (v[0] == 0) return {kNan, Eigen::RowVectorXd::Constant(dv.cols(), kNan)};
  return {v[0], dv.row(0)};
}

}  // namespace

/// How a figure follows from some of the output's values.
struct ShownFigures::Part {
  std::string name, unit;
  bool relative;
  Eigen::Index first, count;
  Differentiated (*figure)(const VectorXd&, const MatrixXd&);
};

ShownFigures::ShownFigures(const Model& model, const WrinkleMeasure& measure) {
  std::vector<std::shared_ptr<const adjoint::Output>> outputs;
  for (const std::string& name : contact_names(model)) {
    if (name == "base") continue;
    colliders_.push_back(name);
    outputs.push_back(std::make_shared<adjoint::ResultantForce>(adjoint::collider_force(model, name)));
  }
  outputs.push_back(std::make_shared<adjoint::StoredEnergy>(model));
  WrinkleSamples samples = place_samples(model.mesh, measure);
  has_line_ = samples.line.has_value();
  has_window_ = samples.window.has_value();
  for (auto* part : {&samples.line, &samples.window})
    if (*part)
      outputs.push_back(std::make_shared<adjoint::WrinkleDescription>(std::move(**part), measure.band));
  output_ = std::make_shared<adjoint::CombinedOutput>(std::move(outputs));
}

std::vector<ShownFigures::Part> ShownFigures::parts() const {
  std::vector<Part> list;
  Eigen::Index at = 0;
  const auto add = [&](std::string name, std::string unit, bool relative, Eigen::Index count, auto figure) {
    list.push_back({std::move(name), std::move(unit), relative, at, count, figure});
  };
  for (const std::string& name : colliders_) {
    add("force_" + name, "N", true, 3, length);
    at += 3;
  }
  add("stored_energy", "mJ", true, 1, size);
  at += 1;
  const auto wrinkles = [&](const std::string& of) {
    for (const char* what : {"_amplitude", "_wavelength"}) {
      add(of + what, "mm", true, 1, size);
      at += 1;
    }
  };
  if (has_line_) wrinkles("line");
  if (has_window_) {
    wrinkles("window");
    add("window_direction", "deg", false, 2, half_angle);
    add("window_coherence", "", false, 2, length);
  }
  return list;
}

std::vector<ShownFigure> ShownFigures::figures(const std::vector<VectorXd>& values,
                                               const std::vector<MatrixXd>& tangents) const {
  const auto frames = static_cast<Eigen::Index>(values.size()) - 1;
  std::vector<ShownFigure> result;
  for (const Part& part : parts()) {
    ShownFigure figure{part.name, part.unit, part.relative, VectorXd(frames), {}};
    for (Eigen::Index f = 0; f < frames; ++f) {
      const auto frame = static_cast<std::size_t>(f) + 1;
      const Differentiated d = part.figure(values[frame].segment(part.first, part.count),
                                           tangents[frame].middleRows(part.first, part.count));
      figure.values[f] = d.value;
      if (figure.derivatives.size() == 0) figure.derivatives.resize(frames, d.derivative.size());
      figure.derivatives.row(f) = d.derivative;
    }
    result.push_back(std::move(figure));
  }
  return result;
}

}  // namespace rhytid::tools
