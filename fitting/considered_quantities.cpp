#include "fitting/considered_quantities.h"

#include <algorithm>
#include <cstdio>

#include "fitting/difference_shifts.h"
#include "sim/core/error.h"
#include "sim/scene/located_json.h"
#include "sim/scene/scene_quantity.h"

namespace rhytid::fitting {
namespace {

std::string number(double x) {
  char text[32];
  std::snprintf(text, sizeof text, "%.3g", x);
  return text;
}

bool has(const Scene& scene, const std::string& address) {
  try {
    describe_quantity(scene, address);
    return true;
  } catch (const InputError&) {
    return false;
  }
}

/// A folder's name: addresses have slashes.
std::string folder_of(const ConsideredQuantity& q) {
  std::string name = (q.clip.empty() ? "" : "/clips/" + q.clip) + q.address;
  std::replace(name.begin(), name.end(), '/', '_');
  return "/moved" + name;
}

}  // namespace

std::vector<ConsideredQuantity> considered_quantities(const JointFitInput& input) {
  std::vector<ConsideredQuantity> list;
  const auto add = [&list](const ConsideredQuantity& q) {
    const bool is_known = std::any_of(list.begin(), list.end(), [&q](const ConsideredQuantity& other) {
      return other.address == q.address && other.clip == q.clip;
    });
    if (!is_known && q.sigma > 0) list.push_back(q);
  };
  if (input.options.consider) {
    for (const ConsideredQuantity& q : input.options.consider_quantities) add(q);
    return list;
  }
  for (const FitClip& clip : input.clips)
    for (const LayerScene& layer : clip.scene.skin.layers)
      add({.address = "/skin/layers/" + escape_key(layer.name) + "/thickness",
           .sigma = kThicknessSigma,
           .is_relative = true});
  return list;
}

Scene moved_scene(const Scene& scene, const ConsideredQuantity& q) {
  const double value = describe_quantity(scene, q.address).value;
  return with_quantity(scene, q.address, q.is_relative ? value * (1 + q.sigma) : value + q.sigma);
}

std::vector<SystematicShift> quantity_shifts(const JointFitInput& input, JointProblem& problem,
                                             const VectorXd& t, const FitProblem::Linearised& linearised,
                                             const MatrixXd& basis, const FitObserver& observer) {
  std::vector<OtherFit> fits;
  for (const ConsideredQuantity& q : considered_quantities(input)) {
    OtherFit& fit = fits.emplace_back();
    fit.input = input;
    if (!input.evaluations.empty()) fit.input.evaluations += folder_of(q);
    std::string name, unit;
    for (FitClip& clip : fit.input.clips) {
      if ((!q.clip.empty() && q.clip != clip.name) || !has(clip.scene, q.address)) continue;
      const SceneQuantity found = describe_quantity(clip.scene, q.address);
      name = found.name + (q.clip.empty() ? "" : " (" + q.clip + ")"), unit = unit_text(found.dimension);
      try {
        clip.scene = moved_scene(clip.scene, q);
      } catch (const InputError& error) {
        fit.failure = error.what();
      }
    }
    const std::string by =
        q.is_relative ? number(100 * q.sigma) + " %" : number(q.sigma) + (unit.empty() ? "" : " " + unit);
    fit.name = "held " + name;
    fit.change = name + " off by " + by + ", run with so much more";
    fit.note = "held values: " + name + " off by " + by;
    fit.axis = {
        .name = name, .unit = q.is_relative ? "%" : unit, .amount = q.is_relative ? 100 * q.sigma : q.sigma};
  }
  return difference_shifts(fits, problem, t, linearised, basis, observer);
}

}  // namespace rhytid::fitting
