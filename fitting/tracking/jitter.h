// What tracks jump from frame to frame beyond what their covariances say.
//
// Inter-frame video compression moves blocks of the picture by rounded vectors: texture that looks sharp and fits its
// template well stands in a wrong place, another one in every frame. Residuals do not tell; neighbours do:
//
//   d_if = a_if − â_if,   a_if = x_i,f+1 − 2 x_if + x_i,f−1,   â_if = affine fit of the a of eight neighbours, at i
//   E|d|² = tr(V_if) + 2 k_if s²,   V of the stated covariances, k_if = 6 (1 + Σ_n l_n²), l the weights of the fit
//
// Accelerations of the skin that are affine over some 20 px drop out. s² is what brings the median of |d|²/(tr V + 2 k s²)
// to that of two Gaussian numbers, ln 2: half of the jumps may be wrong, which a twentieth of the tracks makes so.
// Accelerations that are not affine (an edge of a sliding contact) count as jitter, which is on the safe side.
//
// Units  px.   Tests  tests/fitting/tracking/jitter_test.cpp
#pragma once

#include "fitting/observations.h"

namespace rhytid::fitting {

/// s, the standard deviation per axis; 0 when the covariances explain the jumps, and where fewer than 50 can be compared
/// (frames of one camera from the third on, with neighbours in three frames running).
double measure_jitter(const TrackSet& tracks);

/// Adds s² to the covariances of all ok observations but each track's first one, which says what its frames share.
void add_jitter(double s, TrackSet* tracks);

}  // namespace rhytid::fitting
