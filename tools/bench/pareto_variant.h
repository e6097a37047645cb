// One variant of `bench pareto`: its run, what it took, and what it found.
#pragma once

#include <optional>
#include <string>

#include "sim/scene/scene_model.h"
#include "tools/progress.h"
#include "tools/study/experiment.h"
#include "tools/study/variant_result.h"

namespace rhytid::tools {

/// Runs the scene, `repeats` times, and measures it. Into `folder` go
///  - displacements.csv: displacement [mm] of every point of the comparison's window after every frame, nan
///    beside the surface;
///  - forces.csv: force [N] on every collider after every frame;
/// and last variant.json with all numbers: sizes, counts, CPU seconds (medians), energy, wrinkles and, with
/// parameters, the mean square displacement J [mm²] of the points in the last frame with its derivatives by
/// them, in coordinates (adjoint/parameter_space.h), from an adjoint sweep over the very run that was timed.
/// A run that fails is a result too. Nothing when interrupted. Throws InputError for points or addresses that
/// the scene does not have.
std::optional<VariantResult> measure_pareto_variant(const SceneModel& scene_model,
                                                    const Experiment& experiment, int repeats,
                                                    const std::string& folder, VariantResult result,
                                                    Progress& progress);

/// Points of the comparison on this scene. Throws InputError when most of them lie beside the surface.
SurfaceSamples comparison_points(const SkinMesh& mesh, const Comparison& comparison);

/// Begins the names of the columns that hold derivatives; the address follows.
inline const std::string gradient_column = "d_mean_square_by ";

}  // namespace rhytid::tools
