// Procedural skin, fixed to the material: colour as a function of the rest position in space, so that it
// needs no parametrisation, has no seams and no resolution.
//
// Furrows are the walls of a Voronoi pattern (small F2 − F1), pores and moles are spots at some of its seeds,
// blotches and grain are gradient noise over six octaves: structure at every scale from 1/4 of to 8 times the
// typical size. Source  S. Worley, "A cellular texture basis function", 1996; K. Perlin, "Improving noise",
// 2002.
#pragma once

#include <cstdint>

#include "sim/core/types.h"

namespace rhytid::tools {

class SkinTexture {
 public:
  /// `scale`: typical size of skin marks, mm; details smaller than `footprint` (mm per sample) are left out,
  /// since they would flicker.
  SkinTexture(double scale, double footprint, std::uint32_t seed);

  /// Reflectance (linear R, G, B in 0..1) at rest position X, mm. Without `has_spots`, no pores and moles.
  Vec3 albedo(const Vec3& X, bool has_spots = true) const;

 private:
  double scale_, seed_shift_;
  std::uint32_t seed_;
  double weights_[6];  ///< of the octaves, coarse to fine
};

/// Gradient noise of unit wavelength, mean 0, about −1..1; C² in p.
double gradient_noise(const Vec3& p, std::uint32_t seed);

/// A hash of three integers, well mixed; for seeded noise at pixels.
std::uint32_t mixed_hash(std::uint32_t a, std::uint32_t b, std::uint32_t c, std::uint32_t seed);

}  // namespace rhytid::tools
