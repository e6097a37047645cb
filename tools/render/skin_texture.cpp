#include "tools/render/skin_texture.h"

#include <algorithm>
#include <array>
#include <cmath>

namespace rhytid::tools {
namespace {

double smoothstep(double low, double high, double x) {
  const double t = std::clamp((x - low) / (high - low), 0.0, 1.0);
  return t * t * (3 - 2 * t);
}

/// Dot product of one of 12 edge directions of a cube with (x, y, z).
double edge_dot(std::uint32_t hash, double x, double y, double z) {
  const std::uint32_t h = hash >> 28;
  const double u = h < 8 ? x : y, v = h < 4 ? y : (h == 12 || h == 14 ? x : z);
  return ((h & 1) != 0 ? -u : u) + ((h & 2) != 0 ? -v : v);
}

double fade(double t) {
  return t * t * t * (t * (t * 6 - 15) + 10);
}

struct Cells {
  double nearest = 1e9, second = 1e9;  ///< distances to the two nearest seeds, in cells
  std::uint32_t nearest_hash = 0;      ///< random number of the nearest one
};

/// Distances to the seeds of a unit Voronoi pattern, one jittered seed a cell.
Cells voronoi(const Vec3& p, std::uint32_t seed) {
  const double fx = std::floor(p.x()), fy = std::floor(p.y()), fz = std::floor(p.z());
  const Vec3 r = p - Vec3(fx, fy, fz);
  // Squared distance to the neighbouring cells' slabs, by offset −1, 0, 1.
  std::array<std::array<double, 3>, 3> gap;
  for (int a = 0; a < 3; ++a) gap[a] = {r[a] * r[a], 0, (1 - r[a]) * (1 - r[a])};
  Cells out;
  double first = 1e9, second = 1e9;
  constexpr std::array<int, 3> order = {0, -1, 1};
  for (const int k : order)
    for (const int j : order)
      for (const int i : order) {
        if (gap[0][i + 1] + gap[1][j + 1] + gap[2][k + 1] >= second) continue;
        const std::uint32_t h =
            mixed_hash(static_cast<std::uint32_t>(static_cast<std::int64_t>(fx) + i),
                       static_cast<std::uint32_t>(static_cast<std::int64_t>(fy) + j),
                       static_cast<std::uint32_t>(static_cast<std::int64_t>(fz) + k), seed);
        const double x = i + (h & 1023) / 1024.0 - r.x(), y = j + ((h >> 10) & 1023) / 1024.0 - r.y(),
                     z = k + ((h >> 20) & 1023) / 1024.0 - r.z();
        const double d = x * x + y * y + z * z;
        if (d < first) {
          second = first, first = d, out.nearest_hash = h;
        } else if (d < second) {
          second = d;
        }
      }
  out.nearest = std::sqrt(first), out.second = std::sqrt(second);
  out.nearest_hash = mixed_hash(out.nearest_hash, 1, 2, seed);
  return out;
}

}  // namespace

std::uint32_t mixed_hash(std::uint32_t a, std::uint32_t b, std::uint32_t c, std::uint32_t seed) {
  std::uint32_t h = a * 0x9E3779B1u ^ b * 0x85EBCA77u ^ c * 0xC2B2AE3Du ^ seed * 0x27D4EB2Fu;
  h ^= h >> 16, h *= 0x7FEB352Du;
  h ^= h >> 15, h *= 0x846CA68Bu;
  return h ^ (h >> 16);
}

double gradient_noise(const Vec3& p, std::uint32_t seed) {
  const double fx = std::floor(p.x()), fy = std::floor(p.y()), fz = std::floor(p.z());
  const double x = p.x() - fx, y = p.y() - fy, z = p.z() - fz;
  const auto ix = static_cast<std::uint32_t>(static_cast<std::int64_t>(fx)),
             iy = static_cast<std::uint32_t>(static_cast<std::int64_t>(fy)),
             iz = static_cast<std::uint32_t>(static_cast<std::int64_t>(fz));
  const auto corner = [&](std::uint32_t i, std::uint32_t j, std::uint32_t k) {
    return edge_dot(mixed_hash(ix + i, iy + j, iz + k, seed), x - i, y - j, z - k);
  };
  const double u = fade(x), v = fade(y), w = fade(z);
  const auto mix = [](double t, double a, double b) { return a + t * (b - a); };
  return mix(w, mix(v, mix(u, corner(0, 0, 0), corner(1, 0, 0)), mix(u, corner(0, 1, 0), corner(1, 1, 0))),
             mix(v, mix(u, corner(0, 0, 1), corner(1, 0, 1)), mix(u, corner(0, 1, 1), corner(1, 1, 1))));
}

SkinTexture::SkinTexture(double scale, double footprint, std::uint32_t seed)
    : scale_(scale), seed_shift_(0.123 + 0.001 * (seed % 1000)), seed_(seed) {
  // Wavelengths 8, 4, 2, 1, 1/2, 1/4 of the scale; an octave fades out below three footprints.
  constexpr std::array<double, 6> amplitude = {0.10, 0.09, 0.09, 0.10, 0.10, 0.07};
  for (int i = 0; i < 6; ++i) {
    const double wavelength = scale * std::exp2(3 - i);
    weights_[i] = amplitude[static_cast<size_t>(i)] * smoothstep(1.5, 3.5, wavelength / footprint);
  }
}

Vec3 SkinTexture::albedo(const Vec3& X, bool has_spots) const {
  const Vec3 p = X / scale_ + Vec3::Constant(seed_shift_);
  double grain = 0, blotch = 0, fine = 0;
  for (int i = 0; i < 6; ++i) {
    if (weights_[i] == 0) continue;
    const double n = gradient_noise(std::exp2(i - 3) * p + Vec3::Constant(17.3 * i), seed_ + 31u * i);
    grain += weights_[i] * n;
    if (i < 2) blotch += n;
    if (i == 4) fine = n;
  }
  // Bent walls of uneven depth: furrows run out and meet, unlike cracks.
  const double bend = 0.45 * gradient_noise(0.6 * p + Vec3(5, 9, 2), seed_ + 977u) + 0.10 * fine;
  const Cells cells = voronoi(Vec3(p.x() / 1.25 + bend, p.y() / 0.95 - bend, p.z() / 1.1), seed_ + 7919u);
  const double depth = std::clamp(0.55 + 0.5 * blotch + 0.5 * fine, 0.1, 1.0);
  const double furrow = depth * (1 - smoothstep(0.0, 0.30, cells.second - cells.nearest));
  // One cell in seven has a pore, one in three hundred a mole.
  const double chance = (cells.nearest_hash & 0xffff) / 65536.0,
               size = 0.14 + 0.16 * (cells.nearest_hash >> 16) / 65536.0;
  double spot = 0, mole = 0;
  if (has_spots && chance < 0.14) spot = 0.5 * std::exp(-0.5 * std::pow(cells.nearest / size, 2));
  if (has_spots && chance > 0.997) mole = 1 - smoothstep(0.28, 0.55, cells.nearest);

  const double light = std::exp(grain) * (1 - 0.26 * furrow) * (1 - spot) * (1 - 0.55 * mole);
  const Vec3 base(0.60, 0.375, 0.28);  // linear reflectance of fair skin
  // What darkens skin is blood and melanin: blue and green fall faster than red.
  return Vec3(base.x() * std::pow(light, 0.8), base.y() * light, base.z() * std::pow(light, 1.15))
      .cwiseProduct(Vec3(1 + 0.03 * blotch, 1 - 0.06 * blotch, 1 - 0.05 * blotch));
}

}  // namespace rhytid::tools
