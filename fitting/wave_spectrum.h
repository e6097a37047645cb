// What tracks say of wrinkles without asking where their crests are: the waves in the displacement of tracked points.
//
// Point residuals know wrinkles by their phase: a wave that is shifted by half its length costs more than none, and a
// wavelength that is slightly wrong is out of phase after a few crests, so that the fit lets waves die. Their amplitudes
// by wave vector do not depend on the phase. In every frame and camera, with x_i the rest positions of the points that are
// seen, in the plane that fits them best, and d_i how far each has moved in the picture since frame 0,
//
//   d_i ≈ quadratic(x_i) + a_k cos(k·x_i) + b_k sin(k·x_i)     least squares, for each wave vector k by itself
//   s_k = √(|a_k|² + |b_k|² + σ_k²)   px                        of what was tracked (less what noise adds), of the prediction
//   residual  (s_k,tracked − s_k,predicted)/√(σ_k² + (τ s_k,tracked)²)
//
// with σ_k the deviation of one coefficient by the tracks' noise and τ a relative tolerance. k runs over four directions
// and lengths 2π/λ between those of the band, as finely as the patch tells waves apart (one wave more over its extent).
//
// The tracks' noise is in these residuals and in those of the points alike. They lead the fit, but say nothing of how sure
// it is: covariances, χ² and systematic shifts are those of the points (FitProblem::linearised).
//
// Units  mm at rest, px in the picture.   Tests  tests/fitting/wave_spectrum_test.cpp
#pragma once

#include <string>
#include <vector>

#include "sim/core/types.h"

namespace rhytid::fitting {

/// Wavelengths that count, mm.
struct WaveBand {
  double shortest = 0, longest = 0;
  double tolerance = 0.05;  ///< τ
};

/// The observations of one track that are compared.
struct WavePoint {
  Vec3 rest;  ///< mm
  int camera = 0;
  std::vector<int> frames;
  VectorXd moved;                 ///< [2n] px since frame 0, as tracked
  std::vector<double> variances;  ///< [n] px² per axis, of that
};

/// What waves there are in one frame, for one camera.
struct WaveDescription {
  int frame = 0, camera = 0;
  double amplitude = 0, amplitude_sigma = 0;    ///< px, root of the sum of squares over all waves
  double wavelength = 0, wavelength_sigma = 0;  ///< mm, of the mean wave number, weighted with squares
  double direction = 0, direction_sigma = 0;    ///< rad of the wave vector in the plane, in (−π/2, π/2]
};

class WaveSpectrum {
 public:
  /// Frames that see too few points for a wave beside the quadratic have no residuals. Throws InputError for a band
  /// without wavelengths or with waves shorter than twice the median distance of a point to its nearest, and where no frame
  /// tells any.
  WaveSpectrum(const std::vector<WavePoint>& points, const WaveBand& band);

  int size() const { return size_; }
  /// Of differences observed − predicted by track, [2n] px each.
  VectorXd residuals(const std::vector<VectorXd>& differences) const;
  /// Their derivative along columns of the differences' derivatives.
  MatrixXd jacobian(const std::vector<VectorXd>& differences, const std::vector<MatrixXd>& dr) const;
  /// ∂½|z|²/∂differences, by track.
  std::vector<VectorXd> gradient(const std::vector<VectorXd>& differences) const;
  /// As tracked, and as predicted (without deviations).
  std::vector<WaveDescription> tracked() const;
  std::vector<WaveDescription> predicted(const std::vector<VectorXd>& differences) const;
  /// The axes that directions are of, [3][2].
  const Eigen::Matrix<double, 3, 2>& plane() const { return plane_; }

 private:
  struct Seen {
    std::size_t point;
    int observation;
  };
  /// One camera in one frame.
  struct Block {
    int frame, camera;
    std::vector<Seen> points;
    MatrixXd moved;           ///< [points][2] px, as tracked
    MatrixXd coefficients;    ///< [2 waves][points]: a and b of each wave by the displacements
    MatrixXd waves;           ///< [waves][2] k, 1/mm
    VectorXd noise, tracked;  ///< [waves] σ_k and s_k of the tracks
    VectorXd power;           ///< [waves] of the tracks, less noise, px²
  };
  void add_block(const std::vector<WavePoint>& points, const WaveBand& band, Block block);
  MatrixXd moved_by_prediction(const Block& block, const std::vector<VectorXd>& differences) const;
  WaveDescription described(const Block& block, const VectorXd& power, bool with_sigma) const;

  std::vector<Block> blocks_;
  std::vector<Eigen::Index> sizes_;  ///< [points] of their differences
  Eigen::Matrix<double, 3, 2> plane_;
  double tolerance_ = 0;
  int size_ = 0;
};

}  // namespace rhytid::fitting
