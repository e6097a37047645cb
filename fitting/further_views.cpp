#include "fitting/further_views.h"

#include <Eigen/Eigenvalues>
#include <Eigen/Geometry>
#include <Eigen/SVD>
#include <cmath>
#include <limits>

namespace rhytid::fitting {
namespace {

constexpr double kTurn = 0.7853981633974483;  ///< 45°
constexpr double kGrazing = 0.342;            ///< sin 20°: skin seen flatter than this shows little

/// Deviations √diag H⁻¹; infinite along what H leaves open.
VectorXd deviations(const MatrixXd& h) {
  const Eigen::SelfAdjointEigenSolver<MatrixXd> eigen(h);
  const VectorXd& values = eigen.eigenvalues();
  VectorXd variances = VectorXd::Zero(h.rows());
  const double least = 1e-14 * values.cwiseAbs().maxCoeff();
  for (Eigen::Index i = 0; i < values.size(); ++i)
    for (Eigen::Index k = 0; k < h.rows(); ++k) {
      const double part = std::pow(eigen.eigenvectors()(k, i), 2);
      if (values[i] > least)
        variances[k] += part / values[i];
      else if (part > 1e-12)
        variances[k] = std::numeric_limits<double>::infinity();
    }
  return variances.cwiseSqrt();
}

/// The camera turned by `angle` about the world axis through `middle`.
Camera turned(const Camera& camera, const Vec3& axis, double angle, const Vec3& middle) {
  const Mat3 turn = Eigen::AngleAxisd(angle, axis.normalized()).toRotationMatrix();
  Camera c = camera;
  c.rotation = camera.rotation * turn.transpose();
  c.translation = camera.rotation * middle + camera.translation - c.rotation * middle;
  return c;
}

/// Normal of the plane through the points that looks toward the camera.
Vec3 mean_normal(const std::vector<Vec3>& points, const Vec3& middle, const Camera& camera) {
  MatrixXd offsets(static_cast<Eigen::Index>(points.size()), 3);
  for (Eigen::Index i = 0; i < offsets.rows(); ++i)
    offsets.row(i) = (points[static_cast<std::size_t>(i)] - middle).transpose();
  const Eigen::JacobiSVD<MatrixXd> svd(offsets, Eigen::ComputeFullV);
  const Vec3 normal = svd.matrixV().col(2);
  return normal.dot(camera.centre() - middle) < 0 ? Vec3(-normal) : normal;
}

/// Information of a camera that sees the points that the clip's first camera saw, by the clip's parameters.
MatrixXd information(const FitProblem& clip, const FitEvaluation& at, const MatrixXd& motion,
                     const Camera& camera) {
  const Eigen::Index n = clip.num_parameters();
  MatrixXd sum = MatrixXd::Zero(n, n);
  Eigen::Index row = 0;
  for (std::size_t i = 0; i < clip.compared().size(); ++i) {
    const auto count = static_cast<Eigen::Index>(clip.compared()[i].frames.size());
    MatrixXd dr(2 * count, n);
    bool is_seen = true;
    for (Eigen::Index j = 0; j < count; ++j, row += 3) {
      const Vec3 x = motion.col(0).segment<3>(row);
      dr.middleRows<2>(2 * j) = -camera.projection_jacobian(x) * motion.rightCols(n).middleRows<3>(row);
      is_seen = is_seen && dr.middleRows<2>(2 * j).allFinite();
    }
    if (!is_seen || clip.compared()[i].camera != 0) continue;
    const MatrixXd whitened = clip.noise()[i].weighted_jacobian(at.tracks[i], dr);
    sum += whitened.transpose() * whitened;
  }
  return sum;
}

}  // namespace

std::vector<FurtherView> further_views(JointProblem& problem, const VectorXd& t,
                                       const FitProblem::Linearised& at) {
  const MatrixXd now = at.jacobian.transpose() * at.jacobian;
  const VectorXd before = deviations(now);
  std::vector<FurtherView> views;
  const auto add = [&](const std::string& name, const MatrixXd& information) {
    const VectorXd after = deviations(now + information);
    FurtherView& view = views.emplace_back();
    view.name = name;
    for (Eigen::Index k = 0; k < before.size(); ++k)
      view.ratios.push_back(std::isfinite(before[k]) ? after[k] / before[k]
                                                     : std::numeric_limits<double>::quiet_NaN());
  };
  const auto of_all = [&](int c, const MatrixXd& own) {
    MatrixXd all = MatrixXd::Zero(now.rows(), now.cols());
    const std::vector<int>& columns = problem.columns(c);
    for (std::size_t a = 0; a < columns.size(); ++a)
      for (std::size_t b = 0; b < columns.size(); ++b)
        all(columns[a], columns[b]) += own(static_cast<Eigen::Index>(a), static_cast<Eigen::Index>(b));
    return all;
  };
  Eigen::Index first_row = 0;
  for (int c = 0; c < problem.num_clips(); ++c) {
    FitProblem& clip = problem.clip(c);
    // All that the clip was compared with, and not its priors, which come last.
    Eigen::Index rows = static_cast<Eigen::Index>(clip.measured().size());
    for (const TrackNoise& noise : clip.noise()) rows += noise.num_rows();
    const MatrixXd compared = at.jacobian.middleRows(first_row, rows);
    first_row += clip.num_residuals();
    const std::string of_clip = clip.name.empty() ? "" : " of clip " + clip.name;
    add("the same once more" + of_clip, compared.transpose() * compared);
    // Where frame 0 moves with the parameters a camera sees that too, which is not predicted here.
    if (clip.run_options().settle || clip.compared().size() < 3) continue;
    const VectorXd own = problem.of_clip(c, t);
    const std::optional<MatrixXd> motion = clip.point_motion(own);
    if (!motion) continue;
    const FitEvaluation& evaluation = clip.evaluate(own);
    const Camera& camera = clip.cameras()[0];
    const std::vector<Vec3> points = clip.rest_points();
    Vec3 middle = Vec3::Zero();
    for (const Vec3& x : points) middle += x / static_cast<double>(points.size());
    const Vec3 normal = mean_normal(points, middle, camera);
    // The camera's own axes: x to the right in the picture, y down. A camera that goes left turns about y.
    const Vec3 right = camera.rotation.row(0).transpose(), down = camera.rotation.row(1).transpose();
    const struct {
      const char* side;
      Vec3 axis;
      double angle;
    } sides[] = {{"to the left", down, kTurn},
                 {"to the right", down, -kTurn},
                 {"up", right, -kTurn},
                 {"down", right, kTurn}};
    for (const auto& side : sides) {
      const Camera other = turned(camera, side.axis, side.angle, middle);
      if (normal.dot((other.centre() - middle).normalized()) < kGrazing) continue;
      add(std::string("another camera 45° ") + side.side + of_clip,
          of_all(c, information(clip, evaluation, *motion, other)));
    }
  }
  return views;
}

}  // namespace rhytid::fitting
