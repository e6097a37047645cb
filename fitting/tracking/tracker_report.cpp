// What the tracker accepts as options, and how it says what happened.
#include <cstdio>

#include "fitting/tracking/tracker.h"
#include "sim/core/error.h"

namespace rhytid::fitting {
namespace {

void check(bool good, const char* name, double value, const char* expected) {
  if (!good) throw InputError(std::string("tracker: ") + name, std::to_string(value), expected);
}

}  // namespace

void TrackerOptions::validate() const {
  const TrackerOptions& o = *this;
  check(o.window_px >= 7 && o.window_px <= 201 && o.window_px % 2 == 1, "window_px", o.window_px,
        "odd, 7 to 201 px");
  check(o.smoothing_px >= 0 && o.smoothing_px <= 10, "smoothing_px", o.smoothing_px, "0 to 10 px");
  check(o.pyramid_levels >= 0 && o.pyramid_levels <= 8, "pyramid_levels", o.pyramid_levels, "0 to 8");
  check(o.max_forward_backward_px > 0, "max_forward_backward_px", o.max_forward_backward_px, "above 0 px");
  check(o.max_correction_px > 0, "max_correction_px", o.max_correction_px, "above 0 px");
  check(o.min_correlation >= 0 && o.min_correlation < 1, "min_correlation", o.min_correlation,
        "from 0 to below 1");
  check(o.max_residual_jump > 1, "max_residual_jump", o.max_residual_jump, "above 1");
  check(o.max_sigma_px > 0, "max_sigma_px", o.max_sigma_px, "above 0 px");
  check(o.max_covered_fraction >= 0 && o.max_covered_fraction < 1, "max_covered_fraction",
        o.max_covered_fraction, "from 0 to below 1");
  check(o.update_residual_ratio == 0 || o.update_residual_ratio > 1, "update_residual_ratio",
        o.update_residual_ratio, "0 or above 1");
  check(o.update_correlation >= 0 && o.update_correlation <= 1, "update_correlation", o.update_correlation,
        "0 to 1");
  check(o.max_gradient_change > 0, "max_gradient_change", o.max_gradient_change, "above 0");
  check(o.redetect_search_px >= 1 && o.redetect_search_px <= 100, "redetect_search_px", o.redetect_search_px,
        "1 to 100 px");
  check(o.redetect_max_return_px > 0, "redetect_max_return_px", o.redetect_max_return_px, "above 0 px");
  check(!o.exposure || (*o.exposure >= 0 && *o.exposure <= 1), "exposure", o.exposure.value_or(0), "0 to 1");
  check(!o.camera.empty() && o.camera.find_first_of(",\r\n") == std::string::npos, "camera", 0,
        "a name without commas");
}

const char* to_string(Refusal refusal) {
  constexpr std::array<const char*, kNumRefusals> names = {
      "none",        "occluded", "outside",    "flow",      "forward_backward", "not_converged",
      "correlation", "residual", "correction", "uncertain", "neighbours"};
  return names.at(static_cast<std::size_t>(refusal));
}

const char* to_string(TrackerEnd end) {
  switch (end) {
    case TrackerEnd::finished:
      return "finished";
    case TrackerEnd::source_ended_early:
      return "the footage ended early";
    case TrackerEnd::interrupted:
      return "interrupted";
  }
  throw ContractError("unknown TrackerEnd");
}

std::string summary(const TrackerReport& r) {
  char text[400];
  std::snprintf(
      text, sizeof text,
      "%d of %d frames (%s); %d tracks started, %d kept to the end, %d in every frame, %d times found again\n"
      "flow there and back per frame: median %.3f px, 95 %% %.3f px; noise %.2f grey; jitter %.3f "
      "px; sigma %.3f px; %d template updates",
      r.frames_processed, r.frames_asked, to_string(r.end), r.started, r.kept, r.unbroken, r.redetected,
      r.forward_backward_median_px, r.forward_backward_95_px, r.noise_grey, r.jitter_px, r.sigma_median_px,
      r.template_updates);
  std::string all = text;
  if (r.exposure > 0) {
    std::snprintf(text, sizeof text, "; blur of a shutter open for %.2f of the frame interval allowed for",
                  r.exposure);
    all += text;
  }
  return all;
}

}  // namespace rhytid::fitting
