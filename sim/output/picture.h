// Shaded pictures of a skin surface: raking light that makes fine wrinkles visible, an optional scalar field
// with a colour bar, optional rigid colliders drawn as glass.
#pragma once

#include <array>
#include <optional>
#include <string>
#include <vector>

#include "sim/core/types.h"
#include "sim/output/camera.h"
#include "sim/output/colour_map.h"
#include "sim/output/image.h"
#include "sim/output/surface_tessellation.h"

namespace rhytid {

/// A rigid body in the picture: a closed triangle mesh with smooth normals.
struct PictureSolid {
  MatrixX3 vertices, normals;  ///< [n][3] mm, unit outward
  std::vector<std::array<int, 3>> triangles;
  Rgb colour{120, 160, 205};
  double opacity = 0.45;  ///< seen face-on; rises to 1 at the outline
};

/// A capsule around the segment a–b (a sphere when a = b), mm.
PictureSolid capsule_solid(const Vec3& a, const Vec3& b, double radius);

/// An ellipsoid with semi-axes (mm) along the columns of `rotation`.
PictureSolid ellipsoid_solid(const Vec3& centre, const Mat3& rotation, const Vec3& semi_axes);

/// A scalar painted on the surface.
struct PictureField {
  VectorXd values;    ///< [surface.num_vertices()]; NaN is drawn grey
  std::string label;  ///< over the colour bar, with the unit: "ligament b [1/mm]"
  ColourMap map = ColourMap::sequential;
  /// Range of the colours; unset = range of the finite values (made symmetric about 0 for a diverging map).
  std::optional<double> minimum, maximum;
};

struct PictureOptions {
  int width = 1200, height = 900;  ///< px, at least 64
  int samples = 3;                 ///< n × n samples a pixel
  std::string title;
  std::optional<PinholeCamera>
      camera;  ///< its width and height win; unset = three-quarter view of the surface
  /// Direction of sight and picture-up for the automatic view; unset = from the mean normal of the surface.
  std::optional<Vec3> view_direction, up;
  double light_elevation_deg =
      28;  ///< of the key light above the mean tangent plane: low = wrinkles stand out
  double light_azimuth_deg = 135;  ///< in that plane, counter-clockwise from picture-right
  Rgb skin{226, 186, 162};         ///< surface colour where no field is painted
  Rgb background{250, 250, 249};
};

/// The automatic view: three quarters from above the surface (45° off the mean normal), framing `positions`.
PinholeCamera three_quarter_view(const MatrixX3& positions, const Vec3& mean_normal,
                                 const PictureOptions& options);

/// Draws the deformed surface. `displacement` is [num_nodes · 3] mm (empty = rest). Throws ContractError on
/// sizes that do not fit.
Image draw_surface(const SubdividedSurface& surface, const VectorXd& displacement,
                   const PictureOptions& options, const PictureField* field = nullptr,
                   const std::vector<PictureSolid>& solids = {});

/// Draws a vertical colour bar with ticks and its label into a picture: the bar's box in pixels; `scale` =
/// size of a font pixel. Throws ContractError unless minimum < maximum.
void draw_colour_bar(Image& image, int x, int y, int width, int height, ColourMap map, double minimum,
                     double maximum, const std::string& label, double scale);

}  // namespace rhytid
