// Which key of a scene file belongs to which member of the structs in scene.h: one list for reading and
// writing.
//
// An archive is called as archive("key", member) and has group("key", is_present, f), which calls f on the
// archive of a nested object: when reading if the file has it, when writing if is_present.
#pragma once

#include <type_traits>

#include "sim/scene/scene.h"

namespace rhytid {

template <class A, class T>
concept FieldsOf = std::is_same_v<std::remove_const_t<A>, T>;

template <class Archive, FieldsOf<LayerScene> T>
void fields(Archive& archive, T& layer) {
  archive("name", layer.name);
  if (archive.has("thickness_map", !layer.thickness_map.empty()))
    archive("thickness_map", layer.thickness_map);
  else
    archive("thickness", layer.thickness);
  archive("elements", layer.elements);
  archive("order", layer.order);
  archive("youngs_modulus", layer.youngs_modulus);
  archive("poissons_ratio", layer.poissons_ratio);
  archive("stiffening", layer.stiffening);
  archive("relaxing_fraction", layer.relaxing_fraction);
  archive("relaxation_time", layer.relaxation_time);
}

template <class Archive, FieldsOf<SurfaceScene> T>
void fields(Archive& archive, T& surface) {
  if (archive.has("file", !surface.file.empty())) {
    archive("file", surface.file);
    archive.scale("mm_per_unit", "unit", surface.mm_per_unit);
  }
  if (archive.has("coincident", !surface.file.empty())) archive("coincident", surface.coincident);
  const bool is_cropped = surface.crop_centre || surface.crop_low || !surface.crop_vertices.empty() ||
                          !surface.crop_vertices_file.empty();
  archive.group("crop", is_cropped, [&surface](auto& crop) {
    if (crop.has("centre", surface.crop_centre.has_value())) {
      crop("centre", surface.crop_centre);
      crop("radius", surface.crop_radius);
      crop("by", surface.crop_by);
    }
    crop.group("box", surface.crop_low.has_value(), [&surface](auto& box) {
      box("low", surface.crop_low);
      box("high", surface.crop_high);
    });
    if (crop.has("vertices", !surface.crop_vertices.empty())) crop("vertices", surface.crop_vertices);
    if (crop.has("vertices_file", !surface.crop_vertices_file.empty()))
      crop("vertices_file", surface.crop_vertices_file);
  });
  if (archive.has("subdivide", surface.subdivide > 0)) archive("subdivide", surface.subdivide);
  archive.flag("side", "outer", "inner", surface.is_outer);
  archive.group("grid", surface.file.empty(), [&surface](auto& grid) {
    grid("size", surface.grid_size);
    grid("cells", surface.grid_cells);
    grid("pattern", surface.grid_pattern);
    grid("bend_radius", surface.bend_radius);
  });
  archive("normal_smoothing", surface.normal_smoothing);
  archive.group("imperfection", surface.imperfection_amplitude > 0, [&surface](auto& imperfection) {
    imperfection("amplitude", surface.imperfection_amplitude);
    imperfection("seed", surface.imperfection_seed);
  });
}

template <class Archive, FieldsOf<HeldKnot> T>
void fields(Archive& archive, T& knot) {
  archive("time", knot.time);
  archive("displacement", knot.displacement);
}

template <class Archive, FieldsOf<HeldScene> T>
void fields(Archive& archive, T& held) {
  archive("name", held.name);
  archive.group("box", true, [&held](auto& box) {
    box("low", held.low);
    box("high", held.high);
  });
  if (archive.has("path", !held.path.empty())) archive("path", held.path);
}

template <class Archive, FieldsOf<PreStretchScene> T>
void fields(Archive& archive, T& pre_stretch) {
  archive("stretch", pre_stretch.stretch);
  archive("across", pre_stretch.across);
  archive("direction", pre_stretch.direction);
}

template <class Archive, FieldsOf<SkinScene> T>
void fields(Archive& archive, T& skin) {
  archive("surface", skin.surface);
  archive("order", skin.order);
  archive("scheme", skin.scheme);
  archive("composite_order", skin.composite_order);
  archive.group("quadrature", true, [&skin](auto& quadrature) {
    quadrature("rule", skin.rule);
    quadrature("triangle_degree", skin.triangle_degree);
    quadrature("thickness_points", skin.thickness_points);
    quadrature("prism_degree", skin.prism_degree);
    quadrature("volume", skin.volume);
    quadrature("contact_degree", skin.contact_degree);
  });
  archive("rim", skin.rim);
  if (archive.has("held", !skin.held.empty())) archive("held", skin.held);
  archive("pre_stretch", skin.pre_stretch);
  archive("layers", skin.layers);
}

template <class Archive, FieldsOf<SourceScene> T>
void fields(Archive& archive, T& source) {
  archive("name", source.name);
  if (archive.has("vertex", source.vertex.has_value()))
    archive("vertex", source.vertex);
  else
    archive("position", source.position);
  archive("strength", source.strength);
  archive("radius", source.radius);
}

template <class Archive, FieldsOf<LigamentScene> T>
void fields(Archive& archive, T& ligaments) {
  archive("law", ligaments.law);
  archive("stiffness", ligaments.stiffness);
  archive("smoothing", ligaments.smoothing);
  if (archive.has("map", !ligaments.map.empty())) {
    archive("map", ligaments.map);
    archive("map_scale", ligaments.map_scale);
  } else {
    archive("diffusion_time", ligaments.diffusion_time);
    archive("sources", ligaments.sources);
  }
}

template <class Archive, FieldsOf<PointsScene> T>
void fields(Archive& archive, T& points) {
  archive("file", points.file);
  archive.scale("mm_per_unit", "unit", points.mm_per_unit);
}

template <class Archive, FieldsOf<BaseScene> T>
void fields(Archive& archive, T& base) {
  archive("shape", base.shape);
  archive("stiffness", base.stiffness);
  archive("onset", base.onset);
  archive("centre", base.centre);
  archive("radius", base.radius);
  archive("normal", base.normal);
  archive("imls_support", base.imls_support);
  archive("imls_kernel", base.imls_kernel);
  archive("points", base.points);
}

template <class Archive, FieldsOf<FrictionScene> T>
void fields(Archive& archive, T& friction) {
  archive("coefficient", friction.coefficient);
  archive("slip_speed", friction.slip_speed);
  archive("mollifier", friction.mollifier);
}

template <class Archive, FieldsOf<PathKnot> T>
void fields(Archive& archive, T& knot) {
  archive("time", knot.time);
  archive("position", knot.position);
  archive("rotation", knot.rotation);
}

template <class Archive, FieldsOf<ColliderScene> T>
void fields(Archive& archive, T& collider) {
  archive("name", collider.name);
  archive("shape", collider.shape);
  archive("radius", collider.radius);
  archive("length", collider.length);
  archive("axis", collider.axis);
  archive("semi_axes", collider.semi_axes);
  archive("normal", collider.normal);
  archive("stiffness", collider.stiffness);
  archive("onset", collider.onset);
  archive("friction", collider.friction);
  archive("interpolation", collider.interpolation);
  // Written out in full, wherever it was read from: what a run records does not need the file.
  if (archive.has("path_file", false))
    archive("path_file", collider.path_file);
  else
    archive("path", collider.path);
}

template <class Archive, FieldsOf<TimeScene> T>
void fields(Archive& archive, T& time) {
  archive("frame_rate", time.frame_rate);
  archive("frames", time.frames);
  archive("substeps", time.substeps);
  archive("lag", time.lag);
  archive("lag_passes", time.lag_passes);
  archive("max_bisections", time.max_bisections);
  archive("damper", time.damper);
  archive("offset", time.offset);
}

template <class Archive, FieldsOf<SolverScene> T>
void fields(Archive& archive, T& solver) {
  archive("minimiser", solver.minimiser);
  archive("relative_tolerance", solver.relative_tolerance);
  archive("absolute_tolerance", solver.absolute_tolerance);
  archive("max_iterations", solver.max_iterations);
  archive("lbfgs_memory", solver.lbfgs_memory);
  archive("lbfgs_refresh", solver.lbfgs_refresh);
  archive("factor_precision", solver.factor_precision);
}

template <class Archive, FieldsOf<OutputScene> T>
void fields(Archive& archive, T& output) {
  archive("vtu", output.vtu);
  archive("pictures", output.pictures);
  archive("csv", output.csv);
  archive("every", output.every);
}

template <class Archive, FieldsOf<Scene> T>
void fields(Archive& archive, T& scene) {
  archive("name", scene.name);
  archive("description", scene.description);
  archive("skin", scene.skin);
  archive("ligaments", scene.ligaments);
  archive("base", scene.base);
  archive("colliders", scene.colliders);
  archive("time", scene.time);
  archive("solver", scene.solver);
  archive("output", scene.output);
}

}  // namespace rhytid
