// One track under way: its template, its state in the last frame, and how it is measured in the next.
// Used by tracker.cpp only.
#pragma once

#include <optional>

#include "fitting/tracking/optical_flow.h"
#include "fitting/tracking/patch_alignment.h"
#include "fitting/tracking/tracker.h"

namespace rhytid::fitting {

/// The track of one material point. `warp` and `patch` belong together: warp maps the template into the last
/// frame in which the track was ok.
struct Follower {
  Track track;
  Vec2 seed = Vec2::Zero();  ///< px in the first frame
  bool active = true;        ///< ok in the last frame
  PatchTemplate patch;
  PatchWarp warp;
  /// Covariance of what all frames err alike: the noise of the first template as its alignments felt it, px².
  std::optional<Eigen::Matrix2d> common;
  std::optional<Alignment> with_itself;  ///< of the first template, until `common` is known
  bool has_first_template = true;        ///< the template is of the first frame
  bool renewed = false;                  ///< the template is newer than the last recorded observation
  Eigen::Matrix2d template_gradient =
      Eigen::Matrix2d::Identity();                       ///< deformation from first frame to template
  Eigen::Matrix2d covariance = Eigen::Matrix2d::Zero();  ///< own, in the last ok frame, px²
  double baseline = 0;     ///< first residual against this template, grey; 0 = none yet
  double correlation = 1;  ///< of the last accepted alignment
  double residual = 0;     ///< last accepted residual, grey
};

/// Everything about a frame that measuring a point needs.
struct FrameView {
  const SplineImage* image;
  const SplineImage* previous;
  const SplineImage* first;  ///< frame, which lost points are compared with
  const cv::Mat* mask;       ///< covered pixels (may be empty)
  double least_residual;     ///< quantisation noise of a difference of two images, grey
};

/// Outcome for one track in one frame.
struct Measurement {
  Refusal refusal = Refusal::none;
  Alignment alignment;
  double forward_backward_px = 0;
  bool from_previous = false;                        ///< aligned with a template cut in the previous frame
  PatchTemplate new_patch;                           ///< that template
  Eigen::Matrix2d misfit = Eigen::Matrix2d::Zero();  ///< covariance that no residual shows, px²
};

/// Aligns with the chosen model, which has to end within `max_correction` px of `start` with at least
/// `min_correlation`. The deformation is held at `held`, and only the position sought, when texture does not fix it: when
/// the affine alignment is refused, or makes the position much less certain (twice the variance) without explaining
/// the picture better (10 % of the residual).
Refusal try_align(const PatchTemplate& patch, const PatchWarp& start, const Eigen::Matrix2d& held,
                  double max_correction, const FrameView& view, const TrackerOptions& options,
                  double min_correlation, Alignment* result);

/// First attempt: aligns the follower's template near the guess, with the full warp model and, when that is
/// not acceptable, with the deformation held at `held` (since the template was cut). Does not change the follower, as
/// the following two.
Measurement measure(const Follower& follower, const FlowGuess& guess, const Eigen::Matrix2d& held,
                    const FrameView& view, const TrackerOptions& options);

/// The deformation since its template was cut that the follower and its seven nearest neighbours tell by how they moved, for windows whose
/// texture does not; its own last one where neighbours are few or contradict it.
Eigen::Matrix2d held_gradient(const std::vector<Follower>& followers, const Follower& follower);

/// Did the residual grow by more than max_residual_jump over both the track's last one and `typical`, the
/// median of this frame? (When the whole picture gets worse, as at a video key frame, all grow, and none is
/// at fault.)
bool residual_jumped(const Follower& follower, const Alignment& alignment, double typical,
                     const FrameView& view, const TrackerOptions& options);

/// Did the window move, since the last frame, unlike the eight nearest of `others` (places there, and motions), by more than
/// 2 px and five times what these differ among themselves? Not asked where it matches its template well, nor of fewer than
/// four others. `itself` is where the window is in the list, past its end where it is not.
bool strays(const Follower& follower, const Alignment& alignment,
            const std::vector<std::pair<Vec2, Vec2>>& others, std::size_t itself);

/// Second attempt (incremental reference update): the skin may have deformed too much since the template was
/// taken, but much less since the previous frame; so aligns a template cut there. Keeps `first` when this
/// fails.
void measure_from_previous(const Follower& follower, const FlowGuess& guess, double typical,
                           const FrameView& view, const TrackerOptions& options, Measurement* first);

/// Takes an accepted measurement over into the follower: covariance, warp, baseline.
void accept(const Measurement& measurement, const ResidualCorrelation& correlation, const FrameView& view,
            Follower* follower);

/// Fraction of the window around `pixel` that the mask covers (0 for an empty mask).
double covered_fraction(const cv::Mat& mask, const Vec2& pixel, int half);

/// Where neighbours in the first frame say that a point of it is now: weighted affine fit of their motion.
/// Returns nothing when fewer than `fewest` are active, itself counted if it is.
std::optional<PatchWarp> expected_from_neighbours(const std::vector<Follower>& followers, const Vec2& seed,
                                                  std::size_t fewest = 3);

}  // namespace rhytid::fitting
