#include "adjoint/certificate.h"

#include <algorithm>
#include <chrono>
#include <cmath>
#include <cstdio>
#include <cstring>
#include <limits>
#include <map>
#include <random>

#include "sim/core/error.h"
#include "sim/core/parallel.h"

namespace rhytid::adjoint {

namespace {

struct Stopped {};

// Of the largest slope: parameters below it are not scaled up further.
constexpr double kSmallestShare = 1e-4;
// Of the largest effect: below it a derivative is zero but for rounding, and no run could show it.
constexpr double kRounding = 1e-12;

std::string text(const char* format, auto... values) {
  char buffer[400];
  std::snprintf(buffer, sizeof buffer, format, values...);
  return buffer;
}

/// Restores the number of threads.
class ThreadScope {
 public:
  explicit ThreadScope(int count) : before_(num_threads()) { set_num_threads(count); }
  ~ThreadScope() { set_num_threads(before_); }
  ThreadScope(const ThreadScope&) = delete;
  ThreadScope& operator=(const ThreadScope&) = delete;

 private:
  int before_;
};

/// The state of one call of certify.
class Certification {
 public:
  Certification(const SceneModel& scene_model, const Trajectory& run, const Output& output,
                const std::vector<VectorXd>& weights, const CertificateOptions& options,
                const CertificateProgress& progress)
      : scene_model_(scene_model),
        model_(scene_model.model()),
        native_(scene_model.native()),
        run_(run),
        output_(output),
        weights_(weights),
        options_(options),
        progress_(progress),
        rng_(options.seed) {}

  CertificateReport run();

 private:
  void begin(const std::string& part, int total = 0) {
    part_ = part;
    done_ = 0;
    total_ = total;
    if (progress_ && !progress_(part_, 0, total_)) throw Stopped{};
  }
  bool tick() { return !progress_ || progress_(part_, ++done_, total_) || (stopped_ = true, false); }

  void choose_parameters();
  VectorXd random_direction(int size);
  void duality();
  void measure_noise_once(const ParameterSpace& space, const VectorXd& direction);
  void taylor();
  void gauge();
  void without_effect();
  void error_bar();
  void pivots();
  void repeatability();
  void add(CertificateCheck check) { report_.checks.push_back(std::move(check)); }

  const SceneModel& scene_model_;
  const Model& model_;
  VectorXd native_;
  const Trajectory& run_;
  const Output& output_;
  const std::vector<VectorXd>& weights_;
  const CertificateOptions& options_;
  const CertificateProgress& progress_;
  std::mt19937 rng_;
  std::string part_;
  int done_ = 0, total_ = 0;
  bool stopped_ = false, noise_known_ = false;
  CertificateReport report_;
  AdjointResult adjoint_;
  std::vector<std::string> addresses_;
  std::unique_ptr<FunctionalDifference> functional_;
};

VectorXd Certification::random_direction(int size) {
  std::normal_distribution<double> normal;
  return VectorXd::NullaryExpr(size, [&] { return normal(rng_); });
}

void Certification::choose_parameters() {
  std::vector<std::string> wanted, all;
  for (const ParameterSpec& spec : all_parameters(scene_model_.scene())) all.push_back(spec.address);
  for (const std::string& address : options_.addresses.empty() ? all : options_.addresses)
    (scene_model_.is_smooth_in(address, run_) ? wanted : report_.not_smooth).push_back(address);
  // A modulus that only scales all forces has terms that cancel, but for rounding as in the gauge identity.
  const auto terms = [this](const ParameterSpace& space) {
    return space.jacobian().col(0).cwiseProduct(adjoint_.native_bar).eval();
  };
  double largest = 0;
  for (const std::string& address : all)
    largest = std::max(largest, terms(ParameterSpace(scene_model_, {address})).cwiseAbs().sum());
  for (const std::string& address : wanted) {
    const ParameterSpace one(scene_model_, {address});
    // What does not reach the functional has no slope to test.
    const VectorXd own = terms(one);
    const double rounding = std::max(options_.largest_gauge * own.cwiseAbs().sum(), kRounding * largest);
    const bool is_zero = std::fabs(own.sum()) <= rounding;
    (is_zero ? report_.without_effect : addresses_).push_back(one.specs()[0].address);
  }
  const ParameterSpace space(scene_model_, addresses_);
  report_.parameters = space.specs();
  const VectorXd g = space.jacobian().transpose() * adjoint_.native_bar;
  report_.gradient.assign(g.begin(), g.end());
}

void Certification::duality() {
  begin("tangent sweep");
  const int count = std::max(1, options_.duality_directions);
  const ParameterSpace space(scene_model_, addresses_);
  MatrixXd directions(native_.size(), count);
  for (int k = 0; k < count; ++k) {
    if (k % 2 == 0 && space.size() > 0) {
      directions.col(k) = space.jacobian() * random_direction(space.size());
      continue;
    }
    // Every native parameter at once, b of each column and knots of paths included.
    directions.col(k) = random_direction(static_cast<int>(native_.size()));
    for (Eigen::Index i = 0; i < native_.size(); ++i)
      directions(i, k) *= native_[i] != 0 ? std::fabs(native_[i]) : 1;
  }
  const TangentResult tangent = options_.tangent(model_, native_, run_, output_, directions);
  report_.tangent_seconds = tangent.report.seconds;
  double worst = 0;
  for (int k = 0; k < count; ++k) {
    double forward = 0, terms = 0;
    for (int f = 0; f <= run_.frames(); ++f) {
      if (output_.size(f) == 0) continue;
      const VectorXd product = tangent.frames[f].col(k).cwiseProduct(weights_[f]);
      forward += product.sum();
      terms += product.cwiseAbs().sum();
    }
    const double backward = directions.col(k).dot(adjoint_.native_bar);
    // A sum that nearly cancels is compared with a hundredth of its terms.
    const double scale = std::max({std::fabs(forward), std::fabs(backward), 1e-2 * terms});
    // Nothing on either side, where nothing has an effect, is no disagreement; what is no number is one.
    const double error = std::fabs(forward - backward), relative = error == 0 ? 0 : error / scale;
    worst = std::max(worst, std::isfinite(relative) ? relative : std::numeric_limits<double>::infinity());
  }
  const bool ok = worst <= options_.largest_duality;
  add({"duality", worst, options_.largest_duality, ok ? Verdict::pass : Verdict::fail,
       text(ok ? "tangent and adjoint sweeps are transposes of each other on %d random directions"
               : "tangent and adjoint sweeps disagree on one of %d random directions: one of them is wrong",
            count)});
}

void Certification::measure_noise_once(const ParameterSpace& space, const VectorXd& direction) {
  if (noise_known_) return;
  report_.noise = measure_noise(*functional_, space, direction, [this] { return tick(); });
  if (stopped_) throw Stopped{};
  noise_known_ = true;
}

void Certification::taylor() {
  begin("rounding noise", 2 * static_cast<int>(run_.steps.size()));
  MinimiserOptions minimiser = certificate_minimiser({});
  functional_ = std::make_unique<FunctionalDifference>(scene_model_, run_, output_, weights_, minimiser);
  std::map<std::pair<std::string, std::string>, long> counts;
  for (std::size_t i = 0; i < run_.steps.size(); ++i) {
    std::size_t at = 0;
    for (const Term& term : model_.terms) {
      const KernelTable& k = term.kernels();
      if (!k.regime) continue;
      std::vector<long> own(k.num_regimes, 0);
      for (int q = 0; q < term.num_points(); ++q) ++own[functional_->regimes()[i][at++]];
      for (int r = 0; r < k.num_regimes; ++r) counts[{term.name(), k.regime_names[r]}] += own[r];
    }
  }
  for (const auto& [key, points] : counts) report_.regimes.push_back({key.first, key.second, points});

  if (addresses_.empty())
    add({"Taylor slope", 0, 2, Verdict::fail, "no parameter has an effect on the functional: nothing to test",
         LimitKind::near});
  std::vector<ParameterGroup> groups{{"joint", addresses_}};
  groups.insert(groups.end(), options_.groups.begin(), options_.groups.end());
  if (options_.each_parameter)
    for (const ParameterSpec& spec : report_.parameters) groups.push_back({spec.name, {spec.address}});
  for (const ParameterGroup& group : groups) {
    const ParameterSpace space(scene_model_, group.addresses);
    if (space.size() == 0) continue;
    const VectorXd gradient = space.jacobian().transpose() * adjoint_.native_bar;
    // Balanced, so that each parameter has a like share of the slope: unscaled, the collider's radius would
    // drown a ligament's strength a thousandfold.
    VectorXd random = random_direction(space.size());
    const double largest = gradient.cwiseAbs().maxCoeff();
    if (largest > 0)
      random = random.cwiseQuotient(gradient.cwiseAbs().cwiseMax(kSmallestShare * largest).eval());
    measure_noise_once(space, random);
    for (const bool along_gradient : {false, true}) {
      if (along_gradient && space.size() == 1 && groups.size() > 1) continue;  // the same line again
      const std::string direction = along_gradient ? "gradient" : space.size() == 1 ? "alone" : "random";
      begin("Taylor test of " + group.name + ", " + direction);
      TaylorSeries series;
      if (along_gradient && !(gradient.cwiseAbs().maxCoeff() > 0)) {
        series.sentence = "the gradient is zero: there is no direction to test along";
      } else {
        series = taylor_test(*functional_, space, along_gradient ? gradient : random, gradient, report_.noise,
                             options_.taylor, [this] { return tick(); });
      }
      if (stopped_) throw Stopped{};
      series.group = group.name;
      series.direction = direction;
      double slope = std::numeric_limits<double>::quiet_NaN();
      if (!series.slopes.empty()) slope = series.slopes.back();
      add({"Taylor slope, " + group.name + ", " + direction, slope, 2,
           series.passed ? Verdict::pass : Verdict::fail, series.sentence, LimitKind::near});
      report_.taylor.push_back(std::move(series));
    }
  }
}

/// That a parameter has no effect is the gradient's word. One run with all of them changed shows it, or that
/// a path of the derivative is missing.
void Certification::without_effect() {
  if (report_.without_effect.empty()) return;
  begin("parameters without effect", (noise_known_ ? 1 : 3) * static_cast<int>(run_.steps.size()));
  const ParameterSpace space(scene_model_, report_.without_effect);
  CertificateCheck check{"no effect", 0, 0, Verdict::fail, ""};
  const VectorXd small = VectorXd::Constant(space.size(), 1e-4);
  measure_noise_once(space, small);  // where nothing has an effect
  const auto other = functional_->evaluate(space.native(small), {}, [this] { return tick(); });
  if (stopped_) throw Stopped{};
  check.figure = std::fabs(other.difference);
  check.threshold = 100 * report_.noise;
  if (!other.complete) {
    check.verdict = Verdict::warning;
    check.sentence = "the run with parameters changed by 0.01 % that have no effect failed: " + other.failure;
  } else if (check.figure <= check.threshold) {
    check.verdict = Verdict::pass;
    check.sentence = text(
        "%d parameters whose derivative is zero but for rounding, changed by 0.01 %% together, change "
        "nothing",
        space.size());
  } else {
    check.sentence = text(
        "%d parameters whose derivative is zero change the functional when they change by 0.01 %%: a part of "
        "the derivative is missing",
        space.size());
  }
  add(check);
}

void Certification::gauge() {
  double sum = 0, terms = 0;
  int count = 0;
  for (const NativeBlock& block : model_.native_blocks)
    for (const int i : block.stiffness_like) {
      const double term = native_[i] * adjoint_.native_bar[i];
      sum += term;
      terms += std::fabs(term);
      ++count;
    }
  if (!(terms > 0)) {
    add({"gauge identity", 0, options_.largest_gauge, Verdict::warning,
         "no stiffness has an effect on the functional: there is nothing to check"});
    return;
  }
  const double figure = std::fabs(sum) / terms;
  const bool ok = figure <= options_.largest_gauge;
  add({"gauge identity", figure, options_.largest_gauge, ok ? Verdict::pass : Verdict::fail,
       text(ok ? "all %d stiffnesses scaled together leave displacements alone, to rounding"
               : "all %d stiffnesses scaled together would change displacements, which they cannot: a "
                 "derivative by a stiffness is wrong",
            count)});
}

void Certification::error_bar() {
  CertificateCheck check{"error bar", 0, options_.largest_error_bar_error, Verdict::warning, ""};
  // What the prediction leaves out is of second order: where the first cancels by chance a tighter run decides.
  // That of a wrong residual or adjoint stays as it is.
  double tolerance = options_.loose_tolerance;
  for (int attempt = 0; attempt < 3; ++attempt, tolerance *= 0.1) {
    begin("loosely converged run", static_cast<int>(run_.steps.size()));
    MinimiserOptions loose;
    loose.relative_tolerance = tolerance;
    loose.keep_factor = false;
    const auto observe = [this](int, const StepProblem&, const State&) { return tick(); };
    const Trajectory run = resimulate(model_, native_, run_, loose, {}, observe, true);
    if (stopped_) throw Stopped{};
    // What a tighter run cannot say does not take back what the first one said: verdict and figure are its.
    const std::string subject =
        attempt == 0 ? "the loosely converged run" : check.sentence + "; a tighter run";
    if (!run.complete) {
      check.sentence = subject + " failed" +
                       (attempt == 0 ? ", so that the error bar was not tested: " : ": ") + run.failure;
      break;
    }
    double predicted = 0;
    try {
      predicted = options_.adjoint(model_, native_, run, output_, weights_).residual_error;
    } catch (const GradientError& error) {
      check.sentence = subject + " has no gradient: " + error.what();
      break;
    }
    const double actual = functional_->difference(run);
    if (actual == 0 || std::fabs(actual) < 100 * report_.noise) {
      if (attempt == 0)
        check.sentence =
            text("the loosely converged run is off by %.1e only, too little to compare with", actual);
      break;
    }
    check.figure = std::fabs(predicted - actual) / std::fabs(actual);
    const bool ok = check.figure <= check.threshold;
    check.verdict = ok ? Verdict::pass : Verdict::fail;
    check.sentence = text(
        "at tolerance %.0e the functional is off by %.3e and adjoint times residual says %.3e; in the "
        "certified run it says %.1e",
        tolerance, actual, predicted, report_.error_bar);
    if (ok) break;
  }
  add(check);
}

void Certification::pivots() {
  const std::vector<double> pivots = report_.steps.relative_pivots();
  if (pivots.empty()) return;
  const auto least = std::min_element(pivots.begin(), pivots.end());
  const auto step = static_cast<std::size_t>(least - pivots.begin());
  const bool dips = *least < options_.pivot_dip;
  add({"pivots", *least, options_.pivot_dip, dips ? Verdict::warning : Verdict::pass,
       text(dips
                ? "the Hessian comes near to singular at step %zu (t = %.4g s): a bifurcation is near, "
                  "derivatives hold in a small neighbourhood only"
                : "every Hessian is positive definite and none stands out (smallest at step %zu, t = %.4g s)",
            step, run_.steps[step].step.t),
       LimitKind::at_least});
}

void Certification::repeatability() {
  begin("repeated sweeps", 3);
  int different = 0;
  const auto compare = [&](int threads) {
    const ThreadScope scope(threads);
    const AdjointResult again = options_.adjoint(model_, native_, run_, output_, weights_);
    for (Eigen::Index i = 0; i < native_.size(); ++i)
      different += std::memcmp(&again.native_bar[i], &adjoint_.native_bar[i], sizeof(double)) != 0;
    if (!tick()) throw Stopped{};
  };
  compare(num_threads());
  compare(1);
  compare(2);
  add({"repeatability", static_cast<double>(different), 0, different == 0 ? Verdict::pass : Verdict::fail,
       different == 0 ? "the same bits on repetition, with one thread and with two"
                      : text("%d components changed on repetition, with one thread or with two", different)});
}

CertificateReport Certification::run() {
  const auto start = std::chrono::steady_clock::now();
  report_.forward_seconds = run_.seconds;
  for (const StepRecord& record : run_.steps) report_.step_times.push_back(record.step.t);
  try {
    begin("adjoint sweep");
    adjoint_ = options_.adjoint(model_, native_, run_, output_, weights_);
    report_.steps = adjoint_.report;
    report_.adjoint_seconds = adjoint_.report.seconds;
    report_.error_bar = adjoint_.residual_error;
    choose_parameters();
    duality();
    if (options_.displacement_output) gauge();
    taylor();
    without_effect();
    error_bar();
    pivots();
    repeatability();
  } catch (const Stopped&) {
    report_.interrupted = true;
  }
  report_.total_seconds = std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
  return std::move(report_);
}

}  // namespace

const char* name(Verdict verdict) {
  return verdict == Verdict::pass ? "pass" : verdict == Verdict::warning ? "look" : "FAIL";
}

bool CertificateReport::passed() const {
  return !interrupted && !checks.empty() &&
         std::none_of(checks.begin(), checks.end(), [](const auto& c) { return c.verdict == Verdict::fail; });
}

MinimiserOptions certificate_minimiser(const MinimiserOptions& from) {
  MinimiserOptions options = from;
  options.method = Minimiser::newton;
  options.relative_tolerance = std::min(options.relative_tolerance, 1e-10);
  options.certify_minimum = true;
  // Slopes are taken down to rounding, which steps with a factor kept come less near to than Newton's last one does.
  options.keep_factor = false;
  options.polish = true;
  return options;
}

CertificateReport certify(const SceneModel& scene_model, const Trajectory& run, const Output& output,
                          const std::vector<VectorXd>& weights, const CertificateOptions& options,
                          const CertificateProgress& progress) {
  return Certification(scene_model, run, output, weights, options, progress).run();
}

std::shared_ptr<const Output> default_output(const Model& model, int points) {
  require(points >= 1, "default_output: at least one point");
  std::vector<MaterialPoint> chosen;
  const int every = (model.mesh.num_faces + points - 1) / points;
  for (int f = 0; f < model.mesh.num_faces; f += every) chosen.push_back({f, 0.3, 0.4, true});
  std::vector<std::shared_ptr<const Output>> parts;
  parts.push_back(std::make_shared<PointPositions>(model.mesh, chosen));
  parts.push_back(std::make_shared<MeanNormalDisplacement>(model.mesh, chosen));
  return std::make_shared<CombinedOutput>(std::move(parts));
}

std::vector<VectorXd> random_weights(const Output& output, int frames, unsigned seed) {
  std::mt19937 rng(seed);
  std::normal_distribution<double> normal;
  std::vector<VectorXd> weights;
  Eigen::Index total = 0;
  for (int f = 0; f <= frames; ++f) {
    weights.push_back(VectorXd::NullaryExpr(output.size(f), [&] { return normal(rng); }));
    total += weights.back().size();
  }
  for (VectorXd& w : weights) w /= static_cast<double>(std::max<Eigen::Index>(total, 1));
  return weights;
}

}  // namespace rhytid::adjoint
