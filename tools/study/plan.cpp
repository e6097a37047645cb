#include "tools/study/plan.h"

#include <algorithm>
#include <ostream>

#include "adjoint/surface_response.h"
#include "sim/core/error.h"
#include "sim/core/parse_number.h"
#include "sim/output/text.h"
#include "sim/scene/load.h"
#include "tools/polished_run.h"

namespace rhytid::tools {
namespace {

bool is_in(const std::vector<std::string>& list, const std::string& item) {
  return std::find(list.begin(), list.end(), item) != list.end();
}

/// The upper triangle of R as columns of a result, and back.
void add_root(const MatrixXd& root, VariantResult& result) {
  for (Eigen::Index i = 0; i < root.rows(); ++i)
    for (Eigen::Index j = i; j < root.cols(); ++j)
      result.columns.push_back({"root_" + std::to_string(i) + "_" + std::to_string(j), "mm", root(i, j)});
}
std::optional<MatrixXd> root_of(const VariantResult& result, Eigen::Index n) {
  if (static_cast<Eigen::Index>(result.columns.size()) != n * (n + 1) / 2) return std::nullopt;
  MatrixXd root = MatrixXd::Zero(n, n);
  std::size_t at = 0;
  for (Eigen::Index i = 0; i < n; ++i)
    for (Eigen::Index j = i; j < n; ++j, ++at) {
      if (!result.columns[at].value) return std::nullopt;
      root(i, j) = *result.columns[at].value;
    }
  return root;
}

class Planning {
 public:
  Planning(VerbContext& context, const Experiment& experiment, const PlanOptions& options)
      : context_(context), experiment_(experiment), options_(options), folder_(context.options.output) {}

  ExitCode run() {
    choose_swipes();
    choose_parameters();
    choose_priors();
    for (const Variant* v : wanted_) {
      require_frames(scene_of(*v), experiment_.file + ": variant " + v->name);
      if (is_of_run(folder_ + "/" + v->name))
        throw InputError(folder_ + "/" + v->name, "a run of a sweep or of `simulate`",
                         "a folder of its own for the plan, by -o");
    }
    context_.output_folder();
    ExitCode worst = ExitCode::ok;
    for (const Variant* v : wanted_) {
      const ExitCode code = run(*v);
      if (code == ExitCode::interrupted) return code;
      if (code != ExitCode::ok) worst = code;
    }
    if (plan_.swipes.empty()) return worst;
    for (const std::string& name : options_.filmed) {
      const auto at = std::find(plan_.swipes.begin(), plan_.swipes.end(), name);
      const int swipe = static_cast<int>(at - plan_.swipes.begin());
      const bool is_twice = std::find(plan_.filmed.begin(), plan_.filmed.end(), swipe) != plan_.filmed.end();
      if (at != plan_.swipes.end() && !is_twice) plan_.filmed.push_back(swipe);
    }
    context_.out << write_plan(folder_, experiment_, plan_, options_) << "written to " << folder_
                 << ": index.html, swipes.csv, pairs.csv, order.csv\n";
    return worst;
  }

 private:
  Scene scene_of(const Variant& v) const {
    std::vector<Setting> settings = v.settings;
    for (const std::string& text : context_.options.settings) settings.push_back({text});
    return load_scene(experiment_.scene, settings);
  }

  void choose_swipes() {
    for (const auto& [list, option] : {std::pair{&options_.only, "--only"}, {&options_.filmed, "--filmed"}})
      for (const std::string& name : *list)
        if (std::none_of(experiment_.variants.begin(), experiment_.variants.end(),
                         [&](const Variant& v) { return v.name == name; }))
          throw InputError(option, "'" + name + "'", "one of " + variant_names(experiment_));
    for (const Variant& v : experiment_.variants)
      if (options_.only.empty() || is_in(options_.only, v.name) || is_in(options_.filmed, v.name))
        wanted_.push_back(&v);
  }

  /// The unknowns are those of one face: the same in all swipes.
  void choose_parameters() {
    const std::vector<ParameterSpec> first = study_parameters(scene_of(*wanted_.front()), options_.addresses);
    std::vector<std::string> different;
    for (const ParameterSpec& spec : first) {
      bool is_common = true;
      for (const Variant* v : wanted_) {
        const Scene scene = scene_of(*v);
        const auto all = all_parameters(scene);
        const auto same = std::find_if(all.begin(), all.end(),
                                       [&](const ParameterSpec& p) { return p.address == spec.address; });
        const bool is_same = same != all.end() && same->value == spec.value;
        if (!is_same && !options_.addresses.empty())
          throw InputError(experiment_.file + ": variant " + v->name + ": " + spec.address,
                           same == all.end() ? "nothing" : short_text(same->value),
                           short_text(spec.value) + ", as in the other swipes");
        is_common = is_common && is_same;
      }
      if (is_common) {
        plan_.parameters.push_back(spec);
      } else {
        different.push_back(spec.address);
      }
    }
    for (const std::string& address : different)
      context_.progress.note(address + " is not the same in all swipes: taken as known");
    if (plan_.parameters.empty())
      throw InputError(experiment_.file, "no parameter with the same value in all swipes", "at least one");
    for (const ParameterSpec& spec : plan_.parameters) {
      addresses_.push_back(spec.address);
      plan_.coordinates.push_back(adjoint::coordinate_of(spec));
    }
  }

  void choose_priors() {
    plan_.priors = VectorXd::Constant(static_cast<Eigen::Index>(addresses_.size()), options_.prior);
    std::vector<std::string> known;
    for (const std::string& text : options_.priors) {
      const std::size_t equals = text.find('=');
      double deviation = 0;
      if (equals == std::string::npos || !parse(std::string_view(text).substr(equals + 1), deviation) ||
          !is_size(deviation))
        throw InputError("--prior-of", "'" + text + "'",
                         "ADDRESS=standard deviation of its coordinate, a number from 1e-9 to 1e9");
      const std::string address =
          describe_parameter(scene_of(*wanted_.front()), text.substr(0, equals)).address;
      const auto at = std::find(addresses_.begin(), addresses_.end(), address);
      if (at == addresses_.end())
        throw InputError("--prior-of", "'" + address + "'", "one of the parameters planned for");
      if (is_in(known, address))
        throw InputError("--prior-of", "'" + text + "', that address a second time", "each address once");
      known.push_back(address);
      plan_.priors[at - addresses_.begin()] = deviation;
    }
  }

  ExitCode run(const Variant& v) {
    const SceneModel scene_model(scene_of(v));
    std::string measure = "tangent";
    for (const std::string& address : addresses_) measure += " " + address;
    if (options_.tracks.view)
      for (const double x : *options_.tracks.view) measure += " " + exact_text(x);
    const VariantIdentity identity = study_identity(scene_model.scene(), scene_model.model(), measure);
    const std::string folder = folder_ + "/" + v.name;
    const auto n = static_cast<Eigen::Index>(addresses_.size());
    const auto earlier = read_variant(folder);
    if (earlier && earlier->finished() && earlier->identity == identity && !options_.anew) {
      const auto root = root_of(*earlier, n);
      if (earlier->status != "complete") {
        context_.progress.note(v.name + ": " + earlier->reason + " (before, kept)");
        plan_.left_out.push_back(v.name + " (" + earlier->reason + ")");
        return ExitCode::not_converged;
      }
      if (root) {
        context_.progress.note(v.name + ": complete before, kept");
        add(v, *root);
        return ExitCode::ok;
      }
    }
    context_.progress.note(v.name + ": runs");
    VariantResult result{v.name, identity, "complete", "", {}};
    CommonOptions own = context_.options;
    own.output = folder;
    VerbContext{own, context_.program, context_.progress, context_.out}.output_folder();
    ExitCode code = ExitCode::ok;
    try {
      const auto trajectory = polished_run(scene_model, context_.progress, code);
      if (code == ExitCode::interrupted) return code;
      if (!trajectory) {
        result.reason = "did not reach its last frame";
      } else {
        context_.progress.stage("tangent of " + std::to_string(n) + " parameters", 0);
        const adjoint::ParameterSpace space(scene_model, addresses_);
        const SkinMesh& mesh = scene_model.model().mesh;
        const auto tangent = adjoint::tangent_sweep(scene_model.model(), scene_model.native(), *trajectory,
                                                    adjoint::OuterDisplacements(mesh), space.jacobian());
        const MatrixXd root = adjoint::surface_response(mesh, tangent, options_.tracks.view).root;
        add_root(root, result);
        add(v, root);
      }
    } catch (const adjoint::GradientError& error) {
      result.reason = std::string("no gradient: ") + error.what();
    }
    if (!result.reason.empty()) {
      result.status = "not_converged";
      context_.progress.warning(v.name + ": " + result.reason);
      plan_.left_out.push_back(v.name + " (" + result.reason + ")");
    }
    write_variant(folder, result);
    return result.status == "complete" ? ExitCode::ok : ExitCode::not_converged;
  }

  void add(const Variant& v, const MatrixXd& root) {
    plan_.swipes.push_back(v.name);
    plan_.roots.push_back(options_.tracks.weight() * root);
  }

  VerbContext& context_;
  const Experiment& experiment_;
  const PlanOptions& options_;
  std::string folder_;
  std::vector<const Variant*> wanted_;
  std::vector<std::string> addresses_;
  Plan plan_;
};

}  // namespace

ExitCode run_plan(VerbContext& context, const Experiment& experiment, const PlanOptions& options) {
  return Planning(context, experiment, options).run();
}

}  // namespace rhytid::tools
