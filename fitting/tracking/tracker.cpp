#include "fitting/tracking/tracker.h"

#include <algorithm>
#include <cmath>
#include <numbers>
#include <opencv2/imgproc.hpp>

#include "fitting/tracking/follower.h"
#include "fitting/tracking/jitter.h"
#include "fitting/tracking/motion_blur.h"
#include "fitting/tracking/optical_flow.h"
#include "fitting/tracking/redetection.h"
#include "sim/core/error.h"

namespace rhytid::fitting {
namespace {

/// Value at `fraction` of the sorted list (0 when empty); the list is reordered.
double quantile(std::vector<double>* values, double fraction) {
  if (values->empty()) return 0;
  const auto nth = values->begin() + static_cast<std::ptrdiff_t>(fraction * (values->size() - 1) + 0.5);
  std::nth_element(values->begin(), nth, values->end());
  return *nth;
}

SplineImage smooth_image(const cv::Mat& grey, double smoothing_px) {
  if (!(smoothing_px > 0)) return SplineImage(grey);
  cv::Mat smooth;
  const int reach = static_cast<int>(std::ceil(4 * smoothing_px));
  cv::GaussianBlur(grey, smooth, {2 * reach + 1, 2 * reach + 1}, smoothing_px, smoothing_px,
                   cv::BORDER_REFLECT);
  return SplineImage(smooth);
}

/// One run over a source.
class Run {
 public:
  Run(FrameSource* source, const TrackerOptions& options) : source_(*source), o_(options) {
    // The difference of two images rounded to multiples of q has variance 2 q²/12; a Gaussian of deviation s
    // divides the variance of white noise by 4 π s².
    least_residual_ = source_.quantum() / std::sqrt(6.0);
    least_residual_ /= std::max(1.0, std::sqrt(4 * std::numbers::pi) * o_.smoothing_px);
  }

  TrackerResult execute() {
    report_.frames_asked = source_.frames_asked();
    while (std::optional<Frame> frame = source_.next()) {
      if (report_.frames_processed == 0)
        start(*frame);
      else
        advance(*frame);
      ++report_.frames_processed;
      if (o_.progress &&
          !o_.progress(report_.frames.back(), report_.frames_processed, report_.frames_asked)) {
        report_.end = TrackerEnd::interrupted;
        break;
      }
    }
    if (report_.end != TrackerEnd::interrupted && report_.frames_processed < report_.frames_asked)
      report_.end = TrackerEnd::source_ended_early;
    if (report_.frames_processed == 0)
      throw InputError(source_.options().path.empty() ? "image list" : source_.options().path,
                       "no readable frame", "at least one frame");
    return finish();
  }

 private:
  cv::Mat mask_of(const Frame& frame) const {
    cv::Mat mask = occluder_mask(frame, o_.occluder);
    if (o_.mask) {
      const cv::Mat extra = o_.mask(frame);
      if (!extra.empty()) {
        require(extra.type() == CV_8U && extra.size() == frame.grey.size(),
                "tracker: mask callback: wrong type or size");
        mask = mask.empty() ? extra : cv::Mat(mask | extra);
      }
    }
    return mask;
  }

  void start(const Frame& frame) {
    const int half = o_.window_px / 2;
    image_ = smooth_image(frame.grey, o_.smoothing_px);
    first_ = image_;
    pyramid_ = flow_pyramid(frame.grey, o_.window_px, o_.pyramid_levels);
    for (const Vec2& seed : choose_seeds(frame.grey, mask_of(frame), half + 3, o_.seeds)) {
      Follower f;
      f.patch = cut_template(image_, seed, half);
      if (f.patch.values.empty()) {
        ++report_.seeds_refused;
        continue;
      }
      // Alignment with itself: tells whether the texture fixes a position at all.
      const Alignment self = align(f.patch, image_, {seed, Eigen::Matrix2d::Identity()}, {o_.model});
      if (self.status != AlignmentStatus::converged) {
        ++report_.seeds_refused;
        continue;
      }
      f.track.id = static_cast<int>(followers_.size());
      f.track.camera = o_.camera;
      f.seed = f.warp.centre = seed;
      f.with_itself = self;
      followers_.push_back(std::move(f));
    }
    if (followers_.empty())
      throw InputError("tracker: first frame",
                       "no point with enough texture (" + std::to_string(report_.seeds_refused) + " refused)",
                       "a region of interest with visible texture, or a lower quality threshold");
    report_.started = static_cast<int>(followers_.size());
    FrameCounts counts{frame.index, frame.time_s};
    for (Follower& f : followers_) record(frame, TrackStatus::ok, 1.0, &f, &counts);
    report_.frames.push_back(counts);
  }

  void advance(const Frame& frame) {
    const SplineImage image = smooth_image(frame.grey, o_.smoothing_px);
    const FlowPyramid pyramid = flow_pyramid(frame.grey, o_.window_px, o_.pyramid_levels);
    const cv::Mat mask = mask_of(frame);
    const FrameView view{&image, &image_, &first_, &mask, least_residual_};
    const std::vector<FlowGuess> guesses =
        flow(pyramid_, pyramid, active_positions(), o_.window_px, o_.pyramid_levels);

    std::vector<int> guess_of(followers_.size(), -1);
    for (std::size_t i = 0, next = 0; i < followers_.size(); ++i)
      if (followers_[i].active) guess_of[i] = static_cast<int>(next++);
    std::vector<Measurement> measured(followers_.size());
    // Each track writes its own slot: the result does not depend on the threads.
    cv::parallel_for_(cv::Range(0, static_cast<int>(followers_.size())), [&](const cv::Range& range) {
      for (int i = range.start; i < range.end; ++i) {
        if (guess_of[i] >= 0)
          measured[i] = measure(followers_[i], guesses[guess_of[i]], held_gradient(followers_, followers_[i]),
                                view, o_);
        else
          measured[i].refusal = Refusal::flow;  // was lost before; the search below may find it
      }
    });

    if (o_.exposure != 0.0) allow_for_blur(view, &measured);
    const double typical = typical_residual(measured);
    cv::parallel_for_(cv::Range(0, static_cast<int>(followers_.size())), [&](const cv::Range& range) {
      for (int i = range.start; i < range.end; ++i) {
        if (guess_of[i] < 0) continue;
        Measurement& m = measured[i];
        if (m.refusal == Refusal::none && residual_jumped(followers_[i], m.alignment, typical, view, o_))
          m.refusal = Refusal::residual;
        const bool worth_it = m.refusal == Refusal::not_converged || m.refusal == Refusal::correlation ||
                              m.refusal == Refusal::residual || m.refusal == Refusal::correction ||
                              m.refusal == Refusal::uncertain;
        if (worth_it && o_.update_residual_ratio > 0)
          measure_from_previous(followers_[i], guesses[guess_of[i]], typical, view, o_, &m);
      }
    });

    refuse_strays(&measured);
    FrameCounts counts{frame.index, frame.time_s};
    take_over(view, guess_of, &measured, &counts);
    if (o_.redetect) find_lost(view, &measured, &counts);
    for (std::size_t i = 0; i < followers_.size(); ++i) {
      Follower& f = followers_[i];
      if (f.active)
        record(frame, TrackStatus::ok, measured[i].alignment.correlation, &f, &counts);
      else
        record(frame, lost_as(f, guess_of[i] >= 0 ? measured[i].refusal : Refusal::none), 0, &f, &counts);
    }
    renew_templates(image, &counts);
    report_.frames.push_back(counts);
    image_ = image;
    pyramid_ = pyramid;
  }

  std::vector<Vec2> active_positions() const {
    std::vector<Vec2> positions;
    for (const Follower& f : followers_)
      if (f.active) positions.push_back(f.warp.centre);
    return positions;
  }

  static double typical_residual(const std::vector<Measurement>& measured) {
    std::vector<double> residuals;
    for (const Measurement& m : measured)
      if (m.refusal == Refusal::none) residuals.push_back(m.alignment.residual_rms);
    return quantile(&residuals, 0.5);
  }

  /// Learns how long the shutter is open unless that is given, and measures accepted windows again that were blurred otherwise
  /// than their templates.
  void allow_for_blur(const FrameView& view, std::vector<Measurement>* measured) {
    const int count = static_cast<int>(followers_.size());
    const auto each = [count](const auto& work) {
      cv::parallel_for_(cv::Range(0, count), [&work](const cv::Range& range) {
        for (int i = range.start; i < range.end; ++i) work(i);
      });
    };
    if (!o_.exposure && !shutter_.is_known()) {
      // Every third window: their neighbours tell the same.
      std::vector<std::optional<std::array<double, 5>>> costs(followers_.size());
      each([&](int i) {
        const Measurement& m = (*measured)[i];
        if (i % 3 == 0 && m.refusal == Refusal::none)
          costs[i] = Shutter::compare(followers_[i], m.alignment, view, o_);
      });
      for (const auto& c : costs)
        if (c) shutter_.add(*c);
    }
    const double exposure = o_.exposure.value_or(shutter_.exposure());
    if (exposure == 0) return;
    each([&](int i) {
      Measurement& m = (*measured)[i];
      const Follower& f = followers_[i];
      if (m.refusal != Refusal::none) return;
      const PatchWarp start = m.alignment.warp;
      const std::optional<Motions> motions = motions_of(f, start.centre);
      if (!motions) return;
      const RelativeBlur blur = relative_blur(motions->first, motions->now, start.gradient, exposure);
      // A window smeared by more than half its side is too even to be told from others.
      if (blur.longest() == 0 || blur.longest() > f.patch.half) return;
      Measurement again = measure_blurred(f, start, blur, view, o_);
      if (again.refusal != Refusal::none) return;
      // Where motion is not what its differences say, blurring fits worse.
      const double before = m.alignment.residual_rms, after = again.alignment.residual_rms;
      if (after * after > noise_after(blur, o_) * before * before) return;
      m.alignment = std::move(again.alignment);
      m.misfit = blur_misfit(blur);
    });
  }

  void refuse_strays(std::vector<Measurement>* measured) const {
    std::vector<std::size_t> accepted;
    std::vector<std::pair<Vec2, Vec2>> motions;
    for (std::size_t i = 0; i < measured->size(); ++i) {
      if ((*measured)[i].refusal != Refusal::none) continue;
      const Vec2& before = followers_[i].warp.centre;
      accepted.push_back(i);
      motions.emplace_back(before, (*measured)[i].alignment.warp.centre - before);
    }
    for (std::size_t k = 0; k < accepted.size(); ++k) {
      Measurement& m = (*measured)[accepted[k]];
      if (strays(followers_[accepted[k]], m.alignment, motions, k)) m.refusal = Refusal::neighbours;
    }
  }

  /// Accepts or refuses what was measured; noise statistics of the frame.
  void take_over(const FrameView& view, const std::vector<int>& guess_of, std::vector<Measurement>* measured,
                 FrameCounts* counts) {
    std::vector<const Alignment*> accepted;
    std::vector<double> residuals, errors;
    for (const Measurement& m : *measured) {
      if (m.refusal != Refusal::none) continue;
      accepted.push_back(&m.alignment);
      residuals.push_back(m.alignment.residual_rms);
      errors.push_back(m.forward_backward_px);
    }
    correlation_ = ResidualCorrelation(accepted);
    cv::parallel_for_(cv::Range(0, static_cast<int>(followers_.size())), [&](const cv::Range& range) {
      for (int i = range.start; i < range.end; ++i) {
        if (guess_of[i] < 0) continue;
        if ((*measured)[i].refusal == Refusal::none)
          accept((*measured)[i], correlation_, view, &followers_[i]);
        else
          followers_[i].active = false;
      }
    });
    for (std::size_t i = 0; i < followers_.size(); ++i) {
      if (guess_of[i] < 0) continue;
      const Measurement& m = (*measured)[i];
      if (m.refusal != Refusal::none) ++report_.refusals[static_cast<int>(m.refusal)];
      if (m.refusal == Refusal::none && m.from_previous) ++counts->template_updates;
    }
    all_errors_.insert(all_errors_.end(), errors.begin(), errors.end());
    all_residuals_.insert(all_residuals_.end(), residuals.begin(), residuals.end());
    counts->forward_backward_px = quantile(&errors, 0.5);
    counts->residual_grey = quantile(&residuals, 0.5);
  }

  void find_lost(const FrameView& view, std::vector<Measurement>* measured, FrameCounts* counts) {
    std::vector<char> is_found(followers_.size(), 0);
    cv::parallel_for_(cv::Range(0, static_cast<int>(followers_.size())), [&](const cv::Range& range) {
      for (int i = range.start; i < range.end; ++i) {
        if (followers_[i].active || followers_[i].patch.values.empty()) continue;
        const std::optional<PatchWarp> expected = expected_from_neighbours(followers_, followers_[i].seed);
        if (!expected) continue;
        Measurement m = redetect(followers_[i], *expected, view, o_);
        if (m.refusal != Refusal::none) continue;
        (*measured)[i] = std::move(m);
        is_found[i] = 1;
      }
    });
    // After the loop, so that a point found does not count as a neighbour of the next in the same frame.
    for (std::size_t i = 0; i < followers_.size(); ++i) {
      if (!is_found[i]) continue;
      accept((*measured)[i], correlation_, view, &followers_[i]);
      ++counts->redetected;
    }
  }

  /// Cuts new templates where the skin in the window has changed beyond what the warp explains.
  void renew_templates(const SplineImage& image, FrameCounts* counts) {
    if (o_.update_residual_ratio <= 0) return;
    for (Follower& f : followers_) {
      if (!f.active) continue;
      const bool changed = f.correlation < o_.update_correlation &&
                           f.residual > o_.update_residual_ratio * std::max(f.baseline, typical_baseline());
      const bool stretched = (f.warp.gradient - Eigen::Matrix2d::Identity()).norm() > o_.max_gradient_change;
      if (!changed && !stretched) continue;
      PatchTemplate fresh = cut_template(image, f.warp.centre, o_.window_px / 2);
      if (fresh.values.empty()) continue;
      f.patch = std::move(fresh);
      f.renewed = true;
      f.has_first_template = false;
      f.template_gradient = f.warp.gradient * f.template_gradient;
      f.warp.gradient.setIdentity();
      f.baseline = 0;
      ++counts->template_updates;
    }
  }

  /// Median of the first residuals: a track that was lucky at the start is not renewed for being normal
  /// later.
  double typical_baseline() {
    if (baseline_frame_ != report_.frames_processed) {
      std::vector<double> values;
      for (const Follower& f : followers_)
        if (f.baseline > 0) values.push_back(f.baseline);
      typical_baseline_ = quantile(&values, 0.5);
      baseline_frame_ = report_.frames_processed;
    }
    return typical_baseline_;
  }

  /// Status of a track that is not ok: the reason of the refusal, or what it was before.
  static TrackStatus lost_as(const Follower& f, Refusal refusal) {
    switch (refusal) {
      case Refusal::none:
        return f.track.observations.back().status;
      case Refusal::occluded:
        return TrackStatus::occluded;
      case Refusal::outside:
        return TrackStatus::outside;
      default:
        return TrackStatus::lost;
    }
  }

  void record(const Frame& frame, TrackStatus status, double correlation, Follower* f, FrameCounts* counts) {
    Observation observation;
    observation.frame = frame.index;
    observation.time_s = frame.time_s;
    observation.status = status;
    if (status == TrackStatus::ok) {
      observation.pixel = f->warp.centre;
      observation.covariance = f->covariance;
      observation.correlation = correlation;
      observation.renewed = f->renewed;
      f->renewed = false;
    }
    f->track.observations.push_back(observation);
    switch (status) {
      case TrackStatus::ok:
        ++counts->ok;
        break;
      case TrackStatus::occluded:
        ++counts->occluded;
        break;
      case TrackStatus::lost:
        ++counts->lost;
        break;
      case TrackStatus::outside:
        ++counts->outside;
        break;
    }
  }

  TrackerResult finish() {
    TrackerResult result;
    std::vector<double> sigmas;
    const double typical = std::max(quantile(&all_residuals_, 0.5), least_residual_);
    report_.noise_grey = quantile(&all_residuals_, 0.5) / std::sqrt(2.0);
    for (Follower& f : followers_) {
      auto& list = f.track.observations;
      // The first position is the definition of the material point; what it errs by is common to all frames.
      // A point that was never seen again has no residuals of its own and is given typical ones.
      if (!f.common) f.common = 0.5 * correlation_.covariance(*f.with_itself, typical);
      list[0].covariance = *f.common;
      report_.kept += f.active;
      report_.unbroken += std::all_of(list.begin(), list.end(),
                                      [](const Observation& o) { return o.status == TrackStatus::ok; });
      result.tracks.tracks.push_back(std::move(f.track));
    }
    report_.exposure = o_.exposure.value_or(shutter_.exposure());
    if (report_.exposure > 0)
      for (Track& t : result.tracks.tracks) remove_acceleration(report_.exposure, &t);
    report_.jitter_px = measure_jitter(result.tracks);
    add_jitter(report_.jitter_px, &result.tracks);
    for (const Track& t : result.tracks.tracks) {
      const std::vector<Eigen::Matrix2d> shared = t.shared_covariances();
      for (std::size_t i = 1; i < t.observations.size(); ++i)
        if (t.observations[i].status == TrackStatus::ok)
          sigmas.push_back(std::sqrt((shared[i] + t.observations[i].covariance).trace() / 2));
    }
    for (const FrameCounts& c : report_.frames) {
      report_.template_updates += c.template_updates;
      report_.redetected += c.redetected;
    }
    report_.forward_backward_median_px = quantile(&all_errors_, 0.5);
    report_.forward_backward_95_px = quantile(&all_errors_, 0.95);
    report_.sigma_median_px = quantile(&sigmas, 0.5);
    result.report = std::move(report_);
    return result;
  }

  FrameSource& source_;
  const TrackerOptions& o_;
  TrackerReport report_;
  std::vector<Follower> followers_;
  SplineImage first_, image_;  // of the first and of the last frame
  FlowPyramid pyramid_;
  ResidualCorrelation correlation_{{}};
  Shutter shutter_;
  double least_residual_ = 0, typical_baseline_ = 0;
  int baseline_frame_ = -1;
  std::vector<double> all_errors_, all_residuals_;
};

}  // namespace

TrackerResult track(FrameSource& source, const TrackerOptions& options) {
  options.validate();
  return Run(&source, options).execute();
}

}  // namespace rhytid::fitting
