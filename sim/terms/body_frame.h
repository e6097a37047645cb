// The moving frame of a rigid body: place c and orientation q of a quaternion that need not have unit length.
//
//   x_local = Rᵀ (x − c),   R = (q_w² − |v|²) I + 2 v vᵀ + 2 q_w [v]  over |q|²,   v = (q_x, q_y, q_z)
//
// Quaternions come interpolated from knots (path.h); dividing by |q|² here is what makes them rotations, and
// lets derivatives by their components pass.
//
// Shapes   q = w, x, y, z.   Exact (no rounding) for q = 1, 0, 0, 0; no relative turn for equal q.
// Tests    tests/sim/terms/rotating_contact_test.cpp
#pragma once

#include "sim/math/dual.h"

namespace rhytid {
inline namespace RHYTID_ISA {

template <class T>
struct Rotation {
  T m[3][3];

  explicit Rotation(const T* q) {
    const T &w = q[0], *v = q + 1;
    const T scale = 2.0 / (w * w + v[0] * v[0] + v[1] * v[1] + v[2] * v[2]);
    for (int i = 0; i < 3; ++i) {
      const int j = (i + 1) % 3, k = (i + 2) % 3;
      m[i][i] = 1.0 - scale * (v[j] * v[j] + v[k] * v[k]);
      m[i][j] = scale * (v[i] * v[j] - w * v[k]);
      m[j][i] = scale * (v[i] * v[j] + w * v[k]);
    }
  }
  void to_world(const T* local, T* world) const {
    for (int i = 0; i < 3; ++i) world[i] = m[i][0] * local[0] + m[i][1] * local[1] + m[i][2] * local[2];
  }
  void to_local(const T* world, T* local) const {
    for (int i = 0; i < 3; ++i) local[i] = m[0][i] * world[0] + m[1][i] * world[1] + m[2][i] * world[2];
  }
};

/// (R R_oldᵀ − I) a: how far a point at a from the centre is carried by the turn from q_old to q.
template <class T>
void carried_by_turn(const T* q, const T* q_old, const T* a, T* out) {
  const auto cross = [](const T* x, const T* y, T* z) {
    for (int i = 0; i < 3; ++i) {
      const int j = (i + 1) % 3, k = (i + 2) % 3;
      z[i] = x[j] * y[k] - x[k] * y[j];
    }
  };
  // p = q q_old*, the turn; |p|² = |q|² |q_old|²
  T v[3], once[3], twice[3];
  cross(q + 1, q_old + 1, v);
  for (int i = 0; i < 3; ++i) v[i] = q_old[0] * q[1 + i] - q[0] * q_old[1 + i] - v[i];
  const T w = q[0] * q_old[0] + q[1] * q_old[1] + q[2] * q_old[2] + q[3] * q_old[3];
  const T scale = 2.0 / (w * w + v[0] * v[0] + v[1] * v[1] + v[2] * v[2]);
  cross(v, a, once);
  cross(v, once, twice);
  for (int i = 0; i < 3; ++i) out[i] = scale * (w * once[i] + twice[i]);
}

}  // namespace RHYTID_ISA
}  // namespace rhytid
