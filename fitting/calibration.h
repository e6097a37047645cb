// The lens of a camera from photographs of a checkerboard.
//
//   min over fx fy cx cy, distortion, poses:   Σ_photographs Σ_corners |corner − project(R_i X + t_i)|²
//
// with project as in cameras.h (Z. Zhang, "A flexible new technique for camera calibration", PAMI 2000;
// OpenCV's calibrateCameraExtended).
//
// Which photographs. One whose corners are off by more than three times the median of all is taken out, the
// worst first, and the rest is fitted again.
//
// Which distortion. Each of a ladder of models, from none to k1 k2 p1 p2 k3, is fitted without some of the
// photographs and judged by how well it predicts those (their poses alone are fitted). Terms that the
// photographs do not determine predict worse. Taken is the model with the fewest terms whose mean square
// errors are not above those of the best by more than chance (their ratios over the photographs, logarithms,
// 95 % of Student's t), and on average not by more than a fifth.
//
// How sure. Intervals of 95 % come from the larger of two deviations: that of the linearised fit with
// independent corners, σ² = |r|²/(2 corners − parameters), and the jackknife over groups of photographs, which
// sees what the corners of a photograph err alike (a board that is not flat): σ² = (g − 1)/g Σ_j (p_j − p̄)²,
// p_j fitted without group j, Student's t with g − 1 degrees. A group is photographs that follow each other,
// which are often alike. A term that is not in the model has no interval.
// Tests: tests/fitting/calibration_test.cpp
#pragma once

#include <array>
#include <functional>
#include <optional>
#include <string>
#include <vector>

#include "fitting/cameras.h"
#include "fitting/chessboard.h"

namespace rhytid::fitting {

/// fx fy cx cy k1 k2 p1 p2 k3, in this order everywhere.
inline constexpr int kNumLensParameters = 9;
inline constexpr std::array<const char*, kNumLensParameters> kLensParameters = {"fx", "fy", "cx", "cy", "k1",
                                                                                "k2", "p1", "p2", "k3"};

struct LensParameter {
  double value = 0;            ///< px (fx fy cx cy), else 1
  bool is_fitted = false;      ///< else it is 0 and has no interval
  double sigma = 0;            ///< standard deviation
  double low = 0, high = 0;    ///< interval of 95 %
  double linear_sigma = 0;     ///< of the linearised fit alone
  double jackknife_sigma = 0;  ///< between groups of photographs alone
};

struct CalibrationPhotograph {
  std::string file;
  BoardView board;  ///< no corners: none was found
  bool is_used = false;
  std::string reason;                ///< why not
  double rms_px = 0, worst_px = 0;   ///< of corner − projection
  double tilt = 0;                   ///< rad, between the board's normal and the line of sight to its middle
  Mat3 rotation = Mat3::Identity();  ///< board to camera
  Vec3 translation = Vec3::Zero();   ///< mm when the squares are
  std::vector<Vec2> residuals;       ///< corner − projection, px
};

struct LensModel {
  std::string name;  ///< "k1 k2"
  int num_terms = 0;
  double predicted_rms = 0;  ///< px, of photographs that it was not fitted to
  bool is_chosen = false;
};

struct Calibration {
  Camera camera;  ///< with the identity for its pose
  BoardSize board;
  double square = 0;  ///< mm; 0: not known, lengths are in squares
  std::array<LensParameter, kNumLensParameters> parameters;
  std::vector<CalibrationPhotograph> photographs;  ///< as given
  std::vector<LensModel> models;                   ///< by number of terms
  std::string model;
  int used = 0;
  double rms_px = 0;
  double coverage = 0;                ///< share of 10 x 10 cells of the picture that have a corner
  double reach = 0;                   ///< farthest corner from the picture's middle, in half diagonals
  std::vector<std::string> warnings;  ///< sentences about what is poor
};

struct CalibrationOptions {
  double square = 0;  ///< mm; 0: not known, poses are in squares
  /// Called before each of so many fits; false stops (calibrate() then returns nothing).
  std::function<bool(int done, int all)> progress;
};

/// From the boards in `photographs` (those without corners are left out), all of `size` px and of one board.
/// Nothing when stopped. Throws InputError unless three photographs can be used.
std::optional<Calibration> calibrate(std::vector<CalibrationPhotograph> photographs, int width, int height,
                                     const CalibrationOptions& options);

/// Where the board is for a calibrated camera: its R and t become those of the camera, so that the world is the
/// board's: the first corner is its origin, columns run along x, rows along y, z points away from the camera.
/// Returns the root mean square of corner − projection, px.
double place_at_board(const BoardView& board, double square, Camera* camera);

}  // namespace rhytid::fitting
