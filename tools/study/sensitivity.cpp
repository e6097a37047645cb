#include "tools/study/sensitivity.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <ostream>

#include "adjoint/ligament_gradient.h"
#include "adjoint/output_values.h"
#include "sim/core/error.h"
#include "sim/output/text.h"
#include "tools/polished_run.h"
#include "tools/study/sensitivity_report.h"
#include "tools/study/study_page.h"
#include "tools/study/study_run.h"

namespace rhytid::tools {
namespace {

using adjoint::ParameterSpace;

/// Below this part of the largest response a parameter has none but rounding.
constexpr double kNoEffect = 1e-10;
constexpr double kInfinity = std::numeric_limits<double>::infinity();

std::vector<std::string> addresses_of(const std::vector<ParameterSpec>& specs) {
  std::vector<std::string> list;
  for (const ParameterSpec& spec : specs) list.push_back(spec.address);
  return list;
}

MatrixXd without_column(const MatrixXd& m, int column) {
  MatrixXd rest(m.rows(), m.cols() - 1);
  rest << m.leftCols(column), m.rightCols(m.cols() - 1 - column);
  return rest;
}

/// Deviations of all coordinates; those of open ones are infinite.
VectorXd deviations_of(const adjoint::Directions& d) {
  const Eigen::Index n = d.right_vectors.cols();
  const MatrixXd basis = d.basis();
  VectorXd result(n);
  for (Eigen::Index k = 0; k < n; ++k)
    result[k] = d.is_open(VectorXd::Unit(n, k)) ? kInfinity : basis.row(k).norm();
  return result;
}

/// The parameter that is taken as known: what was asked for, else the softest layer's modulus if there is a
/// gauge to fix.
int held_parameter(const Sensitivity& s, const SensitivityOptions& options) {
  int softest = -1;
  for (int k = 0; k < static_cast<int>(s.parameters.size()); ++k) {
    const ParameterSpec& spec = s.parameters[k];
    if (spec.address == options.hold) return k;
    if (spec.address.starts_with("/skin/layers/") && spec.address.ends_with("/youngs_modulus") &&
        (softest < 0 || spec.value < s.parameters[softest].value))
      softest = k;
  }
  return s.has_gauge && options.hold.empty() ? softest : -1;
}

/// Keeps the columns of `response` that move something and names the others.
void drop_without_effect(Sensitivity& s, const ParameterSpace& space, const adjoint::TangentResult& tangent,
                         std::vector<int>& kept) {
  const std::vector<ParameterSpec>& specs = space.specs();
  VectorXd largest = VectorXd::Zero(static_cast<Eigen::Index>(specs.size()));
  for (const MatrixXd& frame : tangent.frames)
    if (frame.rows() > 0) largest = largest.cwiseMax(frame.cwiseAbs().colwise().maxCoeff().transpose());
  for (int k = 0; k < largest.size(); ++k) {
    if (largest[k] > kNoEffect * largest.maxCoeff()) {
      kept.push_back(k);
      s.parameters.push_back(specs[k]);
      s.coordinates.push_back(space.coordinates()[k]);
    } else {
      s.without_effect.push_back(specs[k].address);
    }
  }
}

/// Leaves the rows of `first` in the tangents and returns those below them.
std::vector<MatrixXd> split_off(adjoint::TangentResult& tangent, const adjoint::Output& first) {
  std::vector<MatrixXd> rest;
  for (std::size_t f = 0; f < tangent.frames.size(); ++f) {
    MatrixXd& frame = tangent.frames[f];
    const Eigen::Index rows = first.size(static_cast<int>(f));
    rest.push_back(frame.bottomRows(frame.rows() - rows));
    frame.conservativeResize(rows, Eigen::NoChange);
  }
  return rest;
}

/// A tenth of the coordinates along a direction, with what that is of places and of fractions: "by 10 %", "by
/// 0.5 mm", "by 10 % (knot by 0.5 mm)".
std::string by_a_tenth(const Sensitivity& s, const VectorXd& direction) {
  const std::vector<int> named = adjoint::named_components(direction);
  std::string others;
  for (const int k : named) {
    const adjoint::Coordinate& c = s.coordinates[k];
    if (c.transform == ParameterTransform::log) continue;
    const std::string by =
        " by " + (c.transform == ParameterTransform::none ? deviation_text(0.1, c, s.parameters[k].unit)
                                                          : std::string("10 % of its odds"));
    if (named.size() == 1) return by;
    others += (others.empty() ? "" : ", ") + s.parameters[k].name + by;
  }
  return " by 10 %" + (others.empty() ? "" : " (" + others + ")");
}

void add_map(Sensitivity& s, const SceneModel& scene_model, const Trajectory& run,
             const SensitivityOptions& options) {
  const Model& model = scene_model.model();
  const int frames = run.frames(), first = options.map_all_frames ? 1 : frames;
  const adjoint::MeanSquareDisplacement mean(model.mesh, first);
  const double weight = 1.0 / (frames - first + 1);
  std::vector<VectorXd> weights;
  for (int f = 0; f <= frames; ++f) {
    weights.push_back(VectorXd::Constant(mean.size(f), weight));
    if (mean.size(f) > 0) s.figure += weight * mean.values(f, run.at_frame(f))[0];
  }
  if (scene_model.ligaments() == nullptr) return;
  const auto gradient = adjoint::adjoint_sweep(model, scene_model.native(), run, mean, weights);
  s.b = adjoint::ligament_gradient(model, model.native);
  s.dJ_db = adjoint::ligament_gradient(model, gradient.native_bar);
  s.area = adjoint::column_areas(model.mesh, false);
  constexpr double mm2_per_cm2 = 100;
  s.share = mm2_per_cm2 / s.figure * s.b.cwiseProduct(s.dJ_db).cwiseQuotient(s.area);
}

}  // namespace

void judge(Sensitivity& s, const SensitivityOptions& options, const std::optional<VectorXd>& gauge) {
  const auto n = static_cast<Eigen::Index>(s.parameters.size());
  std::vector<std::string> names;
  for (const ParameterSpec& spec : s.parameters) names.push_back(spec.name);
  const MatrixXd whitened = options.tracks.weight() * s.response.root;
  s.directions = adjoint::directions_of(whitened);
  s.has_gauge = gauge && adjoint::lead_null_space(s.directions, *gauge);
  s.deviations = deviations_of(s.directions);

  s.held = held_parameter(s, options);
  const adjoint::Directions fixed =
      s.held >= 0 ? adjoint::directions_of(without_column(whitened, s.held)) : s.directions;
  const VectorXd fixed_deviations = deviations_of(fixed);
  const MatrixXd basis = fixed.basis(), covariance = basis * basis.transpose();
  s.held_deviations = VectorXd::Zero(n);
  s.correlation = MatrixXd::Identity(n, n);
  const auto place = [&](Eigen::Index k) { return k - (s.held >= 0 && k > s.held ? 1 : 0); };
  for (Eigen::Index a = 0; a < n; ++a) {
    if (a != s.held) s.held_deviations[a] = fixed_deviations[place(a)];
    for (Eigen::Index b = 0; b < n; ++b) {
      if (a == b) continue;
      const bool is_open = a == s.held || b == s.held || !std::isfinite(fixed_deviations[place(a)]) ||
                           !std::isfinite(fixed_deviations[place(b)]);
      s.correlation(a, b) =
          is_open ? std::numeric_limits<double>::quiet_NaN()
                  : covariance(place(a), place(b)) / fixed_deviations[place(a)] / fixed_deviations[place(b)];
    }
  }

  s.sentences.clear();
  for (Eigen::Index i = n - 1; i >= 0; --i) {
    const VectorXd v = s.directions.right_vectors.col(i);
    if (i >= s.directions.rank) {
      s.sentences.push_back(
          i == s.directions.rank && s.has_gauge
              ? "All stiffnesses together: scaling all of them by one factor moves nothing. "
                "Positions tell ratios of stiffnesses only; a force, or one modulus that is "
                "known, sets the scale."
              : adjoint::direction_in_words(v, names) + " moves nothing.");
    } else if (s.directions.singular_values[i] < 1) {
      s.sentences.push_back(
          adjoint::direction_in_words(v, names) + by_a_tenth(s, v) + " changes all tracks together by " +
          short_text(0.1 * s.directions.singular_values[i], 2) + " standard deviations only.");
    }
  }
}

ExitCode run_sensitivity(VerbContext& context, const SensitivityOptions& options) {
  Progress& progress = context.progress;
  const StudyScene loaded = load_study_scene(context, options.size, options.variant);
  const SceneModel scene_model(loaded.scene);
  const Model& model = scene_model.model();
  const std::vector<ParameterSpec> specs = study_parameters(scene_model.scene(), options.addresses);
  if (specs.empty()) throw InputError(context.options.file, "no parameters", "a scene with at least one");
  SensitivityOptions used = options;
  used.shown_variant = loaded.variant;
  if (!options.hold.empty()) used.hold = describe_parameter(scene_model.scene(), options.hold).address;
  if (!used.hold.empty() && std::none_of(specs.begin(), specs.end(),
                                         [&](const ParameterSpec& p) { return p.address == used.hold; }))
    throw InputError("--hold", "'" + options.hold + "'", "one of the parameters that are studied");
  require_frames(scene_model.scene(), context.options.file);
  const ShownFigures shown(model, loaded.measure);
  const std::string folder = context.output_folder();

  ExitCode code = ExitCode::ok;
  const std::optional<Trajectory> run = polished_run(scene_model, progress, code);
  if (!run) return code;
  Sensitivity s;
  try {
    progress.stage("tangent of " + std::to_string(specs.size()) + " parameters", 0);
    const ParameterSpace space(scene_model, addresses_of(specs));
    const auto outer = std::make_shared<adjoint::OuterDisplacements>(model.mesh);
    adjoint::TangentResult tangent =
        adjoint::tangent_sweep(model, scene_model.native(), *run,
                               adjoint::CombinedOutput({outer, shown.output()}), space.jacobian());
    std::vector<MatrixXd> of_shown = split_off(tangent, *outer);
    std::vector<int> kept;
    drop_without_effect(s, space, tangent, kept);
    for (std::vector<MatrixXd>* frames : {&tangent.frames, &of_shown})
      for (MatrixXd& frame : *frames) frame = frame(Eigen::all, kept).eval();
    s.shown =
        shown.figures(adjoint::output_values(model, scene_model.native(), *run, *shown.output()), of_shown);
    if (std::find(s.without_effect.begin(), s.without_effect.end(), used.hold) != s.without_effect.end())
      throw InputError("--hold", "'" + options.hold + "'", "a parameter that has an effect");
    if (kept.empty())
      throw InputError(context.options.file, "parameters without any effect", "a scene that moves");
    s.response = adjoint::surface_response(model.mesh, tangent, options.tracks.view);
    // What has no effect may have part in the gauge, and is left out of it without loss.
    std::optional<VectorXd> gauge = adjoint::gauge_coordinates(model, space.jacobian());
    if (gauge) gauge = VectorXd((*gauge)(kept));
    judge(s, used, gauge);
    if (progress.interrupted()) {
      progress.note("interrupted; nothing is kept, the same command starts over");
      return ExitCode::interrupted;
    }
    progress.stage("adjoint", 0);
    add_map(s, scene_model, *run, options);
  } catch (const adjoint::GradientError& error) {
    progress.error(std::string("the run has no gradient: ") + error.what());
    return ExitCode::not_converged;
  }
  progress.stage("files", 0);
  write_sensitivity(folder, scene_model, run->steps.back().step.t, s, used);
  progress.finish();
  context.out << sensitivity_text(s, used) << "written to " << folder
              << ": index.html, parameters.csv and more\n";
  return ExitCode::ok;
}

}  // namespace rhytid::tools
