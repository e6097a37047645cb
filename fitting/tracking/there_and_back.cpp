#include "fitting/tracking/there_and_back.h"

#include <algorithm>
#include <cstdio>
#include <vector>

#include "sim/core/error.h"

namespace rhytid::fitting {

std::string summary(const ThereAndBack& r) {
  char text[200];
  std::snprintf(
      text, sizeof text,
      "there and back over the whole clip: median %.3f px, 90 %% %.3f px; %d of %d points came back",
      r.median_px, r.p90_px, r.returned, r.sent);
  return text;
}

std::optional<ThereAndBack> there_and_back(const FrameSourceOptions& footage, const TrackSet& forward,
                                           TrackerOptions options) {
  ThereAndBack result;
  FrameSourceOptions reversed = footage;
  reversed.backwards = true;
  reversed.last = footage.first;
  for (const Track& t : forward.tracks)
    if (!t.observations.empty()) reversed.last = std::max(reversed.last, t.observations.back().frame);
  std::vector<const Track*> sent;
  options.seeds.seeding = Seeding::points;
  options.seeds.points.clear();
  for (const Track& t : forward.tracks) {
    const Observation* end = t.at(reversed.last);
    if (end == nullptr || end->status != TrackStatus::ok || t.observations.front().status != TrackStatus::ok)
      continue;
    sent.push_back(&t);
    options.seeds.points.push_back(end->pixel);
  }
  result.sent = static_cast<int>(sent.size());
  if (sent.empty() || reversed.last == footage.first) return result;

  FrameSource source(reversed);
  const TrackerResult back = track(source, options);
  if (back.report.end == TrackerEnd::interrupted) return std::nullopt;
  // A point without texture where it ended starts no track back: matched by place, which tracks keep bit by
  // bit.
  std::vector<double> distances;
  std::size_t i = 0;
  for (const Track& t : back.tracks.tracks) {
    while (i < sent.size() && options.seeds.points[i] != t.observations.front().pixel) ++i;
    require(i < sent.size(), "there_and_back: a track that nobody sent");
    const Observation& end = t.observations.back();
    if (end.status == TrackStatus::ok && end.frame == footage.first)
      distances.push_back((end.pixel - sent[i]->observations.front().pixel).norm());
    ++i;
  }
  result.returned = static_cast<int>(distances.size());
  if (distances.empty()) return result;
  std::sort(distances.begin(), distances.end());
  result.median_px = distances[distances.size() / 2];
  result.p90_px = distances[distances.size() * 9 / 10];
  return result;
}

}  // namespace rhytid::fitting
