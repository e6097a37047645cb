#include "fitting/tracking/jitter.h"

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>
#include <map>
#include <numbers>
#include <set>
#include <string>
#include <utility>

namespace rhytid::fitting {
namespace {

/// The second difference of a track about a frame.
struct Bend {
  Vec2 seed, value;
  double variance = 0;  ///< stated, per axis
};

/// |d|² and what it is made of.
struct Jump {
  double square, stated, factor;  ///< E square = 2 (stated + factor s²)
};

/// Bends by frame. The first observation of a track is left out, its covariance is of another kind.
std::map<int, std::vector<Bend>> bends_of(const TrackSet& set, const std::string& camera) {
  std::map<int, std::vector<Bend>> by_frame;
  for (const Track& t : set.tracks) {
    if (t.camera != camera) continue;
    const auto is_ok = [](const Observation& o) { return o.status == TrackStatus::ok; };
    const auto first = std::find_if(t.observations.begin(), t.observations.end(), is_ok);
    if (first == t.observations.end()) continue;
    for (auto o = first + 1;
         o != t.observations.end() && o + 1 != t.observations.end() && o + 2 != t.observations.end(); ++o) {
      const Observation &before = o[0], &here = o[1], &after = o[2];
      if (!is_ok(before) || !is_ok(here) || !is_ok(after)) continue;
      if (here.frame - before.frame != after.frame - here.frame) continue;
      const Eigen::Matrix2d both = before.covariance + 4 * here.covariance + after.covariance;
      by_frame[here.frame].push_back(
          {first->pixel, after.pixel - 2 * here.pixel + before.pixel, 0.5 * both.trace()});
    }
  }
  return by_frame;
}

/// The bend of one track against the affine fit of its neighbours'.
Jump jump_of(const std::vector<Bend>& bends, std::size_t i) {
  constexpr std::size_t kNeighbours = 8;
  std::vector<std::pair<double, std::size_t>> near;
  for (std::size_t k = 0; k < bends.size(); ++k)
    if (k != i) near.emplace_back((bends[k].seed - bends[i].seed).squaredNorm(), k);
  std::partial_sort(near.begin(), near.begin() + kNeighbours, near.end());
  double reach = 0;
  for (std::size_t n = 0; n < kNeighbours; ++n) reach += near[n].first / kNeighbours;
  Mat3 normal = Mat3::Zero();
  Eigen::Matrix<double, 3, kNeighbours> rows;
  for (std::size_t n = 0; n < kNeighbours; ++n) {
    const Vec2 offset = (bends[near[n].second].seed - bends[i].seed) / std::sqrt(std::max(reach, 1.0));
    rows.col(static_cast<Eigen::Index>(n)) << 1, offset;
    normal += rows.col(static_cast<Eigen::Index>(n)) * rows.col(static_cast<Eigen::Index>(n)).transpose();
  }
  // Neighbours in a line: the slope across it is then held near 0.
  normal(1, 1) += 0.01, normal(2, 2) += 0.01;
  const Eigen::Matrix<double, kNeighbours, 1> weights = rows.transpose() * normal.inverse().col(0);
  Vec2 d = bends[i].value;
  Jump jump{0, bends[i].variance, 6 * (1 + weights.squaredNorm())};
  for (std::size_t n = 0; n < kNeighbours; ++n) {
    const double w = weights[static_cast<Eigen::Index>(n)];
    d -= w * bends[near[n].second].value;
    jump.stated += w * w * bends[near[n].second].variance;
  }
  jump.square = d.squaredNorm();
  return jump;
}

double median_ratio(const std::vector<Jump>& jumps, double variance) {
  std::vector<double> ratios;
  for (const Jump& j : jumps) ratios.push_back(j.square / (2 * (j.stated + j.factor * variance)));
  const auto middle = ratios.begin() + static_cast<std::ptrdiff_t>(ratios.size() / 2);
  std::nth_element(ratios.begin(), middle, ratios.end());
  return *middle;
}

}  // namespace

double measure_jitter(const TrackSet& tracks) {
  constexpr std::size_t kFewest = 50, kFewestInFrame = 9;
  std::vector<Jump> jumps;
  std::set<std::string> cameras;
  for (const Track& t : tracks.tracks) cameras.insert(t.camera);
  for (const std::string& camera : cameras)
    for (const auto& [frame, bends] : bends_of(tracks, camera))
      for (std::size_t i = 0; bends.size() >= kFewestInFrame && i < bends.size(); ++i)
        jumps.push_back(jump_of(bends, i));
  if (jumps.size() < kFewest || median_ratio(jumps, 0) <= std::numbers::ln2) return 0;
  double low = 0, high = 1e-4;
  while (median_ratio(jumps, high) > std::numbers::ln2) high *= 4;
  for (int k = 0; k < 40; ++k) {
    const double middle = 0.5 * (low + high);
    (median_ratio(jumps, middle) > std::numbers::ln2 ? low : high) = middle;
  }
  return std::sqrt(high);
}

void add_jitter(double s, TrackSet* tracks) {
  for (Track& t : tracks->tracks) {
    bool is_first = true;
    for (Observation& o : t.observations) {
      if (o.status != TrackStatus::ok) continue;
      if (!is_first) o.covariance += s * s * Eigen::Matrix2d::Identity();
      is_first = false;
    }
  }
}

}  // namespace rhytid::fitting
