#include "tools/bench/recovery_variant.h"

#include <algorithm>

#include "sim/core/error.h"
#include "sim/output/text.h"
#include "sim/scene/names.h"
#include "sim/scene/parameter.h"

namespace rhytid::tools {
namespace {

constexpr double kHeldFriction = 0.7;  ///< of the truth: a fit that knows it to a third knows it well
constexpr double kThickness = 1.1;     ///< of the truth: about what ultrasound leaves open
constexpr double kShift = 0.5;         ///< mm: about what a tracked finger is off

void set(VariedCase& varied, const std::string& text) {
  varied.c.scene_settings.push_back({text, "a variant of bench recovery"});
}

bool hold_friction(const Scene& fit, const Scene& truth, VariedCase& varied) {
  auto& fitted = varied.c.fit.parameters;
  bool is_held = false;
  for (const ColliderScene& collider : fit.colliders) {
    const auto same = std::find_if(truth.colliders.begin(), truth.colliders.end(),
                                   [&](const ColliderScene& c) { return c.name == collider.name; });
    if (!collider.friction || same == truth.colliders.end() || !same->friction) continue;
    const std::string address = "/colliders/" + collider.name + "/friction/coefficient";
    set(varied, address + "=" + exact_text(kHeldFriction * same->friction->coefficient));
    std::erase_if(fitted, [&](const fitting::FitParameter& p) { return p.address == address; });
    is_held = true;
  }
  return is_held && !fitted.empty();
}

bool thicken(const Scene& fit, VariedCase& varied) {
  const LayerScene& inner = fit.skin.layers.front();
  if (!inner.thickness_map.empty()) return false;
  set(varied, "/skin/layers/" + inner.name + "/thickness=" + exact_text(kThickness * inner.thickness));
  return true;
}

bool shift_paths(const Scene& fit, VariedCase& varied) {
  bool is_shifted = false;
  for (const ColliderScene& collider : fit.colliders) {
    if (!collider.path_file.empty()) continue;
    for (std::size_t k = 0; k < collider.path.size(); ++k) {
      set(varied, "/colliders/" + collider.name + "/path/" + std::to_string(k) +
                      "/position/0=" + exact_text(collider.path[k].position[0] + kShift));
      is_shifted = true;
    }
  }
  return is_shifted;
}

bool fits_a_time(const VariedCase& varied) {
  const auto& fitted = varied.c.fit.parameters;
  return std::any_of(fitted.begin(), fitted.end(), [](const fitting::FitParameter& p) {
    return p.address.find("/relax") != std::string::npos;
  });
}

bool change_damper(const Scene& fit, VariedCase& varied) {
  if (!fits_a_time(varied)) return false;
  set(varied,
      std::string("/time/damper=") + (fit.time.damper == DamperScheme::literal ? "exponential" : "literal"));
  return true;
}

bool halve_steps(const Scene& fit, VariedCase& varied) {
  if (!fits_a_time(varied)) return false;
  set(varied, "/time/substeps=" + std::to_string(2 * fit.time.substeps));
  return true;
}

/// The truth is the fit's own scene at the truth's values.
bool same_discretisation(const Scene& fit, const Scene& truth, VariedCase& varied) {
  fitting::Case& c = varied.c;
  c.fit.discretisation_check = false;  // it has no error
  c.fit.consider.emplace();            // nor has what is held
  c.truth_scene = c.scene, c.truth_settings = c.scene_settings;
  const std::vector<ParameterSpec> known = all_parameters(truth);
  for (const ParameterSpec& spec : all_parameters(fit)) {
    const auto same = std::find_if(known.begin(), known.end(),
                                   [&](const ParameterSpec& k) { return k.address == spec.address; });
    if (same != known.end() && same->value != spec.value)
      c.truth_settings.push_back(
          {spec.address + "=" + exact_text(same->value), "a variant of bench recovery"});
  }
  return true;
}

}  // namespace

const std::vector<RecoveryVariant>& recovery_variants() {
  static const std::vector<RecoveryVariant> all = {
      {"as_is", "the case as it is"},
      {"same_discretisation",
       "the truth simulated with the fit's own mesh, elements and steps: noise and "
       "tracking are all that is left"},
      {"noise_x2", "twice the noise of the picture"},
      {"noise_x4", "four times the noise of the picture"},
      {"half_tracks", "every second track"},
      {"quarter_tracks", "every fourth track"},
      {"friction_held", "friction not fitted but held at 0.7 of the truth"},
      {"thicker", "the innermost layer 1.1 times as thick as it is"},
      {"finger_shifted", "the finger's path off by 0.5 mm along x"},
      {"other_damper", "the damper literal where it was exponential, or the reverse"},
      {"half_step", "half the time step"},
  };
  return all;
}

std::optional<VariedCase> varied_case(const fitting::Case& c, const Scene& fit, const Scene& truth,
                                      const std::string& name) {
  VariedCase varied{c};
  bool applies = true;
  if (name == "as_is") {
  } else if (name == "same_discretisation") {
    applies = same_discretisation(fit, truth, varied);
  } else if (name == "noise_x2") {
    varied.c.render.noise *= 2;
  } else if (name == "noise_x4") {
    varied.c.render.noise *= 4;
  } else if (name == "half_tracks") {
    varied.keep_every = 2;
  } else if (name == "quarter_tracks") {
    varied.keep_every = 4;
  } else if (name == "friction_held") {
    applies = hold_friction(fit, truth, varied);
  } else if (name == "thicker") {
    applies = thicken(fit, varied);
  } else if (name == "finger_shifted") {
    applies = shift_paths(fit, varied);
  } else if (name == "other_damper") {
    applies = change_damper(fit, varied);
  } else if (name == "half_step") {
    applies = halve_steps(fit, varied);
  } else {
    require(false, "varied_case: no such variant");
  }
  return applies ? std::optional(varied) : std::nullopt;
}

}  // namespace rhytid::tools
