#include "sim/surface/imls.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <nanoflann.hpp>

#include "sim/core/error.h"
#include "sim/surface/point_lattice.h"

namespace rhytid {
namespace {

// The search radius is widened by more than the rounding of a squared distance, so that the tree never loses
// a point that the sum (which computes the distance itself) would count.
constexpr double kSearchSlack = 1 + 1e-10;

struct TreePoints {
  const MatrixX3& points;
  std::size_t kdtree_get_point_count() const { return static_cast<std::size_t>(points.rows()); }
  double kdtree_get_pt(int i, std::size_t k) const { return points(i, static_cast<Eigen::Index>(k)); }
  template <class Box>
  bool kdtree_get_bbox(Box&) const {
    return false;
  }
};

using KdTree =
    nanoflann::KDTreeSingleIndexAdaptor<nanoflann::L2_Simple_Adaptor<double, TreePoints>, TreePoints, 3, int>;

/// nanoflann result set: all indices within a squared radius, unordered.
struct IndicesWithin {
  double squared_radius;
  std::vector<int>& found;
  void init() { found.clear(); }
  std::size_t size() const { return found.size(); }
  bool full() const { return true; }
  double worstDist() const { return squared_radius; }
  bool addPoint(double squared_distance, int index) {
    if (squared_distance < squared_radius) found.push_back(index);
    return true;
  }
};

/// θ, and a, c with ∇θ = a d, ∇²θ = a I + c d dᵀ.
struct KernelJet {
  double theta, a, c;
};

struct SmoothKernel {
  double inverse_h2;
  bool supports(double d2) const { return d2 * inverse_h2 < 1; }
  KernelJet operator()(double d2) const {
    const double u = 1 - d2 * inverse_h2;
    const double u2 = u * u;
    return {u2 * u2, -8 * u2 * u * inverse_h2, 48 * u2 * inverse_h2 * inverse_h2};
  }
};

struct LiteralKernel {
  double inverse_h, epsilon2;
  bool supports(double d2) const { return std::sqrt(d2 + epsilon2) * inverse_h < 1; }
  KernelJet operator()(double d2) const {
    const double e = std::sqrt(d2 + epsilon2);  // ≥ ε > 0
    const double v = 1 - e * inverse_h;
    const double v2 = v * v;
    const double a = -4 * v2 * v * inverse_h / e;
    return {v2 * v2, a, 4 * v2 * inverse_h * (3 * inverse_h + v / e) / (e * e)};
  }
};

/// Two passes over the candidates: g first, so that the derivatives sum the differences sᵢ − g themselves.
/// Signed distances are taken relative to the first one in support, σ = s − s₀, so that the differences lose
/// nothing (on a plane σ is round-off and all curvature vanishes with it). No underflow to guard against: 1 −
/// q ≥ 2⁻⁵³ inside the support, hence W ≥ 2⁻²¹².
template <JetOrder order, class Samples, class Kernel>
GapJet imls_sum(const Samples& samples, std::span<const int> candidates, const Vec3& x,
                const Kernel& kernel) {
  double s0 = 0, w = 0, w_sigma = 0;  // W = Σ θ, Σ θ σ
  bool supported = false;
  for (const int i : candidates) {
    const auto& sample = samples[static_cast<std::size_t>(i)];
    const Vec3 d = x - sample.point;
    const double d2 = d.squaredNorm();
    if (!kernel.supports(d2)) continue;
    const double s = sample.normal.dot(d);
    if (!supported) s0 = s;
    supported = true;
    const double theta = kernel(d2).theta;
    w += theta;
    w_sigma += theta * (s - s0);
  }
  GapJet jet;
  jet.supported = supported;
  if (!supported) return jet;
  const double gamma = w_sigma / w;  // g − s₀
  jet.gap = s0 + gamma;
  if constexpr (order == JetOrder::gap) return jet;

  Vec3 slope = Vec3::Zero();  // Σ θ n + (s − g) ∇θ
  Vec3 dw = Vec3::Zero();     // ∇W
  double isotropic = 0;       // Σ (s − g) a
  Mat3 half = Mat3::Zero();  // Σ d (a n + ½ (s − g) c d)ᵀ: with its transpose the rest of the bracket in ∇²g
  for (const int i : candidates) {
    const auto& sample = samples[static_cast<std::size_t>(i)];
    const Vec3 d = x - sample.point;
    const double d2 = d.squaredNorm();
    if (!kernel.supports(d2)) continue;
    const double difference = (sample.normal.dot(d) - s0) - gamma;
    const KernelJet k = kernel(d2);
    const double a_difference = k.a * difference;
    slope += k.theta * sample.normal + a_difference * d;
    if constexpr (order == JetOrder::hessian) {
      dw += k.a * d;
      isotropic += a_difference;
      const Vec3 right = k.a * sample.normal + (0.5 * k.c * difference) * d;
      half.noalias() += d * right.transpose();
    }
  }
  jet.gradient = slope / w;
  if constexpr (order == JetOrder::hessian) {
    half -= dw * jet.gradient.transpose();
    jet.hessian = (half + half.transpose()) / w;
    jet.hessian.diagonal().array() += isotropic / w;
  }
  return jet;
}

template <class Samples, class Kernel>
GapJet imls_sum(const Samples& samples, std::span<const int> candidates, const Vec3& x, const Kernel& kernel,
                JetOrder order) {
  switch (order) {
    case JetOrder::gap:
      return imls_sum<JetOrder::gap>(samples, candidates, x, kernel);
    case JetOrder::gradient:
      return imls_sum<JetOrder::gradient>(samples, candidates, x, kernel);
    case JetOrder::hessian:
      break;
  }
  return imls_sum<JetOrder::hessian>(samples, candidates, x, kernel);
}

}  // namespace

class ImlsSurface::Tree {
 public:
  explicit Tree(const MatrixX3& points) : points_(points), cloud_{points_}, index_(3, cloud_) {
    index_.buildIndex();
  }
  void within(const Vec3& x, double radius, std::vector<int>* found) const {
    IndicesWithin result{radius * radius, *found};
    result.init();
    index_.findNeighbors(result, x.data(), nanoflann::SearchParams());
  }

  int nearest(const Vec3& x) const {
    int found = 0;
    double squared = 0;
    index_.knnSearch(x.data(), 1, &found, &squared);
    return found;
  }

 private:
  MatrixX3 points_;
  TreePoints cloud_;
  KdTree index_;
};

ImlsSurface::ImlsSurface(const MatrixX3& points, const MatrixX3& normals, const ImlsOptions& options)
    : kernel_(options.kernel) {
  require(points.rows() > 0, "ImlsSurface: no points");
  require(points.rows() == normals.rows(), "ImlsSurface: one normal per point is needed");
  require(points.allFinite() && normals.allFinite(), "ImlsSurface: points and normals must be finite");
  require(options.support >= 0 && std::isfinite(options.support),
          "ImlsSurface: support must be finite and positive (0 = default)");
  support_ = options.support > 0 ? options.support : default_imls_support(points);
  require(options.literal_epsilon >= 0 && options.literal_epsilon < support_,
          "ImlsSurface: epsilon of the literal kernel must lie in [0, support)");
  epsilon_ = options.literal_epsilon > 0 ? options.literal_epsilon : 1e-3 * support_;
  samples_.reserve(static_cast<std::size_t>(points.rows()));
  for (Eigen::Index i = 0; i < points.rows(); ++i) {
    const Vec3 normal = normals.row(i).transpose();
    const double length = normal.stableNorm();
    require(length > 0, "ImlsSurface: a normal has length zero");
    samples_.push_back({points.row(i).transpose(), normal / length});
  }
  tree_ = std::make_unique<const Tree>(points);
  if (!options.cached_neighbours) return;
  auto lattice = std::make_unique<const PointLattice>(points, support_);
  if (lattice->usable()) lattice_ = std::move(lattice);
}

ImlsSurface::~ImlsSurface() = default;

std::size_t ImlsSurface::num_neighbours() const {
  return lattice_ ? lattice_->num_entries() : 0;
}

std::size_t ImlsSurface::bytes() const {
  // The tree keeps its own copy of the points and an index of each.
  const std::size_t tree = samples_.size() * (sizeof(Vec3) + sizeof(std::size_t));
  return samples_.size() * sizeof(Sample) + tree + (lattice_ ? lattice_->bytes() : 0);
}

void ImlsSurface::search(const Vec3& x, double radius, std::vector<int>* found) const {
  tree_->within(x, radius * kSearchSlack, found);
  // The order of summation is part of the result: ascending index, however the points were found.
  std::sort(found->begin(), found->end());
}

GapJet ImlsSurface::sum(const Vec3& x, std::span<const int> candidates, JetOrder order) const {
  if (kernel_ == ImlsKernel::smooth)
    return imls_sum(samples_, candidates, x, SmoothKernel{1 / (support_ * support_)}, order);
  return imls_sum(samples_, candidates, x, LiteralKernel{1 / support_, epsilon_ * epsilon_}, order);
}

GapJet ImlsSurface::evaluate(const Vec3& x, JetOrder order) const {
  if (lattice_) return sum(x, lattice_->near(x), order);
  thread_local std::vector<int> found;  // scratch only: emptied by every search
  search(x, support_, &found);
  return sum(x, found, order);
}

bool ImlsSurface::behind(const Vec3& x) const {
  const Sample& sample = samples_[static_cast<std::size_t>(tree_->nearest(x))];
  return sample.normal.dot(x - sample.point) < 0;
}

double default_imls_support(const MatrixX3& points) {
  require(points.rows() >= 2, "default_imls_support: needs at least two points");
  const TreePoints cloud{points};
  KdTree index(3, cloud);
  index.buildIndex();
  const double size = (points.colwise().maxCoeff() - points.colwise().minCoeff()).norm();
  // Seams repeat points; a neighbour counts once it is further away than rounding. Eight are enough for any
  // seam.
  constexpr std::size_t kNearest = 8;
  std::vector<double> spacing;
  for (Eigen::Index i = 0; i < points.rows(); ++i) {
    std::array<int, kNearest> neighbour{};
    std::array<double, kNearest> squared{};
    const std::size_t found =
        index.knnSearch(points.row(i).data(), kNearest, neighbour.data(), squared.data());
    for (std::size_t k = 0; k < found; ++k) {
      if (std::sqrt(squared[k]) <= 1e-9 * size) continue;
      spacing.push_back(std::sqrt(squared[k]));
      break;
    }
  }
  require(!spacing.empty(), "default_imls_support: all points coincide");
  const auto middle = spacing.begin() + static_cast<std::ptrdiff_t>(spacing.size() / 2);
  std::nth_element(spacing.begin(), middle, spacing.end());
  return 3 * *middle;
}

}  // namespace rhytid
