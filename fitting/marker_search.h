// The search of finger_marker.h: all poses of a finger and the shifts that its points have in all frames, together.
// Used by finger_marker.cpp only.
#pragma once

#include <vector>

#include "fitting/finger_marker.h"
#include "fitting/pose.h"

namespace rhytid::fitting {

/// A tracked point: its place in the list of the marker, and its noise common to all frames.
struct MarkerPoint {
  std::size_t marker = 0;
  const Track* track = nullptr;
  Vec3 place = Vec3::Zero();                                    ///< p, mm
  Eigen::Matrix2d common = Eigen::Matrix2d::Identity();         ///< σ² 1 + C_0, px²
  Eigen::Matrix2d gain_in_first = Eigen::Matrix2d::Identity();  ///< 1 − K
  Eigen::Matrix2d own_in_first = Eigen::Matrix2d::Identity();   ///< C_0 − K C_0, px²
};

/// A point in a frame: pixel = projection + gain · s + own error.
struct MarkerSight {
  int point = 0;
  Vec2 pixel = Vec2::Zero();
  Eigen::Matrix2d gain = Eigen::Matrix2d::Identity();
  Eigen::Matrix2d information = Eigen::Matrix2d::Identity();  ///< of the own error
};

/// A frame in which the pose can be found; the camera as if the finger stood still.
struct FramedMarker {
  int index = 0;
  Camera pose;
  std::vector<MarkerSight> sights;
};

/// Columns: the steps (ω, τ) of a pose that are searched.
using PoseBasis = Eigen::Matrix<double, 6, Eigen::Dynamic, 0, 6, 6>;

/// The camera as it sees the body's own axes, and back.
Camera seen_from_body(const Camera& camera, const BodyPose& body);
BodyPose body_of(const Camera& camera, const Camera& relative);

class MarkerSearch {
 public:
  /// `points` must outlive it; at least one.
  MarkerSearch(const std::vector<MarkerPoint>& points, PoseBasis basis, double huber);

  /// The pose of a frame with the shifts as they are, from its own as a start; false when its sights do not
  /// determine it.
  bool place(FramedMarker& frame) const;
  /// All poses and shifts.
  void settle(std::vector<FramedMarker>& frames);
  /// Fills in poses, deviations, shifts and scales.
  void conclude(const std::vector<FramedMarker>& frames, const Camera& camera, MarkerMotion& motion) const;

 private:
  using PoseMatrix = Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, 0, 6, 6>;
  using PoseVector = Eigen::Matrix<double, Eigen::Dynamic, 1, 0, 6, 1>;
  /// Of one frame, by its pose and the shifts.
  struct Normal {
    PoseMatrix pose;  ///< H_f
    PoseVector gradient;
    MatrixXd mixed;  ///< H_fs, [k][2n]
  };
  /// Of all, poses eliminated.
  struct Joint {
    std::vector<Normal> frames;
    MatrixXd shifts;
    VectorXd gradient;
  };

  static Vec2 shift(const VectorXd& shifts, std::size_t point) {
    return shifts.segment<2>(2 * static_cast<Eigen::Index>(point));
  }
  const Vec3& place_of(const MarkerSight& s) const {
    return points_[static_cast<std::size_t>(s.point)].place;
  }
  Vec2 residual(const FramedMarker& frame, const MarkerSight& s, const VectorXd& shifts) const;
  double weight(const Vec2& r, const MarkerSight& s) const;
  double cost_of(const FramedMarker& frame, const VectorXd& shifts) const;
  double cost_of(const std::vector<FramedMarker>& frames, const VectorXd& shifts) const;
  Normal normal_of(const FramedMarker& frame) const;
  Joint joint_of(const std::vector<FramedMarker>& frames) const;
  void set_scales(const std::vector<FramedMarker>& frames, MarkerMotion& motion) const;
  static bool is_determined(const PoseMatrix& hessian);

  const std::vector<MarkerPoint>& points_;
  PoseBasis basis_;
  double huber_;
  Vec3 middle_ = Vec3::Zero();  ///< of the points, mm
  VectorXd shifts_;             ///< [2n] px
};

}  // namespace rhytid::fitting
