#include "fitting/joint_problem.h"

#include <algorithm>
#include <cmath>
#include <map>

#include "sim/core/error.h"
#include "sim/scene/parameter.h"

namespace rhytid::fitting {
namespace {

std::string label(const FitClip& clip) {
  return "clip '" + clip.name + "'" + (clip.files.empty() ? "" : " (" + clip.files + ")");
}

bool has_parameter(const Scene& scene, const std::string& address) {
  try {
    describe_parameter(scene, address);
    return true;
  } catch (const InputError&) {
    return false;
  }
}

void require_names(const std::vector<FitClip>& clips) {
  if (clips.empty()) throw InputError("fit: clips", "none", "at least one clip");
  for (std::size_t a = 0; a < clips.size(); ++a) {
    if (clips.size() > 1 && clips[a].name.empty())
      throw InputError("fit: clips", "one without a name", "a name for each");
    for (std::size_t b = 0; b < a; ++b)
      if (clips[a].name == clips[b].name)
        throw InputError("fit: clips", "two with the name '" + clips[a].name + "'",
                         "a name of its own for each");
  }
}

/// A parameter that moves several has them all or none.
bool has_parameter(const Scene& scene, const FitParameter& p) {
  return has_parameter(scene, p.moves.empty() ? p.address : p.moves.front().first);
}

/// What the first clip that has it says about a parameter, so that all clips mean the same by it.
FitParameter complete(const FitParameter& given, const Scene& scene) {
  if (!given.moves.empty()) return given;
  const ParameterSpec spec = describe_parameter(scene, given.address);
  FitParameter p = given;
  p.address = spec.address;
  p.initial = given.initial.value_or(spec.value);
  p.lower = given.lower.value_or(spec.lower);
  p.upper = given.upper.value_or(spec.upper);
  p.transform = given.transform.value_or(spec.transform);
  return p;
}

}  // namespace

std::string joint_address(const FitParameter& parameter) {
  return parameter.clip.empty() ? parameter.address : "/clips/" + parameter.clip + parameter.address;
}

JointProblem::JointProblem(const std::vector<FitClip>& clips, const FitCase& fit) {
  require_names(clips);
  for (const FitClip& clip : clips) names_.push_back(clip.name);
  choose_variables(clips, fit);
  build_clips(clips, fit);
  if (num_clips() > 1) require_one_gauge();
}

void JointProblem::choose_variables(const std::vector<FitClip>& clips, const FitCase& fit) {
  parameters_.resize(clips.size());
  columns_.resize(clips.size());
  int column = 0;
  for (const FitParameter& given : fit.parameters) {
    std::optional<FitParameter> common;
    for (std::size_t c = 0; c < clips.size(); ++c) {
      const bool is_of_clip = given.clip.empty() || given.clip == clips[c].name;
      // The only clip says itself what is wrong with an address.
      if (!is_of_clip || (clips.size() > 1 && !has_parameter(clips[c].scene, given))) continue;
      if (clips.size() == 1) {
        parameters_[c].push_back(given);
        common = given;
      } else if (!common) {
        common = complete(given, clips[c].scene);
        parameters_[c].push_back(*common);
      } else {
        parameters_[c].push_back(*common);
        parameters_[c].back().prior_sigma.reset();  // it counts once
      }
      columns_[c].push_back(column);
    }
    if (!common)
      throw InputError("fit: " + joint_address(given), "in no clip",
                       given.clip.empty() ? "a parameter of at least one clip's scene"
                                          : "a clip of the case and a parameter of its scene");
    ++column;
  }
  initial_.resize(column);
  lower_.resize(column);
  upper_.resize(column);
  variables_.resize(column);
}

void JointProblem::build_clips(const std::vector<FitClip>& clips, const FitCase& fit) {
  std::vector<bool> is_known(variables_.size(), false);
  for (std::size_t c = 0; c < clips.size(); ++c) {
    FitCase of_clip = fit;
    of_clip.parameters = parameters_[c];
    of_clip.clip_weight = clips[c].weight;
    try {
      clips_.emplace_back(clips[c].scene, of_clip, clips[c].cameras, clips[c].tracks, clips[c].measured);
    } catch (const InputError& error) {
      if (clips.size() == 1) throw;
      throw InputError(label(clips[c]) + ": " + error.what());
    }
    clips_.back().name = clips[c].name;
    const Parametrisation& p = clips_.back().parametrisation();
    for (int k = 0; k < p.size(); ++k) {
      const int column = columns_[c][k];
      if (is_known[column]) continue;
      is_known[column] = true;
      variables_[column] = p.variables()[k];
      initial_[column] = p.initial()[k];
      lower_[column] = p.lower()[k];
      upper_[column] = p.upper()[k];
      const FitParameter& given = parameters_[c][k];
      if (given.clip.empty()) continue;
      variables_[column].address = "/clips/" + given.clip + p.variables()[k].address;
      variables_[column].name += " (" + given.clip + ")";
    }
    clips_.back().on_run = [this](const FitProgress& of_clip_run) {
      running_.seconds += of_clip_run.seconds;
      running_.replayed = running_.replayed && of_clip_run.replayed;
    };
  }
}

void JointProblem::require_one_gauge() const {
  const std::string address = "/skin/layers/" + gauge_layer() + "/youngs_modulus";
  if (modulus_variable(gauge_layer()) >= 0) return;
  const auto held = [&](int c) {
    return get_parameter(clips_[c].parametrisation().scene(clips_[c].initial()), address);
  };
  for (int c = 1; c < num_clips(); ++c)
    if (held(c) != held(0))
      throw InputError("clip '" + names_[c] + "': " + address, std::to_string(held(c)) + " MPa",
                       std::to_string(held(0)) + " MPa as in clip '" + names_[0] +
                           "': the modulus that is held is the scale of all clips");
}

std::vector<std::string> JointProblem::differences() const {
  std::vector<std::string> sentences;
  const auto scene_of = [this](int c) { return clips_[c].parametrisation().scene(clips_[c].initial()); };
  const Scene first = scene_of(0);
  for (int c = 1; c < num_clips(); ++c) {
    const Scene scene = scene_of(c);
    std::string list;
    for (const ParameterSpec& spec : all_parameters(scene)) {
      const bool is_tissue =
          spec.address.starts_with("/skin/layers/") || spec.address.starts_with("/ligaments/");
      const bool is_own = std::any_of(variables_.begin(), variables_.end(), [&](const FitVariable& v) {
        return v.address.starts_with("/clips/") && v.address.ends_with(spec.address);
      });
      if (!is_tissue || is_own) continue;
      if (!has_parameter(first, spec.address) || get_parameter(first, spec.address) != spec.value)
        list += (list.empty() ? "" : ", ") + spec.address;
    }
    if (!list.empty())
      sentences.push_back("The skin of clip " + names_[c] + " is not that of clip " + names_[0] + ": " +
                          list + " differ and are not fitted per clip.");
  }
  return sentences;
}

int JointProblem::num_residuals() const {
  int n = 0;
  for (const FitProblem& clip : clips_) n += clip.num_residuals();
  return n;
}

int JointProblem::num_observations() const {
  int n = 0;
  for (const FitProblem& clip : clips_) n += clip.num_observations();
  return n;
}

int JointProblem::degrees_of_freedom() const {
  double weights = 0;
  for (const FitProblem& clip : clips_) weights += clip.sum_of_weights();
  int dof = static_cast<int>(std::lround(2 * weights)) + num_measured() - num_parameters();
  for (const FitVariable& v : variables_) dof += v.prior_sigma ? 1 : 0;
  return dof;
}

bool JointProblem::was_stopped() const {
  return std::any_of(clips_.begin(), clips_.end(), [](const FitProblem& p) { return p.was_stopped(); });
}

bool JointProblem::gauge_is_free() const {
  return std::all_of(clips_.begin(), clips_.end(),
                     [](const FitProblem& p) { return p.parametrisation().gauge_is_free(); });
}

int JointProblem::num_measured() const {
  int n = 0;
  for (const FitProblem& clip : clips_) n += static_cast<int>(clip.measured().size());
  return n;
}

bool JointProblem::has_forces() const {
  for (const FitProblem& clip : clips_)
    for (const MeasuredQuantities::Value& v : clip.measured())
      if (v.measurement.quantity.starts_with("force_")) return true;
  return false;
}

std::string JointProblem::gauge_sentence() const {
  if (has_forces() && gauge_is_free())
    return "Nothing was held: measured forces set the scale of all stiffnesses, with contact penalties that "
           "follow the "
           "modulus of layer " +
           gauge_layer() + ".";
  const std::string sentence = clips_[0].parametrisation().gauge_sentence();
  return has_forces() ? sentence + " Measured forces do: every modulus can be fitted." : sentence;
}

int JointProblem::modulus_variable(const std::string& layer) const {
  const int k = clips_[0].parametrisation().modulus_variable(layer);
  return k < 0 ? k : columns_[0][k];
}

void JointProblem::stop_when(const std::function<bool()>& should_stop) {
  for (FitProblem& clip : clips_) clip.should_stop = should_stop;
}

VectorXd JointProblem::values(const VectorXd& t) const {
  VectorXd p(num_parameters());
  for (int k = 0; k < num_parameters(); ++k) p[k] = variables_[k].to_parameter(t[k]);
  return p;
}

VectorXd JointProblem::of_clip(int c, const VectorXd& t) const {
  VectorXd own(columns_[c].size());
  for (std::size_t k = 0; k < columns_[c].size(); ++k) own[static_cast<Eigen::Index>(k)] = t[columns_[c][k]];
  return own;
}

int JointProblem::runs_of_clips() const {
  int runs = 0;
  for (const FitProblem& clip : clips_) runs += clip.counters().forward_runs;
  return runs;
}

void JointProblem::fail(int c, const std::string& why) {
  evaluation_.failed = true;
  evaluation_.failure = last_failure_ = num_clips() > 1 ? "clip '" + names_[c] + "': " + why : why;
}

const ObjectiveEvaluation& JointProblem::evaluate(const VectorXd& t) {
  require(t.size() == num_parameters(), "JointProblem: wrong number of variables");
  if (t_.size() != t.size() || t_ != t) run(t);
  return evaluation_;
}

void JointProblem::run(const VectorXd& t) {
  t_ = t;
  evaluation_ = ObjectiveEvaluation();
  evaluation_.failed = false;
  running_ = FitProgress();
  running_.replayed = true;
  const int runs_before = runs_of_clips();
  std::vector<const FitEvaluation*> parts;
  for (int c = 0; c < num_clips() && !evaluation_.failed; ++c) {
    parts.push_back(&clips_[c].evaluate(of_clip(c, t)));
    if (parts.back()->failed) fail(c, parts.back()->failure);
  }
  if (!evaluation_.failed) {
    evaluation_.residuals.resize(num_residuals());
    Eigen::Index row = 0;
    for (const FitEvaluation* part : parts) {
      evaluation_.cost += part->cost;
      evaluation_.residuals.segment(row, part->residuals.size()) = part->residuals;
      row += part->residuals.size();
    }
  }
  if (runs_of_clips() == runs_before) return;  // nothing that a budget counts
  running_.forward_runs = ++forward_runs_;
  running_.values = values(t);
  running_.cost = evaluation_.cost;
  running_.failed = evaluation_.failed;
  running_.failure = evaluation_.failure;
  if (on_run) on_run(running_);
}

std::optional<MatrixXd> JointProblem::jacobian(const VectorXd& t) {
  if (evaluate(t).failed) return std::nullopt;
  MatrixXd all = MatrixXd::Zero(num_residuals(), num_parameters());
  Eigen::Index row = 0;
  for (int c = 0; c < num_clips(); ++c) {
    const std::optional<MatrixXd> own = clips_[c].jacobian(of_clip(c, t));
    if (!own) {
      fail(c, clips_[c].last_failure());
      return std::nullopt;
    }
    for (std::size_t k = 0; k < columns_[c].size(); ++k)
      all.col(columns_[c][k]).segment(row, own->rows()) = own->col(static_cast<Eigen::Index>(k));
    row += own->rows();
  }
  return all;
}

std::optional<VectorXd> JointProblem::gradient(const VectorXd& t) {
  if (evaluate(t).failed) return std::nullopt;
  VectorXd all = VectorXd::Zero(num_parameters());
  for (int c = 0; c < num_clips(); ++c) {
    const std::optional<VectorXd> own = clips_[c].gradient(of_clip(c, t));
    if (!own) {
      fail(c, clips_[c].last_failure());
      return std::nullopt;
    }
    for (std::size_t k = 0; k < columns_[c].size(); ++k)
      all[columns_[c][k]] += (*own)[static_cast<Eigen::Index>(k)];
  }
  return all;
}

std::optional<FitProblem::Linearised> JointProblem::linearised(const VectorXd& t) {
  if (evaluate(t).failed) return std::nullopt;
  FitProblem::Linearised all{VectorXd::Zero(num_residuals()),
                             MatrixXd::Zero(num_residuals(), num_parameters())};
  Eigen::Index row = 0;
  for (int c = 0; c < num_clips(); ++c) {
    const auto own = clips_[c].linearised(of_clip(c, t));
    if (!own) {
      fail(c, clips_[c].last_failure());
      return std::nullopt;
    }
    const Eigen::Index n = own->residuals.size();
    all.residuals.segment(row, n) = own->residuals;
    for (std::size_t k = 0; k < columns_[c].size(); ++k)
      all.jacobian.col(columns_[c][k]).segment(row, n) = own->jacobian.col(static_cast<Eigen::Index>(k));
    row += n;
  }
  return all;
}

}  // namespace rhytid::fitting
