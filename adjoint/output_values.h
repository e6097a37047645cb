// Values of an output over a run.
#pragma once

#include <vector>

#include "adjoint/outputs.h"
#include "sim/time/simulate.h"

namespace rhytid::adjoint {

/// Values per frame [output.size(frame)], frames 0..frames(), of a run at its own native parameters. The run
/// must have kept its states; histories it dropped are recomputed.
std::vector<VectorXd> output_values(const Model& model, const VectorXd& native, const Trajectory& run,
                                    const Output& output);

}  // namespace rhytid::adjoint
