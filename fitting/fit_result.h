// What a fit found: the one record from which the terminal answer, fit.json and report.html are made.
#pragma once

#include <limits>
#include <optional>
#include <string>
#include <vector>

#include "sim/core/types.h"
#include "sim/scene/scene.h"

namespace rhytid::fitting {

struct FittedParameter {
  std::string address, name, unit, transform;           ///< transform: none | log | logit
  double initial = 0, value = 0, lower = 0, upper = 0;  ///< internal units
  /// Standard deviation in the transformed parameter (log: relative), the shifts of the discretisation
  /// included; NaN = undetermined.
  double sigma = 0;
  /// 95 % interval in the parameter itself, internal units (identifiability.h).
  double low95 = 0, high95 = 0;
  bool at_bound = false, determined = true;
  std::optional<double> truth;  ///< known in twin experiments
};

/// A quantity derived from the parameters, with its own interval (e.g. the modulus ratio of the layers).
struct DerivedQuantity {
  std::string name, unit;
  double value = 0, low95 = 0, high95 = 0;
  std::optional<double> truth;
  /// Address of the only fitted parameter that it hangs on, and its power there (1 or −1); empty with several.
  std::string follows = {};
  double power = 1;
};

/// One change of the model that the residuals may look like (residual_signature.h).
struct ResidualAxis {
  std::string name;       ///< what is off: "finger path x", "film thickness"
  std::string unit = {};  ///< mm, %, ...; empty: times the change
  double amount = 1;      ///< of the change that was looked at, in that unit
  double estimate = 0;    ///< by how much of that change the residuals say that it is off
  double sigma = 0;       ///< of the estimate, where whitened residuals have variance 1
};

/// By how much the answer would move with one kind of step of the discretisation finer (discretisation.h), or
/// with something that is held off by what is left of its deviation (consider.h, considered_quantities.h).
struct SystematicShift {
  std::string name;           ///< thickness | plane | steps | held NAME
  std::string change;         ///< what was changed, in words
  std::string failure;        ///< why it could not be run; empty when it was
  double rms_px = 0;          ///< by which predictions moved, over all observations; 0 where not looked at
  double seconds = 0;         ///< that it took
  std::vector<double> shift;  ///< [parameters] of the transformed parameters; empty when it was not run
  /// Of several errors that are told together: shifts whose squares add up to those of `shift`, which has no sign then.
  std::vector<std::vector<double>> axes = {};
  std::vector<ResidualAxis> signature = {};  ///< what the residuals say of it; empty where not looked at
  double explained = 0;                      ///< of |z|² of the whitened residuals, by the whole signature
  /// Of something held, by error: root mean square, in deviations, that the residuals leave of it (error_posterior.h); `shift`
  /// has this factor. Empty where they were not asked.
  std::vector<double> left = {};
  /// [residuals][errors] by which the whitened residuals change with each error by a deviation; only while fitting.
  MatrixXd columns = {};
  bool is_held() const { return name.starts_with("held"); }
};

/// Name of the shift that has all others together, where the residuals were asked about them.
inline constexpr const char* kTogether = "together";

/// The shifts whose squares intervals have: the one of all together where there is one, else each that could be run.
std::vector<const SystematicShift*> counted_shifts(const std::vector<SystematicShift>& shifts);

/// A view that was not filmed, and what it would do to the deviations (further_views.h).
struct FurtherView {
  std::string name;  ///< in words: "another camera 45° to the left"
  /// [parameters] deviation from noise with it per deviation without; NaN where the footage leaves a
  /// parameter open.
  std::vector<double> ratios;
};

/// A cheaper fit before the fit (stages.h).
struct FittedStage {
  std::string change, status;  ///< what it did otherwise; converged | max_evaluations | failed: ...
  int forward_runs = 0;
  double cost = 0, seconds = 0;
  std::vector<double> values;  ///< where it ended, internal units
};

struct FitIteration {
  int iteration = 0, evaluations = 0;
  double cost = 0, gradient_norm = 0, step_norm = 0, seconds = 0;
  std::vector<double> values;  ///< of the parameters, internal units
};

/// One of several starts (starts.h); the first is the case's own.
struct FittedStart {
  std::vector<double> initial;  ///< values of the parameters, internal units
  /// On the early frames, comparable among starts alone; NaN when that run failed.
  double screened_cost = std::numeric_limits<double>::quiet_NaN();
  std::string failure;  ///< of that run
  /// Of the search from there; empty, NaN and 0 when there was none or all its runs failed.
  std::string status;
  double final_cost = std::numeric_limits<double>::quiet_NaN();
  std::vector<double> values;
  int forward_runs = 0;
  int optimum = 0;  ///< 1 = the best; starts with the same number ended at the same values; 0 = none
  std::vector<int> evaluations;  ///< of the search so far, at each of its iterations
  std::vector<double> costs;     ///< there
};

/// One value of a profile (profile.h), the others fitted again.
struct ProfilePoint {
  double value = 0;  ///< of the parameter, internal units
  double cost = 0;
  double deviance = 0;         ///< 2 (cost − cost of the answer)/w²
  std::string status;          ///< converged | max_evaluations; `optimum`: the answer itself
  int forward_runs = 0;        ///< that it took
  std::vector<double> values;  ///< of all parameters
};

/// Profile likelihood of one parameter; numbers in internal units.
struct ParameterProfile {
  std::string address;
  /// 95 % interval of the profile; the bound where that side is not bounded by the data.
  double low95 = 0, high95 = 0;
  bool bounded_below = true, bounded_above = true;
  /// Of the linearised model with the same noise, without the systematic shifts that the reported interval has.
  double linear_low95 = 0, linear_high95 = 0;
  double sigma = 0;                   ///< its standard deviation, transformed; NaN = undetermined
  double widening = 1, quantile = 0;  ///< w and q: the interval is where the deviance is below q²
  int forward_runs = 0;
  std::string warning;               ///< that a lower cost than the answer's was found; empty when not
  std::vector<ProfilePoint> points;  ///< by value
};

/// One observation against the fitted prediction.
struct FitResidual {
  int frame = 0, track = 0;
  double x_px = 0, y_px = 0;  ///< observed
  double predicted_x_px = 0, predicted_y_px = 0;
  double weight = 1;  ///< of the robust loss, 1 = full
  int clip = 0, view = 0;
};

/// A value measured besides pixels, against the fitted prediction.
struct FittedMeasurement {
  int clip = 0, frame = 0;
  std::string quantity;  ///< measurements.h, which also says the unit
  double value = 0, sigma = 0, predicted = 0;
};

/// What one camera of a clip contributed.
struct FittedView {
  std::string camera;
  int num_tracks = 0, num_observations = 0;
  double rms_px = 0;
  std::string footage_file, tracks_file, camera_file;  ///< as those of FitResult
};

/// What one of several clips contributed.
struct FittedClip {
  std::string name;
  int num_tracks = 0, tracks_left_out = 0, num_observations = 0, frames = 0;
  double rms_px = 0, cost = 0;
  /// |z_c|² over its share of the degrees of freedom, 2 observations − tr(J_c (JᵀJ)⁻¹ J_cᵀ).
  double reduced_chi_square = 0, degrees_of_freedom = 0;
  std::vector<FittedView> views;
  std::string scene_file, fitted_scene_file;  ///< as those of FitResult
};

struct FitResult;
/// What a profile says of a quantity that hangs on its parameter alone.
struct DerivedProfile {
  std::string name, unit;
  double value = 0, low95 = 0, high95 = 0, linear_low95 = 0, linear_high95 = 0;
  bool bounded_below = true, bounded_above = true;
};
std::vector<DerivedProfile> derived_profiles(const FitResult& result, const ParameterProfile& profile);

struct FitResult {
  std::string case_name, case_file, optimiser, status;  ///< status: converged | max_evaluations | failed: ...
  bool converged = false;
  bool stopped = false;  ///< by the user, before it ended: not an answer; not written
  std::vector<FittedParameter> parameters;
  std::vector<DerivedQuantity> derived;
  std::string gauge;  ///< sentence: what was held fixed and why
  double initial_cost = 0, final_cost = 0;
  int num_observations = 0, num_tracks = 0, tracks_left_out = 0, frames = 0;
  double rms_px = 0;              ///< of the residuals
  double reduced_chi_square = 0;  ///< 2·cost / degrees of freedom; above 1, intervals are wider
  int forward_runs = 0, jacobian_runs = 0;
  double seconds = 0, forward_seconds = 0;  ///< whole fit; median forward run
  std::vector<FitIteration> history;
  std::vector<SystematicShift> systematic;  ///< finer steps, then what is held
  std::vector<ParameterProfile> profiles;   ///< of the parameters that were asked for
  std::vector<FittedStart> starts;          ///< empty when there was one
  VectorXd singular_values;              ///< of the whitened Jacobian by transformed parameters, descending
  MatrixXd right_vectors;                ///< [parameters][parameters] columns belong to singular_values
  MatrixXd correlation;                  ///< [parameters][parameters] of the covariance that sigma is from
  std::vector<std::string> cannot_tell;  ///< sentences: what the footage does not determine
  std::vector<std::string> misfit;       ///< sentences: what residuals above the noise look like
  std::vector<std::string> notes;        ///< schemes, settings, warnings
  std::vector<FitResidual> residuals;
  std::vector<FurtherView> further_views;
  std::vector<FittedStage> stages;
  std::vector<FittedMeasurement> measured;  ///< empty where nothing was measured besides
  /// Files as found from the folder of results, or absolute. scene_file is what the fit began from.
  std::string scene_file, footage_file, tracks_file, camera_file;
  std::vector<std::string> settings;  ///< changes of the case by --set
  /// The scene at the fitted values, with everything that settings changed and penalties that follow the
  /// gauge: a scene file like any other, beside fit.json. Empty when no run succeeded.
  std::string fitted_scene_file;
  std::optional<Scene> fitted_scene;  ///< to be written there; not read back
  /// Of a fit of several clips or cameras; empty where one camera saw one clip. The files above are then
  /// those of the first.
  std::vector<FittedClip> clips;
  std::vector<Scene> fitted_scenes;  ///< of the clips, to be written; not read back
  /// The address of a fitted parameter in the scene of a clip; empty when it is another clip's, or the offset of a
  /// path, which is no parameter of a scene.
  std::string address_in_clip(const FittedParameter& parameter, int clip) const;
};

/// fit.json (everything but the following), residuals.csv and the fitted scene in `folder`; each atomically.
void write_fit_result(const FitResult& result, const std::string& folder);
/// Reads the first two back. Throws InputError.
FitResult read_fit_result(const std::string& folder);

}  // namespace rhytid::fitting
