#include "tools/render/track_record.h"

namespace rhytid::tools {

using nlohmann::json;

json track_record(const fitting::TrackerReport& report, const std::optional<fitting::ThereAndBack>& returned,
                  const std::optional<TrackingError>& against_truth) {
  json refusals = json::object();
  for (int i = 1; i < fitting::kNumRefusals; ++i) {
    const int count = report.refusals[static_cast<size_t>(i)];
    if (count > 0) refusals[fitting::to_string(static_cast<fitting::Refusal>(i))] = count;
  }
  json frames = json::array();
  for (const fitting::FrameCounts& f : report.frames)
    frames.push_back({{"frame", f.frame},
                      {"time_s", f.time_s},
                      {"ok", f.ok},
                      {"occluded", f.occluded},
                      {"lost", f.lost},
                      {"outside", f.outside},
                      {"template_updates", f.template_updates},
                      {"redetected", f.redetected},
                      {"residual_grey", f.residual_grey},
                      {"forward_backward_px", f.forward_backward_px}});
  json record = {
      {"end", fitting::to_string(report.end)},
      {"frames_asked", report.frames_asked},
      {"frames_processed", report.frames_processed},
      {"tracks", {{"started", report.started}, {"kept", report.kept}, {"unbroken", report.unbroken}}},
      {"seeds_refused", report.seeds_refused},
      {"template_updates", report.template_updates},
      {"redetected", report.redetected},
      {"forward_backward_px",
       {{"median", report.forward_backward_median_px}, {"p95", report.forward_backward_95_px}}},
      {"exposure", report.exposure},
      {"noise_grey", report.noise_grey},
      {"jitter_px", report.jitter_px},
      {"sigma_median_px", report.sigma_median_px},
      {"refusals", refusals},
      {"frames", frames}};
  if (returned)
    record["there_and_back_px"] = {{"median", returned->median_px},
                                   {"p90", returned->p90_px},
                                   {"sent", returned->sent},
                                   {"returned", returned->returned}};
  if (against_truth) {
    const TrackingError& e = *against_truth;
    record["error_against_truth"] = {{"tracks", e.tracks},
                                     {"off_skin", e.off_skin},
                                     {"observations", e.observations},
                                     {"rms_px", e.rms_px},
                                     {"median_px", e.median_px},
                                     {"p95_px", e.p95_px},
                                     {"largest_px", e.largest_px},
                                     {"gross", e.gross},
                                     {"inlier_rms_px", e.inlier_rms_px},
                                     {"last_frame_rms_px", e.last_frame_rms_px},
                                     {"normalised", e.normalised},
                                     {"reduced_chi_square", e.reduced_chi_square}};
  }
  return record;
}

}  // namespace rhytid::tools
