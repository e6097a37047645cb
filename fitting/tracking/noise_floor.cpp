#include "fitting/tracking/noise_floor.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <map>
#include <vector>

namespace rhytid::fitting {
namespace {

double median(std::vector<double> values) {
  const auto middle = values.begin() + static_cast<std::ptrdiff_t>(values.size() / 2);
  std::nth_element(values.begin(), middle, values.end());
  return *middle;
}

}  // namespace

NoiseFloor measure_noise_floor(const TrackSet& tracks, int first_frame, int last_frame,
                               bool remove_common_motion) {
  struct Sample {
    int frame;
    Vec2 displacement;
    Eigen::Matrix2d covariance;
  };
  std::vector<std::vector<Sample>> all;
  std::map<int, std::array<std::vector<double>, 2>> by_frame;
  for (const Track& t : tracks.tracks) {
    const Observation* start = t.at(first_frame);
    if (start == nullptr || start->status != TrackStatus::ok) continue;
    std::vector<Sample> samples;
    const std::vector<Eigen::Matrix2d> shared = t.shared_covariances();
    const Eigen::Matrix2d before = shared[start - t.observations.data()];
    // What the first frame errs by itself, or as the definition of the point.
    const Eigen::Matrix2d own = start->covariance;
    for (std::size_t i = 0; i < t.observations.size(); ++i) {
      const Observation& o = t.observations[i];
      if (o.frame <= first_frame || o.frame > last_frame || o.status != TrackStatus::ok) continue;
      samples.push_back({o.frame, o.pixel - start->pixel, own + shared[i] - before + o.covariance});
    }
    if (samples.size() < 3) continue;
    for (const Sample& s : samples)
      for (int axis = 0; axis < 2; ++axis) by_frame[s.frame][axis].push_back(s.displacement[axis]);
    all.push_back(std::move(samples));
  }
  std::map<int, Vec2> common;
  if (remove_common_motion)
    for (const auto& [frame, values] : by_frame) common[frame] = {median(values[0]), median(values[1])};

  NoiseFloor floor;
  floor.tracks = static_cast<int>(all.size());
  if (all.empty()) return floor;
  double scatter = 0, drift = 0, predicted = 0, normalised = 0;
  long count = 0, freedom = 0;
  for (auto& samples : all) {
    Vec2 mean = Vec2::Zero();
    for (Sample& s : samples) {
      if (remove_common_motion) s.displacement -= common[s.frame];
      mean += s.displacement / static_cast<double>(samples.size());
    }
    for (const Sample& s : samples) {
      scatter += (s.displacement - mean).squaredNorm();
      predicted += s.covariance.trace();
      for (int axis = 0; axis < 2; ++axis)
        normalised += s.displacement[axis] * s.displacement[axis] / s.covariance(axis, axis);
    }
    drift += mean.squaredNorm();
    count += 2 * static_cast<long>(samples.size());
    freedom += 2 * (static_cast<long>(samples.size()) - 1);
  }
  floor.scatter_px = std::sqrt(scatter / freedom);
  floor.drift_px = std::sqrt(drift / (2.0 * static_cast<double>(all.size())));
  floor.predicted_px = std::sqrt(predicted / count);
  floor.normalised = std::sqrt(normalised / count);
  return floor;
}

}  // namespace rhytid::fitting
