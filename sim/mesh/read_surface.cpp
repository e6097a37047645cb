#include <cctype>
#include <cstdio>
#include <filesystem>

#include "sim/core/error.h"
#include "sim/mesh/surface_builder.h"
#include "sim/mesh/triangle_surface.h"

namespace rhytid {

TriangleSurface read_surface(const std::string& path, double mm_per_unit) {
  require_mesh_file(path);
  std::string extension = std::filesystem::path(path).extension().string();
  for (char& c : extension) c = static_cast<char>(std::tolower(static_cast<unsigned char>(c)));
  if (extension == ".obj") return read_obj(path, mm_per_unit);
  if (extension == ".ply") return read_ply(path, mm_per_unit);
  if (extension == ".glb") return read_glb(path, mm_per_unit);
  if (extension == ".msh") return read_msh(path, mm_per_unit);
  if (extension == ".gltf")
    throw InputError(path + ": glTF in several files is not read; export it as one binary .glb file");
  throw InputError(path, "the extension '" + extension + "'", "a mesh as .obj, .ply, .glb or .msh");
}

void refuse_doubtful_unit(const TriangleSurface& surface) {
  const double extent =
      surface.vertices.rows() == 0
          ? 0
          : (surface.vertices.colwise().maxCoeff() - surface.vertices.colwise().minCoeff()).maxCoeff();
  if (extent > 60) return;
  char text[64];
  std::snprintf(text, sizeof text, ": extent %.3g", extent);
  throw InputError(surface.origin + text +
                   (extent <= 2 ? ": metres? set mm_per_unit 1000"
                                : ": centimetres? set mm_per_unit 10, or 1 if the file is in mm") +
                   " (a head is about 250 mm wide)");
}

std::string giant_hint(const TriangleSurface& surface) {
  if (surface.vertices.rows() == 0) return "";
  const double extent =
      (surface.vertices.colwise().maxCoeff() - surface.vertices.colwise().minCoeff()).maxCoeff();
  if (extent <= 5000) return "";
  char text[160];
  std::snprintf(text, sizeof text,
                " (its extent is %.4g m: is mm_per_unit right? a head is about 250 mm wide)", extent / 1000);
  return text;
}

}  // namespace rhytid
