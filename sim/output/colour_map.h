// Colours for numbers: a sequential map whose lightness rises steadily (viridis family) and a diverging one
// that is white at zero. Both go through few control points, blended in the perceptually even Oklab space.
// Source   B. Ottosson, "A perceptual color space for image processing", 2020 (Oklab).
#pragma once

#include <string>

#include "sim/core/types.h"
#include "sim/output/image.h"

namespace rhytid {

enum class ColourMap { sequential, diverging };

/// Colour at s, clamped to [0, 1]; NaN is a neutral grey.
Rgb map_colour(ColourMap map, double s);

/// Linear-light RGB in [0, 1] of an sRGB colour and back (rounded, clamped).
Vec3 linear_from_srgb(Rgb colour);
Rgb srgb_from_linear(const Vec3& linear);

/// Oklab lightness, 0 black to 1 white.
double lightness(Rgb colour);

/// "#rrggbb".
std::string hex_colour(Rgb colour);

}  // namespace rhytid
