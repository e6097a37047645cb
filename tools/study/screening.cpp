#include "tools/study/screening.h"

#include <cmath>
#include <cstdint>
#include <limits>
#include <numeric>
#include <random>

#include "sim/core/error.h"

namespace rhytid::tools {
namespace {

constexpr double kNan = std::numeric_limits<double>::quiet_NaN();
constexpr int kResamples = 200;

/// Distributions of the standard library differ between machines, its generators do not.
class Seeded {
 public:
  explicit Seeded(unsigned seed) : rng_(seed) {}
  double uniform() { return (rng_() + 0.5) / 4294967296.0; }
  int below(int n) { return static_cast<int>(uniform() * n); }
  std::vector<int> permutation(int n) {
    std::vector<int> order(n);
    std::iota(order.begin(), order.end(), 0);
    for (int i = n - 1; i > 0; --i) std::swap(order[i], order[below(i + 1)]);
    return order;
  }

 private:
  std::mt19937 rng_;
};

double standard_deviation(const std::vector<double>& x) {
  if (x.size() < 2) return kNan;
  const double n = static_cast<double>(x.size());
  const double mean = std::accumulate(x.begin(), x.end(), 0.0) / n;
  double squares = 0;
  for (const double v : x) squares += (v - mean) * (v - mean);
  return std::sqrt(squares / (n - 1));
}

double mean_of(const std::vector<double>& x) {
  return x.empty() ? kNan : std::accumulate(x.begin(), x.end(), 0.0) / static_cast<double>(x.size());
}

/// The three values of a sample, from which both indices of an input are formed.
struct Triple {
  double a, b, ab;
};

/// S and T of resampled triples (`pick` gives indices); the variance is that of all a and b.
std::pair<double, double> shares(const std::vector<Triple>& triples, const std::vector<int>& pick) {
  double sum = 0;
  for (const int j : pick) sum += triples[j].a + triples[j].b;
  const double n = static_cast<double>(pick.size()), mean = sum / (2 * n);
  double variance = 0, first = 0, total = 0;
  for (const int j : pick) {
    const auto [a, b, ab] = triples[j];
    variance += ((a - mean) * (a - mean) + (b - mean) * (b - mean)) / (2 * n);
    first += (b - mean) * (ab - a) / n;
    total += (a - ab) * (a - ab) / (2 * n);
  }
  if (!(variance > 0)) return {kNan, kNan};
  return {first / variance, total / variance};
}

}  // namespace

MorrisDesign morris_design(int inputs, int trajectories, int levels, unsigned seed) {
  require(inputs > 0 && trajectories > 0, "morris_design: inputs and trajectories");
  require(levels >= 2 && levels % 2 == 0, "morris_design: an even number of levels");
  Seeded random(seed);
  MorrisDesign design;
  design.step = levels / (2.0 * (levels - 1));
  design.points.resize(static_cast<Eigen::Index>(trajectories) * (inputs + 1), inputs);
  Eigen::Index row = 0;
  for (int t = 0; t < trajectories; ++t) {
    VectorXd x(inputs);
    // From each level exactly one of ±Δ stays in [0, 1].
    for (double& value : x) value = random.below(levels) / (levels - 1.0);
    design.points.row(row++) = x.transpose();
    for (const int i : random.permutation(inputs)) {
      x[i] += x[i] < 0.5 ? design.step : -design.step;
      x[i] = std::round(x[i] * (levels - 1)) / (levels - 1);
      design.points.row(row++) = x.transpose();
      design.moved.push_back(i);
    }
  }
  return design;
}

std::vector<MorrisEffect> morris_effects(const MorrisDesign& design, const VectorXd& values) {
  const auto inputs = static_cast<int>(design.points.cols());
  require(values.size() == design.points.rows(), "morris_effects: one value per point");
  std::vector<std::vector<double>> effects(inputs), sizes(inputs);
  for (std::size_t s = 0; s < design.moved.size(); ++s) {
    const auto before = static_cast<Eigen::Index>(s + s / static_cast<std::size_t>(inputs));
    const int i = design.moved[s];
    const double effect =
        (values[before + 1] - values[before]) / (design.points(before + 1, i) - design.points(before, i));
    if (!std::isfinite(effect)) continue;
    effects[i].push_back(effect);
    sizes[i].push_back(std::fabs(effect));
  }
  std::vector<MorrisEffect> result;
  for (int i = 0; i < inputs; ++i)
    result.push_back({mean_of(effects[i]), mean_of(sizes[i]), standard_deviation(effects[i]),
                      standard_deviation(sizes[i]) / std::sqrt(static_cast<double>(sizes[i].size())),
                      static_cast<int>(effects[i].size())});
  return result;
}

MatrixXd sobol_design(int inputs, int samples, unsigned seed) {
  require(inputs > 0 && samples > 0, "sobol_design: inputs and samples");
  Seeded random(seed);
  MatrixXd points(static_cast<Eigen::Index>(samples) * (inputs + 2), inputs);
  for (int half = 0; half < 2; ++half)
    for (int i = 0; i < inputs; ++i) {
      const std::vector<int> cell = random.permutation(samples);
      for (int j = 0; j < samples; ++j)
        points(static_cast<Eigen::Index>(half) * samples + j, i) = (cell[j] + random.uniform()) / samples;
    }
  for (int i = 0; i < inputs; ++i) {
    auto block = points.middleRows(static_cast<Eigen::Index>(2 + i) * samples, samples);
    block = points.topRows(samples);
    block.col(i) = points.col(i).segment(samples, samples);
  }
  return points;
}

std::vector<SobolIndex> sobol_indices(int inputs, int samples, const VectorXd& values, unsigned seed) {
  require(values.size() == static_cast<Eigen::Index>(samples) * (inputs + 2),
          "sobol_indices: one value per point");
  std::vector<SobolIndex> result;
  for (int i = 0; i < inputs; ++i) {
    std::vector<Triple> triples;
    for (int j = 0; j < samples; ++j) {
      const Triple t{values[j], values[samples + j], values[static_cast<Eigen::Index>(2 + i) * samples + j]};
      if (std::isfinite(t.a) && std::isfinite(t.b) && std::isfinite(t.ab)) triples.push_back(t);
    }
    SobolIndex index;
    index.count = static_cast<int>(triples.size());
    std::vector<int> pick(triples.size());
    std::iota(pick.begin(), pick.end(), 0);
    std::tie(index.first, index.total) = shares(triples, pick);
    Seeded random(seed + 1 + static_cast<unsigned>(i));
    std::vector<double> firsts, totals;
    for (int r = 0; r < kResamples && index.count > 1; ++r) {
      for (int& p : pick) p = random.below(index.count);
      const auto [first, total] = shares(triples, pick);
      if (!std::isfinite(first)) continue;
      firsts.push_back(first);
      totals.push_back(total);
    }
    index.first_error = standard_deviation(firsts);
    index.total_error = standard_deviation(totals);
    result.push_back(index);
  }
  return result;
}

}  // namespace rhytid::tools
