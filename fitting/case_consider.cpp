#include "fitting/case_consider.h"

#include <algorithm>
#include <cmath>

#include "fitting/considered_quantities.h"
#include "sim/core/error.h"
#include "sim/core/units.h"
#include "sim/scene/scene_quantity.h"

namespace rhytid::fitting {
namespace {

using nlohmann::json;

/// What is held and the case says how well it is known.
class ConsiderReader {
 public:
  ConsiderReader(const LocatedJson& located, const std::vector<Scene>& scenes, Case& c)
      : located_(located), scenes_(scenes), c_(c) {}

  void read() {
    if (!located_.json["fit"].contains("consider")) return;
    c_.fit.consider.emplace();
    for (std::size_t i = 0; i < located_.json["fit"]["consider"].size(); ++i) {
      pointer_ = "/fit/consider/" + std::to_string(i);
      item_ = &located_.json["fit"]["consider"][i];
      const std::string address = (*item_)["address"];
      if (is_parameter(address))
        for (FitParameter& named : parameters_named(c_, scenes_, address, where("address"))) read(named);
      else
        for (ConsideredQuantity& named : quantities_named(c_, scenes_, address, where("address")))
          read(named);
    }
  }

 private:
  std::string where(const std::string& key) const {
    return located_.where(pointer_ + "/" + key) + ": " + pointer_ + "/" + key;
  }
  bool is_relative() const { return item_->contains("relative"); }

  bool is_parameter(const std::string& address) const {
    try {
      parameters_named(c_, scenes_, address, "");
      return true;
    } catch (const InputError&) {
      return false;
    }
  }

  /// The deviation as the case has it, "sigma" in the given dimension.
  double deviation(Dimension dimension) const {
    if (is_relative()) return (*item_)["relative"].get<double>();
    const json& sigma = (*item_)["sigma"];
    const double value = sigma.is_number()
                             ? sigma.get<double>()
                             : parse_quantity(sigma.get_ref<const std::string&>(), dimension, where("sigma"));
    if (!(value >= 0)) throw InputError(where("sigma"), shown_json(sigma), "a deviation >= 0");
    return value;
  }

  const Scene& scene_of(const std::string& address, const std::string& clip) const {
    for (std::size_t s = 0; s < scenes_.size(); ++s) {
      if (!clip.empty() && c_.clips[s].name != clip) continue;
      try {
        describe_quantity(scenes_[s], address);
        return scenes_[s];
      } catch (const InputError&) {
      }
    }
    return scenes_.front();
  }

  void read(FitParameter& named) const {
    const ParameterSpec spec = describe_parameter(parameter_scene(named), named.address);
    const bool is_log = spec.transform == ParameterTransform::log;
    if (is_relative() && !is_log)
      throw InputError(where("relative"), "a fraction of " + named.address,
                       "sigma, since this one is not considered by its logarithm");
    const double given =
        deviation(spec.transform == ParameterTransform::none ? spec.dimension : dimension::none);
    named.prior_sigma = is_relative() ? std::log1p(given) : given;
    c_.fit.consider->push_back(std::move(named));
  }

  const Scene& parameter_scene(const FitParameter& named) const {
    for (std::size_t s = 0; s < scenes_.size(); ++s) {
      if (!named.clip.empty() && c_.clips[s].name != named.clip) continue;
      const std::vector<ParameterSpec> all = all_parameters(scenes_[s]);
      if (std::any_of(all.begin(), all.end(),
                      [&](const ParameterSpec& spec) { return spec.address == named.address; }))
        return scenes_[s];
    }
    return scenes_.front();
  }

  void read(ConsideredQuantity& named) const {
    named.is_relative = is_relative();
    if (named.address.starts_with("/colliders/") && named.address.ends_with("/path")) {
      if (is_relative()) throw InputError(where("relative"), "a fraction of a path", "sigma, in mm");
      named.sigma = deviation(dimension::length);
      c_.fit.consider_paths.push_back(std::move(named));
      return;
    }
    const Scene& scene = scene_of(named.address, named.clip);
    const SceneQuantity quantity = describe_quantity(scene, named.address);
    named.sigma = deviation(quantity.dimension);
    if (is_relative() && !(quantity.value > 0))
      throw InputError(where("relative"),
                       "a fraction of " + format_quantity(quantity.value, quantity.dimension, 6),
                       "sigma, since the value is not > 0");
    try {
      moved_scene(scene, named);
    } catch (const InputError& error) {
      throw InputError(where(is_relative() ? "relative" : "sigma") +
                       ": the scene is run with this much more: " + error.what());
    }
    c_.fit.consider_quantities.push_back(std::move(named));
  }

  const LocatedJson& located_;
  const std::vector<Scene>& scenes_;
  Case& c_;
  std::string pointer_;
  const json* item_ = nullptr;
};

}  // namespace

void read_considered(const LocatedJson& located, const std::vector<Scene>& scenes, Case& c) {
  ConsiderReader(located, scenes, c).read();
}

}  // namespace rhytid::fitting
