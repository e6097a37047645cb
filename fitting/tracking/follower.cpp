#include "fitting/tracking/follower.h"

#include <Eigen/Dense>
#include <algorithm>
#include <array>
#include <cmath>

namespace rhytid::fitting {
namespace {

Refusal refusal_of(AlignmentStatus status) {
  switch (status) {
    case AlignmentStatus::converged:
      return Refusal::none;
    case AlignmentStatus::outside:
      return Refusal::outside;
    case AlignmentStatus::flat:
      return Refusal::uncertain;
    case AlignmentStatus::not_converged:
      return Refusal::not_converged;
  }
  return Refusal::not_converged;
}

double largest_sigma(const Eigen::Matrix2d& covariance) {
  return std::sqrt(
      Eigen::SelfAdjointEigenSolver<Eigen::Matrix2d>(covariance, Eigen::EigenvaluesOnly).eigenvalues()[1]);
}

/// The tests that an alignment must pass by itself to count as a measurement.
Refusal judge(const Alignment& a, const Vec2& guess, double max_correction, const FrameView& view,
              const TrackerOptions& o, double min_correlation) {
  if (a.status != AlignmentStatus::converged) return refusal_of(a.status);
  if (!(a.correlation >= min_correlation)) return Refusal::correlation;
  if ((a.warp.centre - guess).norm() > max_correction) return Refusal::correction;
  const double noise = std::max(a.residual_rms, view.least_residual);
  if (!(largest_sigma(noise * noise * a.unit_covariance) <= o.max_sigma_px)) return Refusal::uncertain;
  // A window squeezed or stretched beyond 2.5 in area has locked on something else.
  const double det = a.warp.gradient.determinant();
  if (!(det > 0.4 && det < 2.5)) return Refusal::not_converged;
  return Refusal::none;
}

}  // namespace

Refusal try_align(const PatchTemplate& patch, const PatchWarp& start, const Eigen::Matrix2d& held_at,
                  double max_correction, const FrameView& view, const TrackerOptions& o,
                  double min_correlation, Alignment* result) {
  constexpr double kCostly = 2, kBetter = 1.1;
  const auto attempt = [&](WarpModel model, Alignment* a) {
    AlignmentOptions options;
    options.model = model;
    const bool is_held = model == WarpModel::translation && o.model == WarpModel::affine;
    *a = align(patch, *view.image, is_held ? PatchWarp{start.centre, held_at} : start, options);
    return judge(*a, start.centre, max_correction, view, o, min_correlation);
  };
  if (o.model == WarpModel::translation) return attempt(WarpModel::translation, result);
  const Refusal refusal = attempt(WarpModel::affine, result);
  if (refusal == Refusal::outside) return refusal;
  if (refusal == Refusal::none && result->deformation_cost < kCostly) return refusal;
  Alignment held;
  const Refusal second = attempt(WarpModel::translation, &held);
  const bool as_good = held.residual_rms <= kBetter * std::max(result->residual_rms, view.least_residual);
  if (refusal != Refusal::none || (second == Refusal::none && as_good)) {
    *result = std::move(held);
    return second;
  }
  return refusal;
}

double covered_fraction(const cv::Mat& mask, const Vec2& pixel, int half) {
  if (mask.empty()) return 0;
  const int x = static_cast<int>(std::lround(pixel.x())), y = static_cast<int>(std::lround(pixel.y()));
  const cv::Rect window(x - half, y - half, 2 * half + 1, 2 * half + 1);
  const cv::Rect inside = window & cv::Rect(0, 0, mask.cols, mask.rows);
  return inside.empty() ? 0 : static_cast<double>(cv::countNonZero(mask(inside))) / window.area();
}

Eigen::Matrix2d held_gradient(const std::vector<Follower>& followers, const Follower& f) {
  // Neighbours across a fold or an outline say nothing about the window: beyond this they are not believed.
  constexpr double kCredible = 0.2;
  // It is one of them: three others leave a check. Without itself real faces drift further (0.99 for 0.90 px there and
  // back) and rendered skin is no better.
  constexpr std::size_t kFewest = 4;
  const std::optional<PatchWarp> expected = expected_from_neighbours(followers, f.seed, kFewest);
  if (!expected) return f.warp.gradient;
  const Eigen::Matrix2d gradient = expected->gradient * f.template_gradient.inverse();
  return (gradient - f.warp.gradient).norm() < kCredible ? gradient : f.warp.gradient;
}

Measurement measure(const Follower& f, const FlowGuess& guess, const Eigen::Matrix2d& held,
                    const FrameView& view, const TrackerOptions& o) {
  Measurement m;
  m.forward_backward_px = guess.forward_backward_px;
  const int half = o.window_px / 2;
  const bool flowed = guess.found && guess.forward_backward_px <= o.max_forward_backward_px;
  // When the flow failed, the best guess for what covers the point is what covers the place where it was.
  const Vec2 place = flowed ? guess.pixel : f.warp.centre;
  if (covered_fraction(*view.mask, place, half) > o.max_covered_fraction)
    m.refusal = Refusal::occluded;
  else if (!guess.found)
    m.refusal = Refusal::flow;
  else if (!view.image->contains(guess.pixel.x(), guess.pixel.y()))
    m.refusal = Refusal::outside;
  else if (!flowed)
    m.refusal = Refusal::forward_backward;
  if (m.refusal != Refusal::none) return m;

  m.refusal = try_align(f.patch, {guess.pixel, f.warp.gradient}, held, o.max_correction_px, view, o,
                        o.min_correlation, &m.alignment);
  return m;
}

namespace {

/// A window that still correlates this well is neither covered, however still the footage was before, nor mistaken.
constexpr double kIntact = 0.95;

}  // namespace

bool strays(const Follower& f, const Alignment& a, const std::vector<std::pair<Vec2, Vec2>>& others,
            std::size_t itself) {
  constexpr std::size_t kNeighbours = 8, kFewest = 4;
  if (a.correlation >= kIntact) return false;
  std::vector<std::pair<double, std::size_t>> near;
  for (std::size_t i = 0; i < others.size(); ++i)
    if (i != itself) near.emplace_back((others[i].first - f.warp.centre).squaredNorm(), i);
  if (near.size() < kFewest) return false;
  const std::size_t count = std::min(kNeighbours, near.size());
  std::partial_sort(near.begin(), near.begin() + static_cast<std::ptrdiff_t>(count), near.end());
  const auto median = [count](std::array<double, kNeighbours> values) {
    std::nth_element(values.begin(), values.begin() + count / 2, values.begin() + count);
    return values[count / 2];
  };
  std::array<double, kNeighbours> x{}, y{}, spread{};
  for (std::size_t i = 0; i < count; ++i)
    x[i] = others[near[i].second].second.x(), y[i] = others[near[i].second].second.y();
  const Vec2 usual(median(x), median(y));
  for (std::size_t i = 0; i < count; ++i) spread[i] = (others[near[i].second].second - usual).norm();
  return (a.warp.centre - f.warp.centre - usual).norm() > 2 + 5 * median(spread);
}

bool residual_jumped(const Follower& f, const Alignment& a, double typical, const FrameView& view,
                     const TrackerOptions& o) {
  const double usual = std::max({f.residual, typical, view.least_residual});
  return a.residual_rms > o.max_residual_jump * usual && a.correlation < kIntact;
}

void measure_from_previous(const Follower& f, const FlowGuess& guess, double typical, const FrameView& view,
                           const TrackerOptions& o, Measurement* first) {
  PatchTemplate patch = cut_template(*view.previous, f.warp.centre, o.window_px / 2);
  if (patch.values.empty()) return;
  Alignment a;
  const PatchWarp start{guess.pixel, Eigen::Matrix2d::Identity()};
  if (try_align(patch, start, start.gradient, o.max_correction_px, view, o, o.min_correlation, &a) !=
      Refusal::none)
    return;
  if (residual_jumped(f, a, typical, view, o)) return;
  first->alignment = std::move(a);
  first->refusal = Refusal::none;
  first->from_previous = true;
  first->new_patch = std::move(patch);
  first->misfit.setZero();
}

void accept(const Measurement& m, const ResidualCorrelation& correlation, const FrameView& view,
            Follower* f) {
  if (m.from_previous) {
    f->renewed = f->common.has_value();  // a template cut in the first frame is the first again
    f->template_gradient = f->warp.gradient * f->template_gradient;
    f->patch = m.new_patch;
    f->has_first_template = !f->common.has_value();
    f->baseline = 0;
  }
  f->residual = m.alignment.residual_rms;
  f->correlation = m.alignment.correlation;
  if (f->baseline == 0) f->baseline = std::max(f->residual, view.least_residual);
  f->warp = m.alignment.warp;
  // Half of the residual's noise is the template's, which all frames share, half the frame's own. The
  // position of a renewed template is as uncertain as the frame it was cut from; the readers of the track
  // know (observations.h).
  const Eigen::Matrix2d both =
      correlation.covariance(m.alignment, std::max(f->residual, view.least_residual));
  if (!f->common) f->common = 0.5 * both;
  f->with_itself.reset();
  f->covariance = 0.5 * both + m.misfit;
  f->active = true;
}

std::optional<PatchWarp> expected_from_neighbours(const std::vector<Follower>& followers, const Vec2& seed,
                                                  std::size_t fewest) {
  constexpr std::size_t kNeighbours = 8;
  std::vector<std::pair<double, const Follower*>> near;
  for (const Follower& f : followers)
    if (f.active) near.emplace_back((f.seed - seed).squaredNorm(), &f);
  if (near.size() < fewest) return std::nullopt;
  const std::size_t count = std::min(kNeighbours, near.size());
  std::partial_sort(near.begin(), near.begin() + count, near.end(), [](const auto& a, const auto& b) {
    return a.first != b.first ? a.first < b.first : a.second->track.id < b.second->track.id;
  });
  // x = c + F (X − seed), weights 1/(1 + d²/d_mean²). The ridge pulls F towards the identity when the
  // neighbours are nearly collinear; 0.01 is small beside the normalised spread of a healthy neighbourhood,
  // which is about 1.
  double mean = 0;
  for (std::size_t i = 0; i < count; ++i) mean += near[i].first / count;
  mean = std::max(mean, 1.0);
  Mat3 normal = Mat3::Zero();
  Eigen::Matrix<double, 3, 2> right = Eigen::Matrix<double, 3, 2>::Zero();
  for (std::size_t i = 0; i < count; ++i) {
    const Follower& f = *near[i].second;
    const Vec2 offset = (f.seed - seed) / std::sqrt(mean);
    const Vec3 row(1, offset.x(), offset.y());
    const double weight = 1 / (1 + near[i].first / mean);
    normal += weight * row * row.transpose();
    right += weight * row * (f.warp.centre - f.seed).transpose();  // displacement: the ridge then means F = I
  }
  normal(1, 1) += 0.01;
  normal(2, 2) += 0.01;
  const Eigen::Matrix<double, 3, 2> fit = normal.ldlt().solve(right);
  PatchWarp warp;
  warp.centre = seed + fit.row(0).transpose();
  warp.gradient += fit.bottomRows<2>().transpose() / std::sqrt(mean);
  return warp;
}

}  // namespace rhytid::fitting
