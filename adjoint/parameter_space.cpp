#include "adjoint/parameter_space.h"

#include <cmath>

namespace rhytid::adjoint {

Coordinate coordinate_of(const ParameterSpec& spec) {
  const double p = spec.value, range = spec.upper - spec.lower;
  switch (spec.transform) {
    case ParameterTransform::none:
      return {ParameterTransform::none, 0.5 * range};
    case ParameterTransform::log:
      if (p > 0) return {spec.transform, 0};
      break;
    case ParameterTransform::logit:
      if (p > spec.lower && p < spec.upper) return {spec.transform, 0};
      break;
  }
  return {ParameterTransform::none, p != 0 ? std::fabs(p) : range};
}

ParameterSpace::ParameterSpace(const SceneModel& scene_model, const std::vector<std::string>& addresses)
    : scene_model_(&scene_model), jacobian_(scene_model.native().size(), addresses.size()) {
  for (std::size_t k = 0; k < addresses.size(); ++k) {
    ParameterSpec spec = describe_parameter(scene_model.scene(), addresses[k]);
    const double p = spec.value;
    coordinates_.push_back(coordinate_of(spec));
    spec.transform = coordinates_.back().transform;
    const double slope = spec.transform == ParameterTransform::log ? p
                         : spec.transform == ParameterTransform::logit
                             ? (p - spec.lower) * (spec.upper - p) / (spec.upper - spec.lower)
                             : coordinates_.back().scale;
    jacobian_.col(static_cast<Eigen::Index>(k)) =
        slope * scene_model.native_derivative(scene_model.scene(), spec.address);
    specs_.push_back(std::move(spec));
  }
}

double ParameterSpace::value(int k, double x) const {
  const ParameterSpec& s = specs_[k];
  if (x == 0) return s.value;
  switch (s.transform) {
    case ParameterTransform::log:
      return s.value * std::exp(x);
    case ParameterTransform::logit: {
      const double odds = (s.value - s.lower) / (s.upper - s.value) * std::exp(x);
      return s.lower + (s.upper - s.lower) * odds / (1 + odds);
    }
    case ParameterTransform::none:
      break;
  }
  return s.value + x * coordinates_[k].scale;
}

std::vector<double> ParameterSpace::values(const VectorXd& x) const {
  std::vector<double> p;
  for (int k = 0; k < size(); ++k) p.push_back(value(k, x[k]));
  return p;
}

Scene ParameterSpace::scene(const VectorXd& x) const {
  Scene changed = scene_model_->scene();
  for (int k = 0; k < size(); ++k)
    if (x[k] != 0) set_parameter(changed, specs_[k].address, value(k, x[k]));
  return changed;
}

}  // namespace rhytid::adjoint
