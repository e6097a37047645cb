#include "fitting/parametrisation.h"

#include <algorithm>
#include <cmath>
#include <cstdio>

#include "sim/core/error.h"
#include "sim/scene/parameter.h"

namespace rhytid::fitting {
namespace {

/// A logit variable stays this far (in units of the range) from its ends: t in ±ln(1e6).
constexpr double kLogitMargin = 1e-6;

std::string number(double x) {
  char text[32];
  std::snprintf(text, sizeof(text), "%.6g", x);
  return text;
}

std::string modulus_address(const std::string& layer) {
  return "/skin/layers/" + layer + "/youngs_modulus";
}

}  // namespace

double FitVariable::to_transformed(double p) const {
  switch (transform) {
    case ParameterTransform::log:
      return std::log(p);
    case ParameterTransform::logit:
      return std::log((p - lower) / (upper - p));
    case ParameterTransform::none:
      break;
  }
  return p;
}

double FitVariable::to_parameter(double t) const {
  switch (transform) {
    case ParameterTransform::log:
      return std::exp(t);
    case ParameterTransform::logit:
      return lower + (upper - lower) / (1 + std::exp(-t));
    case ParameterTransform::none:
      break;
  }
  return t;
}

double FitVariable::derivative(double t) const {
  switch (transform) {
    case ParameterTransform::log:
      return std::exp(t);
    case ParameterTransform::logit: {
      const double half = std::cosh(t / 2);
      return (upper - lower) / (4 * half * half);
    }
    case ParameterTransform::none:
      break;
  }
  return 1;
}

Parametrisation::Parametrisation(const Scene& scene, const FitCase& fit) : scene_(scene) {
  if (fit.parameters.empty()) throw InputError("fit: parameters", "none", "at least one address");
  const std::vector<LayerScene>& layers = scene.skin.layers;
  gauge_layer_ = fit.gauge_layer.empty() ? layers.front().name : fit.gauge_layer;
  const auto gauge =
      std::find_if(layers.begin(), layers.end(), [&](const LayerScene& l) { return l.name == gauge_layer_; });
  if (gauge == layers.end())
    throw InputError("fit: gauge_layer", "'" + gauge_layer_ + "'", "the name of a layer of the scene");
  gauge_modulus_ = gauge->youngs_modulus;

  for (const FitParameter& parameter : fit.parameters) add_variable(parameter);
  initial_.resize(size());
  lower_.resize(size());
  upper_.resize(size());
  for (int k = 0; k < size(); ++k) {
    const FitVariable& v = variables_[k];
    if (v.transform == ParameterTransform::logit) {
      upper_[k] = -std::log(kLogitMargin);
      lower_[k] = -upper_[k];
    } else {
      lower_[k] = v.to_transformed(v.lower);
      upper_[k] = v.to_transformed(v.upper);
    }
    initial_[k] = std::clamp(v.to_transformed(v.initial), lower_[k], upper_[k]);
  }
  following_ = penalties_that_follow();

  gauge_is_free_ = modulus_variable(gauge_layer_) >= 0;
  for (const LayerScene& l : layers) gauge_is_free_ = gauge_is_free_ && modulus_variable(l.name) >= 0;
  if (scene.ligaments)
    gauge_is_free_ = gauge_is_free_ &&
                     std::any_of(variables_.begin(), variables_.end(),
                                 [](const FitVariable& v) { return v.address == "/ligaments/stiffness"; });
}

void Parametrisation::add_variable(const FitParameter& parameter) {
  ParameterSpec spec;
  if (parameter.moves.empty())
    spec = describe_parameter(scene_, parameter.address);
  else
    spec.address = parameter.address, spec.name = parameter.name, spec.unit = "σ";
  FitVariable v{.address = spec.address,
                .name = spec.name,
                .unit = spec.unit,
                .transform = parameter.transform.value_or(spec.transform),
                .initial = parameter.initial.value_or(spec.value),
                .lower = parameter.lower.value_or(spec.lower),
                .upper = parameter.upper.value_or(spec.upper),
                .prior_sigma = parameter.prior_sigma,
                .moves = parameter.moves};
  const std::string where = "fit: " + v.address;
  for (const FitVariable& other : variables_)
    if (other.address == v.address) throw InputError(where, "a second entry", "each address once");
  if (!(v.lower < v.upper))
    throw InputError(where, "lower " + number(v.lower) + ", upper " + number(v.upper), "lower < upper");
  if (v.transform == ParameterTransform::log && !(v.lower > 0))
    throw InputError(where, "lower " + number(v.lower), "a positive lower bound with transform log");
  if (!(v.initial >= v.lower && v.initial <= v.upper))
    throw InputError(where, "initial " + number(v.initial),
                     "a value in " + number(v.lower) + ".." + number(v.upper));
  if (v.prior_sigma && !(*v.prior_sigma > 0))
    throw InputError(where, "prior_sigma " + number(*v.prior_sigma), "a positive number");
  if (v.moves.empty()) {
    Scene trial = scene_;  // refuses bounds that no scene may hold
    set_parameter(trial, v.address, v.lower);
    set_parameter(trial, v.address, v.upper);
    set_parameter(scene_, v.address, v.initial);
  }
  variables_.push_back(std::move(v));
}

std::vector<std::string> Parametrisation::penalties_that_follow() const {
  std::vector<std::string> addresses;
  if (modulus_variable(gauge_layer_) < 0) return addresses;
  const auto is_fitted = [&](const std::string& address) {
    return std::any_of(variables_.begin(), variables_.end(),
                       [&](const FitVariable& v) { return v.address == address; });
  };
  for (const ParameterSpec& spec : all_parameters(scene_)) {
    const bool is_penalty = spec.address == "/base/stiffness" ||
                            (spec.address.starts_with("/colliders/") && spec.address.ends_with("/stiffness"));
    if (is_penalty && !is_fitted(spec.address)) addresses.push_back(spec.address);
  }
  return addresses;
}

int Parametrisation::modulus_variable(const std::string& layer) const {
  for (int k = 0; k < size(); ++k)
    if (variables_[k].address == modulus_address(layer)) return k;
  return -1;
}

VectorXd Parametrisation::values(const VectorXd& t) const {
  require(t.size() == size(), "Parametrisation: wrong number of variables");
  VectorXd p(size());
  for (int k = 0; k < size(); ++k) p[k] = variables_[k].to_parameter(t[k]);
  return p;
}

Scene Parametrisation::scene(const VectorXd& t) const {
  const VectorXd p = values(t);
  Scene scene = scene_;
  // exp and ln round: a bound must not be overstepped by the last bit.
  for (int k = 0; k < size(); ++k) {
    const FitVariable& v = variables_[k];
    const double value = std::clamp(p[k], v.lower, v.upper);
    if (v.moves.empty()) set_parameter(scene, v.address, value);
    if (value == 0) continue;
    for (const auto& [address, amount] : v.moves)
      set_parameter(scene, address, get_parameter(scene, address) + amount * value);
  }
  if (const int gauge = modulus_variable(gauge_layer_); gauge >= 0)
    for (const std::string& address : following_)
      set_parameter(scene, address, get_parameter(scene_, address) * p[gauge] / gauge_modulus_);
  return scene;
}

MatrixXd Parametrisation::native_directions(const SceneModel& model, const VectorXd& t) const {
  const Scene at = scene(t);
  MatrixXd directions(model.native().size(), size());
  for (int k = 0; k < size(); ++k) {
    const FitVariable& v = variables_[k];
    if (v.moves.empty())
      directions.col(k) = model.native_derivative(at, v.address);
    else
      directions.col(k).setZero();
    for (const auto& [address, amount] : v.moves)
      directions.col(k) += amount * model.native_derivative(at, address);
    directions.col(k) *= v.derivative(t[k]);
  }
  if (const int gauge = modulus_variable(gauge_layer_); gauge >= 0)
    for (const std::string& address : following_)
      directions.col(gauge) += model.native_derivative(at, address) *
                               (get_parameter(scene_, address) / gauge_modulus_) *
                               variables_[gauge].derivative(t[gauge]);
  return directions;
}

std::string Parametrisation::gauge_sentence() const {
  std::string held;
  for (const LayerScene& l : scene_.skin.layers)
    if (modulus_variable(l.name) < 0) held += (held.empty() ? "" : ", ") + l.name;
  const std::string why =
      " Displacements do not tell the overall stiffness: all moduli, ligament and contact stiffnesses scale "
      "together.";
  if (modulus_variable(gauge_layer_) < 0)
    return "The Young's modulus of layer " + gauge_layer_ + " was held at " + number(gauge_modulus_) +
           " MPa; every other stiffness is relative to it." + why;
  const std::string follow =
      following_.empty() ? "" : " Contact penalties followed the modulus of layer " + gauge_layer_ + ".";
  if (gauge_is_free_)
    return "Nothing was held: all stiffnesses were fitted, so only their ratios mean anything." + follow +
           why;
  return "The modulus of layer " + gauge_layer_ + " was fitted relative to what was held" +
         (held.empty() ? " (ligament stiffness)" : " (Young's modulus of " + held + ")") + "." + follow + why;
}

}  // namespace rhytid::fitting
