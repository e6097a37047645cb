// Points of skin for tests of its closed forms: random states and the ones that hurt (repeated eigenvalues, nearly
// repeated, tiny and large strains).
#pragma once

#include <Eigen/Geometry>

#include "law_cases.h"

namespace rhytid::test {

inline VectorXd strain_of(const Vec3& stretches, Rng& rng) {
  const Mat3 q = Eigen::Quaterniond(uniform(rng, 4).normalized().data()).toRotationMatrix();
  // Y from stretches − 1, so that tiny strains keep their digits.
  const Vec3 e = stretches.array() - 1;
  const Mat3 y = q * Mat3((2 * e.array() + e.array().square()).matrix().asDiagonal()) * q.transpose();
  VectorXd v(6);
  for (int c = 0; c < 6; ++c) v[c] = y(kSymRow[c], kSymCol[c]);
  return v;
}

/// Strain, history and parameters of viscoelastic skin.
struct Point {
  VectorXd y, history, theta;
};

inline std::vector<Point> points() {
  Rng rng(31);
  std::vector<Vec3> stretches = {{1, 1, 1},
                                 {1.2, 1.2, 0.9},
                                 {1.3, 1.3, 1.3},
                                 {1.1, 1.1 + 1e-9, 0.8},
                                 {1.1, 1.1, 1.1 + 1e-13},
                                 {0.9, 1.2, 1.2 + 1e-6},
                                 {2.4, 0.5, 0.9},
                                 {0.4, 0.4, 2.2},
                                 {1.13, 1, 0.9}};
  for (double tiny : {1e-4, 1e-8, 1e-13}) stretches.push_back(Vec3(1 + tiny, 1 - 0.3 * tiny, 1 + 0.2 * tiny));
  std::vector<Point> all;
  for (const Vec3& s : stretches)
    for (const Vec3& h : {Vec3(1, 1, 1), Vec3(1.1, 1, 1 / 1.1), Vec3(0.9, 0.9, 1 / 0.81)})
      for (double stiffening : {1.0, 0.0, 6.0}) {
        Point p;
        p.y = strain_of(s, rng);
        p.history = strain_of(h, rng);
        p.theta = VectorXd(5);
        p.theta << 0.2, stiffening, 17, 0.8, 1. / 12;
        all.push_back(p);
      }
  for (int i = 0; i < 200; ++i) {
    Point p;
    p.y = random_strain(rng, 0.25);
    p.history = random_strain(rng, 0.15);
    p.theta = VectorXd(5);
    p.theta << 0.2, 1.5, 33, 0.8, 0.03;
    all.push_back(p);
  }
  return all;
}

}  // namespace rhytid::test
